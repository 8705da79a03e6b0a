"""Restitution that depends on the approach speed, for :attr:`Contact.restitution`.

Each function here takes constants of the materials and returns a function ``e(v)``: the coefficient in [0, 1]
for an approach speed ``v`` >= 0 [m/s]. The returned functions can be pickled.
"""

from __future__ import annotations

import math
import sys
from bisect import bisect_right
from collections.abc import Callable, Sequence
from functools import partial
from itertools import pairwise

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

    Raises:
        ValueError: if ``beta`` is negative or not finite.
    """
    if not 0 <= beta < math.inf:
        raise ValueError(f"beta must be finite and not negative, is {beta}")

    return partial(_viscoelastic, float(beta))


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

    Raises:
        ValueError: if ``yield_speed`` is not positive and finite.
    """
    return partial(_plastic, float(yield_speed), johnson(yield_speed))


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

    Raises:
        ValueError: if ``restitution`` is not in (0, 1], ``speed`` is not positive and finite, or
            ``exponent`` is negative or not finite.
    """
    if not 0 < restitution <= 1:
        raise ValueError(f"restitution must be in (0, 1], is {restitution}")
    if not 0 < speed < math.inf:
        raise ValueError(f"speed must be positive and finite, is {speed}")
    if not 0 <= exponent < math.inf:
        raise ValueError(f"exponent must be finite and not negative, is {exponent}")
    return partial(_power_law, float(restitution), float(speed), float(exponent))


def _power_law(restitution: float, speed: float, exponent: float, v: float) -> float:
    if exponent == 0:
        return restitution
    log_factor = exponent * _log_quotient(speed, v) if v > 0 else math.inf
    if log_factor >= -math.log(restitution):
        return 1.0
    first = min(log_factor, 700.0)  # in two steps, because the factor may overflow if restitution is tiny
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

    Raises:
        ValueError: if ``yield_speed`` is not positive and finite.
    """
    if not 0 < yield_speed < math.inf:
        raise ValueError(f"yield_speed must be positive and finite, is {yield_speed}")
    return partial(_power_law, math.sqrt(6 * math.sqrt(3) / 5) * (24 / 5) ** -0.125, float(yield_speed), 0.25)


def tabulated(speeds: Sequence[float], values: Sequence[float], most: float = 1.0) -> Restitution:
    """Measured values, interpolated linearly; beyond the first and last speed the value stays constant.

    Args:
        speeds: approach speeds [m/s], >= 0, strictly increasing, at least one.
        values: in [0, ``most``] and finite, one for each speed.
        most: upper limit of the values.

    Raises:
        ValueError: if the speeds or values break these conditions.
    """
    speeds, values = tuple(speeds), tuple(values)
    if not speeds or len(speeds) != len(values):
        counts = f"{len(speeds)} and {len(values)}"
        raise ValueError(f"speeds and values must have the same length, at least 1; have {counts}")
    rising = all(a < b for a, b in pairwise(speeds))
    if not rising or speeds[0] < 0 or not math.isfinite(speeds[-1]):
        raise ValueError(f"speeds must be finite, not negative and strictly increasing, are {list(speeds)}")
    for value in values:
        if not (0 <= value <= most and value < math.inf):
            raise ValueError(f"values must be finite and in [0, {most:g}], one is {value}")

    return partial(_interpolated, tuple(map(float, speeds)), tuple(map(float, values)))


def _interpolated(speeds: Sequence[float], values: Sequence[float], v: float) -> float:
    i = bisect_right(speeds, v)
    if i == 0 or i == len(speeds):
        return values[0] if i == 0 else values[-1]
    part = (v - speeds[i - 1]) / (speeds[i] - speeds[i - 1])
    below, above = values[i - 1], values[i]
    return min(below * (1 - part) + above * part, max(below, above))
