"""Collisions of two bodies for many tests: drawn by Hypothesis, or from a seeded generator."""

from __future__ import annotations

import math
import random
from typing import NamedTuple

import pytest

pytest.importorskip("mpmath")

import exact
from exact_adapter import exact_answer
from hypothesis import strategies as st
from scene_cases import rotate, rotated_body

from collision_response import Body, Contact, ImpactModel, Law, resolve
from collision_response.physics.orientation import Quaternion
from collision_response.physics.vector import ZERO, Vec3

EVERY_LAW = [law for law in Law if law is not Law.AUTO]
LAWS_WITH_ORACLE = [Law.FRICTIONLESS, Law.COULOMB, *(Law[name] for name in exact.ORACLE_NAMES)]
CLOSED_FORM_LAWS = [Law.FRICTIONLESS, Law.COULOMB]
PATH_LAWS = [Law.ROUTH_POISSON, Law.ROUTH_STRONGE]
LAWS_WITH_FRICTION = [law for law in LAWS_WITH_ORACLE if law is not Law.FRICTIONLESS]


class Collision(NamedTuple):
    """Two bodies that are about to collide, and their contact."""

    body_a: Body
    body_b: Body
    contact: Contact

    def resolve(self, law: Law, **model):
        return resolve(*self, ImpactModel(law=law, **model))

    def swapped(self) -> Collision:
        return Collision(self.body_b, self.body_a, self.contact._replace(normal=-self.contact.normal))

    def rotated(self, q: Quaternion) -> Collision:
        """The same collision in a frame rotated by ``q``."""
        return Collision(
            rotated_body(self.body_a, q),
            rotated_body(self.body_b, q),
            self.contact._replace(
                position=rotate(q, self.contact.position), normal=rotate(q, self.contact.normal)
            ),
        )

    def by_oracle(self, law: Law) -> exact.Answer:
        return exact_answer(*self, ImpactModel(law))


BODY_A = Body.dynamic(
    2.0, (0.03, 0.002, -0.001, 0.05, 0.003, 0.06), (0.1, 0.2, 0.9), (0.1, -0.2, 0.3, 0.9), (0.5, -0.3, -1.2),
    (1.0, -2.0, 0.5),
)  # fmt: skip
BODY_B = Body.dynamic(
    3.0, (0.08, -0.004, 0.002, 0.07, 0.005, 0.09), (-0.05, 0.1, -0.8), (-0.3, 0.1, 0.2, 0.8), (-0.1, 0.2, 0.4),  # noqa: E501
    (0.3, 0.7, -1.0),
)  # fmt: skip
CONTACT = Contact.of((0.02, 0.05, 0.1), (0.1, -0.2, 1.0), 0.7, 0.2)
"""Two rotating bodies in general axes, struck off-centre; they slide by every law."""


def _numbers(least: float, most: float):
    return st.floats(least, most, allow_subnormal=False)


def _vectors(size: float):
    return st.builds(Vec3, *[_numbers(-size, size)] * 3)


quaternions = st.builds(Quaternion, *[_numbers(-1, 1)] * 4).filter(lambda q: q.squared_length() > 0.1)


@st.composite
def inertias(draw, mass: float):
    """Valid inertias: second moments are arbitrary, moments of inertia are not."""
    x, y, z = (mass * draw(_numbers(0.01, 1.0)) for _ in range(3))
    return (y + z, 0.0, 0.0, x + z, 0.0, x + y)


@st.composite
def bodies(draw) -> Body:
    mass = draw(_numbers(0.1, 10.0))
    return Body.dynamic(
        mass,
        draw(inertias(mass)),
        draw(_vectors(1.0)),
        draw(quaternions),
        draw(_vectors(3.0)),
        draw(_vectors(3.0)),
        draw(st.just(ZERO) | _vectors(0.5)),
    )


immovable = st.builds(Body.kinematic, _vectors(1.0), _vectors(1.0), _vectors(1.0))


@st.composite
def collisions(draw) -> Collision:
    normal = draw(_vectors(1.0).filter(lambda n: n.norm() > 0.1))
    contact = Contact.of(draw(_vectors(1.0)), normal, draw(_numbers(0.0, 1.0)), draw(_numbers(0.0, 3.0)))
    return Collision(draw(bodies()), draw(st.one_of(bodies(), immovable)), contact)


@st.composite
def planar_collisions(draw) -> Collision:
    def in_plane(v: Vec3) -> Vec3:
        return v._replace(z=0.0)

    def flat(body: Body) -> Body:
        x, y, z, w = body.orientation or (0.0, 0.0, 0.0, 1.0)
        return body._replace(
            position=in_plane(body.position),
            velocity=in_plane(body.velocity),
            angular_velocity=Vec3(0.0, 0.0, body.angular_velocity.z),
            orientation=Quaternion(0.0, 0.0, math.hypot(x, y, z), w) if body.is_movable() else None,
            com=in_plane(body.com),
        )

    collision = draw(collisions().filter(lambda s: in_plane(s.contact.normal).norm() > 0.1))
    contact = collision.contact._replace(
        position=in_plane(collision.contact.position), normal=in_plane(collision.contact.normal)
    )
    return Collision(flat(collision.body_a), flat(collision.body_b), contact)


def random_collision(
    seed: int, *, slender: bool = False, friction: float | None = None, off_centre: bool = False
) -> Collision:
    """A collision of bodies that approach.

    ``slender`` bodies have one moment 1e-4 of the others; ``off_centre`` bodies have reference points away
    from their centres of mass.
    """
    rng = random.Random(seed)

    def vector(size: float) -> Vec3:
        return Vec3(*(rng.uniform(-size, size) for _ in range(3)))

    def body() -> Body:
        mass = math.exp(rng.uniform(-2, 2))
        least = 1e-4 if slender else 0.05
        x, y, z = 0.1 * mass * least, 0.1 * mass * least, 0.1 * mass * rng.uniform(0.5, 1)
        return Body.dynamic(
            mass, (y + z, 0.0, 0.0, x + z, 0.0, x + y), vector(0.5), [rng.gauss(0, 1) for _ in range(4)],
            vector(2.0), vector(3.0), vector(0.4) if off_centre else ZERO,
        )  # fmt: skip

    while True:
        mu = rng.uniform(0, 1.2) if friction is None else friction
        collision = Collision(body(), body(), Contact.of(vector(0.5), vector(1.0), rng.uniform(0, 1), mu))
        if collision.resolve(Law.FRICTIONLESS).normal_impulse > 0:
            return collision
