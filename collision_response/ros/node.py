"""The node: it subscribes, serves and publishes; what it says is computed elsewhere."""

from __future__ import annotations

import sys
import traceback
from contextlib import suppress
from typing import Any

import rclpy
from rclpy.exceptions import NameValidationException, ParameterException
from rclpy.executors import SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.qos_overriding_options import QoSOverridingOptions
from rclpy.signals import SignalHandlerOptions

from ..msg import BodyState, CollisionResult
from ..recording import Record, Recorder, Refusal, Sighting
from ..requirements import SceneSurvey
from ..resolve import resolve
from ..srv import ResolveCollision, ResolveCollisionBatch
from ..status import ImpactError, StatusCode
from . import convert, convert_batch, parameters
from .request import complete
from .results import Results
from .signals import on_signal
from .states import LatestStates, nanoseconds

SERVICE_QOS = QoSProfile(history=HistoryPolicy.KEEP_ALL, reliability=ReliabilityPolicy.RELIABLE)
"""With a limited history, requests that arrive faster than they are answered would be lost unnoticed."""

STATE_QOS = QoSProfile(history=HistoryPolicy.KEEP_LAST, depth=1000, reliability=ReliabilityPolicy.BEST_EFFORT)
"""Sensor data, but deep enough for the states of many bodies to arrive at once."""


class CollisionResponseNode(Node):
    """Collision response as a service.

    Interfaces (all may be remapped):
        service ``~/resolve_collision``: every request is answered, with a code and a message.
        service ``~/resolve_collision_batch``: the same for many contacts, as arrays.
        subscription ``body_states``, or the parameter ``body_state_topics``: bodies that requests
            may then give by name only.
        publisher ``~/result``: every answer of the first, refusals included, once anybody subscribes.

    Args:
        options: those of :class:`rclpy.node.Node`.
    """

    def __init__(self, **options: Any) -> None:
        super().__init__("collision_response", **options)
        self._answers = 0
        self._states = LatestStates()
        self._recorder: Recorder | None = None
        self._survey: SceneSurvey | None = None
        parameters.declare(self)
        self._latest = parameters.LatestParameters(self)
        start = parameters.StartParameters.of(self)
        overridable = QoSOverridingOptions.with_default_policies()
        self._results = Results(self)
        topics = [
            self.create_subscription(
                BodyState, topic, self._hear, STATE_QOS, qos_overriding_options=overridable
            ).topic_name
            for topic in start.body_state_topics
        ]
        self.create_service(ResolveCollision, "~/resolve_collision", self._serve, qos_profile=SERVICE_QOS)
        self.create_service(
            ResolveCollisionBatch, "~/resolve_collision_batch", self._serve_batch, qos_profile=SERVICE_QOS
        )
        if start.scene_tolerance:
            self._survey = SceneSurvey(start.scene_tolerance)
        if start.recording_directory is not None:
            self._recorder = Recorder(
                start.recording_directory, self.get_logger().warning, name=start.recording_file
            )
        self.get_logger().info(
            f"serving {self.resolve_service_name('~/resolve_collision')}; "
            f"bodies from {', '.join(topics) or 'requests only'}; "
            f"results on {self._results.topic}; "
            f"{'not recording' if self._recorder is None else f'recording to {self._recorder.path}'}"
        )

    def _hear(self, state: BodyState) -> None:
        self._states.remember(state)
        if self._recorder is not None and state.name:
            with suppress(ImpactError):  # it is refused when it is asked for
                body = convert.body_of(state.name, state)
                convert.check_body(state.name, body)
                self._recorder.add(Sighting(self._stamp(state), state.name, body))

    def _serve(
        self, request: ResolveCollision.Request, response: ResolveCollision.Response
    ) -> ResolveCollision.Response:
        self._answers += 1
        try:
            self._answer(request, response.result)
        except ImpactError as error:
            self._refuse(request, response, error.code, convert.as_in_message(error))
        except Exception as error:  # if it left this callback, spin() would end and nobody be answered
            self.get_logger().error(traceback.format_exc())
            self._refuse(request, response, StatusCode.INTERNAL_ERROR, f"{type(error).__name__}: {error}")
        else:
            response.success = True
        response.result.sequence = self._answers
        self._results.publish(response.result)
        return response

    def _answer(self, request: ResolveCollision.Request, result: CollisionResult) -> None:
        current = self._latest.values
        complete(request, self._states, current, self._now)
        scene = convert.scene_of(request, current)
        impact = resolve(*scene)
        convert.write_answer(result, request, impact)
        names = result.contact.body_a or "body_a", result.contact.body_b or "body_b"
        if self._survey is not None:
            self._log_requirements(self._survey, " - ".join(names), scene)
        if self._recorder is not None:
            self._recorder.add(
                Record(self._stamp(result), self._answers, *names, scene.body_a, scene.body_b, impact)
            )

    def _log_requirements(self, survey: SceneSurvey, name: str, scene: convert.Scene) -> None:
        before = survey.requirements()
        with suppress(ImpactError):  # without friction there is no answer
            survey.add(name, scene.body_a, scene.body_b, scene.contact)
        if survey.requirements() != before:
            self.get_logger().info(f"the scene requires {survey.requirements()}")

    def _refuse(
        self,
        request: ResolveCollision.Request,
        response: ResolveCollision.Response,
        code: StatusCode,
        message: str,
    ) -> None:
        response.result = CollisionResult()
        convert.write_refusal(response.result, request, code, message)
        if self._recorder is not None:
            text = f"{code.name}: {message}"
            self._recorder.add(Refusal(self._stamp(response.result), self._answers, text))

    def _serve_batch(
        self, request: ResolveCollisionBatch.Request, response: ResolveCollisionBatch.Response
    ) -> ResolveCollisionBatch.Response:
        try:
            current = self._latest.values
            convert_batch.answer(request, response, self._states, current, self._now)
        except ImpactError as error:
            return convert_batch.refusal(request, error.code, convert.as_in_message(error))
        except Exception as error:
            self.get_logger().error(traceback.format_exc())
            message = f"{type(error).__name__}: {error}"
            return convert_batch.refusal(request, StatusCode.INTERNAL_ERROR, message)
        return response

    def _stamp(self, message: BodyState | CollisionResult) -> int:
        """When that was [ns]: now, if nobody said."""
        return nanoseconds(message.header.stamp) or self._now()

    def _now(self) -> int:
        return self.get_clock().now().nanoseconds

    def destroy_node(self) -> None:
        """Give up every interface, then complete the recording."""
        super().destroy_node()
        if self._recorder is not None:
            self._recorder.close()


def main(args: list[str] | None = None) -> int:
    """Run the node until SIGINT or SIGTERM; the exit code is 0 then."""
    stop = on_signal()
    rclpy.init(args=args, signal_handler_options=SignalHandlerOptions.NO)
    executor = SingleThreadedExecutor()
    node = None
    try:
        node = CollisionResponseNode()
        executor.add_node(node)
        executor.spin_until_future_complete(stop)
    except (ParameterException, NameValidationException) as error:
        print("collision_response:", *str(error).split(), file=sys.stderr)  # on one line
        return 1
    finally:
        executor.shutdown()
        if node is not None:
            node.destroy_node()
        rclpy.try_shutdown()
    return 0
