"""Measurements that no law can explain: wrong units, signs and columns."""

from __future__ import annotations

import math

import numpy as np
import pytest

pytest.importorskip("scipy")

from collisions import random_collision

from collision_response import Body, Contact, ImpactModel, Law, Twist, resolve
from collision_response.identify import Impacts, identify
from collision_response.identify.measurements import BODY

IMPULSE, ENERGY, APPROACH = "no impulse at the contact points", "which no law does", "still approach"


def spheres(fault=lambda before, after: (before, after)):
    """Spheres that slide on a floor, measured with noise of 1 cm/s and 0.1 rad/s, and then with a fault."""
    rng, rows = np.random.default_rng(2), []
    floor, contact = Body.static(), Contact.of((0, 0, 0), (0, 0, 1), restitution=0.5, friction=0.2)
    for i in range(16):
        ball = Body.sphere(1.0, 0.1, position=(0, 0, 0.1), velocity=(2 + i % 5, 0, -1 - i % 3))
        twist = resolve(ball, floor, contact).twist_a
        linear, angular = (np.add(v, s * rng.normal(size=3)) for v, s in zip(twist, (0.01, 0.1), strict=True))
        before, after = fault(ball, Twist(ball.velocity._make(linear), ball.velocity._make(angular)))
        rows.append((before, floor, contact, after, after))
    return Impacts.of(*zip(*rows, strict=True))


FAULTS = {
    "after in mm/s": (lambda b, a: (b, a._replace(linear=a.linear * 1000)), {IMPULSE, ENERGY}),
    "all speeds in mm/s": (
        lambda b, a: (b._replace(velocity=b.velocity * 1000), a._replace(linear=a.linear * 1000)),
        {IMPULSE},
    ),
    "spin in degrees": (lambda b, a: (b, a._replace(angular=a.angular * (180 / math.pi))), {IMPULSE, ENERGY}),
    "position in mm": (lambda b, a: (b._replace(position=b.position * 1000), a), {IMPULSE}),
    "inertia in kg mm^2": (lambda b, a: (b._replace(inertia=b.inertia * 1e6), a), {IMPULSE}),
    "spin before left out": (
        lambda b, a: (b, a._replace(angular=a.angular + b.velocity._make((0, 30, 0)))),
        {IMPULSE},
    ),
    "x for z": (lambda b, a: (b, a._replace(linear=a.linear._make(reversed(a.linear)))), {IMPULSE}),
    "a point in mm/s": (
        lambda b, a: (b._replace(inertia=b.inertia * 0), Twist(a.linear * 1000, a.angular * math.nan)),
        {ENERGY},
    ),
    "the sign of z after": (
        lambda b, a: (b, a._replace(linear=a.linear._replace(z=-a.linear.z))),
        {APPROACH},
    ),
}


@pytest.mark.parametrize("kind", ["nothing", *FAULTS])
def test_wrong_units_and_columns_are_named(kind):
    """Each with the note that is true of it; a fit without fault has none."""
    fault, expected = FAULTS.get(kind, (lambda before, after: (before, after), set()))
    notes = identify(spheres(fault), resamples=2).notes
    assert {text for text in (IMPULSE, ENERGY, APPROACH) if any(text in note for note in notes)} == expected


def test_the_misfit_is_the_same_for_every_observer():
    drift = np.array((100.0, -30.0, 20.0))
    at_rest = spheres()
    bodies, after = at_rest.bodies.copy(), at_rest.after.copy()
    bodies[BODY.velocity] += drift[:, None, None]
    after[:3] += drift[:, None, None]
    moving = Impacts(bodies, at_rest.contacts, after, at_rest.root)
    one, other = (identify(impacts, resamples=2) for impacts in (at_rest, moving))
    assert other.misfit == pytest.approx(one.misfit, rel=1e-6)


@pytest.mark.parametrize("kind", Impacts.kinds)
@pytest.mark.parametrize("law", [law for law in Law if law is not Law.AUTO])
def test_the_nearest_impulses_explain_the_answers_of_every_law(law, kind):
    """By definition of an impulse, and because no law adds energy."""
    rows = []
    for seed in range(20):
        *bodies, contact = random_collision(seed, friction=0.4, off_centre=True)
        answer = resolve(*bodies, contact, ImpactModel(law))
        rows.append((*bodies, contact, answer.twist_a, answer.twist_b))
    impacts = Impacts.of(*zip(*rows, strict=True))
    missed, energy, approach = impacts.nearest_impulses(kind)
    assert abs(missed).max() <= 1e-12 * abs(impacts.sizes(kind)).max()  # rounding of the pseudo-inverses
    assert energy.max() <= 1 + 1e-9
    assert approach.max() <= 1e-9
