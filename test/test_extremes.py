"""Extreme inputs that break solvers, one by one."""

from __future__ import annotations

import math
import random
from fractions import Fraction

import pytest

pytest.importorskip("flint")

from collisions import CLOSED_FORM_LAWS, Collision
from exact_adapter import exact_answer, true_error
from extremes import BEYOND_FLOAT64, ORDINARY, collision_named, extremes

from collision_response import (
    Body,
    Contact,
    Geometry,
    Impact,
    ImpactError,
    ImpactModel,
    Law,
    Precision,
    Regime,
    StatusCode,
    resolve,
)
from collision_response.model import USEFUL_BOUND
from collision_response.numbers.operations import numbers_in
from collision_response.physics.vector import Vec3

TIERS = [Precision.SINGLE, Precision.DOUBLE, Precision.EXTENDED]
ULP = 2.0**-52

each_extreme = pytest.mark.parametrize("extreme", extremes(), ids=lambda extreme: extreme.name)
each_law = pytest.mark.parametrize("law", CLOSED_FORM_LAWS, ids=lambda law: law.name)
each_tier = pytest.mark.parametrize("precision", TIERS, ids=lambda tier: tier.name)


def assert_sound(impact: Impact, collision: Collision) -> None:
    """Check that all numbers are finite, that the bound holds, and that an unknown error has the status
    TOLERANCE_NOT_MET.
    """
    numbers = numbers_in(impact._replace(error_bound=0.0))
    assert all(math.isfinite(x) for x in numbers if isinstance(x, float))
    assert true_error(impact, exact_answer(*collision, impact.model)) <= impact.error_bound
    assert impact.error_bound < math.inf or impact.status is StatusCode.TOLERANCE_NOT_MET


@each_extreme
@each_law
@each_tier
def test_every_precision_is_within_its_bound_or_refused(extreme, law, precision):
    model = ImpactModel(law, Geometry.SPATIAL, precision)
    try:
        impact = resolve(*extreme.collision, model)
    except ImpactError as refusal:
        assert refusal.code is StatusCode.OUT_OF_RANGE
        assert precision is not Precision.EXTENDED or extreme.name in BEYOND_FLOAT64
        return
    assert_sound(impact, extreme.collision)
    if precision is Precision.EXTENDED:
        assert impact.status is StatusCode.OK
        assert impact.error_bound <= ULP


@each_extreme
@each_law
@pytest.mark.parametrize("tolerance", [0.0, 1e-3, 1e-9, 1e-15])
def test_with_auto_precision_every_extreme_meets_the_tolerance(extreme, law, tolerance):
    model = ImpactModel(law, tolerance=tolerance)
    if extreme.name in BEYOND_FLOAT64:
        with pytest.raises(ImpactError, match="beyond float64"):
            resolve(*extreme.collision, model)
        return
    impact = resolve(*extreme.collision, model)
    assert_sound(impact, extreme.collision)
    assert impact.status is StatusCode.OK
    assert impact.error_bound <= (tolerance or USEFUL_BOUND)


@each_law
def test_a_grazing_contact_needs_extended(law):
    """The digits of its approach speed cancel to the last."""
    collision = collision_named("grazing, |u_n|/|u| = 1e-15")
    errors = []
    for precision in (*TIERS, Precision.AUTO):
        impact = resolve(*collision, ImpactModel(law, precision=precision))
        errors.append(true_error(impact, exact_answer(*collision, impact.model)))
    single, double, extended, by_itself = errors
    assert single > 1e-3
    assert double > 1e-3
    assert extended <= ULP
    assert by_itself <= ULP
    assert impact.model.precision is Precision.EXTENDED


CONSERVATIVE = [extreme for extreme in extremes() if extreme.name != "kinematic body at 1e+06 m/s"]
"""All except the one whose kinematic body does work."""


@pytest.mark.parametrize("extreme", CONSERVATIVE, ids=lambda extreme: extreme.name)
@each_tier
def test_elastic_frictionless_impacts_keep_the_energy(extreme, precision):
    """Up to the bound of the impulse and the rounding of both energies."""
    collision = extreme.collision._replace(contact=extreme.collision.contact._replace(restitution=1.0))
    try:
        impact = resolve(*collision, ImpactModel(Law.FRICTIONLESS, Geometry.SPATIAL, precision))
    except ImpactError:
        return
    before, after = impact.kinetic_energy_before, impact.kinetic_energy_after
    if impact.error_bound < math.inf and before > 1e-290:
        assert abs(after - before) <= (impact.error_bound + 100 * ULP) * (before + after)


@each_extreme
@each_law
def test_plastic_impacts_end_without_normal_velocity(extreme, law):
    """Up to the rounding of the velocities that cancel."""
    contact = extreme.collision.contact._replace(restitution=0.0)
    collision = extreme.collision._replace(contact=contact)
    if extreme.name in BEYOND_FLOAT64:
        return
    impact = resolve(*collision, ImpactModel(law, Geometry.SPATIAL, Precision.EXTENDED))
    assert abs(impact.normal_velocity_after) <= 2.0**-60 * abs(impact.normal_velocity_before)


@each_tier
def test_an_impulse_through_the_centre_of_a_slender_body(precision):
    """An error in the direction of such an impulse turns the body; the right impulse does not."""
    draw = random.Random(7)
    checked = 0
    while checked < 60:
        collision, model = _through_the_centre(draw)
        impact = resolve(*collision, model._replace(precision=precision))
        if impact.regime.name == "STICKING" and impact.error_bound < math.inf:
            assert_sound(impact, collision)
            checked += 1


def _through_the_centre(draw: random.Random) -> tuple[Collision, ImpactModel]:
    """A slender, fast-spinning body whose contact is brought to rest by an impulse along its lever arm."""

    def vector(size: float = 1.0) -> Vec3:
        return Vec3(*(size * draw.gauss(0, 1) for _ in range(3)))

    y, z = 10 ** draw.uniform(-4, 0), 10 ** draw.uniform(-4, 0)
    moments = (y + z, 1.0 + z, 1.0 + y)
    arm, spin = vector(), vector(10 ** draw.uniform(1, 5))
    inertia = (moments[0], 0.0, 0.0, moments[1], 0.0, moments[2])
    orientation = [draw.gauss(0, 1) for _ in range(4)]
    impulse = arm * draw.choice([1, -1])
    body = Body.dynamic(1.0, inertia, (0, 0, 0), orientation, impulse * -1.0 - spin.cross(arm), spin)
    normal = impulse / impulse.norm() + vector(0.3)
    collision = Collision(body, Body.static(), Contact.of(arm, normal, 0.0, 50.0))
    return collision, ImpactModel(Law.COULOMB, Geometry.SPATIAL)


@pytest.mark.parametrize("distance", [1e8, 1e12])
def test_far_from_the_origin_the_input_loses_the_digits(distance):
    """The answer is right for the rounded positions. Relative positions would keep the digits."""
    moved = collision_named(f"{distance:.0e} m from the origin")
    impact, near = resolve(*moved), resolve(*ORDINARY)
    assert true_error(impact, exact_answer(*moved, impact.model)) <= impact.error_bound < 1e-12
    apart = math.dist(impact.impulse, near.impulse) / math.hypot(*near.impulse)
    assert 1e-18 * distance < apart < 1e-14 * distance


def test_bodies_that_move_together_and_hardly_approach():
    """The approach is far slower than the bodies, so it must not be the unit for their energies."""
    inertia, spin = (2.0, 0.0, 0.0, 2.0, 0.0, 2.0), (0.0, 0.0, -1e-231)
    a, b = (Body.dynamic(1.0, inertia, (x, 0, 0), None, (1.0, 0, 0), spin) for x in (0.0, 1.0))
    collision = Collision(a, b, Contact.of((0, 0, 0), (0, 1, 0), 0.0))
    impact = resolve(*collision)
    assert_sound(impact, collision)
    assert impact.normal_impulse > 0


def test_a_small_body_that_spins_fast():
    """The squares of its lever arm and spin underflow and overflow; their product matters."""
    inertia = (1e-25, 0.0, 0.0, 1e-25, 0.0, 1e-25)
    body = Body.dynamic(1.0, inertia, (0.0, 1e-163, 0.0), None, (0, 0, -1.0), (2e162, 0.0, 0.0))
    collision = Collision(body, Body.static(), Contact.of((0, 0, 0), (0, 0, 1)))
    impact = resolve(*collision, ImpactModel(tolerance=1e-3))
    assert_sound(impact, collision)


@pytest.mark.parametrize(("heavy", "light"), [(306, -3), (200, -120), (155, -155), (300, -300)])
def test_rescaling_does_not_make_a_mass_infinite(heavy, light):
    """An infinite mass would count as an immovable body, without energy."""
    body, other = Body.dynamic(10.0**heavy, velocity=(0, 0, -1)), Body.dynamic(10.0**light)
    impact = resolve(body, other, Contact.of((0, 0, 0), (0, 0, 1)))
    assert impact.kinetic_energy_before == impact.kinetic_energy_after == 10.0**heavy / 2
    assert impact.twist_b.linear == (0, 0, -2)


@pytest.mark.parametrize("restitution", [0.0, 1.0])
@pytest.mark.parametrize("e_t", [0.125, 0.5, 0.875])
def test_a_tie_of_two_regimes_names_one_of_them(e_t, restitution):
    """The cone just holds ``kappa = 1 + e_t``, which reverses the slip: STICKING or REVERSED.

    The slip is ``2^180 + 2^80 - 2^180 - (2^40 - 1) (2^40 + 1) = 1``: only arbitrary precision finds it.
    """
    ball = Body.dynamic(
        1.0,
        (0.125, 0, 0, 0.125, 0, 0.125),
        position=(0, 0, 0.5),
        velocity=(2.0**180, 0, -1.0),
        angular_velocity=(0, 2.0**181, 0),
    )
    ground = Body.kinematic((0, 0, -(2.0**40) - 1), (-(2.0**80), 0, 0), (0, 2.0**40 - 1, 0))
    friction = (1 + e_t) / 3 / (1 + restitution)  # K_tt = 3; this is exact
    for mu in (math.nextafter(friction, 0), friction, math.nextafter(friction, 1)):
        contact = Contact.of((0, 0, 0), (0, 0, 1), restitution, mu)
        impact = resolve(ball, ground, contact, ImpactModel(tangential_restitution=e_t))
        assert impact.regime in (Regime.STICKING, Regime.REVERSED)
        assert impact.impulse.x == pytest.approx(-(1 + e_t) / 3, rel=1e-15)
        assert impact.impulse.z == 1 + restitution


@pytest.mark.parametrize("e", [1e-3, 1e-6, 1e-12])
@pytest.mark.parametrize("law", [law for law in Law if law is not Law.AUTO and law is not Law.COMPLIANT])
def test_a_twist_that_nearly_cancels_is_rounded_once_in_extended(law, e):
    """The twist after is -e times that before. A change rounded to doubles leaves it hardly a digit."""
    ball, contact = Body.dynamic(1.0, velocity=(0, 0, -0.1)), Contact.of((0, 0, 0), (0, 0, 1), e, 0.3)
    answer = resolve(ball, Body.static(), contact, ImpactModel(law, precision=Precision.EXTENDED))
    exact = Fraction(e) * Fraction(0.1)
    assert abs(Fraction(answer.twist_a.linear.z) - exact) <= Fraction(math.ulp(float(exact)))


@each_tier
@pytest.mark.parametrize("ratio", [1e20, 1e22, 1e150, 1e160, 1e163, 1e300])
def test_a_belt_that_is_far_faster_leaves_the_ball_its_energy(ratio, precision):
    """Friction at its limit changes the velocity by 0.3 * 4.5 m/s, and the spin by 2.5 times that."""
    ball = Body.sphere(2.0, 0.1, position=(0, 0, 0.1), velocity=(0, 0, -3.0))
    try:
        answer = resolve(
            ball,
            Body.kinematic((0, 0, 0), (ratio, 0, 0)),
            Contact.of((0, 0, 0), (0, 0, 1), 0.5, 0.3),
            ImpactModel(precision=precision),
        )
    except ImpactError as refusal:
        assert refusal.code is StatusCode.OUT_OF_RANGE and ratio == 1e300
        return
    energy = 1.5**2 + 1.35**2 * (1 + 2.5)
    rel = 1e-6 if precision is Precision.SINGLE else 1e-14
    assert answer.kinetic_energy_before == pytest.approx(9.0, rel=1e-15)
    if answer.error_bound < math.inf:
        assert answer.kinetic_energy_after == pytest.approx(energy, rel=rel)


@pytest.mark.parametrize("precision", [Precision.DOUBLE, Precision.EXTENDED])
@pytest.mark.parametrize(
    ("spin", "v", "m"), [(1e270, 1.0, 1.0), (1e268, 1e-47, 1e150), (1e268, 1e-60, 1e150)]
)
def test_bodies_that_separate_far_faster_than_one_of_them_moves_keep_their_motion(spin, v, m, precision):
    wall = Body.kinematic(position=(0, -1, 0), angular_velocity=(spin, 0, 0))
    body = Body.dynamic(m, (2e-25 * m, 0, 0, 3e-25 * m, 0, 1.6e-25 * m), velocity=(0, v, 0))
    touch = Contact.of((1e29, 0, 0), (0, 0, 1), 0.5, 0.3)
    answer = resolve(wall, body, touch, ImpactModel(precision=precision))
    assert answer.status is StatusCode.SEPARATING
    assert answer.twist_b.linear == body.velocity
    energies = answer.kinetic_energy_before, answer.kinetic_energy_after
    assert energies == pytest.approx((m * v * v / 2,) * 2, rel=1e-15)


def test_a_velocity_that_no_impulse_changes_stays_beside_one_far_faster():
    ball = Body.dynamic(1.0, velocity=(1e-200, 0, -1e150))
    answer = resolve(ball, Body.static(), Contact.of((0, 0, 0), (0, 0, 1), 0.5))
    assert answer.twist_a.linear.x == 1e-200
