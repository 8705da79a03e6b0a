"""Fit the coefficients of a law to measured impacts by robust least squares."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from ..arguments import as_list, check_count, check_mapping, check_number
from ..batch.arrays import Array, compared_by_identity
from ..materials import RANGES
from ..physics.laws import Law
from ..status import ImpactError, StatusCode, format_value
from .estimates import DEVIATIONS, Estimate, estimates, formal_deviations, undetermined
from .least_squares import LOSSES, NEGLIGIBLE_SQUARES, PRECISION, SEARCH_RANGES, LeastSquares, residual_unit
from .measurements import Impacts, Measurements, informative

FITTED_LAWS = tuple(law for law in Law if law is not Law.AUTO)
"""The laws that can be fitted."""

FEW_IMPACTS = 10
"""With fewer impacts than this, the intervals of the bootstrap say little."""

MOST_RESAMPLES = 100_000
"""Greatest number of fits of the bootstrap, which are all kept."""

HUGE_CHANGE = 1e6
"""A change so many times as large as the median is rather a mark for a missing number. No loss function keeps
it from hiding the others."""

LARGE_MISFIT = 0.1
"""A misfit above this may have a cause that no law is to blame for, such as wrong units."""

DISAGREEMENT = 3.0
"""If two kinds of residuals lead to values more formal standard deviations apart than this, the cause is not
only noise."""


@compared_by_identity
class Identification(NamedTuple):
    """A law fitted to measured impacts.

    Attributes:
        law: the fitted law.
        values: all coefficients at the best fit, including the given ones. The value of a coefficient that
            the impacts do not determine is one of many that fit equally well.
        kind: the kind of residuals that was fitted.
        coefficients: an estimate of each fitted coefficient, by name.
        combination: estimate of ``friction (1 + restitution)`` if the impacts determine this product but
            neither factor; else ``None``.
        others: by kind and name, the values that other kinds of residuals lead to, if they determine them.
        misfit: root of the sum of squared residuals, divided by that of the changes by the impacts; for
            readings of spheres, by that of the readings.
        squares: sum of squared residuals of each impact, shape ``(N,)``. Impacts that separate, and impacts
            without a useful measurement after them, are left out.
        resampled: fitted coefficients of each resample of the bootstrap, one row each; NaN where one has no
            effect.
        notes: remarks for the user, as text.
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
            fitted = ", ".join(f"{name} = {value:.4g}" for name, value in values.items())
            lines.append(f"  residuals {kind}: {fitted}")
        return "\n".join([*lines, *(f"  note: {note}" for note in self.notes)])


@np.errstate(over="ignore", invalid="ignore")  # a square beyond float64 is refused
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
    """Find the coefficients with which a law comes closest to measured impacts.

    Args:
        measured: the impacts, as :class:`~collision_response.identify.Impacts` or
            :class:`~collision_response.identify.SphereReadings`.
        law: any law except AUTO.
        fit: names of the coefficients to fit: "restitution", "friction", "tangential_restitution", or
            "stiffness_ratio", which belongs to COMPLIANT and is sought from 0.05 to 20. Default: restitution,
            and friction if the law has friction, without those in ``given``.
        given: known coefficients, by name, none of them in ``fit``. If they are neither fitted nor given,
            restitution is 1, friction is 0 and the others are as in a default
            :class:`~collision_response.ImpactModel`.
        kind: kind of the residuals, one of ``measured.kinds``. Default: the first.
        loss: loss function of SciPy's ``least_squares``. All except "linear" are robust against outliers, up
            to a million times as large as the rest. They act on each component, so the axes of the world have
            an effect, well below the noise.
        resamples: number of fits of the bootstrap, from 2 to 100,000.
        seed: seed of the random numbers of the bootstrap, >= 0.

    Raises:
        ImpactError: INVALID_TABLE if there are too few impacts that approach and have a useful measurement
            after them. INVALID_MODEL if the law, the kind, the loss or the name of a coefficient is unknown,
            a coefficient is in ``fit`` twice or in both ``fit`` and ``given``, none is to be fitted, or
            ``resamples`` or ``seed`` is out of range. INVALID_COEFFICIENT if a given coefficient is out of
            range. Other codes if the law cannot answer an impact.
        TypeError: if ``resamples`` or ``seed`` is not a whole number, or another argument has the wrong type.
        ImportError: if SciPy is not installed.
    """
    if not hasattr(measured, "kinds"):
        raise TypeError(f"measured: must be Impacts or SphereReadings, is {format_value(measured)}")
    given, kind = {} if given is None else given, kind or measured.kinds[0]
    fit = names_to_fit(law, fit, given)
    _check(measured, law, fit, given, kind, loss, resamples, seed)
    used = _informative_impacts(measured, kind, len(fit))
    unit = residual_unit(used, kind)
    given = {"restitution": 1.0, "friction": 0.0} | dict(given)
    problem = LeastSquares(used, law, fit, given, kind, loss, unit)
    problem, best, resampled = problem.best_and_resampled(resamples, seed)
    coefficients, combination = estimates(problem, best, resampled)
    fits = list(_fits_to_other_residuals(problem, best))
    others = {kind: values for kind, values, _ in fits}
    values = problem.at(best.x)
    squares = (used.residuals(law, values, kind) ** 2).sum(axis=0)
    least = NEGLIGIBLE_SQUARES * unit**2  # not 0 even if nothing changes
    changes = (used.changes(kind) ** 2).sum(axis=0)
    whole = max(changes.sum(), least)
    misfit = math.sqrt(squares.sum() / whole)
    notes = [*_notes(measured, len(used), coefficients, fits), *_huge_changes(changes)]
    if isinstance(used, Impacts) and misfit > LARGE_MISFIT:
        notes += _faults(used, kind, misfit, math.sqrt(whole))
    fitted = law, values, kind, coefficients, combination, others
    return Identification(*fitted, misfit, squares, resampled, tuple(notes))


def names_to_fit(law: Law, fit: Sequence[str], given: Mapping[str, float]) -> tuple[str, ...]:
    """Return the names of the coefficients to fit, which are those in ``fit`` if there are any."""
    usual = ("restitution",) if law is Law.FRICTIONLESS else ("restitution", "friction")
    check_mapping("given", given)
    return tuple(as_list("fit", fit)) or tuple(name for name in usual if name not in given)


def _check(
    measured: Measurements,
    law: Law,
    fit: tuple[str, ...],
    given: Mapping[str, float],
    kind: str,
    loss: str,
    resamples: int,
    seed: int,
) -> None:
    check_count("resamples", resamples, 2, MOST_RESAMPLES)
    check_count("seed", seed, 0, math.inf)
    for field, value, known in (
        ("law", law, FITTED_LAWS),
        ("kind", kind, measured.kinds),
        ("loss", loss, tuple(LOSSES)),
        *(("fit", name, tuple(SEARCH_RANGES)) for name in fit),
        *(("given", name, tuple(SEARCH_RANGES)) for name in given),
    ):
        if not isinstance(value, type(known[0])) or value not in known:
            names = ", ".join(str(getattr(one, "name", one)) for one in known)
            reason = f"must be one of {names}; is {format_value(value)}"
            raise ImpactError(StatusCode.INVALID_MODEL, field, reason)
    if not fit:
        reason = f"must name a coefficient: those of {law.name} are given: {', '.join(given)}"
        raise ImpactError(StatusCode.INVALID_MODEL, "fit", reason)
    for name in fit:
        if fit.count(name) > 1:
            raise ImpactError(StatusCode.INVALID_MODEL, "fit", f"has {name} twice")
        if name in given:
            raise ImpactError(StatusCode.INVALID_MODEL, "given", f"has {name}, which is to be fitted")
    for name, value in given.items():
        check_number(f"given.{name}", value, *RANGES[name], StatusCode.INVALID_COEFFICIENT)


def _informative_impacts(measured: Measurements, kind: str, count: int) -> Measurements:
    """Return the impacts that depend on the coefficients, if they are more than the ``count`` to fit."""
    used = informative(measured, kind)
    if len(used) > count:
        return used
    approaching = int(measured.approaching().sum())
    if approaching > count and not len(used):
        reason = f"no measurement after them depends on the coefficients, by residuals {kind}"
        raise ImpactError(StatusCode.INVALID_TABLE, "impacts", reason)
    of_all = f"{approaching} of {len(measured)} impacts approach, and {len(used)} of these are informative"
    reason = f"must be more than {count}, the number of coefficients to fit: {of_all}"
    raise ImpactError(StatusCode.INVALID_TABLE, "impacts", reason)


OtherFit = tuple[str, dict[str, float], dict[str, float]]
"""A kind of residuals, the coefficients that it determines, and their formal standard deviations."""


def _fits_to_other_residuals(problem: LeastSquares, best: Any) -> Iterator[OtherFit]:
    """Yield the fits to the other kinds of residuals that determine any coefficients."""
    for kind in problem.measured.kinds:
        used = informative(problem.measured, kind)
        if kind == problem.kind or len(used) <= len(problem.names):
            continue
        other = problem._replace(measured=used, kind=kind, unit=residual_unit(used, kind), scale=0.0)
        other, nearest = other.best(min(other.start(), best.x, key=other.squares))
        values, (unknown, _) = other.at(nearest.x), undetermined(other, nearest)
        known = {name: values[name] for name in problem.names if name not in unknown}
        formal = dict(zip(problem.names, formal_deviations(other, nearest).tolist(), strict=True))
        if known:
            yield kind, known, formal


def _notes(
    measured: Measurements, used: int, coefficients: Mapping[str, Estimate], others: Sequence[OtherFit]
) -> Iterator[str]:
    """Yield remarks for the user about a fit."""
    approaching = int(measured.approaching().sum())
    if separating := len(measured) - approaching:
        yield f"{separating} impacts separate and are left out"
    if unmeasured := approaching - used:
        why = "no measurement after them depends on restitution or friction"
        yield f"{unmeasured} impacts are left out: {why}"
    if used < FEW_IMPACTS:
        yield f"{used} impacts are too few for reliable intervals"
    for name, (value, low, high, formal) in coefficients.items():
        if math.isnan(value):
            continue
        formal = max(formal, PRECISION)  # without noise it is near 0, but the search ends at PRECISION
        if value in SEARCH_RANGES[name][:2]:
            why = "the measurements lie there, or beyond it because of their errors or the law"
            yield f"{name} is at its limit: {why}"
        if high == math.inf:
            yield f"{name}: too few impacts tell how large it may be; without them, no upper limit is known"
        elif (ratio := (high - low) / (2 * DEVIATIONS * formal)) > 2:
            yield f"{name}: the formal interval is {ratio:.2g} times too small"
        # A good estimate differs from another one by sqrt(f^2 - formal^2), with the deviation f of the other
        # (Hausman, "Specification Tests in Econometrics", Econometrica 46, 1978).
        apart = [
            (abs(values[name] - value), max(formal, math.sqrt(max(formals[name] ** 2 - formal**2, 0))))
            for _, values, formals in others
            if name in values
        ]
        far = [(distance, distance / sd) for distance, sd in apart if distance > DISAGREEMENT * sd]
        if far:
            distance, deviations = max(far)
            yield (
                f"{name}: other kinds of residuals lead to a value {distance:.2g} away, which is "
                f"{deviations:.0f} formal standard deviations: the geometry, the law or noise of the "
                "normals has an effect that no interval here includes"
            )


def _huge_changes(changes: Array) -> Iterator[str]:
    """Yield a remark if some impacts hide the others, from the squared change of the motion of each."""
    median = float(np.median(changes)) or math.inf
    if huge := int((changes > HUGE_CHANGE**2 * median).sum()):
        yield (
            f"{huge} impacts seem to change the motion {HUGE_CHANGE:,.0f} times as much as half of the "
            "others, which they hide: leave them out unless they were measured"
        )


def _faults(used: Impacts, kind: str, misfit: float, whole: float) -> Iterator[str]:
    """Yield what the measurements have that no law can explain, if it is the greater part of the misfit."""
    missed, energy, approach = used.nearest_impulses(kind)
    least = math.sqrt((missed**2).sum()) / whole
    if least > misfit / 2:
        yield (
            f"no law can have a misfit below {least:.1%}, because no impulse at the contact points leads to "
            "these velocities: check their units, the inertia and the positions"
        )
    if (gain := float(np.median(energy))) > 1 + misfit:
        yield (
            f"the impacts make the energy of the relative motion {gain:.2g} times as large, which no law "
            "does: check the units and the signs of the velocities"
        )
    if (left := float(np.median(approach))) > LARGE_MISFIT:
        yield (
            f"after the impacts the bodies still approach, at {left:.0%} of the speed before, which no law "
            "lets them: check the signs of the velocities and the normals"
        )
