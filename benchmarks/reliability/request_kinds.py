"""The kinds of request that clients send, each with the correct status codes of its answer."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import numpy as np

SHUTTING_DOWN = 21
REFUSALS_AT_ANY_TIME = frozenset({20, SHUTTING_DOWN})
"""BUDGET_EXCEEDED and SHUTTING_DOWN."""

ANSWERS = frozenset({1, 2, 17})
"""OK, SEPARATING and TOLERANCE_NOT_MET."""

NAMES = ("known_a", "known_b")
"""Names of bodies whose states ``publisher.py`` publishes."""


class Kind(NamedTuple):
    """A kind of request.

    Attributes:
        make: makes the message.
        codes: the correct codes of an answer.
        is_numbered: whether the stamp may hold the number of the request, which the answer echoes. This is
            not possible where the stamp asks for a state of that time.
    """

    make: Callable[[], Any]
    codes: frozenset[int]
    is_numbered: bool = True


def full(**model: Any) -> Any:
    """Two bodies in space, given completely."""
    from service import impact

    request = impact()
    for field, value in model.items():
        setattr(request.model, field, value)
    return request


def separating() -> Any:
    request = full()
    for body, side in ((request.body_a, 1.0), (request.body_b, -1.0)):
        body.twist.linear.z, body.twist.angular.x, body.twist.angular.y = 9.0 * side, 0.0, 0.0
    return request


def scene() -> Any:
    """Two bodies with two contacts."""
    from collision_response import Body, Contact
    from collision_response.ros.scene_client import pack

    ball = Body.dynamic(2.0, (0.3, 0.0, 0.0, 0.4, 0.0, 0.5), velocity=(0.0, 0.0, -1.0))
    contacts = [Contact.of((x, 0.0, 0.0), (0.0, 0.0, 1.0), 0.5, 0.3) for x in (-0.1, 0.1)]
    return pack([ball, Body.static()], [(0, 1)] * 2, contacts, names=["a", "b"], frame_id="world")


def pile() -> Any:
    """A box that lands on four corners, and a ball on it."""
    from collision_response import Body, Contact
    from collision_response.ros.scene_client import pack

    box = Body.box(2.0, (1.0, 1.0, 1.0), position=(0.0, 0.0, 0.5), velocity=(0.3, 0.0, -1.0))
    ball = Body.sphere(1.0, 0.1, position=(0.2, 0.0, 1.1), velocity=(0.0, 0.1, -2.0))
    corners = [(x, y, 0.0) for x in (-0.5, 0.5) for y in (-0.5, 0.5)]
    contacts = [Contact.of(point, (0.0, 0.0, 1.0), 0.5, 0.3) for point in (*corners, (0.2, 0.0, 1.0))]
    pairs = [*[(0, 2)] * 4, (1, 0)]
    return pack([box, ball, Body.static()], pairs, contacts, names=["a", "b", "c"], frame_id="world")


def stack(boxes: int) -> Any:
    """Boxes on one another, of 1 g and 1 t in turn, which takes long."""
    from collision_response import Body, Contact
    from collision_response.ros.scene_client import pack

    light_and_heavy = [Body.box(mass, (1.0, 1.0, 1.0)) for mass in (1e-3, 1e3)]
    bodies = [
        light_and_heavy[k % 2]._replace(position=(0.0, 0.0, k + 0.5), velocity=(0.1 * k, 0.0, -1.0))
        for k in range(boxes)
    ]
    corners = [(k, x, y) for k in range(boxes) for x in (-0.5, 0.5) for y in (-0.5, 0.5)]
    contacts = [Contact.of((x, y, float(k)), (0.0, 0.0, 1.0), 0.3, 0.5) for k, x, y in corners]
    pairs = [(k, k - 1 if k else boxes) for k, _, _ in corners]
    return pack([*bodies, Body.static()], pairs, contacts, frame_id="world")


def by_name(*names: str) -> Any:
    """Two bodies by name only."""
    request = full()
    for owner, name in zip(("body_a", "body_b"), names, strict=True):
        setattr(request, owner, type(request.body_a)(name=name))
    return request


def without_normal() -> Any:
    request = full()
    request.contact.normal.z = 0.0
    return request


def not_a_number() -> Any:
    request = full()
    request.body_a.twist.linear.x = float("nan")
    return request


def batch(contacts: int, *, law: int = 2, extended: bool = False, of_points: bool = False) -> Any:
    """Contacts with friction between a quarter as many bodies; point masses take fewer bytes."""
    from cases import tables

    from collision_response import Geometry, ImpactModel, Law, Precision
    from collision_response.ros.batch_client import pack

    geometry = Geometry.POINT if of_points else Geometry.SPATIAL
    bodies, contact_table = tables(geometry, contacts)
    number = max(2, contacts // 4)
    body_a = np.arange(contacts) % number
    model = ImpactModel(Law(law), precision=Precision.EXTENDED if extended else Precision.AUTO)
    return pack(
        bodies[:, 0, :number], (body_a, (body_a + 1) % number), contact_table, model, frame_id="world"
    )


def wrong_table() -> Any:
    request = batch(10)
    request.bodies.append(0.0)
    return request


def _kinds() -> dict[str, Kind]:
    law = {"coulomb": 2, "moreau": 3, "routh_poisson": 4, "routh_stronge": 5}
    return {
        "full": Kind(full, frozenset({1})),
        **{name: Kind(partial(full, law=number), frozenset({1})) for name, number in law.items()},
        "extended": Kind(partial(full, precision=4), frozenset({1})),
        "separating": Kind(separating, frozenset({2})),
        "named": Kind(partial(by_name, *NAMES), ANSWERS | {9}, is_numbered=False),
        "unknown": Kind(partial(by_name, "nobody", "noone"), frozenset({8}), is_numbered=False),
        "without normal": Kind(without_normal, frozenset({4})),
        "not finite": Kind(not_a_number, frozenset({6})),
        "batch of 100": Kind(partial(batch, 100), frozenset({1})),
        "batch of 1e4": Kind(partial(batch, 10_000), frozenset({1})),
        "extended batch of 1e4": Kind(partial(batch, 10_000, extended=True), frozenset({1})),
        "stack of 60": Kind(partial(stack, 60), frozenset({1})),
        "wrong table": Kind(wrong_table, frozenset({19})),
        "point batch of 1e6": Kind(partial(batch, 1_000_000, of_points=True), frozenset({1})),
        "extended batch of 1e6": Kind(partial(batch, 1_000_000, extended=True), frozenset({1})),
        "extended batch of 2e5": Kind(partial(batch, 200_000, extended=True), frozenset({1})),
        "routh batch of 2e5": Kind(partial(batch, 200_000, law=5, extended=True), frozenset({1})),
    }


KINDS = _kinds()

SMALL = (
    "full",
    "coulomb",
    "routh_stronge",
    "extended",
    "separating",
    "unknown",
    "without normal",
    "not finite",
)
"""Small requests, answered or refused, for bursts."""

MIXED = (*SMALL, "moreau", "routh_poisson", "batch of 100", "wrong table")
"""Requests to both services, for long runs."""


def service_of(request: Any) -> str:
    """Name of the service that answers a request."""
    if hasattr(request, "layout"):
        return "resolve_collision_batch"
    return "resolve_scene" if hasattr(request, "pairs") else "resolve_collision"


def code_of(response: Any) -> int:
    """Status code of a response of any service."""
    return int(response.code if hasattr(response, "code") else response.result.status.code)


def stamp_of(message: Any) -> Any:
    """The echoed stamp of a request to, or a response of, any service."""
    if hasattr(message, "result"):
        return message.result.header.stamp
    return message.contact.header.stamp if hasattr(message, "contact") else message.header.stamp


def is_right(kind: Kind, response: Any) -> bool:
    """Whether a response has an expected code, and its ``success`` agrees with the code."""
    code = code_of(response)
    return code in kind.codes | REFUSALS_AT_ANY_TIME and bool(response.success) == (code in ANSWERS)
