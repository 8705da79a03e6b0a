"""Routh's laws with friction as a function of the slip speed, followed along the path of the impulse."""

from __future__ import annotations

import itertools
import math
import random
from fractions import Fraction

import pytest

pytest.importorskip("mpmath")
pytest.importorskip("scipy")

from oracle.routh_by_speed import routh_by_speed
from refusals import refused
from routh_problems import FAMILIES

from collision_response import (
    Body,
    Contact,
    Geometry,
    ImpactError,
    ImpactModel,
    Law,
    Precision,
    Regime,
    StatusCode,
    resolve,
    resolve_contact,
    resolve_scene,
)
from collision_response.answer import norm_components
from collision_response.materials import Materials
from collision_response.physics.friction import stribeck, tabulated

LAWS = (Law.ROUTH_POISSON, Law.ROUTH_STRONGE)
UP = (0, 0, 1)
SPHERE = [[3.5, 0, 0], [0, 3.5, 0], [0, 0, 1]]
ROD = [[2.5, 0, -1.5], [0, 1, 0], [-1.5, 0, 2.5]]
"""A friction of 1.5 / 2.5 = 0.6 makes it stick."""
SHORT = [[3.4, 0, -1.2], [0, 1, 0], [-1.2, 0, 1.6]]
OBLIQUE = [[115 / 48, -1 / 8, 2 / 3], [-1 / 8, 13 / 4, 1 / 2], [2 / 3, 1 / 2, 35 / 24]]
MECHANISMS = (
    [[1, 0, 1], [0, 0, 0], [1, 0, 1]],  # along a line
    [[1, 0, 1], [0, 1, 0], [1, 0, 1]],  # in a plane that contains neither the normal nor the tangents
    [[2, 1, 1], [1, 1, 0], [1, 0, 1]],
)
FLOOR = Body.static()
TINY = 1e-13
"""Error of an answer of order 1 with straight steps only: the rounding of about a hundred operations."""
FOLLOWED = 2e-12
"""Error of an answer of order 1: the path is followed to 1e-12."""


def follow(K, u, e, mu, law=Law.ROUTH_STRONGE, **model):
    return resolve_contact(K, u, UP, e, mu, ImpactModel(law, **model))


def apart(one, other):
    return math.dist(one.impulse, other.impulse) / math.hypot(*other.impulse)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("family", FAMILIES)
def test_a_constant_function_equals_a_number(family, law):
    """The answers and bounds of the kernels are known to be right."""
    make, frictions = FAMILIES[family]
    draw, regimes = random.Random(family), set()
    for _ in range(12):
        (xx, xy, xz, yy, yz, zz), u, n = make(draw)
        K, mu = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]], draw.choice(frictions)
        e = draw.choice([0.0, 1e-8, 0.5, 1.0, draw.random()])
        try:
            number = resolve_contact(K, u, n, e, mu, ImpactModel(law))
        except ImpactError as error:  # slip that turns without end
            assert error.code is StatusCode.PATH_TOO_LONG
            continue
        followed = resolve_contact(K, u, n, e, lambda _, mu=mu: mu, ImpactModel(law))
        assert apart(followed, number) <= followed.error_bound + number.error_bound
        assert followed.error_bound < 1e-6
        size = math.hypot(*number.impulse) * math.hypot(*u)
        for field in ("energy_change", "energy_lost_restitution", "energy_lost_friction"):
            assert getattr(followed, field) == pytest.approx(getattr(number, field), abs=1e-8 * size)
        if family not in ("slow", "head_on"):  # there the slip is as small as its rounding
            assert followed.regime is number.regime
        regimes.add(followed.regime)
    assert family != "space" or len(regimes) >= 3


FUNCTIONS = {
    "stribeck": stribeck(0.5, 0.2, 0.3),
    "fast stribeck": stribeck(0.4, 0.1, 0.05),
    "rough stribeck": stribeck(3.0, 1.0, 0.3),
    "table": tabulated([0.01, 1.0], [0.4, 0.25]),
    "bent table": tabulated([0.1, 0.3, 0.6, 1.5], [0.1, 0.6, 0.2, 0.3]),
    "rising": lambda v: 0.1 + 0.3 * v / (1 + v),
}
SLIPS = ((1, 0, -1), (0.5, 0.1, -1), (0, 0, -1), (1.05, 1, -0.75), (-0.5, 0.3, -2), (5, 2, -0.1))
ORACLE = 3e-9
"""Relative to the impulse: the oracle's tolerance of 1e-11, through some hundred steps and an event."""


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("name", FUNCTIONS)
def test_against_the_oracle(name, law):
    mu, mobilities = FUNCTIONS[name], (ROD, SHORT, OBLIQUE, SPHERE, OBLIQUE, SHORT)
    for K, u in zip(2 * mobilities, (*SLIPS, *SLIPS[::-1]), strict=True):
        P, heat, after = routh_by_speed(K, u, 0.6, mu, law is Law.ROUTH_STRONGE)
        found = follow(K, u, 0.6, mu, law)
        size = math.hypot(*P)
        assert math.dist(found.impulse, P) <= ORACLE * size
        assert math.dist(found.velocity_after, after) <= 4 * ORACLE * size
        assert found.energy_lost_friction == pytest.approx(heat, abs=ORACLE)
        assert found.error_bound <= 1e-8
        assert found.energy_change < 0


JAM = [[1, 0, 0.9], [0, 1, 0], [0.9, 0, 1]]
"""A friction above 1 / 0.9 jams."""
DROPS = (
    (JAM, (0, 0, -1), tabulated([0, 0.2, 0.204], [0.85, 0.85, 0])),
    (JAM, (0.01, 0, -1), tabulated([0, 0.2, 0.3], [0.85, 0.85, 0.1])),
    (ROD, (0.001, 0, -1), stribeck(0.5, 0.0, 0.1)),
    (ROD, (0.3, 0.1, -1), stribeck(0.59, 0.0, 0.05)),
    (SHORT, (0, 0.001, -1), stribeck(0.3, 0.0, 0.1)),
    (OBLIQUE, (0, 0.001, -1), stribeck(0.3, 0.0, 0.1)),
)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("case", range(len(DROPS)))
def test_friction_that_drops_creates_no_energy(case, law):
    """By Poisson's end alone, the first case would gain 13 times the energy of the approach."""
    K, u, mu = DROPS[case]
    for e in (0.5, 0.9, 1.0):
        found = follow(K, u, e, mu, law)
        lost = found.energy_lost_restitution, found.energy_lost_friction
        most = found.error_bound * math.hypot(*found.impulse) * math.hypot(*u, *found.velocity_after)
        assert found.energy_change <= most
        assert found.energy_change == pytest.approx(-sum(lost), abs=most)
        P, heat, after = routh_by_speed(K, u, e, mu, law is Law.ROUTH_STRONGE)
        assert math.dist(found.impulse, P) <= ORACLE * math.hypot(*P)
        assert math.dist(found.velocity_after, after) <= 4 * ORACLE * math.hypot(*P)
        assert found.energy_lost_friction == pytest.approx(heat, abs=ORACLE)


@pytest.mark.parametrize("law", LAWS)
def test_random_friction_creates_no_energy(law):
    draw = random.Random(5)
    for _ in range(60):
        (xx, xy, xz, yy, yz, zz), u, n = FAMILIES[draw.choice(["planar", "space", "jammed"])][0](draw)
        K = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]
        speeds = sorted(draw.uniform(0, 2) for _ in range(3))
        mu = tabulated(speeds, [draw.choice([0.0, draw.uniform(0, 2)]) for _ in speeds])
        try:
            found = resolve_contact(K, u, n, 1.0, mu, ImpactModel(law))
        except ImpactError as error:
            assert error.code is StatusCode.PATH_TOO_LONG
            continue
        if found.error_bound < 1e-6:
            size = math.hypot(*found.impulse) * math.hypot(*u, *found.velocity_after)
            assert found.energy_change <= found.error_bound * size
            lost = found.energy_lost_restitution, found.energy_lost_friction
            assert found.energy_change == pytest.approx(-sum(lost), abs=found.error_bound * size)


def test_a_sphere_with_linear_friction_slows_down_exponentially():
    """Nothing couples slip and approach: p ends at (1 + e), and ds/dp = -3.5 (a + b s)."""
    for law, (a, b), e in itertools.product(LAWS, ((0.05, 0.3), (0.2, -0.05), (0.0, 0.25)), (0.0, 0.5, 1.0)):
        found = follow(SPHERE, (1.2, 1.6, -1), e, lambda v, a=a, b=b: a + b * v, law)
        slip = (2 + a / b) * math.exp(-3.5 * b * (1 + e)) - a / b
        along = (2 - slip) / 3.5
        assert found.regime is Regime.SLIDING
        P = (-0.6 * along, -0.8 * along, 1 + e)
        assert math.dist(found.impulse, P) <= found.error_bound * math.hypot(*P)
        assert found.error_bound < 1e-10
        assert found.velocity_after == pytest.approx((0.6 * slip, 0.8 * slip, e), abs=FOLLOWED)
        assert found.energy_lost_friction == pytest.approx((4 - slip**2) / 7, abs=FOLLOWED)
        assert found.energy_lost_restitution == pytest.approx((1 - e * e) / 2, abs=FOLLOWED)


def test_a_sphere_with_friction_that_rises_from_rest_never_stops_and_one_with_a_constant_part_does():
    creeping = follow(SPHERE, (1, 0, -1), 1.0, lambda v: 2 * v)
    assert creeping.velocity_after.x == pytest.approx(math.exp(-14), rel=1e-8)
    assert creeping.regime is Regime.SLIDING
    stopped = follow(SPHERE, (1, 0, -1), 1.0, lambda v: 0.5 + 2 * v)
    assert stopped.velocity_after.x == pytest.approx(0.0, abs=TINY)
    assert stopped.regime is Regime.STICKING
    assert stopped.impulse == pytest.approx((-1 / 3.5, 0, 2), abs=TINY)


def planar_poisson_impulse(K, u, e, phases):
    """Poisson's impulse in the plane in fractions, given the friction before and after slip stops."""
    (A, _, b), _, (_, _, k) = [[Fraction(x) for x in row] for row in K]
    (s, _, un), e = map(Fraction, u), Fraction(e)
    sliding, later = map(Fraction, phases)
    push = -sliding if s > 0 else sliding
    p = s / -(b + A * push)
    Pt, un = push * p, un + p * (k + b * push)
    assert un < 0  # slip stops while they are compressed
    rate = k + b * later
    p_c = p - un / rate
    return Pt + later * ((1 + e) * p_c - p), (1 + e) * p_c


def test_static_friction_above_kinetic_holds_what_kinetic_does_not():
    """The rod needs a friction of 0.6 to stick; it is 0.2 while it slips."""

    def friction(static):
        return lambda v: static if v == 0 else 0.2

    u = (0.25, 0.0, -1.0)
    sticks = follow(ROD, u, 0.5, friction(0.75), Law.ROUTH_POISSON)
    assert sticks.regime is Regime.STICKING
    P = planar_poisson_impulse(ROD, u, 0.5, ("0.2", "0.6"))
    assert (sticks.impulse.x, sticks.impulse.z) == pytest.approx(tuple(map(float, P)), rel=TINY)
    slips_on = follow(ROD, u, 0.5, friction(0.5), Law.ROUTH_POISSON)
    assert slips_on.regime is Regime.REVERSED
    P = planar_poisson_impulse(ROD, u, 0.5, ("0.2", "0.2"))
    assert (slips_on.impulse.x, slips_on.impulse.z) == pytest.approx(tuple(map(float, P)), rel=TINY)


@pytest.mark.parametrize("K", [ROD, OBLIQUE])
def test_from_rest_static_friction_decides_and_kinetic_friction_acts(K):
    for law in LAWS:
        held = follow(K, (0, 0, -1), 0.5, lambda v: 0.875 if v == 0 else 0.125, law)
        assert held.regime is Regime.STICKING
        assert apart(held, follow(K, (0, 0, -1), 0.5, 0.875, law)) < TINY
        slips = follow(K, (0, 0, -1), 0.5, lambda v: 0.25 if v == 0 else 0.125, law)
        assert apart(slips, follow(K, (0, 0, -1), 0.5, 0.125, law)) < 1e-11


def test_a_tie_between_two_answers_has_an_infinite_bound():
    """At exactly 0.6 the rod sticks; one rounding less and it would slip on with 0.2."""
    for static in (0.6, math.nextafter(0.6, 1), math.nextafter(0.6, 0)):
        found = follow(ROD, (0, 0, -1), 0.5, lambda v, static=static: static if v == 0 else 0.2)
        assert (found.status, found.error_bound) == (StatusCode.TOLERANCE_NOT_MET, math.inf)
    clear = follow(ROD, (0, 0, -1), 0.5, lambda v: 0.6001 if v == 0 else 0.2)
    assert clear.error_bound < 1e-11


@pytest.mark.parametrize("speed", [1e-1, 1e-3, 1e-6, 1e-9, 1e-14])
def test_friction_that_vanishes_at_rest_creeps(speed):
    """The slip stays where friction is 0.6, at tanh(v / speed) = 2/3."""
    found = follow(ROD, (0, 0, -1), 0.5, lambda v: 0.9 * math.tanh(v / speed))
    creep = speed * math.atanh(2 / 3)
    assert found.velocity_after.x == pytest.approx(-creep, rel=1e-3 if speed > 1e-2 else 0, abs=FOLLOWED)
    assert found.regime is (Regime.STICKING if speed == 1e-14 else Regime.SLIDING)
    stuck = follow(ROD, (0, 0, -1), 0.5, 0.9)
    assert apart(found, stuck) < 3 * creep + 1e-11


ISOTROPIC = [[1, 0, 0.5], [0, 1, 0.25], [0.5, 0.25, 1]]


@pytest.mark.parametrize("law", LAWS)
def test_tiny_slip_turns_to_the_direction_in_which_it_grows(law):
    """Along x it would persist at friction 0.5, but that direction is unstable."""
    for below, tolerance in itertools.product((1e-14, 2e-14, 1e-13, 1e-12, 1e-9), (0.0, 1e-9, 1e-6)):
        at_rest = follow(ISOTROPIC, (0, 0, -1), 0.5, 0.5 - below, law, tolerance=tolerance)
        for slip in (1e-300, 1e-16, 1e-13):
            mu = 0.5 - below
            found = follow(ISOTROPIC, (slip, 0, -1), 0.5, lambda _, mu=mu: mu, law, tolerance=tolerance)
            moved = 4 * slip  # at most, of the impulse: friction brings any two slips closer
            assert apart(found, at_rest) <= found.error_bound + at_rest.error_bound + moved
            assert found.error_bound < 1e-7


@pytest.mark.parametrize("law", [Law.ROUTH_POISSON, Law.ROUTH_STRONGE])
@pytest.mark.parametrize(
    ("position", "velocity", "spin", "point", "normal", "friction"),
    [
        (
            (-0.41, 0.5, -0.56), (-0.31, -0.4, 0.56), (-0.49, -0.29, 0.34), (-0.2, 0.55, 0.11),
            (0.22, -0.19, -0.76), stribeck(0.5, 0.3, 0.1),
        ),
        (
            (0.69, 0.1, -0.47), (-0.62, 0.46, 0.44), (0.18, -0.74, 0.82), (0.69, -0.52, 0.61),
            (0.51, -0.5, 0.26), lambda s: 1.0,
        ),
        (
            (-0.39, -0.03, 0.39), (0.57, -0.4, 0.06), (0.85, -0.33, 0.41), (-0.1, 0.18, -0.66),
            (-0.78, 0.48, -0.62), stribeck(1.2, 1.0, 0.1),
        ),
    ],
)  # fmt: skip
def test_slip_that_starts_slowly_from_rest_leaves_it(position, velocity, spin, point, normal, friction, law):
    """It is drawn to its direction much faster than it grows. It stopped again and again, by rounding."""
    body = Body.box(1.0, (1, 0.2, 0.3), position=position, velocity=velocity, angular_velocity=spin)
    contact = Contact.of(point, normal, 0.7, friction)
    answer = resolve(body, Body.static(), contact, ImpactModel(law))
    assert answer.error_bound < 1e-9
    # Slip is so slow from then on that friction hardly differs from that at rest.
    same = resolve(body, Body.static(), contact._replace(friction=friction(0.0)), ImpactModel(law))
    assert answer.regime is same.regime
    if friction(0.0) == friction(1.0):
        off = answer.impulse - same.impulse
        assert off.norm() <= (answer.error_bound + same.error_bound) * same.impulse.norm()


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("slip", [1e3, 1e6, 1e8, 1e12])
def test_fast_slip_that_jams_is_followed_to_its_stop(law, slip):
    """The bodies are pressed together until u_n is some multiple of the slip; steps err by a part of that."""
    K = [[2.5, 0, 1.5], [0, 1, 0], [1.5, 0, 2.5]]
    number = follow(K, (slip, 0, -1), 0.5, 2.0, law)
    followed = follow(K, (slip, 0, -1), 0.5, lambda _: 2.0, law)
    assert followed.regime is number.regime is Regime.JAMMED
    assert followed.error_bound < 1e-10
    assert apart(followed, number) <= followed.error_bound + number.error_bound


def test_slip_stays_at_a_speed_at_which_friction_jumps_upwards():
    """From rest it gains speed below 0.125 m/s, and loses speed above."""
    for law in LAWS:
        found = follow(ROD, (0, 0, -1), 0.5, lambda v: 0.1 if v < 0.125 else 2.0, law)
        assert found.velocity_after.x == pytest.approx(-0.125, rel=1e-11)
        assert found.error_bound < 1e-8


def impulse_held_by_a_peak(law, b, A, k, slip, approach, low, high, foot, width):
    """The impulse with ``e = 1`` of planar slip that grows up to a ramp of friction, and stays on it.

    Below the ramp, friction is ``low``. On it the speed is ``foot + depth (1 - exp(-q / decay))``, with the
    normal impulse ``q`` since then.
    """
    steepness = (high - low) / width
    depth, decay = (b - A * low) / (A * steepness), 1 / (A * steepness)
    before = (foot - slip) / (b - A * low)

    def state(p):
        """Tangential impulse, normal velocity, and its work, after a normal impulse ``p``."""
        first, q = min(p, before), max(p - before, 0.0)
        fading = decay * -math.expm1(-q / decay)  # the integral of the exponential
        on_ramp, most = low + steepness * depth, steepness * depth
        P_t = low * first + on_ramp * q - most * fading
        integral = low * first**2 / 2 + low * first * q + on_ramp * q**2 / 2 - most * decay * (q - fading)
        return P_t, -approach + k * p - b * P_t, -approach * p + k * p**2 / 2 - b * integral

    def root(i, least, most):
        for _ in range(200):
            middle = (least + most) / 2
            least, most = (middle, most) if state(middle)[i] < 0 else (least, middle)
        return least

    p_c = root(1, 0.0, 100.0)
    p = 2 * p_c if law is Law.ROUTH_POISSON else root(2, p_c, 100.0)
    return state(p)[0], 0.0, p


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("width", [0.05, 0.1, 0.3])
@pytest.mark.parametrize("foot", [0.4, 0.8, 1.0, 1.3, 2.0, 2.4])
def test_a_narrow_peak_of_friction_holds_the_slip(foot, width, law):
    """Below the peak the slip changes at a constant rate, so nothing else keeps steps short."""
    w = width * foot
    peak = tabulated([foot, foot + w / 4, foot + 3 * w / 4, foot + w], [0.1, 0.7, 0.7, 0.1])
    K = (3.4, 0, -1.2), (0, 1, 0), (-1.2, 0, 1.6)
    impact = follow(K, (-0.25, 0.0, -4.0), 1.0, peak, law)
    held = impulse_held_by_a_peak(law, 1.2, 3.4, 1.6, 0.25, 4.0, 0.1, 0.7, foot, w / 4)
    error = math.dist(impact.impulse, held) / math.hypot(*held)
    assert error <= impact.error_bound < 1e-6


def test_the_error_is_within_the_bound_and_tolerances_are_met_or_reported():
    mobilities = itertools.cycle(
        (ROD, SHORT, OBLIQUE, SPHERE, OBLIQUE)
    )  # five for six slips, so that all pairs occur
    for (name, u), K in zip(itertools.product(FUNCTIONS, SLIPS), mobilities, strict=False):
        best = follow(K, u, 0.6, FUNCTIONS[name], tolerance=1e-15)
        assert (best.status, best.model.precision) == (StatusCode.TOLERANCE_NOT_MET, Precision.DOUBLE)
        for tolerance in (1e-3, 1e-6, 1e-9):
            found = follow(K, u, 0.6, FUNCTIONS[name], tolerance=tolerance)
            assert found.status is StatusCode.OK
            assert found.error_bound <= tolerance
            assert apart(found, best) <= found.error_bound + best.error_bound
        extended = follow(K, u, 0.6, FUNCTIONS[name], precision=Precision.EXTENDED)
        assert extended.status is StatusCode.OK
        assert extended.error_bound <= best.error_bound


UNUSUAL = {
    "none": lambda v: 0.0,
    "hardly any": lambda v: 5e-324,
    "without end": lambda v: 1e300,
    "an integer": lambda v: 1,
    "a fraction": lambda v: Fraction(1, 3),
    "none above a speed": lambda v: 0.8 if v < 0.3 else 0.0,
    "without end when slow": lambda v: 1e300 if v < 0.1 else 0.1,
    "less at rest than in motion": lambda v: 0.2 if v == 0 else 0.8,
    "infinitely steep": math.sqrt,
    "steep": lambda v: 1e12 * v,
    "falls with the speed": lambda v: 0.1 / v if v else 1e300,
    "zero at rest and unbounded next to it": lambda v: 0.1 / v if v else 0.0,
    "waves": lambda v: 0.5 + 0.4 * math.sin(50 * v),
    "a step far below": lambda v: 0.2 if v > 1e-7 else 0.9,
}


@pytest.mark.parametrize("name", UNUSUAL)
def test_unusual_functions_are_followed_and_create_no_energy(name):
    slips = ((0.5, 0.0, -1), (0, 0, -1), (1e-15, 0, -1), (-0.6, 0.3, -1), (50, -3, -1e-2), (1e-3, 2e-4, -10))
    for K, u, law in itertools.product((ROD, OBLIQUE), slips, LAWS):
        found = follow(K, u, 0.5, UNUSUAL[name], law)
        assert found.error_bound < 1e-8
        assert found.energy_change <= 0
        assert found.energy_lost_friction >= 0
        assert found.energy_lost_restitution > 0
        lost = found.energy_lost_friction + found.energy_lost_restitution
        energy = sum(x * x for x in u)  # more than there is to lose
        assert lost == pytest.approx(-found.energy_change, abs=1e-9 * energy)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("e", [0.0, 1e-9, 0.5, 1.0])
def test_slip_may_stop_where_a_phase_ends(e, law):
    """A rod. Slip falls by ``mu A - b``, and ``u_n`` grows by ``1 - mu b``, per normal impulse."""
    draw = random.Random(e)
    for _ in range(12):
        angle, mu = draw.uniform(0.3, 1.2), draw.choice([0.05, 0.1, 0.2, 0.3])
        c, s = math.cos(angle), math.sin(angle)
        K = [[1 + 3 * s * s, 0, -3 * s * c], [0, 1, 0], [-3 * s * c, 0, 1 + 3 * c * c]]
        A, b = K[0][0] / K[2][2], K[0][2] / K[2][2]
        for p in (1, 1 + e):
            slip = (mu * A - b) * p / (1 - mu * b)
            for ulps in (-1, 0, 1):
                u = (slip * (1 + ulps * 2.0**-53), 0, -1)
                number, followed = follow(K, u, e, mu, law), follow(K, u, e, lambda _, mu=mu: mu, law)
                assert followed.status is StatusCode.OK
                assert apart(followed, number) <= followed.error_bound + number.error_bound


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("e", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("mu", [0.3, 1.0, 2.0, 1e120])
@pytest.mark.parametrize("K", MECHANISMS, ids=str)
def test_a_mechanism_without_free_slip_falls_back_as_with_a_number(K, mu, e, law):
    for slip in itertools.product((0, 1, -1, -2), (0, 0.5), (1, -1, -2)):
        u = [sum(k * x for k, x in zip(row, slip, strict=True)) for row in K]  # in the range of K
        if u[2] == 0:
            continue
        number, followed = follow(K, u, e, mu, law), follow(K, u, e, lambda _: mu, law)
        assert followed.adjustments == number.adjustments
        if u[2] > 0:
            assert followed.status is StatusCode.SEPARATING
        elif number.error_bound < math.inf:
            assert followed.model.law is number.model.law
            assert apart(followed, number) <= followed.error_bound + number.error_bound


def test_an_endless_path_is_refused():
    """A function that keeps the slip at one speed and turns it, and one that is random."""
    draw = random.Random(1)
    for K, mu in ((OBLIQUE, lambda v: 0.05 if v < 0.3 else 2.0), (ROD, lambda v: draw.random())):
        with refused(StatusCode.PATH_TOO_LONG):
            follow(K, (0.5, 0.2, -1), 0.5, mu)


@pytest.mark.parametrize(
    ("value", "code"), [(-0.1, "INVALID_COEFFICIENT"), (math.nan, "NOT_FINITE"), (math.inf, "NOT_FINITE")]
)
def test_an_invalid_value_along_the_path_is_refused_with_its_speed(value, code):
    with pytest.raises(ImpactError) as error:
        follow(SPHERE, (1, 0, -1), 0.5, lambda v: 0.5 if v > 0.25 else value)
    assert (error.value.code.name, error.value.field) == (code, "friction(slip_speed)")
    assert float(error.value.reason.split()[-2]) <= 0.25
    with pytest.raises(ZeroDivisionError):
        follow(SPHERE, (1, 0, -1), 0.5, lambda v: 1 / 0)


BOX = Body.box(
    1.5, (1, 2, 3), position=(0.1, 0.2, 1.3), orientation=(1, 2, 3, 9), velocity=(1, 0.5, -2),
    angular_velocity=(1, 2, 3),
)  # fmt: skip
TABLE = Body.box(2.5, (3, 2, 1), position=(0, 0.5, -0.5), orientation=(0, 1, 0, 3))
CORNER = Contact.of((0.4, 0.5, 0.0), (0.125, 0.25, 1), 0.5, stribeck(0.5, 0.2, 0.3))


@pytest.mark.parametrize("law", LAWS)
def test_bodies_in_space_and_all_fields_of_the_answer(law):
    impact = resolve(BOX, TABLE, CORNER, ImpactModel(law))
    assert (impact.status, impact.model) == (
        StatusCode.OK,
        ImpactModel(law, Geometry.SPATIAL, Precision.DOUBLE),
    )
    number = resolve(BOX, TABLE, CORNER._replace(friction=0.3), ImpactModel(law))
    for field in ("normal_velocity_before", "effective_mass", "kinetic_energy_before"):
        assert getattr(impact, field) == pytest.approx(getattr(number, field), rel=1e-15)
    assert 0.2 < impact.contact.friction < 0.5  # at the initial slip
    assert impact.contact == CORNER._replace(friction=impact.contact.friction)
    lost = impact.energy_lost_restitution + impact.energy_lost_friction
    assert impact.kinetic_energy_before - impact.kinetic_energy_after == pytest.approx(lost, rel=1e-11)
    assert f"{impact.contact.friction:.6g}" in str(impact)
    swapped = resolve(TABLE, BOX, CORNER._replace(normal=-CORNER.normal), ImpactModel(law))
    assert math.dist(swapped.impulse, -impact.impulse) <= 1e-11 * math.hypot(*impact.impulse)
    assert math.dist(swapped.twist_a.angular, impact.twist_b.angular) <= 1e-11
    alone = resolve_scene([BOX, TABLE], [(0, 1)], [CORNER], ImpactModel(law))
    assert (alone.impulses, alone.contacts) == ((impact.impulse,), (impact.contact,))


def test_units_do_not_matter_to_the_last_digit():
    """Lengths, masses and times scaled by powers of two; the function takes speeds in its own units."""
    mu = CORNER.friction
    impact = resolve(BOX, TABLE, CORNER, ImpactModel(Law.ROUTH_STRONGE))
    for length, mass, time in ((2.0**10, 1.0, 1.0), (1.0, 2.0**300, 1.0), (2.0**-200, 2.0**-300, 2.0**100)):
        speed = length / time

        def scaled(body, length=length, mass=mass, time=time, speed=speed):
            return body._replace(
                mass=body.mass * mass,
                inertia=body.inertia * (mass * length * length),
                position=body.position * length,
                velocity=body.velocity * speed,
                angular_velocity=body.angular_velocity * (1 / time),
            )

        contact = CORNER._replace(
            position=CORNER.position * length, friction=lambda v, speed=speed: mu(v / speed)
        )
        found = resolve(scaled(BOX), scaled(TABLE), contact, ImpactModel(Law.ROUTH_STRONGE))
        assert found.impulse == impact.impulse * (mass * speed)
        assert (found.error_bound, found.regime) == (impact.error_bound, impact.regime)


def test_both_coefficients_may_be_functions_and_the_threshold_applies():
    def e(v):
        return 1 / (1 + v)

    ball = Body.dynamic(1.0, (0.4, 0, 0, 0.4, 0, 0.4), (0, 0, 1), velocity=(2, 0, -1))
    contact = Contact.of((0, 0, 0), UP, e, lambda v: 0.1 * v, tangential_restitution=0.5)
    model = ImpactModel(Law.ROUTH_STRONGE)
    both = resolve(ball, FLOOR, contact, model)
    assert both.contact == contact._replace(restitution=0.5, friction=0.2)
    assert both.twist_a.linear.z == pytest.approx(0.5, abs=FOLLOWED)
    slip = 2 * math.exp(-3.5 * 0.1 * 1.5)
    assert both.tangential_impulse == pytest.approx((2 - slip) / 3.5, abs=FOLLOWED)
    slow = resolve(ball, FLOOR, contact, model._replace(restitution_threshold=1.5))
    assert slow.contact.restitution == 0.0
    assert str(slow.adjustments) == "RESTITUTION_THRESHOLD"
    assert slow.twist_a.linear.z == pytest.approx(0.0, abs=FOLLOWED)


def test_bodies_that_separate_have_no_path():
    away = BOX._replace(velocity=type(BOX.velocity)(0, 0, 9))
    impact = resolve(away, TABLE, CORNER, ImpactModel(Law.ROUTH_STRONGE))
    assert (impact.status, impact.regime) == (StatusCode.SEPARATING, Regime.SEPARATING)
    assert (impact.error_bound, tuple(impact.impulse)) == (0.0, (0, 0, 0))
    assert impact.twist_a.linear == away.velocity


def test_the_geometry_is_the_simplest_exact_one_or_the_requested_one():
    mu, law = CORNER.friction, Law.ROUTH_POISSON
    flat = Body.dynamic(1.0, (1, 0, 0, 1, 0, 0.125), (0, 1, 0), None, (1, -1, 0), (0, 0, 1))
    contact = Contact.of((0.25, 0, 0), (0, 1, 0), 0.5, mu)
    planar = resolve(flat, FLOOR, contact, ImpactModel(law))
    assert planar.model.geometry is Geometry.PLANAR
    spatial = resolve(flat, FLOOR, contact, ImpactModel(law, Geometry.SPATIAL))
    assert (spatial.impulse, spatial.model.geometry) == (planar.impulse, Geometry.SPATIAL)
    point = resolve(flat, FLOOR, contact, ImpactModel(law, Geometry.POINT))
    assert tuple(point.twist_a.angular) == (0, 0, 1)
    apart = [
        math.dist(found, right) / math.hypot(*right)
        for found, right in (
            (point.impulse, spatial.impulse),
            (norm_components(flat, point.change_a), norm_components(flat, spatial.change_a)),
        )
    ]
    assert point.error_bound == pytest.approx(max(apart), rel=1e-9)


@pytest.mark.parametrize(
    ("change", "code", "field"),
    [
        ({"body_b": BOX}, "SAME_BODY", "body_b"),
        ({"body_a": BOX._replace(mass=math.nan)}, "NOT_FINITE", "body_a.mass"),
        ({"contact": CORNER._replace(restitution=2.0)}, "INVALID_COEFFICIENT", "contact.restitution"),
        ({"contact": CORNER._replace(normal=CORNER.normal * 0.0)}, "INVALID_NORMAL", "contact.normal"),
        ({"model": ImpactModel(Law.ROUTH_STRONGE, tolerance=-1.0)}, "INVALID_MODEL", "model.tolerance"),
    ],
)
def test_an_invalid_request_is_refused_before_the_function_is_called(change, code, field):
    request = {"body_a": BOX, "body_b": TABLE, "contact": CORNER, "model": ImpactModel(Law.ROUTH_STRONGE)}
    request |= change
    request["contact"] = request["contact"]._replace(friction=pytest.fail)
    with refused(StatusCode[code], field):
        resolve(**request)


def test_slip_in_a_locked_direction_is_refused_even_if_friction_begins_at_zero():
    K = [[0, 0, 0], [0, 1, 0], [0, 0, 1]]
    with refused(StatusCode.INVALID_COEFFICIENT, "friction"):
        follow(K, (1, 0, -1), 0.5, lambda v: 0.0 if v > 0.5 else 0.5)
    slides = follow(K, (0, 1, -1), 0.5, lambda v: 0.25)
    assert slides.impulse == pytest.approx((0, -0.375, 1.5), abs=TINY)


def test_fractions_are_accepted():
    third = Fraction(1, 3)
    ball = Body.dynamic(third, (third, 0, 0, third, 0, third), (0, 0, third), velocity=(1, 0, -third))
    contact = Contact.of((0, 0, 0), UP, third, lambda v: v)
    impact = resolve(ball, FLOOR, contact, ImpactModel(Law.ROUTH_STRONGE))
    normal = float((1 + third) * third * third)
    A = 3 + third  # 1/m + r^2 / I
    slip = math.exp(-float(A) * normal)
    assert impact.impulse == pytest.approx((-(1 - slip) / float(A), 0, normal), abs=FOLLOWED)
    assert all(type(x) is float for x in impact.impulse)


def test_magnitudes_too_far_apart_for_floats_are_refused():
    with refused(StatusCode.OUT_OF_RANGE):
        follow(SPHERE, (1e300, 0, -1e-300), 0.5, CORNER.friction)
    for far in (1e10, 1e12, 1e100, 1e150):
        body = Body.dynamic(1.0, (1, 0, 0, 1, 0, 1), (far, far / 3, 0), velocity=(1, 2, -3))
        for law in LAWS:
            model = ImpactModel(law)
            with refused(StatusCode.OUT_OF_RANGE):
                resolve(body, FLOOR, Contact.of((0, 0, 0), UP, 0.5, CORNER.friction), model)


def test_materials_with_friction_by_speed():
    pair = {"materials": ["a", "b"], "friction": {"static": 0.5, "kinetic": 0.2, "speed": 0.3}}
    mu = Materials.of({"pairs": [pair]}).find("friction", "a", "b").value
    for law in LAWS:
        found = resolve(BOX, TABLE, CORNER._replace(friction=mu), ImpactModel(law))
        assert found == resolve(BOX, TABLE, CORNER, ImpactModel(law))
