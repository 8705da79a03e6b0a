"""What the services count, and publishing it on /diagnostics."""

from __future__ import annotations

import time
from collections import Counter, deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.event_handler import PublisherEventCallbacks
from rclpy.node import Node
from rclpy.qos_overriding_options import QoSOverridingOptions

from ..status import StatusCode
from .process import create_steady_timer
from .states import LatestStates

PERIOD = 1.0
"""Time [s] between two messages."""

LATENCIES = 1000
"""Number of requests whose latency is kept."""


@dataclass
class Counters:
    """Counts since the start of the node.

    Attributes:
        requests: requests received.
        answers: answers sent, by status code.
        unsent: answers that the middleware did not accept.
        dropped: requests dropped because their client left before the answer.
        at_risk: answers sent to a client between the last sign of life from it and the discovery that it has
            left. A single one does not count: no client confirms its last answer.
        unreadable: requests that could not be read.
        latencies: of the last requests: time from receiving the request to sending the answer [s].
    """

    requests: int = 0
    answers: Counter[StatusCode] = field(default_factory=Counter)
    unsent: int = 0
    dropped: int = 0
    at_risk: int = 0
    unreadable: int = 0
    latencies: deque[float] = field(default_factory=lambda: deque(maxlen=LATENCIES))

    def percentiles(self) -> dict[str, float]:
        """Percentiles of the latencies [ms]; empty before the first answer."""
        if not self.latencies:
            return {}
        p50, p99, worst = np.percentile(self.latencies, (50, 99, 100)) * 1e3
        return {"p50": float(p50), "p99": float(p99), "max": float(worst)}


class Diagnostics:
    """Publishes counts, rates and latencies once a second, with level WARN if a problem count has grown.

    ``not_recorded`` and ``waiting`` count missing entries of the recording, and unanswered requests.
    """

    def __init__(
        self,
        node: Node,
        counters: Counters,
        states: LatestStates,
        not_recorded: Callable[[], int],
        waiting: Callable[[], int],
    ) -> None:
        self._node = node
        self._counters = counters
        self._states = states
        self._not_recorded = not_recorded
        self._waiting = waiting
        self._problems = self._problem_counts()
        self._counts = self._progress_counts()
        self._last_time = time.perf_counter()
        self._publisher = node.create_publisher(
            DiagnosticArray,
            "/diagnostics",
            10,
            event_callbacks=PublisherEventCallbacks(use_default_callbacks=False),
            qos_overriding_options=QoSOverridingOptions.with_default_policies(),
        )
        create_steady_timer(node, PERIOD, self._publish)

    def _progress_counts(self) -> dict[str, int]:
        requests, answers = self._counters.requests, self._counters.answers.total()
        return {"requests": requests, "answers": answers, "states": self._states.received}

    def _problem_counts(self) -> dict[str, int]:
        counters, states = self._counters, self._states
        return {
            "requests that could not be read": counters.unreadable,
            "requests of clients that left": counters.dropped,
            "answers that could not be sent": counters.unsent,
            "answers to clients that left, perhaps not received": counters.at_risk,
            "requests over budget": counters.answers[StatusCode.BUDGET_EXCEEDED],
            "internal errors": counters.answers[StatusCode.INTERNAL_ERROR],
            "states lost on the way": states.lost,
            "states that could not be read": states.unreadable,
            "states older than the one known": states.outdated,
            "bodies forgotten": states.evicted,
            "entries not recorded": self._not_recorded(),
        }

    def _publish(self) -> None:
        counters, counts, problems = self._counters, self._progress_counts(), self._problem_counts()
        new_problems = [
            f"{name}: {problems[name] - before}"
            for name, before in self._problems.items()
            if problems[name] > before
        ]
        now = time.perf_counter()
        period = now - self._last_time  # longer than PERIOD after a long computation
        rates = {
            f"{name} per second": f"{(counts[name] - before) / period:.1f}"
            for name, before in self._counts.items()
        }
        self._counts, self._problems, self._last_time = counts, problems, now
        values: Mapping[str, object] = {
            **counts,
            **rates,
            "requests waiting": self._waiting(),
            "bodies known": len(self._states),
            **{f"latency {name} [ms]": f"{value:.3g}" for name, value in counters.percentiles().items()},
            **{f"answered {code.name}": number for code, number in sorted(counters.answers.items())},
            **problems,
        }
        message = DiagnosticArray()
        message.header.stamp = self._node.get_clock().now().to_msg()
        message.status = [
            DiagnosticStatus(
                level=DiagnosticStatus.WARN if new_problems else DiagnosticStatus.OK,
                name=self._node.get_fully_qualified_name(),
                message="; ".join(new_problems) or "no problems",
                hardware_id="",
                values=[KeyValue(key=key, value=str(value)) for key, value in values.items()],
            )
        ]
        self._publisher.publish(message)
