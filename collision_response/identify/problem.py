"""The least squares: which coefficients, between which limits, of which residuals."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from itertools import product
from typing import Any, NamedTuple

import numpy as np

from ..model import Law
from ..status import ImpactError, StatusCode
from .measured import Array, Measured


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

INSIDE = 1e-3
"""The search begins this far from the limits."""

ROUGHLY = 1e-4
"""The relative precision of a first fit, and of those of the bootstrap."""

ALIKE = 1e-12
"""A sum of squares this small, relative to that of what was measured, is as good as 0."""

BEYOND = 1e6
"""A residual this many times what was measured is that of no answer."""

PLACES = 4
"""From so many of the starts there is a search."""


class Problem(NamedTuple):
    """What is minimised.

    Attributes:
        measured: impacts that approach.
        law, names, given, kind, loss: see :func:`identify`.
        scale: a residual above this counts as an outlier; 0: none does.
    """

    measured: Measured
    law: Law
    names: tuple[str, ...]
    given: Mapping[str, float]
    kind: str
    loss: str
    scale: float = 0.0

    def at(self, x: Iterable[float]) -> dict[str, float]:
        """All coefficients, with those fitted at ``x``."""
        return {**self.given, **dict(zip(self.names, map(float, x), strict=True))}

    def residuals(self, x: Iterable[float]) -> Array:
        """All of them, one after the other; beyond all measure where the law does not follow an impact to its
        end, so that no search stays there."""
        try:
            return self.measured.residuals(self.law, self.at(x), self.kind).ravel()
        except ImpactError as error:
            if error.code is not StatusCode.PATH_TOO_LONG:
                raise
            sizes = self.measured.sizes(self.kind).ravel()
            return np.full(sizes.shape, BEYOND * abs(sizes).max())

    def start(self) -> Array:
        """Where the search begins: a rough solution, the best of those from several places."""
        places = sorted(product(*(RANGES[name].starts for name in self.names)), key=self._squares)
        found = (self.solve(np.array(place), ROUGHLY) for place in places[:PLACES])
        return min(found, key=lambda one: one.cost).x

    def _squares(self, x: Iterable[float]) -> float:
        return float((self.residuals(x) ** 2).sum())

    def best(self) -> tuple[Problem, Any]:
        """With the scale of the middle residual of a fit that knows no outliers; and the solution."""
        x = self.start()
        sizes = abs(self.residuals(x))
        if self.loss == "linear" or not sizes.any():
            return self, self.solve(x)
        scaled = self._replace(scale=1.4826 * float(np.median(sizes[sizes > 0])))
        return scaled, scaled.solve(x)

    def solve(self, x: Array, precision: float = 1e-10) -> Any:
        """SciPy's solution, from ``x`` on, to a relative precision of its coefficients and of its cost."""
        least, most = np.array([RANGES[name][:2] for name in self.names]).T
        loss = {"loss": self.loss, "f_scale": self.scale} if self.scale else {}
        inside = np.clip(x, least + INSIDE, most - INSIDE)
        ends: dict[str, Any] = {"bounds": (least, most), "xtol": precision, "ftol": precision}
        return _least_squares()(self.residuals, inside, **ends, **loss)

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
        return rest._squares(rest.solve(others).x if rest.names else ())


def _least_squares() -> Any:
    try:
        from scipy.optimize import least_squares
    except ImportError:
        raise ImportError("to identify coefficients needs SciPy: pip install scipy") from None
    return least_squares
