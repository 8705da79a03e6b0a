"""How much the answer depends on the order if contacts are resolved one after another, as game engines do.

In each order the approaching contacts are resolved one by one, again and again, until none approaches. Where
the answers of several orders differ, as for a box that lands flat, no order is right, and the contacts must
be resolved at once. Where they agree, as for two balls that strike one wall, this does not matter.
"""

from __future__ import annotations

import math
import random
from collections.abc import Iterable, Sequence

from ..answer import norm_components
from ..in_python.request_numbers import read_request
from ..model import ImpactModel
from ..physics.body import Body, Twist
from ..physics.contact import Contact
from ..physics.vector import Vec3
from ..resolve import resolve
from ..status import StatusCode
from .find_clusters import Pair
from .request import ContactIndices, SceneRequest, with_scene_names

SWEEPS = 1000
"""Greatest number of passes over the contacts: a ball pressed between two walls, with e = 1, never stops."""

AT_REST = 1e-9
"""Approaches slower than this fraction of the fastest one are ignored."""


def order_sensitivity(
    scene: SceneRequest, clusters: Iterable[Sequence[int]], model: ImpactModel, orders: int
) -> float:
    """Return the greatest relative distance between the changes of velocity that two orders give.

    It is that of the cluster where it is greatest, and infinite where an order does not end. Each impact has
    the restitution of its own contact, also where the law takes one for the cluster. All of it is computed in
    floats: fractions would grow with every impact.
    """
    bodies, contacts = list(scene.bodies), list(scene.contacts)
    for i, (a, b) in enumerate(scene.pairs):
        given = contacts[i]
        bodies[a], bodies[b], contacts[i] = read_request(bodies[a], bodies[b], given)
        if callable(given.restitution):  # each impact has its own speed
            contacts[i] = contacts[i]._replace(restitution=given.restitution)
        if callable(given.friction):
            contacts[i] = contacts[i]._replace(friction=given.friction)
    rng = random.Random(0)
    return max(
        (_of_cluster(bodies, scene.pairs, contacts, model, cluster, orders, rng) for cluster in clusters),
        default=0.0,
    )


def _of_cluster(
    bodies: Sequence[Body],
    pairs: Sequence[Pair],
    contacts: Sequence[Contact],
    model: ImpactModel,
    cluster: Sequence[int],
    orders: int,
    rng: random.Random,
) -> float:
    answers: list[list[Twist]] = []
    for k in range(orders):
        order = list(reversed(cluster)) if k == 1 else list(cluster)
        if k > 1:
            rng.shuffle(order)
        answer = resolve_sequentially(bodies, pairs, contacts, model, order)
        if answer is None:
            return math.inf
        answers.append(answer)
    touched = [bodies[i] for i in _touched(pairs, cluster)]
    return max(relative_distance(touched, one, other) for one in answers for other in answers)


def _touched(pairs: Sequence[Pair], contacts: Iterable[int]) -> list[int]:
    """The bodies that take part in some contacts, in their order."""
    return sorted({body for i in contacts for body in pairs[i]})


def relative_distance(bodies: Sequence[Body], changes: Sequence[Twist], reference: Sequence[Twist]) -> float:
    """Return how far the twist changes of bodies are from a reference, relative to that, in the norm of
    ``error_bound``.
    """
    distances, sizes = [], []
    for body, change, expected in zip(bodies, changes, reference, strict=True):
        if body.is_movable():
            components = norm_components(body, expected)
            root = math.sqrt(body.mass)
            distances.append(root * math.dist(norm_components(body, change), components))
            sizes.append(root * math.hypot(*components))
    distance, size = math.hypot(*distances), math.hypot(*sizes)
    return 0.0 if distance == 0 else distance / size if size else math.inf


def resolve_sequentially(
    bodies: Sequence[Body],
    pairs: Sequence[Pair],
    contacts: Sequence[Contact],
    model: ImpactModel,
    order: Sequence[int],
) -> list[Twist] | None:
    """Return how the twists of bodies change if contacts are resolved one by one until none approaches.

    The bodies are those of the contacts in ``order``. None if that takes more than ``SWEEPS`` passes.

    Raises:
        ImpactError: if an impact on the way has no answer; its field is named as in the scene.
    """
    # Copies, because resolve() refuses one object as both bodies.
    moved = {i: Body(*bodies[i]) for i in _touched(pairs, order)}
    fastest = 0.0
    for _ in range(SWEEPS):
        any_approaches = False
        for i in order:
            a, b = pairs[i]
            given = moved[a], moved[b], contacts[i], model
            impact = with_scene_names(ContactIndices(i, a, b), resolve, *given)
            speed = -impact.normal_velocity_before
            fastest = max(fastest, speed)
            if impact.status is StatusCode.SEPARATING or speed <= AT_REST * fastest:
                continue
            any_approaches = True
            for body, twist in ((a, impact.twist_a), (b, impact.twist_b)):
                if moved[body].is_movable():
                    moved[body] = moved[body].with_twist(twist)
        if not any_approaches:
            return [
                Twist(
                    Vec3(*after.velocity) - Vec3(*before.velocity),
                    Vec3(*after.angular_velocity) - Vec3(*before.angular_velocity),
                )
                for before, after in ((bodies[i], after) for i, after in moved.items())
            ]
    return None
