"""The error bound against exact answers, and the precisions that promise one."""

from __future__ import annotations

import math
import random
import statistics
from concurrent.futures import ThreadPoolExecutor
from fractions import Fraction
from itertools import product
from pathlib import Path

import pytest
from programs import run_python

pytest.importorskip("flint")
pytest.importorskip("mpmath")

import extremes
from batch_cases import batch_of
from collisions import CLOSED_FORM_LAWS, PATH_LAWS, Collision, random_collision
from exact import impulse_error
from exact_adapter import exact_answer, true_error
from flint import ctx
from random_impacts import RandomImpacts

from collision_response import (
    Adjustment,
    Body,
    Contact,
    Geometry,
    Impact,
    ImpactError,
    ImpactModel,
    Law,
    Precision,
    StatusCode,
    resolve,
)
from collision_response.batch import resolve_batch
from collision_response.model import LARGEST_BOUND, USEFUL_BOUND
from collision_response.physics.effective_mass import ContactKinematics
from collision_response.physics.mass_properties import sphere
from collision_response.physics.vector import Vec3

TIERS = [Precision.SINGLE, Precision.DOUBLE, Precision.EXTENDED]
ULP = 2.0**-52


@pytest.mark.parametrize("decades", [0, 3, 10, 60])
@pytest.mark.parametrize("precision", TIERS, ids=lambda tier: tier.name)
@pytest.mark.parametrize("law", CLOSED_FORM_LAWS, ids=lambda law: law.name)
def test_no_error_exceeds_its_bound(law, precision, decades):
    """A sample of what ``make stability`` runs."""
    impacts = RandomImpacts(seed=decades, decades=decades)
    answered = 0
    for _ in range(80):
        collision, model = impacts.request(law)
        model = model._replace(precision=precision, geometry=Geometry.AUTO)
        try:
            impact = resolve(*collision, model)
        except ImpactError as refusal:
            assert refusal.code is StatusCode.OUT_OF_RANGE
            continue
        truth = exact_answer(*collision, impact.model)
        assert true_error(impact, truth) <= impact.error_bound, (collision, model)
        if precision is Precision.EXTENDED:
            assert impact.error_bound <= ULP
        answered += impact.error_bound < math.inf
    # Most have a finite bound; float32 answers few of the numbers from 1e-60 to 1e60.
    assert answered >= (40 if precision is not Precision.SINGLE or decades < 60 else 13)


REPORT = """
import sys
sys.path[:0] = [sys.argv[1]]
import stability
for name, arguments in dict(stability.jobs(400)).items():  # one job of each kind
    result = getattr(stability, name)(*arguments)
    print(name, len(result.violations) if isinstance(result, stability.Tally) else 0)
"""


def test_every_part_of_the_stability_report_runs():
    """On a sample of what ``make stability`` runs."""
    benchmarks = Path(__file__).parents[1] / "benchmarks"
    done = run_python("-c", REPORT, benchmarks)
    assert done.returncode == 0, done.stderr
    assert done.stdout.split("\n") == ["drift 0", "by_condition 0", "attack_family 0", "random_piece 0", ""]


@pytest.mark.parametrize("decades", [0, 1, 10])
@pytest.mark.parametrize("law", CLOSED_FORM_LAWS, ids=lambda law: law.name)
def test_the_bound_covers_what_a_forced_geometry_leaves_out(law, decades):
    impacts = RandomImpacts(seed=decades, decades=decades)
    answered = 0
    for _ in range(150):
        collision, model = impacts.request(law)
        if model.geometry is Geometry.SPATIAL:
            continue
        try:
            impact = resolve(*collision, model)
        except ImpactError as refusal:
            assert refusal.code is StatusCode.OUT_OF_RANGE
            continue
        assert true_error(impact, exact_answer(*collision, impact.model)) <= impact.error_bound, (
            collision,
            model,
        )
        answered += 0 < impact.error_bound < math.inf
    assert answered >= 5


@pytest.mark.parametrize("law", CLOSED_FORM_LAWS, ids=lambda law: law.name)
def test_the_bound_is_tight_enough_to_be_useful(law):
    """On well-conditioned inputs: solid balls that touch, with any velocity and spin."""
    ratios = []
    for seed in range(300):
        collision = touching_balls(random.Random(seed))
        impact = resolve(*collision, ImpactModel(law, Geometry.SPATIAL))
        if impact.status is StatusCode.OK:
            error = true_error(impact, exact_answer(*collision, impact.model))
            ratios.append(impact.error_bound / max(error, 2.0**-54))
    assert min(ratios) >= 1
    assert statistics.median(ratios) < 128


def touching_balls(draw: random.Random) -> Collision:
    def vector(size: float) -> Vec3:
        return Vec3(*(size * draw.gauss(0, 1) for _ in range(3)))

    def ball(position: Vec3, radius: float) -> Body:
        mass = draw.uniform(0.5, 2)
        return Body.dynamic(
            mass, sphere(mass, radius).inertia, position, None, vector(1.0), vector(1.0 / radius)
        )

    normal, contact = vector(1.0), vector(1.0)
    unit, radius_a, radius_b = normal / normal.norm(), draw.uniform(0.2, 2), draw.uniform(0.2, 2)
    return Collision(
        ball(contact + unit * radius_a, radius_a),
        ball(contact - unit * radius_b, radius_b),
        Contact.of(contact, normal, draw.random(), draw.random()),
    )


GRAZING = Collision(
    Body.dynamic(
        1.0, (0.4, 0.0, 0.0, 0.4, 0.0, 0.4), (0.1, 0.2, 0.5), None, (3.0, 1.0, -1e-9), (0.3, 0.1, 0.7)
    ),
    Body.dynamic(2.0, (0.5, 0.1, 0.0, 0.6, 0.0, 0.4), (0.1, 0.3, -0.5), None, (0.1, 0.1, 0.07)),
    Contact.of((0.3, 0.2, 0.1), (0.0, 0.0, 1.0), 0.5, 0.3),
)


def test_a_tolerance_selects_the_cheapest_precision_that_meets_it():
    """SINGLE is never chosen: one impact takes as long in it as in DOUBLE."""
    collision, used = extremes.grazing(1e-10, GRAZING), []
    for tolerance in (1e-3, 1e-9, 1e-15):
        impact = resolve(*collision, ImpactModel(tolerance=tolerance))
        assert true_error(impact, exact_answer(*collision, impact.model)) <= impact.error_bound <= tolerance
        used.append(impact.model.precision)
    assert used == [Precision.DOUBLE, Precision.EXTENDED, Precision.EXTENDED]


def test_a_loose_tolerance_costs_no_digits():
    """Even where its bound is one that AUTO would not accept without a tolerance."""
    collision = extremes.grazing(1e-14, GRAZING)
    impact = resolve(*collision, ImpactModel(tolerance=0.5))
    assert impact.model.precision is Precision.DOUBLE
    assert USEFUL_BOUND < impact.error_bound <= 0.5
    assert true_error(impact, exact_answer(*collision, impact.model)) <= impact.error_bound


@pytest.mark.parametrize(
    ("share", "precision"), [(1e-3, Precision.DOUBLE), (1e-10, Precision.DOUBLE), (1e-14, Precision.EXTENDED)]
)
def test_without_a_tolerance_a_useless_bound_raises_the_precision(share, precision):
    collision = extremes.grazing(share, GRAZING)
    impact = resolve(*collision)
    assert impact.model.precision is precision
    assert true_error(impact, exact_answer(*collision, impact.model)) <= impact.error_bound <= USEFUL_BOUND
    double = resolve(*collision, ImpactModel(precision=Precision.DOUBLE))
    assert (double.error_bound <= USEFUL_BOUND) == (precision is Precision.DOUBLE)


def test_a_tolerance_that_nothing_meets_is_reported():
    impact = resolve(*GRAZING, ImpactModel(tolerance=1e-17))
    assert impact.status is StatusCode.TOLERANCE_NOT_MET
    assert impact.model.precision is Precision.EXTENDED
    assert impact.error_bound <= ULP


@pytest.mark.parametrize("offset", [0.0, 1e-9, 1e-2])
@pytest.mark.parametrize("tolerance", [0.0, 1e-2, 1e-8])
def test_a_tolerance_does_not_simplify_the_geometry(offset, tolerance):
    """A ball struck a little off its centre is modelled in full, however little that matters."""
    ball = Body.dynamic(1.0, (0.4, 0.0, 0.0, 0.4, 0.0, 0.4), (0.0, offset, offset), None, (0.1, 0.2, -1.0))
    collision = Collision(ball, Body.static(), Contact.of((0, 0, 0), (0, 0, 1), 0.5))
    impact = resolve(*collision, ImpactModel(tolerance=tolerance))
    assert true_error(impact, exact_answer(*collision, impact.model)) <= impact.error_bound < 1e-14
    assert impact.model.geometry is (Geometry.SPATIAL if offset else Geometry.POINT)


@pytest.mark.parametrize("precision", TIERS, ids=lambda tier: tier.name)
@pytest.mark.parametrize("off_centre", [False, True])
def test_moreau_errors_are_within_the_bound(precision, off_centre):
    for seed in range(800, 806):
        collision = random_collision(seed, off_centre=off_centre)
        impact = collision.resolve(Law.MOREAU, precision=precision)
        fell_back = impact.adjustments & Adjustment.LAW_FALLBACK
        assert fell_back or collision.by_oracle(Law.MOREAU).report.energy <= 0
        assert error_of(collision, impact) <= impact.error_bound
        # a condition number of 1e4 at most, and hundreds of roundings
        assert impact.error_bound <= {Precision.SINGLE: math.inf, Precision.DOUBLE: 1e-9}.get(precision, ULP)


def test_grazing_moreau_errors_are_within_the_bound():
    for share, seed in product((1e-3, 1e-8, 1e-12), (803, 805)):
        collision = extremes.grazing(share, random_collision(seed))
        impact = collision.resolve(Law.MOREAU)
        assert error_of(collision, impact) <= impact.error_bound <= USEFUL_BOUND


@pytest.mark.parametrize("law", PATH_LAWS, ids=lambda law: law.name)
def test_a_planar_path_is_right_to_the_last_digit(law):
    """Its formula has no loop."""
    a = Body.dynamic(
        2.0, (1, 0, 0, 1, 0, 0.7), (0.1, 0.9, 0), (0, 0, 0.3, 0.8), (1.0, -2.0, 0), (0, 0, 0.5), (0.1, 0.2, 0)
    )
    for b in (Body.static(), Body.dynamic(1.5, (1, 0, 0, 1, 0, 0.3), (-0.2, -0.4, 0), None, (0.1, 0.3, 0))):
        for mu in (0.0, 0.1, 0.4, 2.0):
            collision = Collision(a, b, Contact.of((0.0, 0.1, 0.0), (0.2, 1.0, 0.0), 0.6, mu))
            impact = collision.resolve(law, precision=Precision.EXTENDED)
            assert impact.status is StatusCode.OK
            assert error_of(collision, impact) <= impact.error_bound <= ULP


@pytest.mark.parametrize("law", PATH_LAWS, ids=lambda law: law.name)
@pytest.mark.parametrize("precision", TIERS, ids=lambda tier: tier.name)
def test_no_error_of_a_path_exceeds_its_bound(law, precision):
    for seed in (400, 401):
        collision = random_collision(seed, off_centre=True)
        impact = collision.resolve(law, precision=precision)
        assert error_of(collision, impact) <= impact.error_bound
        if precision is not Precision.SINGLE:
            assert impact.error_bound <= 1e-8


@pytest.mark.parametrize("law", PATH_LAWS, ids=lambda law: law.name)
@pytest.mark.parametrize("tolerance", [0.0, 1e-4])
def test_a_path_meets_its_tolerance(law, tolerance):
    for seed in (402, 403):
        collision = random_collision(seed)
        impact = collision.resolve(law, tolerance=tolerance)
        assert impact.status is StatusCode.OK
        assert error_of(collision, impact) <= impact.error_bound <= (tolerance or 1e-8)


def test_a_tolerance_that_no_path_meets_is_reported():
    collision = random_collision(400)
    impact = collision.resolve(Law.ROUTH_STRONGE, tolerance=1e-15)
    assert impact.status is StatusCode.TOLERANCE_NOT_MET
    assert error_of(collision, impact) <= impact.error_bound


def slender_boxes(length: float) -> list[Collision]:
    """Boxes that are so many times as long as wide, and strike a wall somehow."""
    draw, collisions = random.Random(int(length)), []
    for _ in range(8):
        arm = [draw.uniform(-0.5, 0.5), draw.uniform(-0.5, 0.5), length * draw.uniform(-0.5, 0.5)]
        velocity = [draw.uniform(-1, 1), draw.uniform(-1, 1), -draw.uniform(0.2, 1)]
        turn, spin = ([draw.gauss(0, 1) for _ in range(n)] for n in (4, 3))
        box = Body.box(
            1.0, (1, 1, length), position=arm, orientation=turn, velocity=velocity, angular_velocity=spin
        )
        normal = (draw.uniform(-0.3, 0.3), 0.0, 1.0)
        collisions.append(Collision(box, Body.static(), Contact.of((0, 0, 0), normal, 0.5, 0.4)))
    return collisions


@pytest.mark.parametrize("law", [*PATH_LAWS, Law.COMPLIANT], ids=lambda law: law.name)
@pytest.mark.parametrize("tolerance", [1e-3, 1e-6, 1e-9])
@pytest.mark.parametrize("length", [3.0, 30.0, 100.0])
def test_a_tolerance_costs_no_answer_that_meets_it_without(law, tolerance, length):
    """A tolerance makes the steps of a path coarser, and slender bodies multiply their errors. The rows of a
    batch are the same.
    """
    collisions, model = slender_boxes(length), ImpactModel(law, tolerance=tolerance)
    batch = resolve_batch(*batch_of(collisions), model)
    for i, collision in enumerate(collisions):
        answer, plain = resolve(*collision, model), resolve(*collision, ImpactModel(law))
        is_met = answer.status is not StatusCode.TOLERANCE_NOT_MET
        assert is_met or plain.error_bound > tolerance
        assert is_met == (answer.error_bound <= tolerance)
        assert answer.model.tolerance == tolerance
        assert (batch.status[i], batch.error_bound[i]) == (answer.status, answer.error_bound)
        assert tuple(batch.impulse[:, i]) == answer.impulse


@pytest.mark.parametrize("law", PATH_LAWS, ids=lambda law: law.name)
@pytest.mark.parametrize("share", [1e-7, 1e-12])
def test_grazing_paths_keep_their_digits(law, share):
    for collision in (random_collision(500), random_collision(502, slender=True, friction=5.0)):
        collision = extremes.grazing(share, collision)
        impact, better = collision.resolve(law), collision.resolve(law, precision=Precision.EXTENDED)
        assert error_of(collision, impact) <= impact.error_bound <= USEFUL_BOUND
        assert error_of(collision, better) <= min(better.error_bound, 1e-12)


@pytest.mark.parametrize("e", [1e-2, 1e-5, 1e-8])
def test_paths_with_little_restitution_keep_their_digits(e):
    """The restored work is e^2 of the work of compression."""
    collision = random_collision(600)
    collision = collision._replace(contact=collision.contact._replace(restitution=e))
    impact = collision.resolve(Law.ROUTH_STRONGE)
    assert error_of(collision, impact) <= min(impact.error_bound, 1e-12)


@pytest.mark.parametrize("past", [-1e-2, 1e-2, -1e-5])
def test_path_errors_are_within_the_bound_near_jamming(past):
    """``u_n`` hardly rises, so a small change moves the end of compression a lot."""
    collision = extremes.grazing(1e-3, random_collision(701))
    contact = ContactKinematics.of(*collision)
    n, K = contact.n / contact.n.norm(), contact.inverse_effective_mass()
    slip = contact.u - n * n.dot(contact.u)
    mu = (1 + past) * n.dot(K @ n) * slip.norm() / slip.dot(K @ n)
    collision = collision._replace(contact=collision.contact._replace(friction=mu))
    for law, tolerance in zip(PATH_LAWS, (0.0, 1e-3), strict=True):
        impact = collision.resolve(law, tolerance=tolerance)
        assert error_of(collision, impact) <= impact.error_bound


def error_of(collision: Collision, impact: Impact) -> float:
    """The relative error of the impulse."""
    return impulse_error(impact.impulse, collision.by_oracle(impact.model.law).impulses[0])


def test_a_nan_error_becomes_an_infinite_bound():
    """In float32 both branches of an undecided choice are 0 here, and the error of one is unknown."""
    moment = 4.697040269710177e80
    rod = Body.dynamic(
        8.607564884429794e85,
        (moment, 0.0, 0.0, moment, 0.0, 0.0),
        (-11994213413512.99, 4079752772742.708, -1214296277927.9062),
        None,
        (3.8540722748524385, -16.405474624848416, 7.0473627453441665),
        (1.2852439644602878, 0.4413428445784092, -0.761987689594408),
    )
    wheel = Body.kinematic(
        (1.0588940958313549e-39, -3.7996853449478925e-39, -6.054663743809354e-39),
        (-1.38613201367833e28, -4.5451329451605506e27, 1.1741652888440304e28),
        (-1.6293172118879368e39, -4.172622566640952e39, -4.277801586855334e39),
    )
    contact = Contact.of(
        (-6.834098883957725e-29, -3.286453798787782e-29, -3.750880325343817e-29),
        (-9.6139570218032e-122, -2.7913158387272636e-121, -1.6651510190973857e-121),
        0.7492254563046974,
        0.05811043699660205,
    )
    model = ImpactModel(Law.COULOMB, precision=Precision.SINGLE, tangential_restitution=-0.36217341434364525)
    assert resolve(rod, wheel, contact, model).error_bound == math.inf
    assert any(resolve(rod, wheel, contact, model._replace(precision=Precision.EXTENDED)).impulse)


@pytest.mark.parametrize("precision", [Precision.AUTO, Precision.DOUBLE, Precision.EXTENDED])
@pytest.mark.parametrize("tolerance", [0.0, 1e-17, 1e-30])
@pytest.mark.parametrize("mass", [1.0, 2.0, 2.0**-1000, 2.0**-1020])
def test_the_rounding_of_an_exact_impulse_is_in_the_bound(precision, tolerance, mass):
    """``m (1 + e) v`` has more digits than a float64. Below 1e-308 it is right to the nearest subnormal."""
    model = ImpactModel(precision=precision, tolerance=tolerance)
    speeds = (1.0, 1.5, 3.0, 7.0, 2.0**-60, 3 * 2.0**-60, 1.0 + 2.0**-52)
    for speed, restitution in product(speeds, (0.5, 0.3, 0.1, 2.0**-52, 1 - 2.0**-53)):
        ball = Body.dynamic(mass, velocity=(0.0, 0.0, -speed))
        contact = Contact.of((0, 0, 0), (0, 0, 1), restitution)
        impact = resolve(ball, Body.static(), contact, model)
        exact = Fraction(mass) * (1 + Fraction(restitution)) * Fraction(speed)
        error = max(abs(Fraction(impact.impulse.z) - exact) - Fraction(math.ulp(0.0)) / 2, 0) / exact
        assert error <= impact.error_bound, (speed, restitution)
        assert (impact.status is StatusCode.OK) == (impact.error_bound <= (tolerance or LARGEST_BOUND))
        assert impact.error_bound > 0 or error == 0


def test_threads_do_not_change_each_others_precision():
    """The precision of FLINT is global to the process."""
    collisions = [random_collision(seed) for seed in range(8)] * 4
    model = ImpactModel(Law.COULOMB, precision=Precision.EXTENDED, tolerance=1e-30)
    alone = [resolve(*collision, model) for collision in collisions]
    with ThreadPoolExecutor(4) as pool:
        together = list(pool.map(lambda collision: resolve(*collision, model), collisions))
    assert together == alone
    assert ctx.prec == 53


@pytest.mark.parametrize("law", [law for law in Law if law is not Law.AUTO])
@pytest.mark.parametrize("q", [(2, 1, 1, 0), (1, 2, 0, 1), (2, -1, 1, 2), (1, 1, 1, 0)])
def test_bodies_that_touch_exactly_are_separating(q, law):
    """A rod turns about the normal, in one plane with the contact: thirds and fifths cancel to 0."""
    x, y, z, w = q
    along_rod = (x * x - y * y - z * z + w * w, 2 * (x * y + w * z), 2 * (x * z - w * y))
    contact = Contact.of((*along_rod[:2], along_rod[2] - 0.25), (0, 0, 1), 0.5, 0.3)
    for com in ((0, 0, 0), (0.5, 0, 0)):
        rod = Body.dynamic(1.0, (0, 0, 0, 1, 0, 1), orientation=q, angular_velocity=(0, 0, 3), com=com)
        for precision in (Precision.AUTO, Precision.EXTENDED):
            touch = resolve(rod, Body.static(), contact, ImpactModel(law, precision=precision))
            assert (touch.status, touch.error_bound, *touch.impulse) == (StatusCode.SEPARATING, 0, 0, 0, 0)
            assert (touch.twist_a.linear, touch.twist_a.angular) == (rod.velocity, rod.angular_velocity)
