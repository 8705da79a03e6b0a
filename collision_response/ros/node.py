"""The node: it subscribes, serves and publishes. The other modules compute what it says."""

from __future__ import annotations

import faulthandler
import os
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress
from copy import copy
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

from rclpy.callback_groups import MutuallyExclusiveCallbackGroup
from rclpy.clock import JumpThreshold, TimeJump
from rclpy.duration import Duration
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.qos import HistoryPolicy, QoSProfile, ReliabilityPolicy
from rclpy.qos_overriding_options import QoSOverridingOptions
from rclpy.validate_topic_name import validate_topic_name

from ..model import ImpactModel
from ..msg import BodyState, BodyStates
from ..physics.body import Body
from ..physics.contact import Contact
from ..physics.laws import Law
from ..recording import BodyRecord, Recorder, recorder
from ..requirements import SceneSurvey
from ..resolve import resolve
from ..status import ImpactError
from . import convert, parameters, scenes
from .answer_log import AnswerLog
from .batches import BatchService
from .diagnostics import Counters, Diagnostics
from .impacts import ImpactService
from .parameters import DECLARATIONS, DeclaringNode
from .process import StartError, limit_memory, run
from .scenes import SceneService
from .serialized import MalformedMessage
from .server import Server
from .states import LatestStates
from .take_all import TakeAllWaitable
from .throttled_warnings import ThrottledWarnings

STATE_QOS = QoSProfile(history=HistoryPolicy.KEEP_LAST, depth=1000, reliability=ReliabilityPolicy.BEST_EFFORT)
"""As for sensor data, but deep enough for the states of many bodies that arrive at once."""

TABLE_QOS = QoSProfile(history=HistoryPolicy.KEEP_LAST, depth=10, reliability=ReliabilityPolicy.BEST_EFFORT)

TABLE_TOPIC = "all_body_states"

MIN_SHUTDOWN_TIME = 2.0
"""Time [s] that destroying the node may always take, however short ``shutdown_timeout`` is."""

RECORDING_MEMORY = 250
"""Memory that rerun takes when a recording begins [MiB]. It ends the process if there is less."""

TIME_TO_END = 0.1
"""Time [s] in which a thread without work ends."""

REFUSING_TIME = 1.0
"""Computing time [s] in which a slow machine can refuse 5000 requests at the end."""

CLOCK_JUMPS = JumpThreshold(min_forward=None, min_backward=Duration(nanoseconds=-1), on_clock_change=True)
"""Jumps of the clock after which the stamps of earlier states mean nothing any more."""


class CollisionResponseNode(DeclaringNode):
    """Collision response as a service.

    Interfaces (all may be remapped):
        service ``~/resolve_collision``: one impact. Every request is answered, with a code and a message.
        service ``~/resolve_collision_batch``: many independent impacts, as arrays.
        service ``~/resolve_scene``: several contacts at once.
        subscription ``body_states``, or the topics of the parameter ``body_state_topics``: bodies that
            requests may then give by name only.
        subscription ``all_body_states``: many such bodies, as a table.
        publisher ``~/result``: every answer of ``~/resolve_collision``, refusals included. A late subscriber
            gets the last 100.
        publisher ``~/scene_result``: the same for ``~/resolve_scene``.
        publisher ``/diagnostics``: counts, rates and latencies.

    Raises:
        rclpy.exceptions.ParameterException: if a parameter has a value that is not allowed.
        rclpy.exceptions.NameValidationException: if one of ``body_state_topics`` is no name of a topic.
        StartError: if a value is an empty list, or a number without the point that it needs; if one of
            ``body_state_topics`` is ``all_body_states``; or if ``memory_limit`` is less than the process
            needs to start.
    """

    # On the class, because rclpy destroys a node also if its start failed before these are set.
    _recorder: Recorder | None = None
    _scene_service: SceneService | None = None

    def __init__(self, *, owns_process: bool = False, **options: Any) -> None:
        """Start to serve. ``owns_process``: whether ``memory_limit`` limits the process."""
        super().__init__("collision_response", **options)
        given = parameters.declare(self, DECLARATIONS)
        self.parameters = parameters.LatestParameters(self)
        value = partial(parameters.value_of, self)
        self._warn = ThrottledWarnings(self.get_logger().warning)
        self._states = LatestStates(
            value("max_bodies"), self._now, self._warn, self._take_states, self._publisher_name
        )
        self._jump_handle = self.get_clock().create_jump_callback(CLOCK_JUMPS, post_callback=self._on_jump)

        self._answer_log = answer_log = AnswerLog(self, self._now)
        self.impact_service = ImpactService(
            self.parameters,
            self._states,
            answer_log,
            SceneSurvey(tolerance) if (tolerance := value("scene_tolerance")) else None,
            self.get_logger(),
        )
        self._scene_service = SceneService(self.parameters, self._states, answer_log)
        services = (self.impact_service, BatchService(self.parameters, self._states), self._scene_service)
        warm_up()
        topics = {self._resolved(topic): topic for topic in value("body_state_topics") if topic}
        table_topic = self._resolved(TABLE_TOPIC)
        if table_topic in topics:
            raise StartError(f"body_state_topics: {table_topic} is the topic of tables of states, BodyStates")
        self._state_topics = [*topics, table_topic]
        self._state_inputs = [
            *(self._subscribe(BodyState, topic, STATE_QOS, self._add_state) for topic in topics.values()),
            self._subscribe(BodyStates, TABLE_TOPIC, TABLE_QOS, self._states.add_table),
        ]
        counters = Counters()
        Diagnostics(self, counters, self._states, self._entries_not_recorded, lambda: self._server.waiting())
        parameters.warn_of_unknown(self, given)
        is_recording = value("recording.enabled")
        if owns_process:
            limit_memory(value("memory_limit"), RECORDING_MEMORY if is_recording else 0)
        if is_recording:  # before the services: most starts that fail leave no file
            self._recorder = answer_log.recorder = self._start_recorder()
        # Last: clients take the node for ready as soon as they see its services.
        self._server = Server(
            self, services, counters, self.parameters, self._after_sending, value("service_introspection")
        )
        self.get_logger().info(
            f"serving {', '.join(self.resolve_service_name(service.name) for service in services)}; "
            f"body states from {', '.join(self._state_topics)}; "
            f"results on {', '.join(answer_log.topics)}"
            f"{'; not recording' if self._recorder is None else ''}"
        )

    def _start_recorder(self) -> Recorder:
        value, log = partial(parameters.value_of, self), self.get_logger()
        return Recorder(
            Path(os.path.expanduser(value("recording.directory"))),
            log.warning,
            opened=log.info,
            name=value("recording.file"),
            max_size=value("recording.max_size"),
            max_duration=value("recording.max_duration"),
        )

    def shut_down(self) -> None:
        """Answer the requests that have arrived, complete the recording, and destroy the node.

        The node must not be spun any more, and its context not be shut down yet: without it, nothing is
        answered. All of this takes no longer than the parameter ``shutdown_timeout``. If the middleware
        hangs, the process then prints where it hangs and ends with exit code 1.
        """
        start, limit = time.perf_counter(), self.parameters.values.shutdown_timeout
        faulthandler.dump_traceback_later(max(limit, MIN_SHUTDOWN_TIME), exit=True)
        try:
            unanswered = self._server.drain(0.65 * limit, min(REFUSING_TIME, 0.2 * limit))
            if unanswered:
                self.get_logger().warning(
                    f"at least {unanswered} requests have no answer; shutdown_timeout is {limit:g} s"
                )
            if self._recorder is not None:
                self._recorder.close(max(0.0, start + 0.85 * limit - time.perf_counter()))
            self.destroy_node()
        finally:
            faulthandler.cancel_dump_traceback_later()

    def destroy_node(self) -> None:
        """Destroy the node, and complete the recording."""
        for waitable in [*self.waitables]:
            if isinstance(waitable, TakeAllWaitable):  # rclpy would leave it to the executor
                self.remove_waitable(waitable)
        super().destroy_node()
        if self._recorder is not None:
            self._recorder.close()
        if self._scene_service is not None:
            self._scene_service.close()

    def _after_sending(self) -> None:
        self._answer_log.publish()
        self.impact_service.prepare()

    def _resolved(self, topic: str) -> str:
        validate_topic_name(topic)  # with an error that shows the name
        return self.resolve_topic_name(topic)

    def _subscribe(
        self, kind: Any, topic: str, qos: QoSProfile, add: Callable[[bytes, Any], None]
    ) -> TakeAllWaitable:
        subscription = self.create_subscription(
            kind,
            topic,
            add,
            copy(qos),  # rclpy writes the overrides into it
            raw=True,
            callback_group=MutuallyExclusiveCallbackGroup(),
            event_callbacks=SubscriptionEventCallbacks(use_default_callbacks=False),
            qos_overriding_options=QoSOverridingOptions.with_default_policies(),
        )
        if subscription.qos_profile.reliability is ReliabilityPolicy.RELIABLE:  # not all publishers match
            group, events = self.default_callback_group, SubscriptionEventCallbacks()
            for warning in events.create_event_handlers(group, subscription.handle, subscription.topic_name):
                subscription.event_handlers.append(warning)  # destroyed with it
                self.add_waitable(warning)
        return TakeAllWaitable(
            self, subscription, lambda: self._server.states_arrived(), self._states.note_unreadable
        )

    def _take_states(self) -> None:
        if sum(state_input.take_all() for state_input in self._state_inputs):
            self._server.states_taken()

    def _publisher_name(self, publisher: bytes) -> str:
        """The node and the topic of a publisher of states."""
        for topic in self._state_topics:
            for endpoint in self.get_publishers_info_by_topic(topic):
                if bytes(endpoint.endpoint_gid[:16]) == publisher:
                    return f"{endpoint.node_namespace.rstrip('/')}/{endpoint.node_name} on {topic}"
        return "one that has left"

    def _add_state(self, message: bytes, info: Any) -> None:
        received = self._states.add(message, info)
        if received is None or self._recorder is None:
            return
        with suppress(ImpactError, MalformedMessage):  # an invalid state is refused when a request uses it
            body = convert.body_of(received.name, received.state)
            convert.check_body(received.name, body)
            self._recorder.add(BodyRecord(received.stamp or self._now(), received.name, body))

    def _on_jump(self, jump: TimeJump) -> None:
        self._states.forget()
        text = "the clock was changed or set back: the states of all bodies are forgotten"
        self._warn("clock", lambda: text)

    def _entries_not_recorded(self) -> int:
        return self._recorder.missing() if self._recorder else 0

    def _now(self) -> int:
        return self.get_clock().now().nanoseconds


def warm_up() -> None:
    """Compute an impact by every law, in DOUBLE, in EXTENDED and with more digits than that.

    So the first request is not slow.
    """
    ball = Body.dynamic(1.0, (0.4, 0, 0, 0.4, 0, 0.4), (0.0, 0.1, 1.0), None, (0.1, 0.2, -2.0))
    contact = Contact.of((0, 0, 0), (0, 0, 1), restitution=0.5, friction=0.3)
    for law, tolerance in product(Law, (0.0, 1e-15, 1e-17)):
        resolve(ball, Body.static(), contact, ImpactModel(law, tolerance=tolerance))


def _still_works(wait: float) -> bool:
    """Whether, after a time [s], a scene of a closed service is still computed, or a recording written."""
    names = scenes.THREAD, recorder.THREAD
    threads = [thread for thread in threading.enumerate() if thread.name.startswith(names)]
    for thread in threads:
        thread.join(wait / len(threads))
    return any(thread.is_alive() for thread in threads)


def main(args: list[str] | None = None) -> int:
    """Run the node until SIGINT or SIGTERM, and return the exit code."""
    code = run(partial(CollisionResponseNode, owns_process=True), args, CollisionResponseNode.shut_down)
    if _still_works(TIME_TO_END):  # Python would wait for the thread
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(code)
    return code
