"""Sends requests and states with unusual values through rclpy, and checks the answers."""

from __future__ import annotations

import math
import random
import re
from operator import attrgetter
from typing import Any

import numpy as np

from collision_response import Geometry, Law, Precision

from .child_process import DEADLINE, NAMESPACE, Parent, ros_node, service_client
from .request_kinds import ANSWERS, batch, by_name, code_of, full, pile

TOLERANCE_NOT_MET = 17
LONGEST_MESSAGE = 1000
"""Largest number of characters in the message of a refusal."""

WINDOW, MOST_FAULTS = 50, 10
NUMBERS = (
    0.0, -0.0, 1.0, -1.0, 0.5, 2.0, 1e-3, 1e3, 1e-8, 1e8, 1e-154, 1e154, 1e-200, 1e200, 1e-308, 1e308, -1e308,
    5e-324, 1.7976931348623157e308, math.nextafter(1, 2), math.nextafter(1, 0), math.inf, -math.inf, math.nan,
)  # fmt: skip
NAMES = (
    "",
    "a",
    "b",
    "world",
    "known",
    "x" * 300,
    "x" * 100_000,
    "é\u2028\U0001f600",
    "a\nb",
    "%s%n",
    "../../x",
)
WHOLE = {"uint8": (0, 255), "uint32": (0, 2**32 - 1), "int32": (-(2**31), 2**31 - 1)}
TABLES = {"bodies": "d", "contacts": "d", "pairs": "I"}
Changes = dict[str, Any]
"""New values by the dotted name of a field; ``bodies[3]`` is a number of a table, ``bodies#`` its length."""

_ORIENTATION = {
    "body_a.pose.orientation.x": 0.1,
    "body_a.pose.orientation.y": 0.2,
    "body_a.pose.orientation.z": 1e308,
    "body_a.pose.orientation.w": 0.4,
}
KEPT: dict[str, list[Changes]] = {
    "single": [
        *({**_ORIENTATION, "model.law": law} for law in (3, 4, 5)),
        {"body_a.pose.position.y": -1e308, "body_a.inertia.com.y": 1e308},
        {"contact.header.frame_id": "x" * 100_000},
    ],
    "batch": [],
    "scene": [],
    "states": [],
}
"""Requests that were answered wrongly once. They are sent first."""


def fields(message: Any, prefix: str = "") -> dict[str, str]:
    """Types of all plain fields of a message, by their dotted names."""
    found = {}
    for name, kind in message.get_fields_and_field_types().items():
        if "/" in kind and "<" not in kind and "[" not in kind:
            found.update(fields(getattr(message, name), f"{prefix}{name}."))
        elif "<" not in kind and "[" not in kind:
            found[prefix + name] = kind
    return found


def changed(message: Any, changes: Changes) -> Any:
    """The same message, with changes applied."""
    for path, value in changes.items():
        *owners, name = path.split(".")
        owner = message
        for step in owners:
            owner = getattr(owner, step)
        if name.endswith("#"):
            table = getattr(owner, name[:-1])
            del table[value:]
            table.extend([0] * (value - len(table)))
        elif name.endswith("]"):
            table, _, index = name[:-1].partition("[")
            if int(index) < len(getattr(owner, table)):
                getattr(owner, table)[int(index)] = value
        else:
            setattr(owner, name, value)
    return message


class Draw(random.Random):
    """Draws changes of messages."""

    def value(self, kind: str) -> Any:
        if kind in ("double", "float"):
            anything = self.gauss(0, 1) * 10 ** self.uniform(-300, 300)
            return self.choice(NUMBERS) if self.random() < 0.8 else anything
        if kind == "string":
            return self.choice(NAMES)
        if kind == "boolean":
            return self.random() < 0.5
        least, most = WHOLE.get(kind, (0, 255))
        return self.choice((least, most, self.randint(0, 6), self.randint(least, most)))

    def of(self, types: dict[str, str]) -> Changes:
        """Changes of some fields; often of one group, so that extreme values meet."""
        paths = list(types)
        if self.random() < 0.5:
            group = self.choice(paths).rpartition(".")[0]
            paths = [path for path in paths if path.startswith(group)]
        chosen = self.sample(paths, min(len(paths), self.choice((1, 1, 2, 2, 3, 5, 8))))
        found = {path: self.value(types[path]) for path in chosen}
        for field, known in (("law", Law), ("geometry", Geometry), ("precision", Precision)):
            if f"model.{field}" in types and self.random() < 0.5:
                found[f"model.{field}"] = self.choice((0, *known))
        return found

    def of_tables(self, request: Any) -> Changes:
        """Changes of numbers and lengths of the tables of a batch or a scene."""
        found: Changes = {}
        for _ in range(self.choice((1, 1, 2, 4))):
            name = self.choice(list(TABLES))
            length = len(getattr(request, name))
            if self.random() < 0.2:
                found[f"{name}#"] = self.choice((0, 1, length - 1, length + 1, 2 * length))
            elif TABLES[name] == "d":
                found[f"{name}[{self.randrange(length)}]"] = self.value("double")
            else:
                found[f"{name}[{self.randrange(length)}]"] = self.value("uint32")
        return found


# What is wrong with an answer -----------------------------------------------------------------


def fault_of(response: Any) -> str | None:
    """Description of what is wrong with a response; ``None`` if nothing is."""
    code = code_of(response)
    message = response.message if hasattr(response, "code") else response.result.status.message
    if code == 100:
        return f"INTERNAL_ERROR {message}"
    if response.success != (code in ANSWERS):
        return f"success is {response.success} with code {code}"
    if len(message) > LONGEST_MESSAGE:
        return f"a message of {len(message)} characters"
    if not response.success:
        return None if message else f"code {code} without a message"
    if hasattr(response, "code"):
        return _fault_of_batch(response)
    return _fault_of_result(response.result) or _fault_of_vectors(response.result)


MAY_BE_INFINITE = ("contact.", "model.", "error_bound", "state_age_", "decision_margin")
"""Prefixes of fields of a result that may be infinite: echoed ones, and those whose declaration says so."""


def _fault_of_result(result: Any) -> str | None:
    for path, kind in fields(result).items():
        is_number = kind == "double" and not path.startswith(MAY_BE_INFINITE)
        if is_number and not math.isfinite(attrgetter(path)(result)):
            return f"an answer whose {path} is not finite"
    bound, code = result.error_bound, result.status.code
    is_known = 0 <= bound < math.inf or (bound == math.inf and code == TOLERANCE_NOT_MET)
    return None if is_known else f"error_bound {bound} with code {code}"


def _fault_of_vectors(result: Any) -> str | None:
    """What is wrong with the vectors of a scene; a result of one impact has no lists of them."""
    twists = getattr(result, "twists", ())
    vectors = [part for twist in twists for part in (twist.linear, twist.angular)]
    vectors += getattr(result, "impulses", ())
    is_finite = all(math.isfinite(x) for vector in vectors for x in (vector.x, vector.y, vector.z))
    return None if is_finite else "an answer with a vector that is not finite"


def _fault_of_batch(response: Any) -> str | None:
    status = np.asarray(response.status)
    if (status == 100).any():
        return "INTERNAL_ERROR of a contact"
    answered = np.isin(status, list(ANSWERS))
    for name in ("velocity", "angular_velocity", "impulse"):
        table = np.asarray(getattr(response, name)).reshape(-1, max(1, len(status)))
        if len(status) and not np.isfinite(table[:, answered]).all():
            return f"{name} that is not finite, in an answer"
    return None


def kind_of(fault: str) -> str:
    """The fault without its numbers; two faults of one kind are the same."""
    return re.sub(r"[-+]?[\d.]+(e[-+]?\d+)?", "#", fault)[:120]


# The process ----------------------------------------------------------------------------------


class Fuzzer:
    """Sends requests and counts the answers and their faults."""

    def __init__(self, order: dict[str, Any], node: Any, executor: Any) -> None:
        service, self._base = {
            "single": ("resolve_collision", full),
            "batch": ("resolve_collision_batch", lambda: batch(6)),
            "scene": ("resolve_scene", pile),
            "states": ("resolve_collision", lambda: by_name("known", "fixed")),
        }[order["what"]]
        self.client, self._executor = service_client(node, service), executor
        self._draw, self._has_tables = Draw(order["seed"]), order["what"] in ("batch", "scene")
        self._types = fields(self._base())
        self._kept = list(KEPT[order["what"]])
        self.asked = self.answered = 0
        self.codes: dict[int, int] = {}
        self.faults: dict[str, dict[str, Any]] = {}
        self.counts: dict[str, int] = {}

    def changes(self) -> Changes:
        """Changes for the next request."""
        if self._kept:
            return self._kept.pop()
        found = {} if self._has_tables and self._draw.random() < 0.7 else self._draw.of(self._types)
        return found | self._draw.of_tables(self._base()) if self._has_tables else found

    def ask(self, number: int) -> bool:
        """Send a number of requests, WINDOW at a time; return whether all were answered."""
        for begin in range(0, number, WINDOW):
            pairs = []
            for _ in range(min(WINDOW, number - begin)):
                changes = self.changes()
                pairs.append((changes, self.client.call_async(changed(self._base(), changes))))
                self.asked += 1
            for changes, future in pairs:
                self._executor.spin_until_future_complete(future, DEADLINE)
                if not future.done():
                    self._note("unanswered", changes)
                    return False
                self.answered += 1
                self._judge(changes, future.result())
        return True

    def _judge(self, changes: Changes, response: Any) -> None:
        code = code_of(response)
        self.codes[code] = self.codes.get(code, 0) + 1
        if fault := fault_of(response):
            self._note(fault, changes)

    def _note(self, fault: str, changes: Changes) -> None:
        kind = kind_of(fault)
        self.counts[kind] = self.counts.get(kind, 0) + 1
        if kind not in self.faults and len(self.faults) < MOST_FAULTS:
            self.faults[kind] = {"fault": fault[:300], "changes": changes}

    def minimise(self) -> None:
        """Remove from each fault the changes that are not needed to cause it."""
        for kind, found in self.faults.items():
            for path in list(found["changes"]) if kind != "unanswered" else ():
                fewer = {other: value for other, value in found["changes"].items() if other != path}
                future = self.client.call_async(changed(self._base(), fewer))
                self._executor.spin_until_future_complete(future, DEADLINE)
                if not future.done():
                    return
                if kind_of(fault_of(future.result()) or "") == kind:
                    found["changes"] = fewer
            found["changes"] = {path: _shown(value) for path, value in found["changes"].items()}


def _shown(value: Any) -> Any:
    return repr(value) if isinstance(value, float) else value[:40] if isinstance(value, str) else value


class States:
    """Publishes changed states of the body that the requests name."""

    def __init__(self, node: Any, seed: int) -> None:
        from rclpy.qos import HistoryPolicy, QoSProfile, ReliabilityPolicy

        from collision_response.msg import BodyState

        qos = QoSProfile(history=HistoryPolicy.KEEP_LAST, depth=1000, reliability=ReliabilityPolicy.RELIABLE)
        self.publisher = node.create_publisher(BodyState, f"{NAMESPACE}/body_states", qos)
        self._draw, self._types = Draw(seed), fields(BodyState())

    def publish(self, number: int) -> None:
        for _ in range(number):
            changes = self._draw.of(self._types)
            for name in ("known", "fixed"):
                state = full().body_a if name == "known" else full().body_b
                state.name = name
                self.publisher.publish(changed(state, changes if name == "known" else {}))


def run(order: dict[str, Any], parent: Parent) -> None:
    """Main function of the process: send "done" with the counts."""
    with ros_node("fuzzer") as (node, executor):
        fuzzer = Fuzzer(order, node, executor)
        states = States(node, order["seed"]) if order["what"] == "states" else None
        parent.wait_until(fuzzer.client.service_is_ready)
        if states is not None:
            parent.wait_until(lambda: states.publisher.get_subscription_count())
        parent.send("ready")
        parent.wait_for("go")
        left, sent, is_answered = order["number"], 0, True
        while left > 0 and is_answered and not parent.is_gone():
            some = min(left, 500)
            left -= some
            if states is None:
                is_answered = fuzzer.ask(some)
            else:
                states.publish(some)
                sent += some
                is_answered = fuzzer.ask(some // 10 + 1)
        if is_answered:
            fuzzer.minimise()
        found = {name: getattr(fuzzer, name) for name in ("asked", "answered", "codes", "counts", "faults")}
        parent.send("done", {"sent": sent + fuzzer.asked, **found})
