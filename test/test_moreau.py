"""Moreau's law against the oracle, and its error bound."""

from __future__ import annotations

import math
import random
from fractions import Fraction as F

import pytest

pytest.importorskip("mpmath")

import numpy as np
import rods
from bounded import Bounded
from mpmath import mp
from oracle import impulse

from collision_response import (
    Adjustment,
    Body,
    Contact,
    ImpactModel,
    Law,
    Precision,
    StatusCode,
    resolve,
    resolve_contact,
)
from collision_response.physics.effective_mass import ContactNumbers
from collision_response.physics.laws import Coefficients, Outcome, Regime, Settings
from collision_response.physics.laws.moreau import moreau
from collision_response.physics.tensor import Symmetric3
from collision_response.physics.vector import Vec3

UP = (0.0, 1.0, 0.0)
ROUNDED = 1e-11
"""Relative error: about a hundred roundings at condition numbers of K below 1e3."""
OF_THE_ORACLE = 1e-45
"""Error of the oracle, which has 50 digits."""


def solve(K, u, n, e: float, mu: float, number=float) -> Outcome:
    """MOREAU's outcome for a contact given by ``K``, ``u`` and ``n``, in numbers of any type."""
    n, u = Vec3(*map(number, n)), Vec3(*map(number, u))
    K = Symmetric3(*(number(K[i][j]) for i, j in ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))))
    contact = ContactNumbers(n, u, n.dot(u), n.dot(K @ n), K)
    return moreau(contact, Coefficients(number(e), number(mu), Settings(number(0.0))))


def right_impulse(K, u, n, e: float, mu: float):
    """MOREAU's impulse, or Chatterjee & Ruina's where that creates energy; whether it did; the oracle's
    report.
    """
    P, report = impulse("moreau", K, u, n, e, mu)
    # In 64 bits the law may take up to 2^-44 of the work for rounding.
    work = abs(mp.fdot(P, u))
    fell_back = report.energy > 1e-13 * work
    if fell_back:
        P, _ = impulse("chatterjee_ruina", K, u, n, e, mu)
    return P, fell_back, report


def rod(theta: float) -> list[list[float]]:
    """A uniform rod of mass and length 1 that strikes with its end; its K, the normal along y."""
    s, c = math.sin(theta), math.cos(theta)
    return [[1 + 3 * s * s, -3 * s * c, 0.0], [-3 * s * c, 1 + 3 * c * c, 0.0], [0.0, 0.0, 4.0]]


@pytest.mark.parametrize("case", rods.TABLE)
def test_reference(case):
    theta, velocity, e = rods.request(case)
    u, fell_back = (*velocity, 0.0), case.startswith("T3")
    *P, energy = rods.answer(case, "COULOMB" if fell_back else "MOREAU")
    found = solve(rod(theta), u, UP, e, 0.3)
    assert found.impulse == pytest.approx((*P, 0.0), abs=1e-14)
    assert found.energy_lost_restitution + found.energy_lost_friction == pytest.approx(-energy, abs=6e-7)
    assert found.fell_back is fell_back
    bounded = solve(rod(theta), u, UP, e, 0.3, Bounded)
    for own, value in zip(bounded.impulse, found.impulse, strict=True):
        assert own.covers(value)
        assert own.error < 1e-12


def random_contact(rng: np.random.Generator, spread: float):
    """Random K of a body, slip and normal; ``spread`` is the logarithmic spread of its moments."""
    r, moments = rng.normal(size=3), np.exp(spread * rng.normal(size=3))
    turn = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    X = np.array([[0, -r[2], r[1]], [r[2], 0, -r[0]], [-r[1], r[0], 0]])
    K = np.eye(3) - X @ turn @ np.diag(1 / moments) @ turn.T @ X
    n, u = rng.normal(size=(2, 3))
    return ((K + K.T) / 2).tolist(), (u if u @ n < 0 else -u).tolist(), n.tolist()


def check(K, u, n, e: float, mu: float, limit: float = ROUNDED) -> None:
    P, fell_back, _ = right_impulse(K, u, n, e, mu)
    size = max(abs(p) for p in P)
    found, bounded = solve(K, u, n, e, mu), solve(K, u, n, e, mu, Bounded)
    assert found.fell_back == fell_back
    assert not found.unfinished
    with mp.workdps(60):
        K_P = [mp.fdot(row, P) for row in K]
        lost = -sum(P[i] * (u[i] + K_P[i] / 2) for i in range(3))
        work = sum(abs(P[i] * u[i]) for i in range(3))
        assert abs(found.energy_lost_restitution + found.energy_lost_friction - lost) <= 10 * limit * work
        own = bounded.energy_lost_restitution + bounded.energy_lost_friction
        assert own.covers(lost, OF_THE_ORACLE * work)
        for plain, own, p in zip(found.impulse, bounded.impulse, P, strict=True):
            assert abs(plain - p) <= limit * size
            assert own.covers(p, OF_THE_ORACLE * size)
            assert own.error <= 100 * limit * size


@pytest.mark.parametrize("mu", [0.0, 1e-300, 1e-8, 0.3, 1.0, 1e4, 1e150])
@pytest.mark.parametrize("e", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("spread", [0.3, 2.5])
def test_space(mu, e, spread):
    rng = np.random.default_rng(1)
    for _ in range(3):
        check(*random_contact(rng, spread), e, mu)


@pytest.mark.parametrize("mu", [0.0, 1e-300, 1e-8, 0.3, 1.0, 1e4, 1e150])
def test_plane(mu):
    rng = np.random.default_rng(2)
    for _ in range(6):
        u = [rng.normal(), -abs(rng.normal()), 0.0]
        check(rod(rng.uniform(0.1, 1.4)), u, UP, 0.5, mu)
        assert solve(rod(1.0), u, UP, 0.5, mu).impulse.z == 0


@pytest.mark.parametrize("mu", [0.0, 1e-300, 1e-8, 0.3, 1.0, 1e4])
def test_head_on(mu):
    sphere = (0.7 * np.eye(3)).tolist()
    check(sphere, (0.6, -0.2, -1.4), (-0.3, 0.1, 0.7), 1.0, mu)
    check(rod(0.7), (0.6, -0.2, -1.4), (-0.3, 0.1, 0.7), 1.0, mu)


def test_edge_of_the_cone():
    rng = np.random.default_rng(3)
    edges = 0
    for i in range(20):
        K, u, n = random_contact(rng, 0.5)
        unit = np.array(n) / np.linalg.norm(n)
        P = np.linalg.solve(K, -0.5 * (unit @ u) * unit - u)
        P_n = P @ unit
        if P_n > 0:
            edges += 1
            check(K, u, n, 0.5, float(np.linalg.norm(P - P_n * unit) / P_n) * (1 + (i % 3 - 1) * 1e-15))
    assert edges > 10


def test_three_slides():
    """There are three sliding solutions. The one that loses most energy is the answer."""
    found = 0
    rng = np.random.default_rng(4)
    while found < 4:
        S, beta = np.exp(rng.normal(0, 3, 2)), rng.normal(size=2) * np.exp(rng.normal(0, 2, 2))
        V = rng.normal(size=(2000, 2)) * np.exp(rng.normal(0, 2, (2000, 2)))
        mu = np.exp(rng.normal(size=2000))
        f = V[:, None] / (np.append(0, np.geomspace(1e-5, 1e3, 200))[:, None] + S)
        changes = np.diff(np.sign(mu[:, None] * (1 + f @ beta) - np.linalg.norm(f, axis=2)))
        for i in np.nonzero((changes != 0).sum(1) > 2)[0][:1]:
            K = np.diag([*S, 1.0])
            K[:2, :2] += np.outer(beta, beta)
            K[2, :2] = K[:2, 2] = beta
            u = [*(V[i] - beta), -1 / 1.5]
            case = K.tolist(), u, (0.0, 0.0, 1.0), 0.5, float(mu[i])
            assert len(right_impulse(*case)[2].candidates) == 3
            check(*case, limit=1e-8)  # close roots are as ill-conditioned as a square root
            found += 1


def test_sizes():
    rng = np.random.default_rng(5)
    K, u, n = map(np.array, random_contact(rng, 0.5))
    reference = np.array(solve(K, u, n, 0.5, 0.3).impulse)
    for mass, speed, length in [(1e150, 1.0, 1e-50), (1e-150, 1e100, 1e50), (1.0, 1e-150, 1.0)]:
        found = solve((K / mass).tolist(), (u * speed).tolist(), (n * length).tolist(), 0.5, 0.3)
        assert np.array(found.impulse) / (mass * speed) == pytest.approx(reference, rel=1e-13)
    assert all(map(math.isfinite, solve(K.tolist(), u.tolist(), n.tolist(), 0.5, 1e300).impulse))


def test_regimes():
    assert solve(rod(math.pi / 4), (0.5, -1.0, 0.0), UP, 0.5, 0.05).regime == Regime.REVERSED
    assert solve(rod(math.pi / 4), (0.0, -1.0, 0.0), UP, 0.5, 5.0).regime == Regime.STICKING
    assert solve(rod(math.pi / 2), (9.0, -1.0, 0.0), UP, 0.5, 0.1).regime == Regime.SLIDING


@pytest.mark.parametrize("precision", [Precision.DOUBLE, Precision.EXTENDED])
def test_the_regime_without_friction_is_that_of_the_slip(precision):
    """Fractions are answered in balls."""
    K = [[F(x, 3) for x in row] for row in ((21, 20, 21), (20, 25, 16), (21, 16, 26))]
    model = ImpactModel(Law.MOREAU, precision=precision)
    answer = resolve_contact(K, (-1 / 3, -1, -4 / 3), (0, 0, 1), 0.5, 0.0, model)
    assert answer.velocity_after.x * (-1 / 3) + answer.velocity_after.y * -1 < 0
    assert answer.regime is Regime.REVERSED


@pytest.mark.parametrize("exponent", [3, 9, 12, 15, 18, 21, 24])
@pytest.mark.parametrize("precision", [Precision.EXTENDED, Precision.AUTO])
def test_sticking_of_bodies_with_small_moments(exponent, precision):
    """``det(S)`` is then rounding and often negative. The right impulse comes from fractions."""
    pytest.importorskip("flint")  # the bound needs its digits
    draw = random.Random(exponent)
    moment, found = 10.0**-exponent, 0
    while found < 40:
        r, n, v = (tuple(draw.randint(-9, 9) / 8 for _ in range(3)) for _ in range(3))
        e, mu = 0.5, draw.choice((5.0, 100.0))
        if np.dot(n, v) >= 0 or not any(r):
            continue
        P = sticking_impulse(r, n, v, e, moment)
        P_n, nn = sum(map(F.__mul__, map(F, n), P)), F(sum(map(F.__mul__, map(F, n), map(F, n))))
        P_t = [p - P_n / nn * F(x) for p, x in zip(P, n, strict=True)]
        if P_n <= 0 or sum(p * p for p in P_t) * nn > (F(mu) * P_n) ** 2 * F(0.9):
            continue
        body = Body.dynamic(1.0, (moment, 0, 0, moment, 0, moment), velocity=v)
        model = ImpactModel(Law.MOREAU, precision=precision)
        impact = resolve(body, Body.static(), Contact.of(r, n, e, mu), model)
        if Adjustment.LAW_FALLBACK in impact.adjustments:
            continue
        found += 1
        off = math.dist(impact.impulse, map(float, P)) / math.hypot(*map(float, P))
        assert off <= impact.error_bound + 2.0**-52  # the expected value is rounded too
        assert impact.error_bound < (1e-6 if precision is Precision.AUTO else 1e-15)


def sticking_impulse(r, n, v, e, moment) -> list[F]:
    """The impulse that makes a unit mass stick to a wall and rebound, in fractions."""
    r, n, v, e, moment = [F(x) for x in r], [F(x) for x in n], [F(x) for x in v], F(e), F(moment)
    rr, n_v, nn = sum(x * x for x in r), sum(map(F.__mul__, n, v)), sum(x * x for x in n)
    wanted = [-b - e * n_v / nn * a for a, b in zip(n, v, strict=True)]
    # K = 1 + (r.r - r r^T) / I has the eigenvalues 1 along r, and 1 + r.r / I across it.
    along = sum(map(F.__mul__, r, wanted)) / rr
    return [along * x + (w - along * x) / (1 + rr / moment) for x, w in zip(r, wanted, strict=True)]


@pytest.mark.parametrize("precision", [Precision.DOUBLE, Precision.EXTENDED], ids=lambda one: one.name)
@pytest.mark.parametrize("mass", [1e-200, 1.0, 1e200])
def test_without_friction_it_is_newtons_law(mass, precision):
    """Also where the threshold equals the approach speed, and where masses are far apart."""
    body = Body.dynamic(mass, (mass, 0, 0, mass, 0, mass), velocity=(0.25, 0, -0.5))
    other = Body.dynamic(1e200, (1e200, 0, 0, 1e200, 0, 1e200), (1.0, -1.0, 0.0))
    contact = Contact.of((0.5, 0, 0), (0, 0, 1), 1.0, 0.0)
    for threshold in (0.0, 0.5):
        model = ImpactModel(Law.MOREAU, restitution_threshold=threshold, precision=precision)
        newton = resolve(body, other, contact, model._replace(law=Law.FRICTIONLESS))
        moreau = resolve(body, other, contact, model)
        assert moreau.impulse == pytest.approx(newton.impulse, rel=1e-12, abs=0.0)
        assert moreau.error_bound <= max(4 * newton.error_bound, 1e-13)


@pytest.mark.parametrize("precision", [Precision.DOUBLE, Precision.EXTENDED], ids=lambda one: one.name)
def test_three_slides_are_found_in_every_precision(precision):
    """The third is in a bracket that double-doubles can halve a thousand times."""
    body = Body.dynamic(
        3.3, (0.264, 0.033, 0, 0.297, 0, 0.33), (-2, -2, -2), (0, 0, 0.6, 0.8), (-2, 0.5, -1), (0, 0, 0.7)
    )
    wall = Body.kinematic(velocity=(1, 0.3, 0.7), angular_velocity=(-1, 0, 1), position=(-1, -1, 0.3))
    contact = Contact.of((-2, 0, 0.3), (0.3, 0.5, 0), 0.9, 1.0)
    impact = resolve(body, wall, contact, ImpactModel(Law.MOREAU, precision=precision))
    assert impact.status is StatusCode.OK
    assert impact.error_bound <= (1e-10 if precision is Precision.DOUBLE else 2.0**-52)
    right = resolve(body, wall, contact, ImpactModel(Law.MOREAU, tolerance=1e-15))
    assert math.dist(impact.impulse, right.impulse) <= 2 * impact.error_bound * math.hypot(*right.impulse)


TURNS = (
    [[1, 0, 0], [0, 1, 0], [0, 0, 1]],
    [[1, 2, 2], [2, 1, -2], [-2, 2, -1]],
    [[2, 3, 6], [6, 2, -3], [3, -6, 2]],
)
"""Rotations times 1, 3 and 7: they rotate vectors exactly."""


def sticking_rebound(slip: float, turn: list[list[int]]):
    """A contact that sticks with e = 1, in fractions: K, u, n, the impulse and the energy it adds."""
    K, u, n = [[16, 4, 0], [4, F(17, 16), 0], [0, 0, 1]], (F(slip), -2, 0), (0, 1, 0)
    inverse = [[F(17, 16), -4], [-4, 16]]  # det K = 1
    wanted = -u[0], F(4)
    P = [*(sum(map(F.__mul__, map(F, row), wanted)) for row in inverse), F(0)]
    gained = P[0] * u[0] / 2  # afterwards there is no tangential velocity, and the normal part loses nothing
    size = math.isqrt(sum(x * x for x in turn[0]))

    def turned(v):
        return [sum(F(x) * y for x, y in zip(row, v, strict=True)) for row in turn]

    rows = [turned(row) for row in K]
    both = [turned(column) for column in zip(*rows, strict=True)]
    assert all(F(float(x)) == x for row in both for x in row)
    return both, turned(u), turned(n), [p / size**2 for p in turned(P)], gained


@pytest.mark.parametrize("turn", TURNS, ids=["straight", "thirds", "sevenths"])
@pytest.mark.parametrize(
    "precision", [Precision.AUTO, Precision.DOUBLE, Precision.EXTENDED], ids=lambda p: p.name
)
def test_energy_created_is_explained_by_the_bound(turn, precision):
    """A slip of 2^-k loses energy in one direction and gains some in the other; no slip is a tie."""
    for slip in [0.0, *(sign * 2.0**-k for k in range(0, 44, 3) for sign in (-1, 1))]:
        K, u, n, P, gained = sticking_rebound(slip, turn)
        model = ImpactModel(
            Law.MOREAU, precision=precision, tolerance=1e-9 if precision is Precision.AUTO else 0.0
        )
        answer = resolve_contact(
            [[float(x) for x in row] for row in K], [*map(float, u)], [*map(float, n)], 1.0, 2.0, model
        )
        own = [F(p) for p in answer.impulse]
        after = [x + sum(map(F.__mul__, row, own)) for x, row in zip(u, K, strict=True)]
        change = sum(p * (x + y) for p, x, y in zip(own, u, after, strict=True)) / 2
        # A relative error b of the impulse changes the energy by b of the work and b^2 of P.KP.
        K_P = [sum(map(F.__mul__, row, own)) for row in K]
        room = 4 * sum(abs(p * (abs(x) + abs(y))) for p, x, y in zip(own, u, K_P, strict=True))
        if answer.error_bound < 1:
            assert change <= F(answer.error_bound) * room
        falls = gained > 0
        if precision is not Precision.DOUBLE:
            assert answer.status is StatusCode.OK
            assert (Adjustment.LAW_FALLBACK in answer.adjustments) is falls
        if not falls:
            off = math.dist(map(float, P), answer.impulse) / math.hypot(*map(float, P))
            assert off <= answer.error_bound + 2.0**-52


@pytest.mark.parametrize("friction", [1e99, 1e100, 1e300, 1.7e308])
@pytest.mark.parametrize("slip", [-1e40, -1e10, 1.0, 1e10, 1e20, 1e40])
def test_friction_without_limit_has_an_answer(slip, friction):
    """Fast slip that no friction stops: the bodies press with nearly no impulse, or the contact sticks."""
    body = Body.dynamic(1.0, (1.0, 0, 0, 1.0, 0, 1.0), (-1.0, -2.0, 0.0), velocity=(slip, -1.0, 0.0))
    contact = Contact.of((0.0, 0.0, 0.0), (0.0, 1.0, 0.0), restitution=0.5, friction=friction)
    impact = resolve(body, Body.static(), contact, ImpactModel(Law.MOREAU))
    assert impact.status is StatusCode.OK
    before, after = impact.kinetic_energy_before, impact.kinetic_energy_after
    assert after <= before * (1 + 1e-12)
