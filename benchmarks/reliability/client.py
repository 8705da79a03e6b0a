"""A client: it asks, counts each request and its answer, and says what came of them.

It runs as a process of its own, so that it can be stopped, continued and killed; see ``processes.py``.
"""

from __future__ import annotations

import random
import time
from collections import Counter
from dataclasses import asdict, dataclass, field
from typing import Any

from .child import Parent, ros_node, service_client
from .kinds import KINDS, code_of, is_right, stamp_of
from .latency import Latencies


@dataclass(frozen=True)
class Order:
    """What a client is to do.

    Attributes:
        kinds: of its requests, drawn at random.
        requests: how many at most.
        seconds: how long to ask at most.
        window: how many may be unanswered at once; as many as ``requests`` for a burst.
        pause: seconds to do nothing after each answer: a slow reader.
        leaves: go, in good order, as soon as everything is asked.
        patience: seconds without an answer after which the rest is given up. While it is stopped none pass.
        seed: of what is drawn.
    """

    kinds: tuple[str, ...] = ("full",)
    requests: int = 1000
    seconds: float = 600.0
    window: int = 1
    pause: float = 0.0
    leaves: bool = False
    patience: float = 60.0
    seed: int = 0

    def to_json(self) -> dict[str, Any]:
        return asdict(self)


@dataclass
class Report:
    """What came of it.

    Attributes:
        asked: requests sent.
        answered: of those, answered, whichever the code.
        codes: how often each was answered, by kind.
        wrong: answers with a code that was not to be expected, or with the number of another request; by kind
            and code.
        blocked: sends that the client's own middleware refused for now; tried again.
    """

    asked: int = 0
    answered: int = 0
    codes: dict[str, Counter[int]] = field(default_factory=dict)
    wrong: Counter[str] = field(default_factory=Counter)
    blocked: int = 0
    latencies: Latencies = field(default_factory=Latencies)

    @property
    def unanswered(self) -> int:
        return self.asked - self.answered

    def to_json(self) -> dict[str, Any]:
        return {**vars(self), "latencies": self.latencies.to_json()}

    @classmethod
    def from_json(cls, found: dict[str, Any]) -> Report:
        codes = {k: Counter({int(c): n for c, n in of.items()}) for k, of in found["codes"].items()}
        latencies, wrong = Latencies.from_json(found["latencies"]), Counter(found["wrong"])
        return cls(**{**found, "codes": codes, "wrong": wrong, "latencies": latencies})

    @classmethod
    def together(cls, reports: list[Report]) -> Report:
        """Of several clients."""
        merged = cls(latencies=Latencies.together(report.latencies for report in reports))
        for report in reports:
            merged.asked += report.asked
            merged.answered += report.answered
            merged.blocked += report.blocked
            merged.wrong.update(report.wrong)
            for kind, codes in report.codes.items():
                merged.codes.setdefault(kind, Counter()).update(codes)
        return merged

    def by_code(self) -> Counter[int]:
        """How often each code was answered."""
        return sum(self.codes.values(), Counter())


class Client:
    """Asks as ordered, by clients of both services in one node."""

    def __init__(self, order: Order, node: Any) -> None:
        self.order, self.report = order, Report()
        self._draw = random.Random(order.seed)
        self._requests = {name: KINDS[name].make() for name in order.kinds}
        self._clients: dict[type, Any] = {}
        for request in self._requests.values():
            if type(request) not in self._clients:
                service = "resolve_collision_batch" if hasattr(request, "pairs") else "resolve_collision"
                self._clients[type(request)] = service_client(node, service)

    def is_ready(self) -> bool:
        """Whether all it asks is served."""
        return all(client.service_is_ready() for client in self._clients.values())

    def ask(self) -> bool:
        """Send a request; ``False`` if the middleware does not take one just now."""
        from rclpy._rclpy_pybind11 import RCLError

        name = self._draw.choice(self.order.kinds)
        request, number, kind = self._requests[name], self.report.asked + 1, KINDS[name]
        if kind.is_numbered:
            stamp_of(request).nanosec = number
        began = time.perf_counter()
        try:
            future = self._clients[type(request)].call_async(request)
        except RCLError:
            self.report.blocked += 1
            return False
        self.report.asked = number
        future.add_done_callback(lambda done: self._answered(name, number, began, done.result()))
        return True

    def _answered(self, name: str, number: int, began: float, response: Any) -> None:
        report, kind = self.report, KINDS[name]
        report.answered += 1
        report.latencies.add(time.perf_counter() - began)
        report.codes.setdefault(name, Counter())[code_of(response)] += 1
        is_its_own = not kind.is_numbered or stamp_of(response).nanosec == number
        if not is_its_own:
            report.wrong[f"{name}: of another request"] += 1
        elif not is_right(kind, response):
            report.wrong[f"{name}: {code_of(response)}"] += 1


def run(order: dict[str, Any], parent: Parent) -> None:
    """As a process: say when it is ready, ask when told to, say when all is asked, then what came of it."""
    with ros_node("client") as (node, executor):
        client = Client(Order(**{**order, "kinds": tuple(order["kinds"])}), node)
        parent.wait_until(client.is_ready)
        parent.say("ready")
        parent.wait_for("go")
        ask_all(client, executor, parent)
        parent.say("done", client.report.to_json())


def ask_all(client: Client, executor: Any, parent: Parent) -> None:
    """Until everything is asked and answered, or nothing comes any more."""
    order, report = client.order, client.report
    end, before, quiet, is_asking = time.monotonic() + order.seconds, time.monotonic(), 0.0, True
    while is_asking or report.unanswered:
        while is_asking and report.unanswered < order.window and client.ask():
            is_asking = report.asked < order.requests
        if is_asking and (time.monotonic() > end or parent.has_said("stop")):
            is_asking = False
        if not is_asking and order.leaves:
            parent.say("sent")
            return
        if report.asked == order.requests == order.window and not report.answered and not quiet:
            parent.say("sent")  # a burst: none of its answers has been taken yet
        answered = report.answered
        executor.spin_once(timeout_sec=0.1)
        if order.pause:
            parent.pause(order.pause)
        now = time.monotonic()
        # Time in which it was stopped does not count: no more of a step than it can take.
        quiet = 1e-9 if report.answered > answered else quiet + min(now - before, 0.2 + order.pause)
        before = now
        if quiet > order.patience or parent.is_gone():
            return
