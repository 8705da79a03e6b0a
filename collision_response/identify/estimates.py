"""How well a fit determines its coefficients: intervals, lower bounds, and combinations.

The formal intervals of least squares treat all residuals as independent noise of one size. Noise of a normal
is different: it tilts the impulse, and the fit makes up for that with other coefficients. So the intervals
come from the bootstrap: from fits to impacts drawn from the measured ones with replacement. They include
errors that vary from impact to impact, but not errors that all impacts share, such as a wrong geometry or
law.

Source: Efron & Tibshirani, *An Introduction to the Bootstrap*, 1993, section 13.3.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from ..batch.arrays import Array
from .least_squares import NEGLIGIBLE_SQUARES, SEARCH_RANGES, LeastSquares

LARGE_COEFFICIENT = 1e3
"""Times the greater of 1 and its value, it stands for the missing upper limit of a coefficient."""

CHI_SQUARE = 3.84
"""The 95 % point of chi square with one degree of freedom."""

DEVIATIONS = 1.96
"""Half of a 95 % interval, in standard deviations of normal noise."""

LEAST_PART = 1e-3
"""A coefficient with a smaller part in a direction does not belong to the combination."""

CONDITION_LIMIT = 1e4
"""A combination of coefficients counts as undetermined if another is determined this many times better."""

OUTLIER_SCALES = 3.0
"""Residuals are clipped at this many scales when their variance is estimated, because an outlier does not
tell how noisy the other residuals are."""

HALVINGS = 20
"""Number of bisection steps in the search for a lower bound."""


class Estimate(NamedTuple):
    """A fitted coefficient and how well it is known.

    Attributes:
        value: the best fit; NaN if the impacts do not determine the coefficient.
        low, high: 95 % interval of the bootstrap, and the values that fit as well where another coefficient
            is not determined, with the interval of ``formal`` where few impacts determine this one; if
            ``value`` is NaN, the limits of the values that the impacts do not rule out. Not all values
            between these need to fit.
        formal: standard deviation according to least squares; far too small if the normals are noisy.
            Infinite if ``value`` is NaN.
    """

    value: float
    low: float
    high: float
    formal: float

    def __str__(self) -> str:
        if not math.isnan(self.value):
            half = DEVIATIONS * self.formal
            return f"= {self.value:.4g}  [{self.low:.4g}, {self.high:.4g}]  (formal ± {half:.2g})"
        if self.high == math.inf and self.low > 0:
            return f">= {self.low:.4g}: these impacts tell only a lower bound"
        return f"in [{self.low:.4g}, {self.high:.4g}]: not determined by these impacts"


def estimates(problem: LeastSquares, best: Any, values: Array) -> tuple[dict[str, Estimate], Estimate | None]:
    """Return an estimate of each fitted coefficient, and one of ``friction (1 + restitution)``.

    The second is ``None`` unless the impacts determine this combination but neither factor. ``best`` is
    SciPy's solution; ``values`` has a row for each resample, with NaN where a coefficient has no effect.
    """
    x, names = best.x, problem.names
    covariance = _covariance(problem, best)
    least, most = np.array([SEARCH_RANGES[name][:2] for name in names]).T
    # Without an effect any value fits; of a coefficient without an upper limit, any that is large enough.
    lowest = np.where(np.isnan(values), np.where(np.isinf(most), most, least), values)
    highest = np.where(np.isnan(values), most, values)
    low, high = _percentile(lowest, 2.5), _percentile(highest, 97.5)
    formal = formal_deviations(problem, best)
    # If few impacts tell a coefficient, the resamples that hold any of them are nearly the same.
    half = np.where(np.isnan(values).any(axis=0), DEVIATIONS * formal, 0)
    places = [np.clip(x - half, least, most), np.clip(x + half, least, most)]
    unknown, fits = undetermined(problem, best)
    low, high = np.min([low, *places, *fits], axis=0), np.max([high, *places, *fits], axis=0)
    found = {name: Estimate(*map(float, row)) for name, *row in zip(names, x, low, high, formal, strict=True)}
    confounded = _confounded(best.jac, names)
    return found | unknown, (_product(x, highest, names, covariance) if confounded == set(PRODUCT) else None)


def formal_deviations(problem: LeastSquares, best: Any) -> Array:
    """Return the standard deviation of each fitted coefficient according to least squares."""
    return np.sqrt(np.diag(_covariance(problem, best)))


def _covariance(problem: LeastSquares, best: Any) -> Array:
    return _variance(problem, best) * np.linalg.pinv(best.jac.T @ best.jac)


def _percentile(values: Array, percent: float) -> Any:
    return np.percentile(values, percent, axis=0, method="inverted_cdf")


def undetermined(problem: LeastSquares, best: Any) -> tuple[dict[str, Estimate], list[Array]]:
    """Return, for each coefficient that the impacts do not determine, the range that they do not rule out.

    The second part holds fits with such a coefficient at a limit of its range. The other coefficients may be
    different there, and these values are not ruled out either.
    """
    unknown = _confounded(best.jac, problem.names)
    negligible = float(problem.reduced(NEGLIGIBLE_SQUARES))
    allowed = problem.squares(best.x) + CHI_SQUARE * _variance(problem, best) + negligible
    found = {name: Estimate(math.nan, *SEARCH_RANGES[name][:2], math.inf) for name in unknown}
    places: list[Array] = []
    for name in problem.names:
        if name not in unknown and (alone := _undetermined_alone(problem, best, name, allowed)):
            found[name], fits = alone
            places += fits
    return found, places


def _variance(problem: LeastSquares, best: Any) -> float:
    """Return the variance of a residual.

    Residuals that are 0 for all coefficients do not count: they were not measured, or are perpendicular to
    the plane of a planar impact.
    """
    counts = (best.fun != 0) | best.jac.any(axis=1)
    most = OUTLIER_SCALES * problem.scale or math.inf
    return float((np.minimum(abs(best.fun), most) ** 2).sum() / max(counts.sum() - best.x.size, 1))


def _confounded(jacobian: Array, names: tuple[str, ...]) -> set[str]:
    """Return the coefficients that the impacts determine only in combination."""
    effective = [i for i in range(len(names)) if jacobian[:, i].any()]
    if len(effective) < 2:
        return set()
    _, sizes, directions = np.linalg.svd(jacobian[:, effective], full_matrices=False)
    if sizes[-1] * CONDITION_LIMIT > sizes[0]:
        return set()
    found = {
        names[i]
        for i, part in zip(effective, directions[len(effective) - 1], strict=True)
        if abs(part) > LEAST_PART
    }
    return found if len(found) > 1 else set()  # one alone, which has little effect, is no combination


PRODUCT = ("restitution", "friction")


def _product(x: Array, values: Array, names: tuple[str, ...], covariance: Array) -> Estimate:
    """Estimate ``friction (1 + restitution)``.

    Where the contact slides throughout the impact, tangential velocities and spins afterwards determine only
    this product.
    """
    e, mu = (names.index(name) for name in PRODUCT)
    products = values[:, mu] * (1 + values[:, e])  # infinite where friction has no effect
    low, high = (float(_percentile(products, percent)) for percent in (2.5, 97.5))
    slope = np.zeros(len(names))
    slope[e], slope[mu] = x[mu], 1 + x[e]
    return Estimate(x[mu] * (1 + x[e]), low, high, math.sqrt(slope @ covariance @ slope))


def _undetermined_alone(
    problem: LeastSquares, best: Any, name: str, allowed: float
) -> tuple[Estimate, list[Array]] | None:
    """Return the range that is not ruled out for a coefficient that can have any value, or any above a bound.

    The second part holds the fits at those limits of the range that are not ruled out. Returns ``None`` if
    the impacts determine the coefficient. A value is ruled out if the sum of squares is above ``allowed``
    with the other coefficients fitted.
    """
    (least, most, _), x, i = SEARCH_RANGES[name], best.x, problem.names.index(name)
    at_most = problem.fitted_at(x, name, min(most, LARGE_COEFFICIENT * max(1.0, float(x[i]))))
    if problem.squares(at_most) > allowed:
        return None
    at_least = problem.fitted_at(x, name, least)
    is_open = problem.squares(at_least) <= allowed
    if most < math.inf and not is_open and best.jac[:, i].any():
        return None
    low, high = least, float(x[i])
    for _ in range(0 if is_open else HALVINGS):
        middle = (low + high) / 2
        is_allowed = problem.squares(problem.fitted_at(x, name, middle)) <= allowed
        low, high = (low, middle) if is_allowed else (middle, high)
    estimate = Estimate(math.nan, least if is_open else high, most, math.inf)
    return estimate, [at_least, at_most] if is_open else [at_most]
