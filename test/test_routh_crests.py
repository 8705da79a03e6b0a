"""Phases of Routh's path that hardly end, or hardly do not end, because friction turns into a jam.

In compression ``u_n`` rises towards 0 and falls again; in restitution by Stronge the work does so towards
what it has to return. Where the crest is just beyond that, the phase ends there, else much later. A crest
between two steps must not be missed. The crests are known from an integration that shares no code with the
package.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from functools import cache
from itertools import product
from typing import NamedTuple

import pytest

from collision_response import ContactImpact, ImpactModel, Law, resolve_contact

LAWS = [Law.ROUTH_POISSON, Law.ROUTH_STRONGE]
TOLERANCES = [0.0, 1e-3, 1e-6, 1e-9, 1e-11]
BEYOND = [sign * 10.0**-k for k in range(2, 11) for sign in (1, -1)]

A, B, MU, ANGLE = (3.25, 10.0), (-1.125, 0.15625), 1.0625, 4.227
K = [[A[0], 0.0, B[0]], [0.0, A[1], B[1]], [*B, 1.0]]


class Point(NamedTuple):
    """A point of the path: the angle and the speed of slip, the normal velocity and the normal work."""

    angle: float
    s: float
    u_n: float
    work: float

    def rates(self) -> Point:
        """The derivatives by ``T``, with ``dp = s dT``."""
        cos, sin = math.cos(self.angle), math.sin(self.angle)
        f1, f2 = B[0] - MU * A[0] * cos, B[1] - MU * A[1] * sin
        r = 1 - MU * (B[0] * cos + B[1] * sin)
        return Point(cos * f2 - sin * f1, (cos * f1 + sin * f2) * self.s, r * self.s, self.u_n * self.s)

    def after(self, h: float, rate: Point) -> Point:
        return Point(*(x + h * slope for x, slope in zip(self, rate, strict=True)))


def path(slip: float) -> Iterator[Point]:
    """The path from an approach at 1 m/s with this slip, by the classical method of Runge and Kutta."""
    y, h = Point(ANGLE, slip, -1.0, 0.0), 1e-4
    while True:
        yield y
        k1 = y.rates()
        k2 = y.after(h / 2, k1).rates()
        k3 = y.after(h / 2, k2).rates()
        k4 = y.after(h, k3).rates()
        y = y.after(h / 6, k1).after(h / 3, k2).after(h / 3, k3).after(h / 6, k4)


def extremes(slip: float, value: Callable[[Point], float]) -> Iterator[float]:
    """The minima and maxima of a number on the path, each from the parabola through three points."""
    first = second = math.nan
    for point in path(slip):
        third = value(point)
        if (second - first) * (third - second) < 0:
            yield second + (third - first) ** 2 / (8 * (2 * second - first - third))
        first, second = second, third


@cache
def rise() -> float:
    """By how much ``u_n`` rises until friction jams, for slip of 1 m/s. It is proportional to the slip."""
    return next(extremes(1.0, lambda y: y.u_n)) + 1


@cache
def returned(slip: float) -> float:
    """The energetic restitution that returns all work that is done until ``u_n`` falls below 0 again."""
    work = extremes(slip, lambda y: y.work)
    compression, crest = next(work), next(work)
    return math.sqrt((crest - compression) / -compression)


def resolved(law: Law, slip: float, e: float, tolerance: float) -> ContactImpact:
    u = slip * math.cos(ANGLE), slip * math.sin(ANGLE), -1.0
    return resolve_contact(K, u, (0.0, 0.0, 1.0), e, MU, ImpactModel(law, tolerance=tolerance))


@pytest.mark.parametrize("law", LAWS, ids=str)
@pytest.mark.parametrize("e", [0.0, 0.5])
def test_compression_ends_if_u_n_just_reaches_0(e, law):
    """It ends at an impulse of at most 3.22 N s, else, in the jam, at 10 or more."""
    if law is Law.ROUTH_STRONGE and e > 0:
        early, late = (13.3, 13.6), (11.8, 12.0)  # the work that is returned includes that of the jam
    else:
        early, late = (0.0, 3.22 * (1 + e)), (10.0 * (1 + e), math.inf)
    wrong, known = [], 0
    for beyond, tolerance in product(BEYOND, TOLERANCES):
        result = resolved(law, (1 + beyond) / rise(), e, tolerance)
        least, most = early if beyond > 0 else late
        known += result.error_bound < 1
        if result.error_bound < 1 and not least <= result.normal_impulse <= most:
            wrong.append((beyond, tolerance, result.normal_impulse, result.error_bound))
    assert not wrong
    # Next to the limit, and with coarse steps, no bound is known.
    assert known >= 0.9 * len(BEYOND) * len(TOLERANCES)


@pytest.mark.parametrize("beyond_rise", [0.3, 0.03])
def test_restitution_ends_if_the_work_just_suffices(beyond_rise):
    """It ends before ``u_n`` falls below 0 again, else after the jam, at an impulse of 13 N s or more."""
    slip = (1 + beyond_rise) / rise()
    wrong, known = [], 0
    for beyond, tolerance in product(BEYOND, TOLERANCES):
        result = resolved(Law.ROUTH_STRONGE, slip, returned(slip) * (1 - beyond), tolerance)
        known += result.error_bound < 1
        if result.error_bound < 1 and (result.normal_impulse < 7) != (beyond > 0):
            wrong.append((beyond, tolerance, result.normal_impulse, result.error_bound))
    assert not wrong
    # Next to the limit, and with coarse steps, no bound is known.
    assert known >= 0.75 * len(BEYOND) * len(TOLERANCES)


@pytest.mark.parametrize("law", LAWS, ids=str)
def test_going_back_to_the_end_of_compression_is_no_jam(law):
    """A step may lead past it, to where friction jams. The impact ends before that."""
    for beyond, tolerance in product((1e-3, 1e-4, 1e-5, 1e-6), TOLERANCES):
        assert resolved(law, (1 + beyond) / rise(), 0.0, tolerance).regime.name == "SLIDING"


FLAT_K = [[20.0, -2.0, 4.0], [-2.0, 80.0, 0.0], [4.0, 0.0, 1.0]]
FLAT_SLIP = (1.0, -1.0)
JAM = 0.25
"""The least friction that jams: then slip along ``b`` presses the bodies together."""


@cache
def risen(mu: float) -> list[tuple[float, float, float]]:
    """Normal impulse, how far ``u_n`` has risen and its slope, on the path of a slip that passes ``b``."""
    A11, A12, A22, b = FLAT_K[0][0], FLAT_K[0][1], FLAT_K[1][1], FLAT_K[0][2]

    def rates(y: tuple[float, ...]) -> tuple[float, ...]:
        t1, t2, s = y[:3]
        f1, f2 = b - mu * (A11 * t1 + A12 * t2), -mu * (A12 * t1 + A22 * t2)
        w = t1 * f2 - t2 * f1
        return -t2 * w, t1 * w, s * (t1 * f1 + t2 * f2), s * (1 - mu * b * t1), s

    def after(y: tuple[float, ...], h: float, rate: tuple[float, ...]) -> tuple[float, ...]:
        return tuple(x + h * slope for x, slope in zip(y, rate, strict=True))

    size, h = math.hypot(*FLAT_SLIP), 2e-4
    y: tuple[float, ...] = FLAT_SLIP[0] / size, FLAT_SLIP[1] / size, size, 0.0, 0.0
    found = []
    while y[2] > 1e-3 and len(found) < 20000:
        k1 = rates(y)
        found.append((y[4], y[3], k1[3] / y[2]))
        k2 = rates(after(y, h / 2, k1))
        k3 = rates(after(y, h / 2, k2))
        k4 = rates(after(y, h, k3))
        y = after(after(after(after(y, h / 6, k1), h / 3, k2), h / 3, k3), h / 6, k4)
    return found


def first_passed(mu: float, rise: float) -> float:
    """The normal impulse at which ``u_n`` has first risen so far; infinite if it does not while it slips."""
    path = risen(mu)
    i = next((i for i, (_, height, _) in enumerate(path) if height >= rise), None)
    if i is None:
        return math.inf
    (p0, u0, _), (p1, u1, _) = path[i - 1 : i + 1]
    return p0 + (p1 - p0) * (rise - u0) / (u1 - u0)


@pytest.mark.parametrize("off", [sign * 10.0**-k for k in range(3, 8) for sign in (1, -1)] + [0.0])
@pytest.mark.parametrize("law", LAWS, ids=str)
def test_compression_ends_where_u_n_hardly_rises_for_a_while(law, off):
    """Next to the friction that jams, ``u_n`` passes 0 with next to no slope. A step beyond tells nothing."""
    mu = JAM * (1 + off)
    _, flat, _ = min(risen(mu), key=lambda point: point[2])
    for beyond, tolerance in product(BEYOND[:14], TOLERANCES):
        approach = flat * (1 + beyond)
        expected = first_passed(mu, approach)
        found = resolve_contact(
            FLAT_K, (*FLAT_SLIP, -approach), (0, 0, 1), 0.0, mu, ImpactModel(law, tolerance=tolerance)
        )
        if expected < math.inf:  # the chord between two points is off by less than 1e-5
            assert abs(found.normal_impulse / expected - 1) <= 3 * found.error_bound + 1e-5
        else:
            assert found.normal_impulse > risen(mu)[-1][0] or found.error_bound == math.inf
