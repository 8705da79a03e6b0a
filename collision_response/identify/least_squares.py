"""The least squares: which coefficients, between which limits, of which residuals."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from ..model import Law
from ..status import ImpactError, StatusCode
from .measurements import Array, Measurements


class Range(NamedTuple):
    """The limits of a coefficient, and the values from which its search starts."""

    least: float
    most: float
    starts: tuple[float, ...]


RANGES = {
    "restitution": Range(0.0, 1.0, (0.1, 0.3, 0.5, 0.7, 0.9)),
    "friction": Range(0.0, math.inf, (0.03, 0.1, 0.3, 1.0)),
    "tangential_restitution": Range(-1.0, 1.0, (-0.5, 0.0, 0.5)),
    "stiffness_ratio": Range(0.05, 20.0, (0.5, 1.0, 3.0)),
}
"""THE coefficients that can be fitted: those of a contact, and fields of ``ImpactModel``."""

MAGNIFICATION = 2.0**100
"""SciPy ends a search at an absolute gradient: of residuals so much larger none but 0 is too small."""

PRECISION = 1e-10
"""Relative precision to which a coefficient is found."""

ROUGH_PRECISION = 1e-4
"""The relative precision of the cost of a first fit, of those of the bootstrap, and of what is ruled out."""

ROUNDING = 1e-13
"""A residual up to this size, in units, counts as rounding of 0."""

NEGLIGIBLE_SQUARES = 1e-12
"""A sum of squares up to this size, in units, counts as 0."""

UNANSWERED_RESIDUAL = 1e6
"""The residual, in units, of impacts that the law cannot answer."""

LOSSES: dict[str, Callable[[Array], Array]] = {
    "linear": lambda z: z,
    "soft_l1": lambda z: 2 * (np.sqrt(1 + z) - 1),
    "huber": lambda z: np.where(z <= 1, z, 2 * np.sqrt(z) - 1),
    "cauchy": np.log1p,
    "arctan": np.arctan,
}
"""What the square of a residual counts, both in parts of the scale's: the losses of SciPy."""

SEARCHES = 4
"""Number of starting points, the best ones, from which a search starts."""


def residual_unit(measured: Measurements, kind: str) -> float:
    """How far bodies are off that have no friction and stop or bounce fully: the root of the sum of squares.

    Unlike what was measured it is not 0 for bodies that stop, and the same in a frame that moves along.
    """
    off = (measured.residuals(Law.FRICTIONLESS, {"restitution": e}, kind) for e in (0.0, 1.0))
    return math.sqrt(sum((one**2).sum() for one in off)) or 1.0


class LeastSquares(NamedTuple):
    """What is minimised.

    Attributes:
        measured: impacts that say anything.
        law, names, given, kind, loss: see :func:`identify`.
        unit: of the residuals, see :func:`residual_unit`.
        scale: a residual above this counts as an outlier; 0: none does.
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
        """All coefficients, with those fitted at ``x``."""
        return {**self.given, **dict(zip(self.names, map(float, x), strict=True))}

    def residuals(self, x: Iterable[float]) -> Array:
        """All of them, one after the other, in parts of the unit; beyond all measure where the law does not
        follow an impact to its end, so that no search stays there."""
        try:
            return self.measured.residuals(self.law, self.at(x), self.kind).ravel() / self.unit
        except ImpactError as error:
            if error.code is not StatusCode.PATH_TOO_LONG:
                raise
            return np.full(self.measured.is_measured(self.kind).size, UNANSWERED_RESIDUAL)

    def start(self) -> Array:
        """Where the search begins: a rough solution, the best of those from several places."""
        places = sorted(product(*(RANGES[name].starts for name in self.names)), key=self.squares)
        found = (self.solve(np.array(place), ROUGH_PRECISION) for place in places[:SEARCHES])
        return min(found, key=lambda one: one.cost).x

    def squares(self, x: Iterable[float]) -> float:
        """The sum of the squares of the residuals; of outliers what the loss leaves of them."""
        squares = self.residuals(x) ** 2
        if self.scale:
            squares = self.scale**2 * LOSSES[self.loss](squares / self.scale**2)
        return float(squares.sum())

    def best(self) -> tuple[LeastSquares, Any]:
        """With the scale of the middle residual of a fit that knows no outliers; and the solution.

        Residuals that are 0 do not say how noisy the others are.
        """
        first = self.solve(self.start())
        noise = abs(first.fun[abs(first.fun) > ROUNDING])
        if self.loss == "linear" or not noise.size:
            return self, first
        scaled = self._replace(scale=1.4826 * float(np.median(noise)))
        return scaled, scaled.solve(first.x)

    def solve(self, x: Array, precision: float = PRECISION) -> Any:
        """SciPy's solution, from ``x`` on, to a relative precision of its cost.

        The search is of coefficients whose lower limit is 1: SciPy's first step is no longer than what it
        begins with, and one that is too short ends it.
        """
        least, most = np.array([RANGES[name][:2] for name in self.names]).T
        loss = {"loss": self.loss, "f_scale": MAGNIFICATION * self.scale} if self.scale else {}
        origin = least - 1
        ends: dict[str, Any] = {
            "bounds": (least - origin, most - origin),
            "xtol": PRECISION,
            "ftol": precision,
        }
        one = _least_squares()(
            lambda y: MAGNIFICATION * self.residuals(y + origin), x - origin, **ends, **loss
        )
        one.cost, one.grad, one.jac = (
            one.cost / MAGNIFICATION**2,
            one.grad / MAGNIFICATION**2,
            one.jac / MAGNIFICATION,
        )
        one.x = _snap_to_limits(one.x + origin, one, (least, most), precision)
        one.fun = self.residuals(one.x)
        return one

    def resampled(self, x: Array, count: int, seed: int) -> Array:
        """Rows of coefficients that fit impacts drawn with replacement; one without effect is at its most."""
        rng, n, most = (
            np.random.default_rng(seed),
            len(self.measured),
            [RANGES[name].most for name in self.names],
        )
        draws = (rng.integers(n, size=n) for _ in range(count))
        found = (self._replace(measured=self.measured.take(draw)).solve(x, ROUGH_PRECISION) for draw in draws)
        return np.array([np.where(one.jac.any(axis=0), one.x, most) for one in found])

    def squares_at_fixed(self, x: Array, name: str, value: float) -> float:
        """The least sum of squares with one coefficient held."""
        i = self.names.index(name)
        rest = self._replace(names=self.names[:i] + self.names[i + 1 :], given={**self.given, name: value})
        others = np.delete(x, i)
        return rest.squares(rest.solve(others, ROUGH_PRECISION).x if rest.names else ())


def _snap_to_limits(x: Array, one: Any, limits: Iterable[Array], precision: float) -> Array:
    """``x``, at the limits that SciPy only comes near: where the next step would lead there or beyond, and
    the cost is as good as the same."""
    curvature = (one.jac**2).sum(axis=0)
    for limit in limits:
        way = np.where(abs(limit - x) < ROUGH_PRECISION, limit - x, 0.0)
        gain = -one.grad * way
        is_there = (gain + PRECISION**2 >= curvature * way**2) & (gain <= precision * one.cost + PRECISION**2)
        x = np.where(is_there, x + way, x)
    return x


def _least_squares() -> Any:
    try:
        from scipy.optimize import least_squares
    except ImportError:
        raise ImportError("to identify coefficients needs SciPy: pip install scipy") from None
    return least_squares
