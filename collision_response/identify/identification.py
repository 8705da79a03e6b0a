"""Coefficients of a law from measured impacts, by robust least squares."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from numbers import Integral
from typing import NamedTuple

from ..model import ImpactModel, Law, check_number
from ..status import ImpactError, StatusCode
from .estimates import Estimate, estimates, undetermined
from .least_squares import LOSSES, NEGLIGIBLE_SQUARES, PRECISION, RANGES, LeastSquares, residual_unit
from .measurements import Array, Measurements, informative

FEW_IMPACTS = 10
"""Of fewer impacts the bootstrap says little."""

DISAGREEMENT = 3.0
"""Residuals of two kinds that lead this many formal deviations apart have more than noise in them."""


class Identification(NamedTuple):
    """What was found.

    Attributes:
        law: that was fitted.
        values: of all coefficients at the best fit, given ones too; one that is not determined is as good
            as others.
        kind: of the residuals.
        coefficients: by name.
        combination: ``friction (1 + restitution)``, where the impacts determine it and not the two apart.
        others: the values that residuals of other kinds lead to, by kind and name, where they determine it.
        misfit: root of the sum of squares of the residuals, over that of what was measured.
        squares: sum of squares of each impact's residuals; those that separate, and those after which
            nothing was measured that tells anything, are left out. Shape ``(N,)``.
        resampled: the coefficients of each fit of the bootstrap, a row each.
        notes: what a person should know, in words.
    """

    law: Law
    values: dict[str, float]
    kind: str
    coefficients: dict[str, Estimate]
    combination: Estimate | None
    others: dict[str, dict[str, float]]
    misfit: float
    squares: Array
    resampled: Array
    notes: tuple[str, ...]

    def __str__(self) -> str:
        lines = [
            f"{self.law.name}, {len(self.squares)} impacts, residuals {self.kind}: misfit {self.misfit:.1%}"
        ]
        lines += [f"  {name} {estimate}" for name, estimate in self.coefficients.items()]
        if self.combination is not None:
            lines.append(f"  friction (1 + restitution) {self.combination}")
        for kind, values in self.others.items():
            told = ", ".join(f"{name} = {value:.4g}" for name, value in values.items())
            lines.append(f"  residuals {kind}: {told}")
        return "\n".join([*lines, *(f"  note: {note}" for note in self.notes)])


def identify(
    measured: Measurements,
    law: Law = Law.COULOMB,
    fit: Sequence[str] = (),
    given: Mapping[str, float] | None = None,
    *,
    kind: str = "",
    loss: str = "soft_l1",
    resamples: int = 200,
    seed: int = 0,
) -> Identification:
    """The coefficients by which a law comes nearest to measured impacts.

    Args:
        measured: :class:`~collision_response.identify.Impacts` or
            :class:`~collision_response.identify.SphereReadings`.
        law: not AUTO.
        fit: what to fit: "restitution", "friction", "tangential_restitution", "stiffness_ratio" of COMPLIANT.
            Left out: restitution, and friction if the law has any; those of them that are not given.
        given: the coefficients that are known, by name, none of them in ``fit``; what is neither fitted nor
            given is 0, restitution 1.
        kind: of the residuals, one of ``measured.kinds``; left out, the first.
        loss: of SciPy's ``least_squares``. All but "linear" are robust against outliers.
        resamples: fits of the bootstrap, >= 2.
        seed: of the bootstrap.

    Raises:
        ImpactError: INVALID_TABLE: too few impacts, or nothing but separating ones, or nothing was measured
            after them. INVALID_MODEL: no such law, coefficient, kind or loss; a coefficient twice, fitted
            and given, or none to fit; ``resamples`` < 2. INVALID_COEFFICIENT: a given one is out of range.
        TypeError: ``resamples`` is no whole number.
        ImportError: SciPy is not installed.
    """
    given, kind = dict(given or {}), kind or measured.kinds[0]
    usual = ("restitution",) if law is Law.FRICTIONLESS else ("restitution", "friction")
    fit = tuple(fit) or tuple(name for name in usual if name not in given)
    _check(measured, law, fit, given, kind, loss, resamples)
    used = _informative_impacts(measured, kind, len(fit))
    unit = residual_unit(used, kind)
    given = {"restitution": 1.0, "friction": 0.0} | given
    problem, best = LeastSquares(used, law, fit, given, kind, loss, unit).best()
    resampled = problem.resampled(best.x, resamples, seed)
    coefficients, combination = estimates(problem, best, resampled)
    others = dict(_fits_to_other_residuals(problem))
    squares = (used.residuals(law, problem.at(best.x), kind) ** 2).sum(axis=0)
    whole = max((used.sizes(kind) ** 2).sum(), NEGLIGIBLE_SQUARES * unit**2)  # bodies may stop
    misfit = math.sqrt(squares.sum() / whole)
    notes = _notes(measured, len(used), coefficients, others)
    return Identification(
        law,
        problem.at(best.x),
        kind,
        coefficients,
        combination,
        others,
        misfit,
        squares,
        resampled,
        tuple(notes),
    )


def _check(
    measured: Measurements,
    law: Law,
    fit: tuple[str, ...],
    given: Mapping[str, float],
    kind: str,
    loss: str,
    resamples: int,
) -> None:
    if not isinstance(resamples, (int, Integral)):
        raise TypeError(f"resamples: must be a whole number, is {resamples!r}")
    here = {"restitution", "friction", *ImpactModel._fields}.intersection(RANGES)
    for field, value, known in (
        ("law", law, [one for one in Law if one is not Law.AUTO]),
        ("kind", kind, measured.kinds),
        ("loss", loss, LOSSES),
        *(("fit", name, here) for name in fit),
        *(("given", name, here) for name in given),
    ):
        if value not in known:
            names = ", ".join(str(getattr(one, "name", one)) for one in known)
            raise ImpactError(StatusCode.INVALID_MODEL, field, f"must be one of {names}; is {value!r}")
    for field, wrong in (
        ("fit", "" if fit else f"must name a coefficient: {' and '.join(given)} of {law.name} are given"),
        *(("fit", f"has {name} twice") for name in set(fit) if fit.count(name) > 1),
        *(("given", f"has {name}, which is to be fitted") for name in fit if name in given),
        ("resamples", "" if resamples >= 2 else f"must be at least 2, is {resamples}"),
    ):
        if wrong:
            raise ImpactError(StatusCode.INVALID_MODEL, field, wrong)
    for name, value in given.items():
        least, most, *_ = RANGES[name]
        check_number(f"given.{name}", value, least, most, StatusCode.INVALID_COEFFICIENT)


def _informative_impacts(measured: Measurements, kind: str, count: int) -> Measurements:
    """The impacts that say anything."""
    used = informative(measured, kind)
    if len(used) > count:
        return used
    approaching = int(measured.approaching().sum())
    if approaching > count and not len(used):
        reason = f"nothing was measured after them that tells anything by residuals {kind}"
        raise ImpactError(StatusCode.INVALID_TABLE, "impacts", reason)
    of_all = f"{approaching} of {len(measured)} impacts approach, and {len(used)} of these tell anything"
    reason = f"must be more than {count}, the number of coefficients to fit: {of_all}"
    raise ImpactError(StatusCode.INVALID_TABLE, "impacts", reason)


def _fits_to_other_residuals(problem: LeastSquares) -> Iterator[tuple[str, dict[str, float]]]:
    """What residuals of other kinds lead to, where they determine anything."""
    for kind in problem.measured.kinds:
        used = informative(problem.measured, kind)
        if kind == problem.kind or len(used) <= len(problem.names):
            continue
        other, nearest = problem._replace(
            measured=used, kind=kind, unit=residual_unit(used, kind), scale=0.0
        ).best()
        values, unknown = other.at(nearest.x), undetermined(other, nearest)
        known = {name: values[name] for name in problem.names if name not in unknown}
        if known:
            yield kind, known


def _notes(
    measured: Measurements,
    used: int,
    coefficients: Mapping[str, Estimate],
    others: Mapping[str, Mapping[str, float]],
) -> Iterator[str]:
    """What a person should know."""
    approaching = int(measured.approaching().sum())
    if separating := len(measured) - approaching:
        yield f"{separating} impacts separate, and do not count"
    if unmeasured := approaching - used:
        yield f"{unmeasured} impacts do not count: nothing was measured after them that tells anything"
    if used < FEW_IMPACTS:
        yield f"{used} impacts are few: the intervals say little"
    for name, (value, low, high, formal) in coefficients.items():
        if math.isnan(value):
            continue
        formal = max(formal, PRECISION)  # what was made without noise is known no better
        if value in RANGES[name][:2]:
            yield f"{name} is at its limit: what was measured is there, or beyond it by law or error"
        if high - low > 2 * 2 * 1.96 * formal:
            yield f"{name}: the formal interval is {(high - low) / (2 * 1.96 * formal):.1f} times too small"
        apart = max((abs(values[name] - value) for values in others.values() if name in values), default=0.0)
        if apart > DISAGREEMENT * formal:
            yield (
                f"{name}: residuals of other kinds lead {apart:.2g} away, {apart / formal:.0f} formal "
                "deviations: geometry, law or noise of the normals are in it, and no interval here holds that"
            )
