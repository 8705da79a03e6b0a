"""The least squares problem: the coefficients with their limits, the residuals, and the search."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterable, Mapping
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from ..batch.arrays import Array
from ..optional import missing
from ..physics.laws import Law
from ..status import ImpactError, StatusCode
from .measurements import Measurements


class Range(NamedTuple):
    """Lower and upper limit of a coefficient, and the values at which a search starts."""

    least: float
    most: float
    starts: tuple[float, ...]


SEARCH_RANGES = {
    "restitution": Range(0.0, 1.0, (0.1, 0.3, 0.5, 0.7, 0.9, 1.0)),  # at 1 MOREAU falls back most often
    "friction": Range(0.0, math.inf, (0.001, 0.03, 0.05, 0.08, 0.13, 0.2, 0.3, 0.45, 0.7, 1.0, 1.5, 2.5)),
    "tangential_restitution": Range(-1.0, 1.0, (-0.5, 0.0, 0.5)),
    "stiffness_ratio": Range(0.05, 20.0, (0.5, 1.0, 3.0)),
}
"""All coefficients that can be fitted: coefficients of a contact, and fields of ``ImpactModel``."""

MAGNIFICATION = 2.0**100
"""Factor on the residuals in SciPy. Its search ends when the gradient is below an absolute limit; with this
factor only a gradient of 0 is."""

PRECISION = 1e-10
"""Relative precision of a fitted coefficient."""

ROUGH_PRECISION = 1e-4
"""Relative precision of the cost in fits that need not be exact: those from several starting points, those of
the bootstrap, and those that tell which values of a coefficient are ruled out. Also how close to a limit a
coefficient must be to be moved onto it."""

LEFT_OVER = 1e-9
"""What a search may leave of a residual, in units of the problem, or of the distance to a limit. SciPy starts
``PRECISION`` inside of a limit."""

NEGLIGIBLE_SQUARES = 1e-12
"""A sum of squares of at most this size, in squared units of the problem, counts as 0."""

LEAST_SQUARES = sys.float_info.min
"""A sum of squares below this has lost digits."""

UNANSWERED_RESIDUAL = 1e6
"""All residuals, in units of the problem, at coefficients with which the law cannot answer some impact."""

LOSSES: dict[str, Callable[[Array], Array]] = {
    "linear": lambda z: z,
    "soft_l1": lambda z: 2 * (np.sqrt(1 + z) - 1),
    "huber": lambda z: np.where(z <= 1, z, 2 * np.sqrt(z) - 1),
    "cauchy": np.log1p,
    "arctan": np.arctan,
}
"""SciPy's loss functions: from a squared residual to its part of the cost, both over the squared scale."""

NORMAL_DEVIATION = 1.4826
"""Standard deviation of normal noise, over the median of its absolute values."""

SAME_SCALE = 0.8
"""A scale that is more than this part of the one before has hardly changed."""

SEARCHES = 4
"""Number of searches, from points with small sums of squares."""


def residual_unit(measured: Measurements, kind: str) -> float:
    """Return a unit for the residuals of one kind.

    It is the root of the sum of the squared residuals without friction, at restitution 0 and 1 together; 1 if
    these are all 0. Unlike the size of the measurements, it is not 0 if all bodies stop, and it is the same
    in a moving frame, unless that is so fast that negligible residuals would be rounding.

    Raises:
        ImpactError: OUT_OF_RANGE if the square of a residual or a measurement is beyond float64, or those of
            all residuals become 0.
    """
    off = [measured.residuals(Law.FRICTIONLESS, {"restitution": e}, kind) for e in (0.0, 1.0)]
    squares = sum(float((one**2).sum()) for one in off)
    if squares < LEAST_SQUARES and any(one.any() for one in off):
        reason = "the measurements are too small: their squares are beyond float64"
        raise ImpactError(StatusCode.OUT_OF_RANGE, "impacts", reason)
    largest = squares + float((measured.sizes(kind) ** 2).sum())
    if not math.isfinite(largest):
        reason = "a measurement is too large: its square is beyond float64"
        raise ImpactError(StatusCode.OUT_OF_RANGE, "impacts", reason)
    rounding = math.sqrt(float((measured.rounding(kind) ** 2).sum()) / NEGLIGIBLE_SQUARES)
    return max(math.sqrt(squares), rounding) or 1.0


class LeastSquares(NamedTuple):
    """A least squares problem, with the arguments of :func:`~collision_response.identify.identify`.

    Attributes:
        measured: the impacts that depend on the coefficients.
        names: the coefficients to fit.
        unit: unit of the residuals, see :func:`residual_unit`.
        scale: size, in units, from which the loss treats a residual as an outlier. 0: no residual is one, and
            the sum of squares itself is minimised.
    """

    measured: Measurements
    law: Law
    names: tuple[str, ...]
    given: Mapping[str, float]
    kind: str
    loss: str
    unit: float
    scale: float = 0.0

    def at(self, x: Iterable[float]) -> dict[str, float]:
        """Return all coefficients by name: the given ones, and ``x`` for the fitted ones."""
        return {**self.given, **dict(zip(self.names, map(float, x), strict=True))}

    def residuals(self, x: Iterable[float]) -> Array:
        """Return the residuals at ``x`` in units of the problem, as a flat array.

        If the law does not follow an impact to its end (PATH_TOO_LONG), all residuals are so large that no
        search stays there.
        """
        try:
            return self.measured.residuals(self.law, self.at(x), self.kind).ravel() / self.unit
        except ImpactError as error:
            if error.code is not StatusCode.PATH_TOO_LONG:
                raise
            return np.full(self.measured.is_measured(self.kind).size, UNANSWERED_RESIDUAL)

    def start(self, *known: Array) -> Array:
        """Return the point where the next search begins: the best of rough solutions from several points.

        They are the ``known`` ones, and some of different frictions: first those in valleys, last those that
        are as good as a smaller one. Where all impacts stick, friction has no effect, and where a law falls
        back to another, its answer jumps. No search leaves such a region.
        """
        squares = {
            place: self.squares(place)
            for place in product(*(SEARCH_RANGES[name].starts for name in self.names))
        }
        chosen = sorted(squares, key=squares.__getitem__)
        if "friction" in self.names:
            i = self.names.index("friction")
            lowest, values = {place[i]: place for place in reversed(chosen)}, SEARCH_RANGES["friction"].starts
            heights = [math.inf, *(squares[lowest[value]] for value in values), math.inf]
            is_valley = {v: heights[k] > heights[k + 1] <= heights[k + 2] for k, v in enumerate(values)}
            is_flat = {v: math.isclose(heights[k], heights[k + 1]) for k, v in enumerate(values)}
            chosen = sorted(
                lowest.values(),
                key=lambda place: (not is_valley[place[i]], is_flat[place[i]], squares[place]),
            )
        places = [*known, *chosen[:SEARCHES]]
        found = (self.solve(np.array(place), ROUGH_PRECISION) for place in places)
        return min(found, key=lambda one: one.cost).x

    def squares(self, x: Iterable[float]) -> float:
        """Return the sum of the squared residuals at ``x``, with outliers reduced by the loss."""
        return float(np.sum(self.reduced(self.residuals(x) ** 2)))

    def reduced(self, squares: Any) -> Any:
        """Return squared residuals, with outliers reduced by the loss."""
        if not self.scale:
            return squares
        return self.scale**2 * LOSSES[self.loss](squares / self.scale**2)

    def best(self, start: Array | None = None) -> tuple[LeastSquares, Any]:
        """Return the problem with its scale set, and SciPy's solution of it.

        The search begins at ``start``; by default, at the best of several rough solutions.

        The scale is taken from the median residual, first of a fit that treats no residual as an outlier.
        Residuals that are 0, or what a search leaves, do not count in the median, because they do not tell
        how noisy the others are: with so small a scale, SciPy would take all others for outliers. Outliers
        lead that fit astray, so that its residuals are too large. Fits with the scale at hand give a smaller
        one, until it hardly changes. From far away "arctan" does not find back; "soft_l1", which is convex,
        does.
        """
        found = self.solve(self.start() if start is None else start)
        if self.loss == "linear":
            return self, found
        scaled = self
        while (noise := abs(found.fun[abs(found.fun) > LEFT_OVER])).size:
            scale = NORMAL_DEVIATION * float(np.median(noise))
            if 0 < SAME_SCALE * scaled.scale < scale:
                break
            scaled = self._replace(loss="soft_l1", scale=scale)
            found = scaled.solve(scaled.start(found.x), ROUGH_PRECISION)
        if not scaled.scale:
            return self, found
        scaled = scaled._replace(loss=self.loss)
        return scaled, scaled.solve(found.x)

    def solve(self, x: Array, precision: float = PRECISION) -> Any:
        """Return SciPy's solution of a search that starts at ``x``.

        The search uses coefficients that are shifted so that their lower limit is 1. SciPy limits its
        first step to the length of the starting point, and a step that is too short would end the search.
        It ends when the relative change of the cost is below ``precision``.
        """
        try:
            from scipy.optimize import least_squares
        except ModuleNotFoundError:
            raise missing("SciPy", "scipy") from None
        least, most = np.array([SEARCH_RANGES[name][:2] for name in self.names]).T
        loss = {"loss": self.loss, "f_scale": MAGNIFICATION * self.scale} if self.scale else {}
        origin = least - 1
        one = least_squares(
            lambda y: MAGNIFICATION * self.residuals(y + origin),
            x - origin,
            bounds=(least - origin, most - origin),
            xtol=PRECISION,
            ftol=precision,
            **loss,
        )
        one.cost = one.cost / MAGNIFICATION**2
        one.grad = one.grad / MAGNIFICATION**2
        one.jac = one.jac / MAGNIFICATION
        one.x = _snap_to_limits(one.x + origin, one, (least, most), precision)
        one.fun = self.residuals(one.x)
        return one

    def best_and_resampled(self, count: int, seed: int) -> tuple[LeastSquares, Any, Array]:
        """Return what :meth:`best` and :meth:`resampled` do.

        A search may end in a hollow of the sum of squares that a fit of the bootstrap leaves: then another
        one begins there.
        """
        problem, best = self.best()
        values = problem.resampled(best.x, count, seed)
        known = values[~np.isnan(values).any(axis=1)]
        nearest = min(known, key=problem.squares, default=best.x)
        if problem.squares(nearest) < (1 - ROUGH_PRECISION) * problem.squares(best.x):
            problem, best = self.best(nearest)
            values = problem.resampled(best.x, count, seed)
        return problem, best, values

    def resampled(self, x: Array, count: int, seed: int) -> Array:
        """Return fits to ``count`` sets of impacts drawn with replacement, one row of coefficients each.

        A coefficient that has no effect on a set of impacts is NaN there.
        """
        rng, n = np.random.default_rng(seed), len(self.measured)
        draws = (rng.integers(n, size=n) for _ in range(count))
        found = (self._replace(measured=self.measured.take(draw)).solve(x, ROUGH_PRECISION) for draw in draws)
        return np.array([np.where(one.jac.any(axis=0), one.x, math.nan) for one in found])

    def fitted_at(self, x: Array, name: str, value: float) -> Array:
        """Return the coefficients that fit best with one of them held; the search starts at ``x``."""
        i = self.names.index(name)
        rest = self._replace(names=self.names[:i] + self.names[i + 1 :], given={**self.given, name: value})
        others = np.delete(x, i)
        return np.insert(rest.solve(others, ROUGH_PRECISION).x if rest.names else others, i, value)


def _snap_to_limits(x: Array, one: Any, limits: Iterable[Array], precision: float) -> Array:
    """Return ``x`` with coefficients moved onto their limits, which SciPy approaches but never reaches.

    A coefficient is moved if the search could not come closer to the limit; or if it is close to it, the next
    step would reach or cross it, and the cost stays the same to the given relative precision.
    """
    curvature = (one.jac**2).sum(axis=0)
    for limit in limits:
        way = np.where(abs(limit - x) < ROUGH_PRECISION, limit - x, 0.0)
        gain = -one.grad * way
        is_there = (gain + PRECISION**2 >= curvature * way**2) & (gain <= precision * one.cost + PRECISION**2)
        x = np.where(is_there | (abs(way) <= LEFT_OVER), x + way, x)
    return x
