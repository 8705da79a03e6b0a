"""How well a fit knows its coefficients: intervals, lower bounds, and combinations.

The formal intervals of least squares take every residual for independent noise of one size. Noise of a
normal is not: it tilts the impulse, and the fit answers with other coefficients. So the intervals given are
those of the bootstrap, of fits to impacts drawn from the measured ones with replacement. They hold what
differs from impact to impact, not what is wrong with all of them, such as a geometry or a law.

Source: Efron & Tibshirani, *An Introduction to the Bootstrap*, 1993, section 13.3.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from .least_squares import NEGLIGIBLE_SQUARES, RANGES, LeastSquares
from .measurements import Array

LARGE_COEFFICIENT = 1e3
"""As good as infinite, for a coefficient."""

HALF_CHI_SQUARE = 1.92
"""Half of the 95 % point of chi square with one degree of freedom."""

CONDITION_LIMIT = 1e4
"""Where one combination of coefficients is known this much better than another, the other is not known."""

OUTLIER_SCALES = 3.0
"""A residual of more scales counts as one of so many: it does not tell how noisy the others are."""

HALVINGS = 20
"""Of the interval in which a lower bound is sought."""


class Estimate(NamedTuple):
    """A coefficient.

    Attributes:
        value: the best; NaN where the impacts do not tell.
        low, high: 95 % interval of the bootstrap; with ``value`` NaN, of what is not ruled out.
        formal: standard deviation by least squares, too small by far where normals are noisy.
    """

    value: float
    low: float
    high: float
    formal: float

    def __str__(self) -> str:
        if not math.isnan(self.value):
            return (
                f"= {self.value:.4g}  [{self.low:.4g}, {self.high:.4g}]  (formal ± {1.96 * self.formal:.2g})"
            )
        if self.high == math.inf and self.low > 0:
            return f">= {self.low:.4g}: the impacts stick, and do not tell how much more"
        return f"in [{self.low:.4g}, {self.high:.4g}]: not determined by these impacts"


def estimates(problem: LeastSquares, best: Any, values: Array) -> tuple[dict[str, Estimate], Estimate | None]:
    """What is known of each coefficient, and of ``friction (1 + restitution)`` where it alone is known.

    Args:
        problem: that was solved.
        best: SciPy's solution.
        values: those of the bootstrap, a row each.
    """
    x, names = best.x, problem.names
    covariance = _variance(problem, best) * np.linalg.pinv(best.jac.T @ best.jac)
    low, high = np.percentile(values, (2.5, 97.5), axis=0, method="inverted_cdf")
    formal = np.sqrt(np.diag(covariance))
    found = {name: Estimate(*map(float, row)) for name, *row in zip(names, x, low, high, formal, strict=True)}
    unknown = _confounded(best.jac, names)
    return found | undetermined(problem, best), (
        _product(x, values, names, covariance) if unknown == set(PRODUCT) else None
    )


def undetermined(problem: LeastSquares, best: Any) -> dict[str, Estimate]:
    """What is not ruled out, of each coefficient that these impacts do not determine.

    Args:
        problem, best: see :func:`estimates`.
    """
    unknown = _confounded(best.jac, problem.names)
    allowed = problem.squares(best.x) + 2 * HALF_CHI_SQUARE * _variance(problem, best) + NEGLIGIBLE_SQUARES
    found = {name: Estimate(math.nan, *RANGES[name][:2], math.inf) for name in unknown}
    rest = {
        name: _undetermined_alone(problem, best, name, allowed)
        for name in problem.names
        if name not in unknown
    }
    return found | {name: estimate for name, estimate in rest.items() if estimate is not None}


def _variance(problem: LeastSquares, best: Any) -> float:
    """Of a residual. One that is 0 whatever the coefficients are does not count: it was not measured, or lies
    across the plane of a planar impact."""
    counts = (best.fun != 0) | best.jac.any(axis=1)
    most = OUTLIER_SCALES * problem.scale or math.inf
    return float((np.minimum(abs(best.fun), most) ** 2).sum() / max(counts.sum() - best.x.size, 1))


def _confounded(jacobian: Array, names: tuple[str, ...]) -> set[str]:
    """The coefficients of which the impacts determine no more than a combination."""
    effective = [i for i in range(len(names)) if jacobian[:, i].any()]
    if len(effective) < 2:
        return set()
    _, sizes, directions = np.linalg.svd(jacobian[:, effective], full_matrices=False)
    if sizes[-1] * CONDITION_LIMIT > sizes[0]:
        return set()
    return {
        names[i]
        for i, part in zip(effective, directions[len(effective) - 1], strict=True)
        if abs(part) > 1e-3
    }


PRODUCT = ("restitution", "friction")


def _product(x: Array, values: Array, names: tuple[str, ...], covariance: Array) -> Estimate:
    """``friction (1 + restitution)``: all that a tangential velocity after sliding tells, or a spin."""
    e, mu = (names.index(name) for name in PRODUCT)
    low, high = np.percentile(values[:, mu] * (1 + values[:, e]), (2.5, 97.5))
    slope = np.zeros(len(names))
    slope[e], slope[mu] = x[mu], 1 + x[e]
    return Estimate(x[mu] * (1 + x[e]), low, high, math.sqrt(slope @ covariance @ slope))


def _undetermined_alone(problem: LeastSquares, best: Any, name: str, allowed: float) -> Estimate | None:
    """What is not ruled out, of a coefficient that may be anything, or anything above some value."""
    (least, most, _), x, i = RANGES[name], best.x, problem.names.index(name)
    if problem.squares_at_fixed(x, name, min(most, LARGE_COEFFICIENT)) > allowed:
        return None
    is_open = problem.squares_at_fixed(x, name, least) <= allowed
    if most < math.inf and not is_open and best.jac[:, i].any():
        return None
    low, high = least, float(x[i])
    for _ in range(0 if is_open else HALVINGS):
        middle = (low + high) / 2
        low, high = (low, middle) if problem.squares_at_fixed(x, name, middle) <= allowed else (middle, high)
    return Estimate(math.nan, least if is_open else high, most, math.inf)
