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
from collision_response.physics.vector import Vec3

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


def noted(after, spins=None):
    """The notes on spheres that fall at 1 m/s, measured at speeds and spins about the normal."""
    n = len(after)
    balls = [Body.sphere(1.0, 0.1, position=(0, 0, 0.1), velocity=(0, 0, -1))] * n
    twists = [Twist(Vec3(0, 0, v), Vec3(0, 0, w)) for v, w in zip(after, spins or [0] * n, strict=True)]
    contacts = [Contact.of((0, 0, 0), (0, 0, 1))] * n
    measured = Impacts.of(balls, [Body.static()] * n, contacts, twists, twists)
    return identify(measured, Law.FRICTIONLESS, loss="linear", resamples=2).notes


@pytest.mark.parametrize(
    ("scatter", "spin", "least"),
    [(0.0, 2.37, None), (0.0, 2.40, "10.1%"), (0.15, 1.5811, "6.6%"), (0.2, 1.5811, None)],
)
def test_what_no_impulse_explains_is_noted_if_it_is_most_of_a_misfit_above_a_tenth(scatter, spin, least):
    """The misfit is that of the spin, 0.004^(1/2) of it, and of the scatter together, over 1.5 m/s or so."""
    notes = noted([0.5 + scatter * (-1) ** i for i in range(12)], [spin] * 12)
    shown = [note.partition(",")[0] for note in notes if IMPULSE in note]
    assert shown == ([f"no law can have a misfit below {least}"] if least else [])


@pytest.mark.parametrize(("most", "few", "gain"), [(1.3, 0.3, "1.7"), (1.04, 0.3, None), (1.05, 1.05, None)])
def test_a_gain_of_energy_is_noted_if_the_misfit_cannot_be_its_cause(most, few, gain):
    """At restitution 1.3 energy is 1.69 times as large. The misfits are 0.25, 0.2 and 0.02."""
    shown = [note for note in noted([most] * 6 + [few] * 4) if ENERGY in note]
    expected = f"the impacts make the energy of the relative motion {gain} times as large"
    assert [note.partition(",")[0] for note in shown] == [expected] * bool(gain)


@pytest.mark.parametrize(("left", "is_noted"), [(0.25, True), (0.11, True), (0.09, False)])
def test_an_approach_that_is_left_is_noted(left, is_noted):
    """Without bounce the misfit is left / (1 - left), above a tenth where more than an eleventh is left."""
    shown = [note for note in noted([-left] * 10) if APPROACH in note]
    expected = f"after the impacts the bodies still approach, at {100 * left:.0f}% of the speed before"
    assert [note.partition(", which")[0] for note in shown] == [expected] * is_noted


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
