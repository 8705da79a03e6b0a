"""How much the order matters: contacts resolved one after another, as game engines do.

In each order the contacts that approach are resolved one by one, and again, until none approaches.
Where the answers of several orders lie apart, the answer for all at once is a matter of modelling: a
flat box; where they agree, it is not: two balls that strike one wall.
"""

from __future__ import annotations

import math
import random
from collections.abc import Sequence

from ..answer import in_norm
from ..model import ImpactModel
from ..physics.body import Body, Twist
from ..physics.contact import Contact
from ..physics.vector import Vec3
from ..resolve import resolve
from ..status import StatusCode
from .clusters import Pair

SWEEPS = 1000
"""A budget for each order: impacts at e = 1 between walls never end."""

AT_REST = 1e-9
"""An approach slower than this part of the fastest counts as none."""


def order_sensitivity(
    bodies: Sequence[Body],
    pairs: Sequence[Pair],
    contacts: Sequence[Contact],
    model: ImpactModel,
    orders: int,
) -> float:
    """The greatest distance of the changes of velocity by two orders, relative to them."""
    indices = list(range(len(contacts)))
    shuffled = random.Random(0)
    answers: list[list[Twist]] = []
    for turn in range(orders):
        order = indices[::-1] if turn == 1 else list(indices)
        if turn > 1:
            shuffled.shuffle(order)
        answers.append(resolve_sequentially(bodies, pairs, contacts, model, order))
    return max(distance(bodies, one, other) for one in answers for other in answers)


def resolve_sequentially(
    bodies: Sequence[Body],
    pairs: Sequence[Pair],
    contacts: Sequence[Contact],
    model: ImpactModel,
    order: Sequence[int],
) -> list[Twist]:
    """The changes of velocity if contacts are resolved one by one, until none approaches."""
    moved = list(bodies)
    fastest = 0.0
    for _ in range(SWEEPS):
        struck = False
        for i in order:
            a, b = pairs[i]
            impact = resolve(moved[a], moved[b], contacts[i], model)
            fastest = max(fastest, -impact.normal_velocity_before)
            if impact.status is StatusCode.SEPARATING or -impact.normal_velocity_before <= AT_REST * fastest:
                continue
            struck = True
            for place, twist in ((a, impact.twist_a), (b, impact.twist_b)):
                if moved[place].is_movable():
                    moved[place] = moved[place].with_twist(twist)
        if not struck:
            break
    return [
        Twist(
            Vec3(*after.velocity) - Vec3(*before.velocity),
            Vec3(*after.angular_velocity) - Vec3(*before.angular_velocity),
        )
        for before, after in zip(bodies, moved, strict=True)
    ]


def distance(bodies: Sequence[Body], one: Sequence[Twist], other: Sequence[Twist]) -> float:
    """How far apart two motions are, relative to the second, in the norm of ``error_bound``."""
    apart, size = [], []
    for body, x, y in zip(bodies, one, other, strict=True):
        if body.is_movable():
            change = in_norm(body, y)
            root = math.sqrt(body.mass)
            apart.append(root * math.dist(in_norm(body, x), change))
            size.append(root * math.hypot(*change))
    far, whole = math.hypot(*apart), math.hypot(*size)
    return 0.0 if far == 0 else far / whole if whole else math.inf
