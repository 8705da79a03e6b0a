"""Restitution that depends on the approach speed, for :attr:`Contact.restitution`.

Each function here takes constants of the materials and returns a function ``e(v)``: the coefficient in [0, 1]
for an approach speed ``v`` >= 0 [m/s]. The returned functions can be pickled.

Constants are real numbers of any type. Each function here raises ``ImpactError``, which is a ``ValueError``,
with the name of a constant that is out of range, and ``TypeError`` with the name of one that is no number.
"""

from __future__ import annotations

import math
import sys
from bisect import bisect_right
from collections.abc import Callable, Iterable, Sequence
from functools import partial
from itertools import pairwise
from typing import Any

from ..arguments import as_list, check_number
from ..status import POSITIVE, ImpactError, StatusCode

Restitution = Callable[[float], float]


def viscoelastic(beta: float) -> Restitution:
    """Viscoelastic spheres: restitution falls as the speed grows.

    Hertz's contact with viscous dissipation has the equation of motion ``x'' = -k x^(3/2) - (3/2) A k x^(1/2)
    x'``, where ``A`` [s] is the dissipative constant and ``k`` Hertz's stiffness over the effective mass. Its
    restitution depends only on ``s = beta^(1/2) v^(1/10)``.

    Source: the [1/4] Pade approximant of Mueller & Poeschel, "Collision of viscoelastic spheres:
    Compact expressions for the coefficient of normal restitution", Phys. Rev. E 84 (2011) 021302. It
    deviates from the solution of the equation of motion by at most 0.01.

    Args:
        beta: ``(3/2) A k^(2/5)`` [(s/m)^(1/5)], >= 0.
    """
    return partial(_viscoelastic, constant("beta", beta))


def _viscoelastic(beta: float, v: float) -> float:
    s = math.sqrt(beta) * v**0.1
    if s > 1:  # in powers of 1/s, which do not overflow
        t = 1 / s
        denominator = 0.532178 + t * (0.577977 + t * (1.15345 + t * (0.501086 + t)))
        return t * t * t * (t + 0.501086) / denominator
    denominator = 1 + s * (0.501086 + s * (1.15345 + s * (0.577977 + s * 0.532178)))
    return (1 + 0.501086 * s) / denominator


def plastic(yield_speed: float) -> Restitution:
    """Elastic-perfectly plastic spheres: 1 up to the yield speed, then falling towards ``v^(-1/4)``.

    Source: Thornton, "Coefficient of Restitution for Collinear Collisions of Elastic-Perfectly
    Plastic Spheres", J. Appl. Mech. 64 (1997) 383-386, eq. 22. For high speed it approaches
    :func:`johnson`.

    Args:
        yield_speed: greatest approach speed without plastic deformation [m/s], > 0.
    """
    return partial(_plastic, constant("yield_speed", yield_speed, POSITIVE), johnson(yield_speed))


def _plastic(yield_speed: float, at_high_speed: Restitution, v: float) -> float:
    if v <= yield_speed:
        return 1.0
    q = yield_speed / v
    if q < NEGLIGIBLE:
        return at_high_speed(v)
    root = math.sqrt(6 / 5 - q * q / 5)
    return min(1.0, math.sqrt(6 * math.sqrt(3) / 5 * (1 - q * q / 6)) * (q / (q + 2 * root)) ** 0.25)


NEGLIGIBLE = 2.0**-60
"""A number below this does not change 1 when added to it."""


def power_law(restitution: float, speed: float, exponent: float) -> Restitution:
    """A power law, at most 1: ``min(1, restitution (v / speed)^-exponent)``.

    Args:
        restitution: the coefficient at ``speed``, in (0, 1].
        speed: approach speed at which it was measured [m/s], > 0.
        exponent: >= 0.
    """
    return partial(
        _power_law,
        constant("restitution", restitution, POSITIVE, 1),
        constant("speed", speed, POSITIVE),
        constant("exponent", exponent),
    )


def _power_law(restitution: float, speed: float, exponent: float, v: float) -> float:
    if exponent == 0:
        return restitution
    log_factor = exponent * _log_quotient(speed, v) if v > 0 else math.inf
    if log_factor >= -math.log(restitution):
        return 1.0
    first = max(-1000.0, min(log_factor, 700.0))  # in two steps: the factor, and its logarithm, may overflow
    return min(1.0, restitution * math.exp(first) * math.exp(log_factor - first))


def _log_quotient(a: float, b: float) -> float:
    """``log(a / b)`` of positive numbers, even if the quotient overflows or underflows."""
    quotient = a / b
    if 0.5 <= quotient <= 2:
        return math.log1p((a - b) / b)
    in_range = sys.float_info.min <= quotient < math.inf
    return math.log(quotient) if in_range else math.log(a) - math.log(b)


def johnson(yield_speed: float) -> Restitution:
    """Fully plastic spheres: ``v^(-1/4)``, cut off at 1 below about twice the yield speed.

    It is the limit of :func:`plastic` for high speed,

        (6 sqrt(3) / 5)^(1/2) (24 / 5)^(-1/8) (yield_speed / v)^(1/4)

    Source: Johnson, *Contact Mechanics*, 1985, section 11.5.

    Args:
        yield_speed: greatest approach speed without plastic deformation [m/s], > 0.
    """
    at_yield_speed = math.sqrt(6 * math.sqrt(3) / 5) * (24 / 5) ** -0.125
    return partial(_power_law, at_yield_speed, constant("yield_speed", yield_speed, POSITIVE), 0.25)


def tabulated(speeds: Iterable[float], values: Iterable[float]) -> Restitution:
    """Measured values, interpolated linearly; beyond the first and last speed the value stays constant.

    Args:
        speeds: approach speeds [m/s], >= 0, strictly increasing as floats, at least one.
        values: in [0, 1], one for each speed.
    """
    return interpolation(speeds, values, 1)


def interpolation(speeds: Iterable[float], values: Iterable[float], most: float) -> Restitution:
    """As :func:`tabulated`, with values in [0, ``most``]."""
    v, y = (
        tuple(constant(f"{name}[{i}]", x, 0, limit) for i, x in enumerate(as_list(name, given)))
        for name, given, limit in (("speeds", speeds, math.inf), ("values", values, most))
    )
    if not v or len(v) != len(y):
        reason = f"must be as many as values, at least 1; are {len(v)} and {len(y)}"
        raise ImpactError(StatusCode.INVALID_COEFFICIENT, "speeds", reason)
    for i, (a, b) in enumerate(pairwise(v), 1):
        if not a < b:
            reason = f"must be greater than the speed before, {a}; is {b}"
            raise ImpactError(StatusCode.INVALID_COEFFICIENT, f"speeds[{i}]", reason)
    return partial(_interpolated, v, y)


def constant(name: str, value: Any, least: float = 0, most: float = math.inf) -> float:
    """Return a constant of a function as a float. Raises: as the head of this file says."""
    return check_number(name, value, least, most, StatusCode.INVALID_COEFFICIENT)


def _interpolated(speeds: Sequence[float], values: Sequence[float], v: float) -> float:
    i = bisect_right(speeds, v)
    if i == 0 or i == len(speeds):
        return values[0] if i == 0 else values[-1]
    part = (v - speeds[i - 1]) / (speeds[i] - speeds[i - 1])
    below, above = values[i - 1], values[i]
    return min(below * (1 - part) + above * part, max(below, above))
