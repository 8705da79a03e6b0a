"""The laws against reference values and the oracle, in every type of number."""

from __future__ import annotations

import math
from fractions import Fraction as F
from itertools import product

import pytest

pytest.importorskip("mpmath")

from operator import attrgetter

import exact
import numpy as np
import rods
from collisions import LAWS_WITH_FRICTION, Collision, random_collision
from mpmath import mp

from collision_response import Adjustment, Body, Contact, Geometry, Impact, ImpactModel, Law, Regime, resolve
from collision_response.demo.systems import all_systems, s1, s2
from collision_response.impact import impact as compute
from collision_response.physics.energy import kinetic_energy
from collision_response.physics.laws import Settings
from collision_response.physics.mass_properties import rod, sphere
from collision_response.physics.orientation import Quaternion
from collision_response.physics.vector import Vec3

DIGITS_GIVEN = 1e-8
"""The reference values have eight digits."""

REFERENCE = [
    (case, law)
    for case, law in product(rods.TABLE, LAWS_WITH_FRICTION)
    if not (law is Law.MOREAU and case.startswith("T3"))  # which it answers by COULOMB
]


def rod_on_plane(case: str) -> Collision:
    """A rod of 1 kg and 1 m strikes a fixed plane with its end, at an angle."""
    angle, (u_t, u_n), e = rods.request(case)
    body = Body.dynamic(
        1.0,
        rod(1.0, 1.0).inertia,
        position=(0.5 * math.cos(angle), 0.5 * math.sin(angle), 0.0),
        orientation=(0.0, 0.0, math.sin(angle / 2), math.cos(angle / 2)),
        velocity=(u_t, u_n, 0.0),
    )
    return Collision(body, Body.static(), Contact.of((0, 0, 0), (0, 1, 0), restitution=e, friction=0.3))


@pytest.mark.parametrize("geometry", [Geometry.PLANAR, Geometry.SPATIAL])
@pytest.mark.parametrize(("case", "law"), REFERENCE)
def test_rod_on_plane(case, law, geometry):
    p_t, p_n, energy_change = rods.answer(case, law.name)
    impact = rod_on_plane(case).resolve(law, geometry=geometry)
    assert impact.impulse.x == pytest.approx(p_t, abs=DIGITS_GIVEN)
    assert impact.impulse.y == pytest.approx(p_n, abs=DIGITS_GIVEN)
    digits = 1e-6 if case == "T1" else DIGITS_GIVEN
    assert impact.kinetic_energy_after - impact.kinetic_energy_before == pytest.approx(
        energy_change, abs=digits
    )
    assert impact.adjustments == Adjustment.NONE


@pytest.mark.parametrize(("case", "gain"), [("T3", 0.01925), ("T3 e=1", 0.1)])
def test_moreau_creates_energy_on_t3_and_is_replaced(case, gain):
    collision = rod_on_plane(case)
    by_moreau = collision.by_oracle(Law.MOREAU)
    assert float(by_moreau.pair.energy_change(by_moreau.impulses[0])) == pytest.approx(gain, rel=1e-13)

    impact = collision.resolve(Law.MOREAU)
    # the same formulas, rounded in another order
    assert impact.impulse == pytest.approx(collision.resolve(Law.COULOMB).impulse, abs=1e-14)
    assert impact.kinetic_energy_after < impact.kinetic_energy_before
    assert impact.model.law is Law.COULOMB
    assert impact.adjustments == Adjustment.LAW_FALLBACK


@pytest.mark.parametrize("law", LAWS_WITH_FRICTION)
def test_t2_reverses_or_sticks(law):
    regime = rod_on_plane("T2").resolve(law).regime
    assert regime is (Regime.STICKING if law is Law.MOREAU else Regime.REVERSED)


def ball(v: float, surface_speed: float, v_n: float = -1.0) -> Body:
    """A solid sphere of 2 kg and 0.1 m over the plane y = 0, spinning about z."""
    return Body.dynamic(
        2.0, sphere(2.0, 0.1).inertia, (0.0, 0.1, 0.0), None, (v, v_n, 0.0), (0.0, 0.0, -surface_speed / 0.1)
    )


@pytest.mark.parametrize("law", LAWS_WITH_FRICTION)
@pytest.mark.parametrize(("mu", "sticks"), [(0.19, False), (0.1905, True)])
def test_t7_a_sphere_sticks_iff_friction_suffices(law, mu, sticks):
    """``2/7 |u_t| <= mu (1 + e) |v_n|``: with u_t = 1, e = 0.5 the limit is mu = 4/21 = 0.190476."""
    impact = resolve(
        ball(1.0, 0.0), Body.static(), Contact.of((0, 0, 0), (0, 1, 0), 0.5, mu), ImpactModel(law=law)
    )
    assert impact.regime is (Regime.STICKING if sticks else Regime.SLIDING)
    assert impact.impulse.x == pytest.approx(-2 * (2 / 7 if sticks else 1.5 * mu), rel=1e-14)


def test_t7_superball():
    """Garwin's ball, e = e_t = 1: v' = (3v + 4Rw)/7, Rw' = (10v - 3Rw)/7, and nothing is lost."""
    impact = resolve(
        ball(1.0, 3.0),
        Body.static(),
        Contact.of((0, 0, 0), (0, 1, 0), 1.0, friction=10.0),
        ImpactModel(law=Law.COULOMB, tangential_restitution=1.0),
    )
    assert impact.twist_a.linear.x == pytest.approx(15 / 7, rel=1e-14)
    assert -0.1 * impact.twist_a.angular.z == pytest.approx(1 / 7, rel=1e-14)
    assert impact.kinetic_energy_after == pytest.approx(impact.kinetic_energy_before, rel=1e-14)


def test_t9_three_balls_in_a_row():
    """Newton's cradle, one contact at a time: the last ball gets all the motion."""
    speeds = [1.0, 0.0, 0.0]
    for i, j in [(0, 1), (1, 2)]:
        left, right = (Body.dynamic(1.0, velocity=(speeds[k], 0.0, 0.0)) for k in (i, j))
        impact = resolve(left, right, Contact.of((0, 0, 0), normal=(-1, 0, 0), restitution=1.0))
        speeds[i], speeds[j] = impact.twist_a.linear.x, impact.twist_b.linear.x
    assert speeds == [0.0, 0.0, 1.0]


def exact_bodies() -> tuple[Body, Body]:
    a = Body.dynamic(
        F(2), map(F, (3, 1, -1, 4, F(1, 2), 5)), map(F, (1, 2, -1)), map(F, (1, 2, -2, 4)),
        map(F, (-1, F(1, 2), 2)), map(F, (F(1, 2), -1, 2)), map(F, (F(1, 3), 0, F(-1, 4))),
    )  # fmt: skip
    b = Body.dynamic(
        F(5), map(F, (6, -1, 1, 7, 2, 8)), map(F, (-1, 0, 1)), None,
        map(F, (2, 1, F(-1, 2))), map(F, (1, F(1, 4), F(-1, 2))), map(F, (0, 0, 0)),
    )  # fmt: skip
    return a, b


EXACT_CONTACT = Contact.of(map(F, (0, 1, 1)), map(F, (2, 1, -2)), F(3, 4), F(10))
"""It sticks, so that COULOMB takes roots only for the report."""
E_T = F(1, 2)


def test_frictionless_conserves_exactly_in_fractions():
    """Momentum, angular momentum, ``u_n+ = -e u_n`` and the energy balance hold without any rounding."""
    a, b = exact_bodies()
    # a normal of length 1 needs no root
    contact = EXACT_CONTACT._replace(normal=Vec3(F(2, 3), F(1, 3), F(-2, 3)))
    answer = compute(a, b, contact, Law.FRICTIONLESS)
    changes, report = answer.changes, answer.report
    P = changes.impulse
    assert all(isinstance(x, F) for x in (*P, *changes.change_a.angular, *report.twist_b.linear))
    assert contact.normal * P.dot(contact.normal) == P
    for body, change, twist, impulse in (
        (a, changes.change_a, report.twist_a, P),
        (b, changes.change_b, report.twist_b, -P),
    ):
        com = body.to_world(body.com)
        assert (change.linear + change.angular.cross(com)) * body.mass == impulse
        gained = body.to_world(body.inertia @ body.to_body(change.angular))
        assert gained == (contact.position - body.position - com).cross(impulse)
        assert twist == (body.velocity + change.linear, body.angular_velocity + change.angular)

    def velocity(body: Body, twist) -> Vec3:
        return twist.linear + twist.angular.cross(contact.position - body.position)

    before = velocity(a, (twist := report.twist_a)._replace(linear=a.velocity, angular=a.angular_velocity))
    before -= velocity(b, twist._replace(linear=b.velocity, angular=b.angular_velocity))
    after = velocity(a, report.twist_a) - velocity(b, report.twist_b)
    assert contact.normal.dot(after) == -contact.restitution * contact.normal.dot(before)
    moved = a.with_twist(report.twist_a), b.with_twist(report.twist_b)
    lost = sum(map(kinetic_energy, (a, b))) - sum(map(kinetic_energy, moved))
    assert lost == -P.dot(before + after) / 2 == report.energy_lost_restitution > 0
    assert report.energy_lost_friction == 0


@pytest.mark.parametrize(
    ("law", "mu"), [(Law.FRICTIONLESS, 10), (Law.COULOMB, 0.05), (Law.COULOMB, 10), (Law.MOREAU, 10)]
)
def test_a_law_gives_the_same_on_floats_arrays_and_exact_numbers(law, mu):
    """An array of contacts gives, element by element, the bits of single floats."""
    speeds = [F(k, 4) for k in range(5)]

    def answer(number, speed):
        a, b = (_converted(body, number) for body in exact_bodies())
        a = a._replace(velocity=a.velocity._replace(x=speed))
        contact = _converted(EXACT_CONTACT._replace(friction=F(mu)), number)
        return compute(a, b, contact, law, Settings(number(E_T))).changes.impulse

    floats = [answer(float, float(-1 - speed)) for speed in speeds]
    together = answer(np.float64, np.array([float(-1 - speed) for speed in speeds]))
    for i, speed in enumerate(speeds):
        assert tuple(np.broadcast_to(c, 5)[i] for c in together) == floats[i]
        if law is Law.FRICTIONLESS:
            exact = answer(F, -1 - speed)
        else:
            with mp.workdps(40):
                exact = answer(lambda x: mp.mpf(F(x).numerator) / F(x).denominator, -1 - mp.mpf(float(speed)))
        # about fifty roundings at a condition number of K below 20
        assert floats[i] == pytest.approx([float(c) for c in exact], rel=1e-13)


def _converted(value, number):
    if isinstance(value, tuple):
        return type(value)(*(_converted(part, number) for part in value))
    return None if value is None else number(value)


ORACLE_TOLERANCE = {Law.COULOMB: 1e-12, Law.MOREAU: 1e-11, Law.ROUTH_POISSON: 1e-9, Law.ROUTH_STRONGE: 1e-9}
"""Relative error of the impulse. Algebraic laws: rounding at condition numbers up to 1e3, 1e4 for MOREAU's
root. Integrated laws: their default tolerance."""


def test_every_law_has_an_oracle():
    """That of FRICTIONLESS are fractions, that of COMPLIANT is in ``test_compliant.py``."""
    assert set(Law) == {Law.AUTO, Law.FRICTIONLESS, Law.COMPLIANT, *LAWS_WITH_FRICTION}


@pytest.mark.parametrize("off_centre", [False, True])
@pytest.mark.parametrize("law", LAWS_WITH_FRICTION)
@pytest.mark.parametrize("seed", range(2))
def test_against_the_oracle(law, seed, off_centre):
    _assert_agrees(random_collision(seed, off_centre=off_centre), law, ORACLE_TOLERANCE[law])


@pytest.mark.parametrize("law", [Law.ROUTH_POISSON, Law.ROUTH_STRONGE])
@pytest.mark.parametrize(("seed", "mu"), [*product(range(100, 102), [0.5, 3.0])])
def test_slender_bodies_against_the_oracle(law, seed, mu):
    _assert_agrees(random_collision(seed, slender=True, friction=mu), law, ORACLE_TOLERANCE[law])


def rod_in_space(
    u_t: float, mu: float, *, lean: float = 2.0, drift: float = 0.0, thickness: float = 0.0
) -> Collision:
    """A rod of 1 kg and 1 m on a plane, leaning by ``atan(lean)``, in rotated axes.

    ``drift`` is slip across the plane of the rod, ``thickness`` the thickness of the rod [m].
    """
    angle = math.atan(lean)
    across = 1 / 12 + thickness**2 / 12
    body = Body.dynamic(
        1.0,
        (thickness**2 / 6, 0.0, 0.0, across, 0.0, across),
        position=(0.5 * math.cos(angle), 0.5 * math.sin(angle), 0.0),
        orientation=(0.0, 0.0, math.sin(angle / 2), math.cos(angle / 2)),
        velocity=(u_t, -1.0, drift),
    )
    collision = Collision(body, Body.static(), Contact.of((0, 0, 0), (0, 1, 0), restitution=0.5, friction=mu))
    return collision.rotated(Quaternion(0.3, -0.5, 0.2, 0.6))


PATHS = {
    "slips through": (rod_in_space(1.0, 0.05, drift=0.7), Regime.SLIDING),
    "stops and reverses": (rod_in_space(1.0, 0.3, lean=1.0), Regime.REVERSED),
    "stops and sticks": (rod_in_space(0.2, 0.9, drift=0.1), Regime.STICKING),
    "starts without slip, sticks": (rod_in_space(0.0, 0.9), Regime.STICKING),
    "starts without slip, slips": (rod_in_space(0.0, 0.3), Regime.SLIDING),
    "starts without slip, which would jam": (rod_in_space(0.0, 1.9, thickness=0.05), Regime.STICKING),
    "jams": (rod_in_space(-0.5, 1.9, thickness=0.05), Regime.JAMMED),
    "jams while it turns": (rod_in_space(-0.5, 1.9, drift=0.2, thickness=0.05), Regime.JAMMED),
    "thin, K nearly singular": (rod_in_space(0.4, 0.6, drift=0.3, thickness=1e-5), Regime.STICKING),
    "near-central": (
        Collision(
            ball(1.0, 2.0)._replace(position=Vec3(1e-9, 0.1, -3e-9), velocity=Vec3(1.0, -1.0, 0.5)),
            Body.static(),
            Contact.of((0, 0, 0), (0, 1, 0), 0.6, 0.2),
        ),
        Regime.STICKING,
    ),
}


@pytest.mark.parametrize("law", [Law.ROUTH_POISSON, Law.ROUTH_STRONGE], ids=lambda law: law.name)
@pytest.mark.parametrize("path", PATHS)
def test_every_kind_of_path_against_the_oracle(path, law):
    collision, regime = PATHS[path]
    assert _assert_agrees(collision, law, ORACLE_TOLERANCE[law]).regime is regime


def _assert_agrees(collision: Collision, law: Law, relative: float, **model) -> Impact:
    """Compare the impulse and the twists with the oracle."""
    impact = collision.resolve(law, **model)
    truth = collision.by_oracle(law)
    if law is Law.MOREAU and truth.report.energy > 0:
        assert impact.adjustments & Adjustment.LAW_FALLBACK
        truth = collision.by_oracle(Law.COULOMB)
    P = truth.impulses[0]
    assert exact.impulse_error(impact.impulse, P) <= relative
    sides = (truth.pair.a, impact.twist_a, P), (truth.pair.b, impact.twist_b, exact.minus(exact.ZERO, P))
    for side, twist, push in sides:
        changes = zip((side.velocity, side.spin), side.response(push), strict=True)
        velocity, spin = (Vec3(*map(float, exact.plus(*parts))) for parts in changes)
        # the condition number of the inertia may amplify the error of the impulse
        assert (twist.linear - velocity).norm() <= 100 * relative * (velocity.norm() + spin.norm())
        assert (twist.angular - spin).norm() <= 100 * relative * (velocity.norm() + spin.norm())
    return impact


ROUNDING = 1e-14
"""Relative: the closed forms and the answers each take some twenty rounded steps."""


@pytest.mark.parametrize("system", all_systems(), ids=attrgetter("name"))
def test_system(system):
    impact = resolve(system.body_a, system.body_b, system.contact)
    for quantity, value in system.expected.items():
        assert attrgetter(quantity)(impact) == pytest.approx(value, rel=ROUNDING, abs=0), quantity


def test_s1_conserves_energy():
    """The second formula of the source as printed lacks a sine and would fail here."""
    system = s1()
    impact = resolve(system.body_a, system.body_b, system.contact)
    assert impact.kinetic_energy_after == pytest.approx(impact.kinetic_energy_before, rel=ROUNDING)


@pytest.mark.parametrize("degrees", range(-45, 46, 5))
def test_s2_for_every_corner_angle(degrees):
    system = s2(math.radians(degrees))
    impact = resolve(system.body_a, system.body_b, system.contact)
    for quantity, value in system.expected.items():
        # the components pass through zero, so the scale is the speed of the impact, 4 m/s
        assert attrgetter(quantity)(impact) == pytest.approx(value, rel=ROUNDING, abs=4 * ROUNDING), quantity
