"""Gradients in reverse mode through the formulas: equal to those of dual numbers, and never NaN."""

from __future__ import annotations

import numpy as np
import pytest
from collisions import LAWS_WITH_ORACLE, random_collision
from reverse_mode import Reverse

from collision_response import Body, Contact, ImpactModel, Law
from collision_response.derivatives import differentiate
from collision_response.impact import impact
from collision_response.physics.laws import Settings
from collision_response.physics.vector import Vec3

SPHERE = (0.4, 0.0, 0.0, 0.4, 0.0, 0.4)
HEAD_ON = (
    Body.dynamic(1.0, SPHERE, (0.0, 0.0, 1.0), None, (0.0, 0.0, -1.0)),
    Body.static(),
    Contact.of((0, 0, 0), (0, 0, 1), 0.5, 0.3),
)


def convert_body(make, body: Body) -> Body:
    """The body with every number converted by ``make``."""
    turn = body.orientation and type(body.orientation)(*map(make, body.orientation))
    vectors = (
        type(v)(*map(make, v))
        for v in (body.inertia, body.position, body.velocity, body.angular_velocity, body.com)
    )
    inertia, x, v, w, com = vectors
    return Body(make(body.mass), inertia, x, turn, v, w, com)


def by_reverse(collision, law: Law) -> np.ndarray:
    """Derivatives of the impulse by velocity and com of body_a, and by friction, shape (3, 7)."""
    make = Reverse
    a, b = (convert_body(make, body) for body in collision[:2])
    c = collision[2]
    contact = Contact(
        Vec3(*map(make, c.position)), Vec3(*map(make, c.normal)), make(c.restitution), make(c.friction)
    )
    answer = impact(a, b, contact, law, Settings(make(0.0), make(0.0), make(1e-12)))
    return np.array([P.gradient(*a.velocity, *a.com, contact.friction) for P in answer.changes.impulse])


@pytest.mark.parametrize("law", [Law.FRICTIONLESS, Law.COULOMB, Law.MOREAU])
@pytest.mark.parametrize(
    "collision", [HEAD_ON, *(random_collision(seed) for seed in range(4))], ids=lambda _: ""
)
def test_reverse_and_forward_agree(law, collision):
    names = ("body_a.velocity", "body_a.com", "contact.friction")
    expected = differentiate(*collision, ImpactModel(law), names).jacobian[12:]
    np.testing.assert_allclose(by_reverse(collision, law), expected, rtol=1e-10, atol=1e-11)


@pytest.mark.parametrize(
    "law", [law for law in LAWS_WITH_ORACLE if law.name in ("FRICTIONLESS", "COULOMB", "MOREAU")]
)
def test_no_gradient_is_nan_at_a_head_on_impact(law):
    assert np.isfinite(by_reverse(HEAD_ON, law)).all()
