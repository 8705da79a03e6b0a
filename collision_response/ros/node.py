"""The node: it subscribes, serves and publishes; what it says is computed elsewhere."""

from __future__ import annotations

import faulthandler
import time
from collections.abc import Callable
from contextlib import suppress
from copy import copy
from itertools import count, product
from typing import Any

from rclpy.clock import JumpThreshold, TimeJump
from rclpy.duration import Duration
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.qos_overriding_options import QoSOverridingOptions

from ..model import ImpactModel
from ..msg import BodyState, BodyStates, CollisionResult, SceneResult
from ..physics.body import Body
from ..physics.contact import Contact
from ..physics.laws import Law
from ..recording import Recorder, Sighting
from ..requirements import SceneSurvey
from ..resolve import resolve
from ..status import ImpactError, StatusCode
from . import convert, parameters
from .batches import Batches
from .diagnostics import Diagnostics
from .impacts import Impacts
from .intake import Intake, OutOfReach, by_the_intake
from .journal import Journal
from .memory import limit_memory
from .parameters import DECLARATIONS
from .process import Unusable, run
from .results import Results
from .scenes import Scenes
from .serialized import Broken
from .server import Server
from .states import LatestStates
from .tally import Tally
from .throttled import Throttled

STATE_QOS = QoSProfile(history=HistoryPolicy.KEEP_LAST, depth=1000, reliability=ReliabilityPolicy.BEST_EFFORT)
"""Sensor data, but deep enough for the states of many bodies to arrive at once."""

TABLE_QOS = QoSProfile(history=HistoryPolicy.KEEP_LAST, depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)

TABLE_TOPIC = "all_body_states"

SHORTEST = 2.0
"""Time [s] that it may always take to give up every interface."""

JUMPS = JumpThreshold(min_forward=None, min_backward=Duration(nanoseconds=-1), on_clock_change=True)
"""Of the clock, after which the stamps of states mean nothing any more."""


class CollisionResponseNode(Node):
    """Collision response as a service.

    Interfaces (all may be remapped):
        service ``~/resolve_collision``: every request is answered, with a code and a message.
        service ``~/resolve_collision_batch``: the same for many contacts, as arrays.
        service ``~/resolve_scene``: several contacts at once.
        subscription ``body_states``, or the parameter ``body_state_topics``: bodies that requests
            may then give by name only.
        subscription ``all_body_states``: the same for many bodies, as a table.
        publisher ``~/result``: every answer of the first, refusals included; the last 100 wait for who
            subscribes.
        publisher ``~/scene_result``: the same for scenes.
        publisher ``/diagnostics``: how it is doing.

    Attributes:
        parameters: as last set.
        impacts: what answers the first service.

    Args:
        options: those of :class:`rclpy.node.Node`.
    """

    _recorder: Recorder | None = None

    def __init__(self, **options: Any) -> None:
        super().__init__(
            "collision_response", automatically_declare_parameters_from_overrides=True, **options
        )
        parameters.declare(self, DECLARATIONS)
        self.parameters = parameters.LatestParameters(self)
        start = parameters.StartParameters.of(self)
        if start.recording_directory is not None:
            self._recorder = Recorder(
                start.recording_directory,
                self.get_logger().warning,
                opened=self.get_logger().info,
                name=start.recording_file,
                max_size=start.recording_max_size,
                max_duration=start.recording_max_duration,
            )
        report = Throttled(self.get_logger().warning)
        self._states = LatestStates(start.max_bodies, self._now, report)
        self._jumps = self.get_clock().create_jump_callback(JUMPS, post_callback=self._forget)
        results, sequence = Results(self, CollisionResult, "~/result"), count(1)
        scene_results = Results(self, SceneResult, "~/scene_result")
        self.impacts = Impacts(
            self.parameters,
            self._states,
            Journal(results, self._recorder, sequence, self._now),
            SceneSurvey(start.scene_tolerance) if start.scene_tolerance else None,
            self._now,
            self.get_logger(),
        )
        journal = Journal(scene_results, self._recorder, sequence, self._now)
        scenes = Scenes(self.parameters, self._states, journal, self._now)
        batches = Batches(self.parameters, self._states, self._now)
        warm_up()
        tally = Tally()
        self._server = Server(
            self, (self.impacts, batches, scenes), tally, self._over_budget, start.service_introspection
        )
        self._hearing = [
            *(self._listen(BodyState, topic, STATE_QOS, self._hear) for topic in start.body_state_topics),
            self._listen(BodyStates, TABLE_TOPIC, TABLE_QOS, self._states.hear_table),
        ]
        self._states.take_all = self._take_states
        Diagnostics(self, tally, self._states, self._recorder, self._server.waiting)
        topics = [self.resolve_topic_name(topic) for topic in start.body_state_topics]
        self.get_logger().info(
            f"serving {self.resolve_service_name(self.impacts.name)}; "
            f"bodies from {', '.join(topics) or 'requests only'}; "
            f"results on {results.topic}"
            f"{'; not recording' if self._recorder is None else ''}"
        )

    def shut_down(self) -> None:
        """Answer the requests that have arrived, then give up every interface and complete the recording.

        It takes no longer than the parameter ``shutdown_timeout``: if the middleware hangs, the process ends
        then with exit code 1 and says where it was. Nobody may spin the node any more.
        """
        start, limit = time.perf_counter(), self.parameters.values.shutdown_timeout
        faulthandler.dump_traceback_later(max(limit, SHORTEST), exit=True)
        left = self._server.drain(0.5 * limit, 0.1 * limit)
        if left:
            self.get_logger().warning(
                f"{left} requests are left without an answer: shutdown_timeout is {limit:g} s"
            )
        super().destroy_node()
        if self._recorder is not None:
            self._recorder.close(max(0.0, start + 0.8 * limit - time.perf_counter()))
        faulthandler.cancel_dump_traceback_later()

    def destroy_node(self) -> None:
        """Give up every interface, then complete the recording."""
        super().destroy_node()
        if self._recorder is not None:
            self._recorder.close()

    def _listen(self, kind: Any, topic: str, qos: QoSProfile, hear: Callable[[bytes, Any], object]) -> Intake:
        subscription = self.create_subscription(
            kind,
            topic,
            by_the_intake,
            copy(qos),  # rclpy writes what overrides say into it
            raw=True,
            callback_group=OutOfReach(),
            event_callbacks=SubscriptionEventCallbacks(use_default_callbacks=False),
            qos_overriding_options=QoSOverridingOptions.with_default_policies(),
        )
        return Intake(self, subscription, hear, self._server.wake, self._states.cannot_take)

    def _take_states(self) -> None:
        for intake in self._hearing:
            intake.take_all()

    def _hear(self, message: bytes, info: Any) -> None:
        heard = self._states.hear(message, info)
        if heard is None or self._recorder is None:
            return
        with suppress(ImpactError, Broken):  # it is refused when it is asked for
            body = convert.body_of(heard.name, heard.state)
            convert.check_body(heard.name, body)
            self._recorder.add(Sighting(heard.stamp or self._now(), heard.name, body))

    def _forget(self, jump: TimeJump) -> None:
        self._states.forget()
        self.get_logger().warning("the clock was changed or set back: the states of all bodies are forgotten")

    def _over_budget(self, spent: float) -> ImpactError | None:
        limit = self.parameters.values.budget_time
        if not limit or spent <= limit:
            return None
        reason = (
            f"took {spent:.3g} s to compute so far; budget.time is {limit:g} s: send fewer contacts at a time"
        )
        return ImpactError(StatusCode.BUDGET_EXCEEDED, "request", reason)

    def _now(self) -> int:
        return self.get_clock().now().nanoseconds


def warm_up() -> None:
    """Compute an impact by every law, in all it takes: the first one must not keep everybody waiting."""
    ball = Body.dynamic(1.0, (0.4, 0, 0, 0.4, 0, 0.4), (0.0, 0.1, 1.0), None, (0.1, 0.2, -2.0))
    contact = Contact.of((0, 0, 0), (0, 0, 1), restitution=0.5, friction=0.3)
    for law, tolerance in product(Law, (0.0, 1e-15, 1e-17)):
        resolve(ball, Body.static(), contact, ImpactModel(law, tolerance=tolerance))


def main(args: list[str] | None = None) -> int:
    """Run the node until SIGINT or SIGTERM; the exit code is 0 then."""
    return run(_within_memory, args, CollisionResponseNode.shut_down)


def _within_memory() -> CollisionResponseNode:
    node = CollisionResponseNode()
    try:
        limit_memory(node.get_parameter("memory_limit").value)
    except Unusable:
        node.destroy_node()
        raise
    return node
