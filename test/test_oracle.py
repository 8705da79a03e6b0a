"""The oracle against published closed forms and a step-by-step integration."""

from fractions import Fraction as F
from math import cos, isqrt, pi, sin, sqrt

import pytest

pytest.importorskip("mpmath")

import numpy as np
from exact import PlainBody, PlainCollision, PlainContact, pair_of
from integrate import integrate_until
from mpmath import mp
from oracle import LAWS, impulse
from oracle.matrices import mat
from rods import TABLE

UP = (0, 0, 1)
EXACT = 1e-45  # the oracle has 50 digits; numbers are of order 1 and K is well conditioned


@pytest.fixture(autouse=True)
def exact_arithmetic_in_the_tests():
    with mp.workdps(80):
        yield


def strike(tan2, u, law, e, mu):
    """A unit rod whose lower end touches the floor; ``tan2`` is the square of the tangent of its angle."""
    ss, cc, sc = F(tan2, 1 + tan2), F(1, 1 + tan2), F(isqrt(tan2), 1 + tan2)
    K = [[1 + 3 * ss, 0, -3 * sc], [0, 4, 0], [-3 * sc, 0, 1 + 3 * cc]]
    return impulse(law, K, (u[0], 0, u[1]), UP, e, mu)


def K_of(body_a, body_b=PlainBody(), point=(0, 0, 0)):  # noqa: B008  an immovable body
    return mat(pair_of(PlainCollision(body_a, body_b, PlainContact(point, UP))).K)


def random_contact(rng, spread=1.0):
    """K of two random boxes and a u with slip; ``spread`` scales their inertia."""
    bodies = []
    for _ in "AB":
        box = rng.uniform(0.5, 2, 3) ** 2
        mass, (x, y, z) = rng.uniform(0.5, 2), (spread * (box.sum() - box) / 12).tolist()
        turn, place = rng.normal(size=4).tolist(), rng.normal(size=3).tolist()
        bodies.append(PlainBody(mass, (x, 0.0, 0.0, y, 0.0, z), place, turn))
    return K_of(*bodies), (*rng.normal(size=2), -1.0)


def matches(value, text):
    """Whether a value agrees with a closed form, or with every digit that the table gives."""
    if "/" in text:
        return abs(value - F(text).numerator / mp.mpf(F(text).denominator)) < EXACT
    return abs(value - mp.mpf(text)) <= mp.mpf(10) ** -(len(text.split(".")[1])) / 2


@pytest.mark.parametrize("law", LAWS[1:])
@pytest.mark.parametrize("case", TABLE)
def test_table_of_rods(case, law):
    (tan2, u, e), rows = TABLE[case]
    P, report = strike(tan2, u, law, e, F(3, 10))
    for value, text in zip((P[0], P[2], report.energy), rows[law], strict=True):
        assert matches(value, text)
    assert abs(P[1]) < EXACT
    assert len(report.candidates) == (law == "moreau")


def test_events_of_a_reversal():
    _, report = strike(1, (1, -1), "routh_poisson", F(1, 2), F(3, 10))
    names, places = zip(*report.events, strict=True)
    assert names == ("end of compression", "slip stops", "slips on", "end")
    for p, q in zip(places, (F(20, 59), F(4, 9), F(4, 9), F(30, 59)), strict=True):
        assert abs(p - mp.mpf(q.numerator) / q.denominator) < EXACT


def test_jam_of_a_slender_rod():
    """tan theta = 2, mu = 3/2 > 4/3: u_n falls until slip stops, then the end is held."""
    e, mu = F(1, 2), F(3, 2)
    stop = F(1) / (F(34, 10) * mu - F(12, 10))
    held = F(16, 10) - F(12, 10) ** 2 / F(34, 10)
    p_c = stop + (1 - (F(16, 10) - F(12, 10) * mu) * stop) / held
    for law in ("routh_poisson", "routh_stronge"):
        _, report = strike(4, (-1, -1), law, e, mu)
        assert report.jam and not report.falls_again and report.energy < 0
        names = [name for name, _ in report.events]
        assert names == ["slip stops", "sticks", "end of compression", "end"]
        for (_, p), q in zip(report.events[:3], (stop, stop, p_c), strict=True):
            assert abs(p - mp.mpf(q.numerator) / q.denominator) < EXACT
    assert not strike(4, (1, -1), law, e, mu)[1].jam


# ---- spheres and points


@pytest.mark.parametrize("u_t, regime", [(F(524, 100), "stick"), (F(526, 100), "slide")])
def test_sphere_sticks_up_to_two_sevenths(u_t, regime):
    """(2/7)|u_t| <= mu (1+e) |u_n|, here 21/4. All laws must agree."""
    K = [[F(7, 6), 0, 0], [0, F(7, 6), 0], [0, 0, F(1, 3)]]  # of 3 kg and 1 m
    outcomes = [impulse(law, K, (u_t, 0, -1), UP, F(1, 2), 1) for law in LAWS[1:]]
    for P, report in outcomes:
        assert mp.norm(P - outcomes[0][0]) < EXACT
        assert report.regime in (regime, "path")
        assert ("sticks" in dict(report.events)) == (report.regime == "path" and regime == "stick")


def test_superball():
    """1 kg and 1 m, at (1, 0, -1) m/s and 3 rad/s: it leaves at (15, 0, 7)/7 m/s and 1/7 rad/s."""
    K = [[F(7, 2), 0, 0], [0, F(7, 2), 0], [0, 0, 1]]
    P, report = impulse("chatterjee_ruina", K, (-2, 0, -1), UP, 1, 10, e_t=1)
    assert abs(P[0] * 7 - 8) < EXACT and abs(P[1]) < EXACT and abs(P[2] - 2) < EXACT
    assert abs(report.energy) < EXACT


def test_ideal_rod_struck_by_a_point():
    """Effective mass m1 m2/(m1 + 4 m2) square to the rod, m1 m2/(m1 + m2) along it."""
    rod_z = PlainBody(3.0, (1.0, 0.0, 0.0, 1.0, 0.0, 0.0))  # m1 = 3, length 2
    K = K_of(rod_z, PlainBody(5.0, position=(0, 0, 1)), (0, 0, 1))
    for i, mass in enumerate((F(15, 23), F(15, 23), F(15, 8))):
        assert abs(K[i, i] * mass.numerator - mass.denominator) < EXACT


# ---- against a step-by-step integration


def by_steps(K, u, e, mu, stronge):
    """Integrate in p step by step. Friction follows the slip; a scan finds the direction in which slip
    resumes.

    y: u, work of the normal impulse, tangential impulse, p.
    """
    K, y = np.array(K.tolist(), float), np.array([*u, 0.0, 0.0, 0.0, 0.0], float)
    p_c = W_c = push = None
    stopped = np.hypot(*y[:2]) == 0
    while True:
        if stopped:
            y[:2] = 0
            push = np.array([*-np.linalg.solve(K[:2, :2], K[:2, 2]), 1])
            if np.hypot(*push[:2]) > mu:
                push = resuming_force(K, mu)

        def rhs(y, push=push):
            f = push if push is not None else np.array([*(-mu * y[:2] / np.hypot(*y[:2])), 1])
            return [*(K @ f), y[2], f[0], f[1], 1.0]

        def stop(y, slips=push is None):
            return 1e-11 - np.hypot(*y[:2]) if slips else -1.0

        def goal(y, p_c=p_c, W_c=W_c):
            if p_c is None:
                return y[2]
            return y[3] - (1 - e * e) * W_c if stronge else y[6] - (1 + e) * p_c

        _, y, event = integrate_until(rhs, y, (stop, goal))
        stopped = event == 0
        if not stopped and p_c is not None:
            return y[4:]
        if not stopped:
            p_c, W_c = y[6], y[3]


def resuming_force(K, mu):
    """The force per normal impulse in the direction in which slip grows from rest."""

    def polar(t):
        z = np.array([cos(t), sin(t)])
        h = K[:2, 2] - mu * K[:2, :2] @ z
        return z @ h, z[0] * h[1] - z[1] * h[0]

    t = np.linspace(0, 2 * pi, 2001)
    grow, turn = np.transpose([polar(x) for x in t])
    (i,) = np.nonzero((turn[:-1] * turn[1:] <= 0) & (grow[:-1] > 0))[0]
    low, high = t[i], t[i + 1]
    while low < (at := (low + high) / 2) < high:
        low, high = (at, high) if polar(at)[1] * turn[i] > 0 else (low, at)
    return np.array([-mu * cos(at), -mu * sin(at), 1])


def wild_contact(rng):
    """A K that few bodies have: very different mobilities along its axes, and strong friction."""
    L = rng.normal(size=(3, 3)) * 10 ** rng.uniform(-1, 0.5, 3)
    K, mu = L @ L.T, 10 ** rng.uniform(-0.3, 0.7)
    u = (*(rng.normal(size=2) * 10 ** rng.uniform(-1, 1)), -1.0)
    return mp.matrix(K.tolist()) / K[2, 2], u, mu


def agrees(P, Q):
    """Whether impulses agree to 1e-9. The tolerance of the integrator, and the slip of 1e-11 that counts as a
    stop, cause errors up to 2e-10 here.
    """
    return np.abs(np.array(P.tolist(), float)[:, 0] - Q).max() < 1e-9 * np.abs(Q).max()


@pytest.mark.parametrize("seed", range(10))
def test_routh_against_integration(seed):
    rng = np.random.default_rng(seed)
    K, u = random_contact(rng)
    e, mu, stronge = rng.uniform(0.1, 1), rng.uniform(0.1, 1), bool(seed % 2)
    P, report = impulse(LAWS[3 + stronge], K, u, UP, e, mu, digits=15)
    assert agrees(P, by_steps(K, u, e, mu, stronge))
    if stronge:
        assert report.energy < 0


@pytest.mark.parametrize(
    "seed, stronge, events, jam, falls_again",
    [
        (35, False, "stops, slips on, p_c", False, False),
        (101, True, "p_c, stops, slips on", True, False),
        (187, False, "stops, sticks, p_c", True, False),
        (154, True, "p_c", False, True),
        (223, False, "p_c", False, True),
    ],
)
def test_routh_of_wild_contacts_against_integration(seed, stronge, events, jam, falls_again):
    K, u, mu = wild_contact(np.random.default_rng(seed))
    P, report = impulse(LAWS[3 + stronge], K, u, UP, 1, mu, digits=15)
    short = {"slip stops": "stops", "end of compression": "p_c"}
    assert ", ".join(short.get(name, name) for name, _ in report.events[:-1]) == events
    assert (report.jam, report.falls_again) == (jam, falls_again)
    assert agrees(P, by_steps(K, u, 1, mu, stronge))


@pytest.mark.parametrize("mu", [0.05, 5])
def test_impact_without_initial_slip(mu):
    K, _ = random_contact(np.random.default_rng(3))
    P, report = impulse("routh_stronge", K, (0, 0, -1), UP, 0.5, mu, digits=15)
    assert report.events[0] == ("slips on" if mu < 1 else "sticks", 0)
    assert agrees(P, by_steps(K, (0, 0, -1), 0.5, mu, True))


# ---- what holds for all


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("seed", range(2))
def test_cone_energy_and_restitution(law, seed):
    rng = np.random.default_rng(seed)
    K, u = random_contact(rng)
    n, e, mu = rng.normal(size=3).tolist(), rng.uniform(), rng.uniform(0.1, 2)
    P, report = impulse(law, K, u, n, e, mu, digits=15)
    n = mp.matrix(n) / mp.norm(n)
    p = mp.fdot(P, n)
    if report.regime == "separating":
        assert mp.norm(P) == 0 and report.un_before >= 0
        return
    assert p > 0 and mp.norm(P - p * n) <= mu * p * (1 + mp.mpf(10) ** -15)
    assert law == "moreau" or report.energy <= 0
    if not law.startswith("routh"):
        assert abs(report.un_after + e * report.un_before) < mp.mpf(10) ** -15


def test_routh_agrees_in_other_axes_and_precisions():
    """Rotated bodies, another length of n, 15 and 30 digits: equal to 15 digits."""
    rng = np.random.default_rng(8)
    K, u = random_contact(rng)
    x, y, z = rng.normal(size=3).tolist()
    turn = mp.expm(mp.matrix([[0, -z, y], [z, 0, -x], [-y, x, 0]]))
    P, _ = impulse("routh_stronge", K, u, UP, 0.5, 0.5, digits=30)
    K, u, n = turn * K * turn.T, turn * mp.matrix(u), 7 * turn[:, 2]
    Q, _ = impulse("routh_stronge", K, u, n, 0.5, 0.5, digits=15)
    assert mp.norm(turn * P - Q) < mp.mpf(10) ** -15 * mp.norm(P)


def test_nearly_singular_mobility():
    """Inertia of 1e-10 m r^2, so K has a condition number of 1e10: all requested digits must be right."""
    K, u = random_contact(np.random.default_rng(5), spread=1e-10)
    for law in LAWS[1:]:
        P, _ = impulse(law, K, u, UP, 0.5, 0.5, digits=15)
        Q, _ = impulse(law, K, u, UP, 0.5, 0.5, digits=30)
        assert mp.norm(P - Q) < mp.mpf(10) ** -15 * mp.norm(Q)


@pytest.mark.parametrize("offset", [1e-3, 1e-9, 1e-17])
def test_almost_a_sphere(offset):
    """The centre of mass is off by ``offset``: slip hardly turns, and the answer changes by about as much."""
    K, u = K_of(PlainBody(1.0, (0.4, 0.0, 0.0, 0.4, 0.0, 0.4), (offset, 2 * offset, 1))), (1, 0.3, -1)
    Q = [-2 / 7, -0.6 / 7, 1.5]
    P, report = impulse("routh_stronge", K, u, UP, 0.5, 1, digits=15)
    assert [name for name, _ in report.events][:2] == ["slip stops", "sticks"]
    assert agrees(P, by_steps(K, u, 0.5, 1, True))
    assert max(abs(x - y) for x, y in zip(P, Q, strict=True)) < 4 * offset + 1e-15


def test_planar_impact_in_rounded_axes():
    """T3 with its plane in rounded axes: the slip misses its reversal by 1e-16."""
    x, y = np.array([2, 1, 2]) / 3, np.array([1, 2, -2]) / 3
    n = np.cross(x, y)
    along = (x + 2 * n) / sqrt(5)
    inertia = (np.eye(3) - np.outer(along, along)) / 12
    K = K_of(PlainBody(1.0, inertia[np.triu_indices(3)].tolist(), (along / 2).tolist()))
    P, _ = impulse("routh_poisson", K, (x / 2 - n).tolist(), n.tolist(), 0.9, 0.3, digits=15)
    Q = 0.25 * x + 47.5 / 37 * n
    assert max(abs(a - b) for a, b in zip(P, Q.tolist(), strict=True)) < 1e-14


def test_moreau_can_have_three_answers():
    K, u, mu = wild_contact(np.random.default_rng(81))
    P, report = impulse("moreau", K, u, UP, 0.5, mu)
    assert [regime for regime, *_ in report.candidates] == ["stick", "slide", "slide"]
    assert report.candidates[0][1] == P
    for regime, P, _ in report.candidates:
        after = mp.matrix(u) + K * P
        assert abs(after[2] - 0.5) < EXACT
        slip = mp.matrix(after[:2])
        if regime == "stick":
            assert mp.norm(slip) < EXACT
        else:
            assert mp.norm(mp.matrix(P[:2]) + mu * P[2] * slip / mp.norm(slip)) < EXACT * mp.norm(P)
