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
    """What a coefficient can be, and where its search begins."""

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

MAGNIFIED = 2.0**100
"""SciPy ends a search at an absolute gradient: of residuals so much larger none but 0 is too small."""

PRECISE = 1e-10
"""So near a coefficient is found."""

ROUGHLY = 1e-4
"""The relative precision of the cost of a first fit, of those of the bootstrap, and of what is ruled out."""

ROUNDED = 1e-13
"""A residual this small, in units, is what rounding leaves of 0."""

ALIKE = 1e-12
"""A sum of squares this small, in units, is as good as 0."""

BEYOND = 1e6
"""A residual of so many units is that of no answer."""

COST: dict[str, Callable[[Array], Array]] = {
    "linear": lambda z: z,
    "soft_l1": lambda z: 2 * (np.sqrt(1 + z) - 1),
    "huber": lambda z: np.where(z <= 1, z, 2 * np.sqrt(z) - 1),
    "cauchy": np.log1p,
    "arctan": np.arctan,
}
"""What the square of a residual counts, both in parts of the scale's: the losses of SciPy."""

PLACES = 4
"""From so many of the starts there is a search."""


def unit_of(measured: Measurements, kind: str) -> float:
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
        unit: of the residuals, see :func:`unit_of`.
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
            return np.full(self.measured.counts(self.kind).size, BEYOND)

    def start(self) -> Array:
        """Where the search begins: a rough solution, the best of those from several places."""
        places = sorted(product(*(RANGES[name].starts for name in self.names)), key=self.squares)
        found = (self.solve(np.array(place), ROUGHLY) for place in places[:PLACES])
        return min(found, key=lambda one: one.cost).x

    def squares(self, x: Iterable[float]) -> float:
        """The sum of the squares of the residuals; of outliers what the loss leaves of them."""
        squares = self.residuals(x) ** 2
        if self.scale:
            squares = self.scale**2 * COST[self.loss](squares / self.scale**2)
        return float(squares.sum())

    def best(self) -> tuple[LeastSquares, Any]:
        """With the scale of the middle residual of a fit that knows no outliers; and the solution.

        Residuals that are 0 do not say how noisy the others are.
        """
        first = self.solve(self.start())
        noise = abs(first.fun[abs(first.fun) > ROUNDED])
        if self.loss == "linear" or not noise.size:
            return self, first
        scaled = self._replace(scale=1.4826 * float(np.median(noise)))
        return scaled, scaled.solve(first.x)

    def solve(self, x: Array, precision: float = PRECISE) -> Any:
        """SciPy's solution, from ``x`` on, to a relative precision of its cost.

        The search is of coefficients whose lower limit is 1: SciPy's first step is no longer than what it
        begins with, and one that is too short ends it.
        """
        least, most = np.array([RANGES[name][:2] for name in self.names]).T
        loss = {"loss": self.loss, "f_scale": MAGNIFIED * self.scale} if self.scale else {}
        origin = least - 1
        ends: dict[str, Any] = {"bounds": (least - origin, most - origin), "xtol": PRECISE, "ftol": precision}
        one = _least_squares()(lambda y: MAGNIFIED * self.residuals(y + origin), x - origin, **ends, **loss)
        one.cost, one.grad, one.jac = one.cost / MAGNIFIED**2, one.grad / MAGNIFIED**2, one.jac / MAGNIFIED
        one.x = _at_limits(one.x + origin, one, (least, most), precision)
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
        found = (self._replace(measured=self.measured.take(draw)).solve(x, ROUGHLY) for draw in draws)
        return np.array([np.where(one.jac.any(axis=0), one.x, most) for one in found])

    def squares_with(self, x: Array, name: str, value: float) -> float:
        """The least sum of squares with one coefficient held."""
        i = self.names.index(name)
        rest = self._replace(names=self.names[:i] + self.names[i + 1 :], given={**self.given, name: value})
        others = np.delete(x, i)
        return rest.squares(rest.solve(others, ROUGHLY).x if rest.names else ())


def _at_limits(x: Array, one: Any, limits: Iterable[Array], precision: float) -> Array:
    """``x``, at the limits that SciPy only comes near: where the next step would lead there or beyond, and
    the cost is as good as the same."""
    curvature = (one.jac**2).sum(axis=0)
    for limit in limits:
        way = np.where(abs(limit - x) < ROUGHLY, limit - x, 0.0)
        gain = -one.grad * way
        is_there = (gain + PRECISE**2 >= curvature * way**2) & (gain <= precision * one.cost + PRECISE**2)
        x = np.where(is_there, x + way, x)
    return x


def _least_squares() -> Any:
    try:
        from scipy.optimize import least_squares
    except ImportError:
        raise ImportError("to identify coefficients needs SciPy: pip install scipy") from None
    return least_squares
