"""A client that sends requests, counts requests and answers, and reports the counts.

It runs as a separate process, so that it can be stopped, continued and killed; see ``processes.py``.
"""

from __future__ import annotations

import random
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from .child_process import Parent, ros_node, service_client
from .request_kinds import KINDS, SHUTTING_DOWN, code_of, is_right, service_of, stamp_of


@dataclass(frozen=True)
class Order:
    """What a client has to do.

    Attributes:
        kinds: kinds of its requests, drawn at random.
        requests: largest number of requests.
        seconds: longest time to send requests [s].
        window: largest number of pending requests; equal to ``requests`` for a burst.
        pause: time to sleep after each answer [s], for a slow reader.
        leaves: whether the client ends properly as soon as it has sent everything.
        patience: time without an answer after which the client gives up [s]; time while it is stopped does
            not count.
        seed: seed of the random numbers.
    """

    kinds: tuple[str, ...] = ("full",)
    requests: int = 1000
    seconds: float = 600.0
    window: int = 1
    pause: float = 0.0
    leaves: bool = False
    patience: float = 60.0
    seed: int = 0


@dataclass
class Report:
    """Counts of requests and answers.

    Attributes:
        asked: number of requests sent.
        times: for each answer, whatever its code, when it came, by the machine's clock [s], and how long it
            took [s].
        codes: number of answers with each code, by kind of request.
        wrong: number of answers with an unexpected code or with the number of another request, by kind and
            code.
    """

    asked: int = 0
    times: list[Sequence[float]] = field(default_factory=list)
    codes: dict[str, Counter[int]] = field(default_factory=dict)
    wrong: Counter[str] = field(default_factory=Counter)

    @property
    def answered(self) -> int:
        return len(self.times)

    @property
    def unanswered(self) -> int:
        return self.asked - self.answered

    @classmethod
    def from_json(cls, found: dict[str, Any]) -> Report:
        """The report of another process: its ``vars`` from JSON, which has only strings for keys."""
        codes = {k: Counter({int(c): n for c, n in of.items()}) for k, of in found["codes"].items()}
        return cls(found["asked"], found["times"], codes, Counter(found["wrong"]))

    @classmethod
    def together(cls, reports: list[Report]) -> Report:
        """The sum of several reports."""
        merged = cls()
        for report in reports:
            merged.asked += report.asked
            merged.times += report.times
            merged.wrong.update(report.wrong)
            for kind, codes in report.codes.items():
                merged.codes.setdefault(kind, Counter()).update(codes)
        return merged

    def by_code(self) -> Counter[int]:
        """Number of answers with each code."""
        return sum(self.codes.values(), Counter())

    def latency(self) -> dict[str, float] | None:
        """Median, 99th percentile and maximum of the times until the answers: see :func:`spread`."""
        return spread([seconds for _, seconds in self.times])


def spread(seconds: Sequence[float]) -> dict[str, float] | None:
    """Median, 99th percentile and maximum of some times [s]; ``None`` if there are none."""
    if not seconds:
        return None
    return dict(zip(("p50", "p99", "max"), np.percentile(seconds, (50, 99, 100)).tolist(), strict=True))


class Client:
    """Sends the requests of an order, to all services, from one node."""

    def __init__(self, order: Order, node: Any) -> None:
        self.order, self.report = order, Report()
        self._draw = random.Random(order.seed)
        self._requests = {name: KINDS[name].make() for name in order.kinds}
        self._clients: dict[type, Any] = {}
        for request in self._requests.values():
            if type(request) not in self._clients:
                self._clients[type(request)] = service_client(node, service_of(request))

    def is_ready(self) -> bool:
        """Whether all services that it calls exist."""
        return all(client.service_is_ready() for client in self._clients.values())

    def destroy(self, node: Any) -> None:
        """Leave without reading any answer."""
        for client in self._clients.values():
            node.destroy_client(client)

    def ask(self) -> bool:
        """Send a request. Return ``False`` if the middleware does not accept one at the moment."""
        from rclpy._rclpy_pybind11 import RCLError

        name = self._draw.choice(self.order.kinds)
        request, number, kind = self._requests[name], self.report.asked + 1, KINDS[name]
        if kind.is_numbered:
            stamp_of(request).nanosec = number
        began = time.monotonic()
        try:
            future = self._clients[type(request)].call_async(request)
        except RCLError:
            return False
        self.report.asked = number
        future.add_done_callback(lambda done: self._answered(name, number, began, done.result()))
        return True

    def _answered(self, name: str, number: int, began: float, response: Any) -> None:
        report, kind, now = self.report, KINDS[name], time.monotonic()
        report.times.append((now, now - began))
        report.codes.setdefault(name, Counter())[code_of(response)] += 1
        is_unread = code_of(response) == SHUTTING_DOWN  # refused without being read, so it has no stamp
        has_own_number = is_unread or not kind.is_numbered or stamp_of(response).nanosec == number
        if not has_own_number:
            report.wrong[f"{name}: of another request"] += 1
        elif not is_right(kind, response):
            report.wrong[f"{name}: {code_of(response)}"] += 1


def run(order: dict[str, Any], parent: Parent) -> None:
    """Main function of the process: "ready", wait for "go", send the requests, "done" with the report."""
    with ros_node("client") as (node, executor):
        client = Client(Order(**{**order, "kinds": tuple(order["kinds"])}), node)
        parent.wait_until(client.is_ready)
        parent.send("ready")
        parent.wait_for("go")
        ask_all(client, executor, parent)
        parent.send("done", vars(client.report))


def ask_all(client: Client, executor: Any, parent: Parent) -> None:
    """Send requests until all are sent and answered, or until no more answers come."""
    order, report = client.order, client.report
    end, before, quiet, is_asking = time.monotonic() + order.seconds, time.monotonic(), 0.0, True
    while is_asking or report.unanswered:
        while is_asking and report.unanswered < order.window and client.ask():
            is_asking = report.asked < order.requests
        if is_asking and (time.monotonic() > end or parent.has_sent("stop")):
            is_asking = False
        if not is_asking and order.leaves:
            parent.send("sent")
            return
        if report.asked == order.requests == order.window and not report.answered and not quiet:
            parent.send("sent")  # a burst: no answer has been read yet
        answered = report.answered
        executor.spin_once(timeout_sec=0.1)
        if order.pause:
            parent.pause(order.pause)
        now = time.monotonic()
        # Time while the process was stopped does not count: limit the step to what it can take.
        quiet = 1e-9 if report.answered > answered else quiet + min(now - before, 0.2 + order.pause)
        before = now
        if quiet > order.patience or parent.is_gone():
            return
