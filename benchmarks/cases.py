"""The requests whose answers are timed."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from collision_response import Body, Contact, Geometry
from collision_response.batch import body_rows, contact_rows
from collision_response.physics.mass_properties import rod
from collision_response.physics.orientation import Quaternion
from collision_response.physics.vector import Vec3


class Scene(NamedTuple):
    """Two bodies and their contact."""

    body_a: Body
    body_b: Body
    contact: Contact


TURN, OTHER_TURN = (0.3, -0.2, 0.5, 0.8), (-0.1, 0.4, 0.2, 0.9)

PAIR = Scene(
    Body.dynamic(
        2.0, (0.3, 0.02, -0.01, 0.4, 0.03, 0.5), (0.1, 0.2, 0.6), TURN, (0.3, -0.2, -1.5), (0.4, -0.7, 0.9)
    ),
    Body.dynamic(
        3.0,
        (0.5, 0.01, 0.02, 0.6, -0.03, 0.7),
        (-0.2, 0.1, -0.5),
        OTHER_TURN,
        (-0.1, 0.2, 0.8),
        (0.2, 0.5, -0.3),
    ),
    Contact.of((0.05, 0.1, 0.02), (0.36, 0.48, 0.8), 0.5, 0.3),
)
"""Two bodies in space that rotate, with orientations."""


def _aligned(body: Body) -> Body:
    return body._replace(orientation=None, inertia=body.inertia._replace(xy=0.0, xz=0.0, yz=0.0))


ALIGNED = Scene(
    _aligned(PAIR.body_a), _aligned(PAIR.body_b), Contact.of((0.05, 0.1, 0.02), (0.0, 0.0, 1.0), 0.5)
)
"""The same as ``PAIR`` for the peers: axes parallel to the world's, no friction."""

FLAT = Scene(
    Body.dynamic(
        2.0,
        (0.3, 0.0, 0.0, 0.4, 0.0, 0.5),
        (0.1, 0.6, 0.0),
        (0, 0, 0.6, 0.8),
        (0.3, -1.5, 0.0),
        (0.0, 0.0, 0.9),
    ),
    Body.dynamic(
        3.0,
        (0.5, 0.0, 0.0, 0.6, 0.0, 0.7),
        (-0.2, -0.5, 0.0),
        (0, 0, -0.2, 1),
        (-0.1, 0.8, 0.0),
        (0.0, 0.0, -0.3),
    ),
    Contact.of((0.05, 0.02, 0.0), (0.0, 1.0, 0.0), 0.5, 0.3),
)
"""Two bodies in the x-y plane."""


def separating(scene: Scene) -> Scene:
    """The same with the opposite normal, so that the bodies separate."""
    return scene._replace(contact=scene.contact._replace(normal=-scene.contact.normal))


def of_numpy(scene: Scene) -> Scene:
    """The same with NumPy scalars."""

    def converted(value: Any) -> Any:
        if isinstance(value, tuple):
            return type(value)(*map(converted, value))
        return value if value is None else np.float64(value)

    return converted(scene)


def grazing(scene: Scene, share: float) -> Scene:
    """The same with an approach speed of only ``share`` times the relative speed."""
    a, b, contact = scene

    def at_contact(body: Body) -> Vec3:
        return body.velocity + body.angular_velocity.cross(contact.position - body.position)

    u, n = at_contact(a) - at_contact(b), contact.normal
    change = n * (-(n.dot(u) + share * u.norm()) / n.dot(n))
    return Scene(a._replace(velocity=a.velocity + change), b, contact)


def thin_rod() -> Scene:
    """A rod a thousand times as long as thick strikes a box; its tensor is in axes other than its own."""
    mass, length, radius = 1.0, 1.0, 5e-4
    across, along = mass * (3 * radius**2 + length**2) / 12, mass * radius**2 / 2
    d = Vec3(2 / 3, 1 / 3, 2 / 3)
    tensor = [
        (across if i == k else 0.0) - (across - along) * d[i] * d[k]
        for i, k in ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))
    ]
    body = Body.dynamic(mass, tensor, d * (length / 2), None, (0.4, 0.1, -1.0), (0.3, 0.2, -0.5))
    return Scene(body, ALIGNED.body_b, Contact.of((1e-5, -1e-5, 0.0), (0.1, 0.2, 1.0), 0.5, 0.3))


def slip_reversal() -> Scene:
    """A rod whose end strikes a floor, in the plane; the slip stops and reverses."""
    angle = math.atan(2.0)
    body = Body.dynamic(
        1.0,
        rod(1.0, 1.0).inertia,
        (math.cos(angle) / 2, math.sin(angle) / 2, 0.0),
        (0.0, 0.0, math.sin(angle / 2), math.cos(angle / 2)),
        (0.5, -1.0, 0.0),
    )
    return Scene(body, Body.static(), Contact.of((0.0, 0.0, 0.0), (0.0, 1.0, 0.0), 0.9, 0.3))


def turning_slip() -> Scene:
    """A slender body whose slip turns throughout the impact."""
    body = Body.dynamic(
        1.0, (0.081, 0.0, 0.0, 0.08, 0.0, 0.004), (0.1, -0.25, 0.35), Quaternion(*TURN), (0.5, 0.9, -1.2),
        (1.0, -0.6, 0.3),
    )  # fmt: skip
    return Scene(body, Body.static(), Contact.of((0.0, 0.0, 0.0), (0.1, -0.2, 1.0), 0.5, 0.4))


# Many -----------------------------------------------------------------------------------------


def tables(geometry: Geometry, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Tables of random pairs of movable bodies, each made of a few points, and of their contacts."""
    random = np.random.default_rng(0)
    body_row, contact_row = body_rows(geometry), contact_rows(geometry)
    bodies = random.normal(size=(body_row.height, 2, n))
    contacts = random.normal(size=(contact_row.height, n))
    bodies[body_row.mass] = random.uniform(0.5, 2.0, size=(1, 2, n))
    if geometry is Geometry.PLANAR:
        bodies[body_row.inertia] = random.uniform(0.5, 2.0, size=(1, 2, n))
    if geometry is Geometry.SPATIAL:
        tensor = np.zeros((6, 2, n))
        for _ in range(4):
            x, y, z = random.normal(size=(3, 2, n))
            tensor += (y * y + z * z, -x * y, -x * z, x * x + z * z, -y * z, x * x + y * y)
        bodies[body_row.inertia] = tensor
    contacts[contact_row.restitution] = random.uniform(size=n)
    contacts[contact_row.friction] = random.uniform(size=n)
    return bodies, contacts


def with_immovable(bodies: np.ndarray, geometry: Geometry) -> np.ndarray:
    """The same, with every second body_b immovable."""
    body_row, bodies = body_rows(geometry), bodies.copy()
    bodies[body_row.mass, 1, ::2], bodies[body_row.inertia, 1, ::2] = math.inf, 0.0
    return bodies


def flat_boxes(n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Tables and pairs of ``n`` sliding boxes that land flat on four corners each. The floor comes last."""
    random = np.random.default_rng(0)
    body_row, contact_row = body_rows(Geometry.SPATIAL), contact_rows(Geometry.SPATIAL)
    bodies, contacts = np.zeros((body_row.height, n + 1)), np.zeros((contact_row.height, 4 * n))
    bodies[body_row.mass], bodies[body_row.mass, n] = 1.0, math.inf
    bodies[body_row.inertia][[0, 3, 5], :n] = 1 / 6
    bodies[body_row.velocity][:2, :n] = random.normal(size=(2, n))
    bodies[body_row.velocity][2, :n] = -1.0
    contacts[contact_row.position] = np.tile([[-0.5, -0.5, 0.5, 0.5], [-0.5, 0.5, -0.5, 0.5], [-0.5] * 4], n)
    contacts[contact_row.normal][2] = 1.0
    contacts[contact_row.restitution], contacts[contact_row.friction] = 0.5, 0.3
    return bodies, contacts, np.array([np.repeat(np.arange(n), 4), np.full(4 * n, n)])
