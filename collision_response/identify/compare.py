"""Compare how well laws fit measured impacts, and say which laws the impacts cannot distinguish."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from ..arguments import as_list
from ..physics.laws import Law
from ..status import ImpactError, StatusCode
from .identification import FITTED_LAWS, Identification, identify, names_to_fit
from .least_squares import LOSSES, NEGLIGIBLE_SQUARES, residual_unit
from .measurements import Measurements, informative

RESAMPLES = 4000

ROUNDED = 1e-6
"""An excess up to this is no difference: COMPLIANT and friction in space are computed to 1e-9 or so."""


class Excess(NamedTuple):
    """Relative excess of a law's sum of squares over that of the best law, both with outliers reduced.

    Attributes:
        value: the excess; 0.1 means that the sum is 10 % larger.
        low, high: 95 % interval of the bootstrap.
    """

    value: float
    low: float
    high: float


class Comparison(NamedTuple):
    """Fits of several laws to the same impacts.

    Attributes:
        fits: the fit of each law, the best law first.
        excess: how much worse each law except the best one is.
        candidates: the best law, and the laws that these impacts cannot distinguish from it.
    """

    fits: dict[Law, Identification]
    excess: dict[Law, Excess]
    candidates: tuple[Law, ...]

    def __str__(self) -> str:
        best, *others = self.fits
        lines = [f"{best.name}: misfit {self.fits[best].misfit:.1%}"]
        for law in others:
            value, low, high = self.excess[law]
            verdict = "cannot tell" if law in self.candidates else "worse"
            squares = f"sum of squares {value:+.1%} [{low:+.1%}, {high:+.1%}]"
            lines.append(f"{law.name}: misfit {self.fits[law].misfit:.1%}, {squares}: {verdict}")
        return "\n".join(lines)


def compare(
    measured: Measurements,
    laws: Sequence[Law] | None = None,
    fit: Sequence[str] = (),
    given: Mapping[str, float] | None = None,
    *,
    loss: str = "soft_l1",
    seed: int = 0,
    **options: Any,
) -> Comparison:
    """Fit several laws to the same impacts, and find out which ones the impacts distinguish.

    The interval of an excess comes from a bootstrap over the impacts, in which each law keeps the
    coefficients that fit all impacts. If it reaches down to 0, but for rounding, the impacts do not
    distinguish the law from the best one.

    Args:
        measured: the impacts, as for :func:`~collision_response.identify.identify`.
        laws: the laws to compare, at least one. Default: all that have a coefficient to fit.
        fit, given: as for :func:`~collision_response.identify.identify`.
        loss: loss function of the fits. It also reduces the sums of squares of impacts to which no law comes
            near, which would otherwise hide what the other impacts say.
        seed: seed of the random numbers of all bootstraps.
        options: the other arguments of :func:`~collision_response.identify.identify`.

    Raises:
        ImpactError: as :func:`~collision_response.identify.identify`, or INVALID_MODEL if there are no laws.
        ImportError: as :func:`~collision_response.identify.identify`.
    """
    fit, given = as_list("fit", fit), {} if given is None else given
    if laws is None:
        laws = [law for law in FITTED_LAWS if names_to_fit(law, fit, given)] or FITTED_LAWS
    laws = as_list("laws", laws)
    if not laws:
        raise ImpactError(StatusCode.INVALID_MODEL, "laws", "must name a law, is empty")
    fits = {law: identify(measured, law, fit, given, loss=loss, seed=seed, **options) for law in laws}
    kind, n = fits[laws[0]].kind, len(fits[laws[0]].squares)
    unit = residual_unit(informative(measured, kind), kind)
    squares = {law: fit.squares + NEGLIGIBLE_SQUARES * unit**2 / n for law, fit in fits.items()}
    scale = min(map(np.median, squares.values()))
    costs = {law: LOSSES[loss](one / scale) for law, one in squares.items()}
    fits = dict(sorted(fits.items(), key=lambda item: float(costs[item[0]].sum())))
    best, *others = fits
    draws = np.random.default_rng(seed).integers(n, size=(RESAMPLES, n))
    least = costs[best]
    excess = {}
    for law in others:
        ratios = costs[law][draws].sum(axis=1) / least[draws].sum(axis=1)
        low, high = map(float, np.percentile(ratios - 1, (2.5, 97.5)))
        excess[law] = Excess(float(costs[law].sum() / least.sum() - 1), low, high)
    return Comparison(fits, excess, (best, *(law for law in others if excess[law].low <= ROUNDED)))
