"""Everything that can be wrong with an answer: each of its fields against exact arithmetic and physical laws.

``attacks.py`` has requests, ``exact.py`` the right answers. Where a tolerance is not ``error_bound``
itself, it allows for the rounding of the number in question: ``ROUNDINGS`` units of the precision used, times
the size of the terms that the number is a sum of.
"""

from __future__ import annotations

import math
from fractions import Fraction
from functools import lru_cache
from typing import Any

import pytest

pytest.importorskip("flint")  # EXTENDED must be exact here
import exact
from attacks import Case
from exact import PlainCollision, cross, dot, length, minus, nearest_float, plus, times
from exact_adapter import as_request, errors_of

from collision_response import (
    Adjustment,
    Geometry,
    Impact,
    ImpactError,
    ImpactModel,
    Law,
    Precision,
    Regime,
    StatusCode,
    resolve,
)
from collision_response.physics.laws import PATHS

ROUNDINGS = 64
"""More roundings than any number of an answer undergoes; a wrong digit is millions of them."""

UNIT = {
    Precision.SINGLE: Fraction(1, 2**24),
    Precision.DOUBLE: Fraction(1, 2**53),
    Precision.EXTENDED: Fraction(1, 2**53),
}

LARGEST = math.nextafter(math.inf, 0.0)

DECIDED = 0.1
"""With a greater bound, a decision may have gone the wrong way, and the bound covers both sides."""

LAST_PLACE = 2.0**-52
"""EXTENDED promises the impulse and the twist changes to one unit in the last place."""

FORMULAS = (Law.FRICTIONLESS, Law.COULOMB)

ANSWERS = (StatusCode.OK, StatusCode.SEPARATING, StatusCode.TOLERANCE_NOT_MET)

ENUMS = {"law": Law, "geometry": Geometry, "precision": Precision}

SCALARS = Impact._fields[Impact._fields.index("impulse") + 1 : Impact._fields.index("regime")]


def model_of(fields: dict[str, Any]) -> ImpactModel:
    return ImpactModel(**{name: ENUMS[name][v] if name in ENUMS else v for name, v in fields.items()})


def resolved(collision: PlainCollision, model: ImpactModel) -> Impact:
    return resolve(*as_request(collision), model)


@lru_cache(maxsize=4096)
def pair_of(collision: PlainCollision) -> exact.Pair:
    return exact.pair_of(collision)


@lru_cache(maxsize=4096)
def right_answer(collision: PlainCollision, law: str, e_t: float, threshold: float) -> exact.Answer:
    coefficients_away = collision.contact._replace(restitution=0.0, friction=0.0)
    pair = pair_of(collision._replace(contact=coefficients_away))
    return exact.answer(collision, law, e_t, threshold, pair)


def decided_law(law: Law, collision: PlainCollision) -> Law:
    if law is not Law.AUTO:
        return law
    return Law.COULOMB if collision.contact.friction else Law.FRICTIONLESS


def numbers_of(impact: Impact) -> dict[str, Any]:
    """Every number of an answer except the bound, by name."""
    numbers = {name: getattr(impact, name) for name in SCALARS}
    numbers |= {f"impulse.{axis}": x for axis, x in zip("xyz", impact.impulse, strict=True)}
    for twist in ("twist_a", "twist_b", "change_a", "change_b"):
        for part, v in zip(("linear", "angular"), getattr(impact, twist), strict=True):
            numbers |= {f"{twist}.{part}.{axis}": x for axis, x in zip("xyz", v, strict=True)}
    return numbers


class Faults(list[str]):
    """Descriptions of what is wrong with an answer."""

    def require(self, holds: Any, what: str) -> None:
        """Note a fault unless a condition holds."""
        if not holds:
            self.append(what)

    def require_near(self, name: str, given: float, right: Fraction, allowed: Fraction) -> None:
        """Note a fault unless a number is as near to the right one as allowed."""
        off = abs(Fraction(given) - right)
        if off > allowed + exact.SMALLEST_FLOAT:
            self.append(
                f"{name} is {given!r}, not {nearest_float(right)!r}: "
                f"off by {nearest_float(off):.2g} > {nearest_float(allowed):.2g}"
            )


def faults_of(case: Case) -> list[str]:
    """Everything that is wrong with the answer to a case."""
    requested = model_of(case.model)
    collision, law = case.collision, decided_law(requested.law, case.collision)
    right = right_answer(
        collision, law.name, requested.tangential_restitution, requested.restitution_threshold
    )
    try:
        impact = resolved(collision, requested)
    except ImpactError as refusal:
        return _faults_of_refusal(refusal, case, requested, law, right)
    return faults_of_answer(impact, case, requested, law, right)


def _faults_of_refusal(
    refusal: ImpactError, case: Case, requested: ImpactModel, law: Law, right: exact.Answer
) -> list[str]:
    """Every request here is valid. A refusal is right if the answer has no float64, or overflows in a
    narrower arithmetic.
    """
    if refusal.code is StatusCode.OUT_OF_RANGE and not exact.is_representable(right):
        return []
    if refusal.code is StatusCode.OUT_OF_RANGE and case.max_error is None:
        gives_up = requested.precision in (Precision.SINGLE, Precision.DOUBLE) or law not in FORMULAS
        if gives_up:
            return []
    if requested.geometry is Geometry.PLANAR and refusal.code is StatusCode.INVALID_NORMAL:
        return [] if not any(case.collision.contact.normal[:2]) else [f"refused: {refusal}"]
    return [f"refused: {refusal.code.name} {refusal}"]


def faults_of_answer(
    impact: Impact, case: Case, requested: ImpactModel, law: Law, right: exact.Answer
) -> list[str]:
    faults = Faults()
    for name, x in numbers_of(impact).items():
        faults.require(isinstance(x, float) or type(x) is int, f"{name} is a {type(x).__name__}")
        faults.require(math.isfinite(x), f"{name} is {x}")
    lost = impact.energy_lost_restitution + impact.energy_lost_friction
    faults.require(lost >= 0, f"{lost:.3g} J are lost")
    if faults:
        return faults
    _check_status(faults, impact, case, requested, law, right)
    bound = impact.error_bound
    fell_back = Adjustment.LAW_FALLBACK in impact.adjustments
    if fell_back:
        right = _after_fallback(faults, impact, case, requested, right)
    known = bound if 0 <= bound < math.inf else case.max_error
    if known is not None:
        error, P = _check_error(faults, impact, right, case)
        if case.check_fields and error < 1:
            _check_fields(faults, impact, case.collision, right, P, Fraction(known))
    return faults


def _check_status(
    faults: Faults, impact: Impact, case: Case, requested: ImpactModel, law: Law, right: exact.Answer
) -> None:
    bound, status, model = impact.error_bound, impact.status, impact.model
    faults.require(isinstance(bound, float) and bound >= 0, f"error_bound is {bound!r}")
    faults.require(status in ANSWERS, f"status is {status!r}")
    meets = bound <= (requested.tolerance or LARGEST)
    faults.require(
        (status is StatusCode.TOLERANCE_NOT_MET) == (not meets), f"{status!r} with error_bound {bound:.3g}"
    )
    separates = impact.regime == Regime.SEPARATING
    if meets:
        faults.require(
            (status is StatusCode.SEPARATING) == separates, f"{status!r} in regime {impact.regime!r}"
        )
        if bound < DECIDED:
            faults.require(
                separates == right.separating,
                f"regime is {impact.regime!r}, n.u = {nearest_float(right.pair.n_u):.3g}",
            )
    faults.require(
        separates == (not any(impact.impulse)) or not meets or impact.normal_impulse == 0,
        "an impulse of separating bodies",
    )
    climbs = law in FORMULAS and requested.geometry in (Geometry.AUTO, Geometry.SPATIAL)
    if climbs and requested.precision in (Precision.AUTO, Precision.EXTENDED):
        faults.require(meets, f"{requested.precision.name} stops at error_bound {bound:.3g}")
    if climbs and requested.precision is Precision.EXTENDED:
        faults.require(bound <= LAST_PLACE, f"EXTENDED has error_bound {bound:.3g}")
    for name in ("law", "geometry", "precision"):
        used, wanted = getattr(model, name), getattr(requested, name)
        faults.require(used.name != "AUTO", f"model.{name} is left to AUTO")
        fell_back = name == "law" and Adjustment.LAW_FALLBACK in impact.adjustments
        # EXTENDED leaves nothing out: it may model more than was forced.
        widened = name == "geometry" and used > wanted
        # The laws of paths need the digits of float64.
        widened |= used is Precision.DOUBLE and wanted is Precision.SINGLE and law in PATHS
        if wanted.name != "AUTO":
            faults.require(
                used is wanted or fell_back or widened, f"model.{name} is {used.name}, not {wanted.name}"
            )
    _check_adjustments(faults, impact, case.collision, right)


def _check_adjustments(
    faults: Faults, impact: Impact, collision: PlainCollision, right: exact.Answer
) -> None:
    off_unit = False
    for solid in (collision.a, collision.b):
        if solid.orientation is not None:
            q = solid.orientation
            off_unit = off_unit or abs(sum(Fraction(c) ** 2 for c in q) - 1) > Fraction(1, 1000)
    says = Adjustment.NORMALISED_ORIENTATION in impact.adjustments
    faults.require(says or not off_unit, "NORMALISED_ORIENTATION is not said")
    if 0 <= impact.error_bound < DECIDED:
        says = Adjustment.RESTITUTION_THRESHOLD in impact.adjustments
        faults.require(says == right.below_threshold, f"RESTITUTION_THRESHOLD is {says}")
        faults.require(
            Fraction(impact.contact.restitution) == right.restitution,
            f"contact.restitution is {impact.contact.restitution!r}, "
            f"not {nearest_float(right.restitution)!r}",
        )
    massless_spin_moves = any(any(cross(s.massless_spin, s.r)) for s in (right.pair.a, right.pair.b))
    if massless_spin_moves and impact.model.geometry is Geometry.SPATIAL:
        says = Adjustment.MASSLESS_SPIN in impact.adjustments
        faults.require(says, "MASSLESS_SPIN is not said")


def _after_fallback(
    faults: Faults, impact: Impact, case: Case, requested: ImpactModel, right: exact.Answer
) -> exact.Answer:
    """The right answer after a fallback. MOREAU may give way only where it creates energy, to the digits of
    the oracle.
    """
    faults.require(impact.model.law is Law.COULOMB, f"fell back to {impact.model.law!r}")
    faults.require(requested.law is Law.MOREAU, f"{requested.law!r} fell back")
    if requested.law is Law.MOREAU and not right.separating:
        P = right.impulses[0]
        gain, work = right.pair.energy_change(P), abs(dot(P, right.pair.u))
        faults.require(
            gain > -work / 10**12, f"fell back though the energy falls by {nearest_float(-gain):.3g}"
        )
    return right_answer(case.collision, "COULOMB", 0.0, requested.restitution_threshold)


def _check_error(faults: Faults, impact: Impact, right: exact.Answer, case: Case) -> tuple[float, exact.Vec]:
    """Check that impulse and changes of twist are within the bound of one answer that the law allows."""
    found = []
    for P in right.impulses:
        errors = errors_of(impact, right, P)
        found.append((max(errors), errors, P))
    error, errors, P = min(found, key=lambda one: one[0])
    slack = exact.ORACLE_ERROR if right.report is not None else 0.0
    limit = impact.error_bound if impact.error_bound >= 0 else math.inf
    faults.require(
        error <= limit + slack,
        "the errors of impulse and twists are {:.3g}, {:.3g}, {:.3g}, ".format(*errors)
        + f"the bound is {limit:.3g}",
    )
    if case.max_error is not None:
        faults.require(
            error <= case.max_error,
            f"the error is {error:.3g}, of an impact that allows {case.max_error:.0e}",
        )
    return error, P


def _norm(K: exact.Mat) -> Fraction:
    return length(tuple(length(row) for row in K))  # type: ignore[arg-type]


def _check_fields(
    faults: Faults,
    impact: Impact,
    collision: PlainCollision,
    right: exact.Answer,
    P: exact.Vec,
    bound: Fraction,
) -> None:
    """Check the other fields, each to the bound and to the rounding of its own terms."""
    pair = right.pair
    rounding = ROUNDINGS * UNIT[impact.model.precision]
    slack = bound + Fraction(exact.ORACLE_ERROR) if right.report is not None else bound
    unit, nn, size = pair.normal_length, dot(pair.n, pair.n), length(P)
    u_after = plus(pair.u, exact.apply(pair.K, P))
    pushed = _norm(pair.K) * size
    speeds = pair.a.speed_scale + pair.b.speed_scale
    u_n, u_n_after = pair.n_u / unit, dot(pair.n, u_after) / unit
    near = faults.require_near

    # in EXTENDED the speed is exact, because the impulse depends on it
    lost_digits = 0 if impact.model.precision is Precision.EXTENDED else speeds
    near(
        "normal_velocity_before",
        impact.normal_velocity_before,
        u_n,
        (slack + rounding) * abs(u_n) + rounding * lost_digits,
    )
    near(
        "normal_velocity_after",
        impact.normal_velocity_after,
        u_n_after,
        slack * (abs(u_n) + pushed) + rounding * (speeds + pushed),
    )
    mass = nn / pair.n_Kn
    allowed = slack + rounding
    near("effective_mass", impact.effective_mass, mass, allowed * mass + rounding * (speeds and mass))

    normal = dot(P, pair.n) / unit
    sideways = length(minus(P, times(pair.n, dot(P, pair.n) / nn)))
    near("normal_impulse", impact.normal_impulse, normal, allowed * size)
    near("tangential_impulse", impact.tangential_impulse, sideways, allowed * size)
    faults.require(impact.normal_impulse >= 0, f"normal_impulse is {impact.normal_impulse!r}")
    mu = Fraction(collision.contact.friction) if impact.model.law is not Law.FRICTIONLESS else Fraction(0)
    over = Fraction(impact.tangential_impulse) - mu * Fraction(impact.normal_impulse)
    # mu times the error of the normal impulse is far below mu P_n plus the error of the tangential impulse
    faults.require(
        over <= allowed * (size + mu * normal) + exact.SMALLEST_FLOAT,
        f"outside the cone by {nearest_float(over):.3g}",
    )
    if impact.model.law in (*FORMULAS, Law.MOREAU) and not right.separating:
        off = abs(Fraction(impact.normal_velocity_after) + right.restitution * u_n)
        faults.require(
            off <= slack * (abs(u_n) + pushed) + rounding * (speeds + pushed) + exact.SMALLEST_FLOAT,
            f"u_n after is {impact.normal_velocity_after!r}, "
            f"-e u_n is {nearest_float(-right.restitution * u_n)!r}",
        )
    _check_twists(faults, impact, pair, rounding)
    _check_energies(faults, impact, collision, pair, P, u_after, slack, rounding)
    _check_regime(faults, impact, right, u_after, pushed, slack + rounding)


def _check_twists(faults: Faults, impact: Impact, pair: exact.Pair, rounding: Fraction) -> None:
    """Check that twists after are twists before plus changes, and that massless parts do not change."""
    for name, side, twist, change in (
        ("a", pair.a, impact.twist_a, impact.change_a),
        ("b", pair.b, impact.twist_b, impact.change_b),
    ):
        for part, before, after, changed in (
            ("linear", side.velocity, twist.linear, change.linear),
            ("angular", side.spin, twist.angular, change.angular),
        ):
            for axis, x, y, d in zip("xyz", before, after, changed, strict=True):
                size = abs(x) + abs(Fraction(d))
                faults.require_near(f"twist_{name}.{part}.{axis}", y, x + Fraction(d), rounding * size)
        if side.mass is None or side.trace == 0:
            faults.require(not any(change.angular), f"change_{name}.angular is {change.angular}")


def _check_energies(
    faults: Faults,
    impact: Impact,
    collision: PlainCollision,
    pair: exact.Pair,
    P: exact.Vec,
    u_after: exact.Vec,
    slack: Fraction,
    rounding: Fraction,
) -> None:
    before = after = before_scale = after_scale = changed = Fraction(0)
    for side, impulse in ((pair.a, P), (pair.b, times(P, Fraction(-1)))):
        if side.mass is None:
            continue
        dv, dw = side.response(impulse)
        v, w = plus(side.velocity, dv), plus(side.spin, dw)
        before, after = before + side.energy(side.velocity, side.spin), after + side.energy(v, w)
        m, arm, moment = side.mass, length(side.com), side.trace
        before_scale += m * (length(side.velocity) + length(side.spin) * arm) ** 2
        before_scale += moment * dot(side.spin, side.spin)
        # rounding of velocity, spin and their changes
        sizes = length(side.velocity) + length(dv), length(side.spin) + length(dw)
        after_scale += m * (sizes[0] + sizes[1] * arm) ** 2 + moment * sizes[1] ** 2
        # an error of the change, in the norm of the bound, is at most 3 times that of sqrt(2 E)
        of_change = exact.square_root(m * dot(dv, dv) + moment / 3 * dot(dw, dw))
        reach = 2 + 2 * (arm * exact.square_root(3 * m / moment) if moment else 0)
        changed += of_change * reach * (exact.square_root(after_scale) + of_change)
    tolerance_after = 2 * slack * changed + rounding * after_scale
    near = faults.require_near
    near("kinetic_energy_before", impact.kinetic_energy_before, before, rounding * before_scale)
    near("kinetic_energy_after", impact.kinetic_energy_after, after, tolerance_after)

    mean = times(plus(pair.u, u_after), Fraction(1, 2))
    if impact.model.law in FORMULAS and any(P):  # the loss of (1+e) P_I; friction takes the rest
        e = Fraction(impact.contact.restitution)
        restitution = (1 - e * e) * pair.n_u**2 / (2 * pair.n_Kn)
    else:
        restitution = -dot(P, pair.n) * dot(pair.n, mean) / dot(pair.n, pair.n)
    total = -dot(P, mean)
    speeds = length(pair.u) + _norm(pair.K) * length(P)
    of_terms = length(P) * (
        4 * slack * speeds + rounding * (speeds + pair.a.speed_scale + pair.b.speed_scale)
    )
    lost = Fraction(impact.energy_lost_restitution) + Fraction(impact.energy_lost_friction)
    follows_path = impact.model.law in (Law.ROUTH_POISSON, Law.ROUTH_STRONGE)
    if not follows_path:
        near("energy_lost_restitution", impact.energy_lost_restitution, restitution, of_terms)
        near("energy_lost_friction", impact.energy_lost_friction, total - restitution, of_terms)
    near("energy lost", nearest_float(lost), total, 2 * of_terms)
    if impact.model.law in FORMULAS:
        faults.require(
            impact.energy_lost_restitution >= 0, f"restitution gives {impact.energy_lost_restitution!r}"
        )
        faults.require(impact.energy_lost_friction >= 0, f"friction gives {impact.energy_lost_friction!r}")
    does_work = any(s.mass is None and (any(s.velocity) or any(s.spin)) for s in (collision.a, collision.b))
    if not does_work:
        given_before = Fraction(impact.kinetic_energy_before)
        given_after = Fraction(impact.kinetic_energy_after)
        allowed = tolerance_after + rounding * before_scale + 2 * of_terms + 2 * exact.SMALLEST_FLOAT
        # the energies are rounded, and so is the gain
        faults.require(
            given_after <= given_before + tolerance_after + rounding * before_scale + exact.SMALLEST_FLOAT,
            f"the energy grows by {nearest_float(given_after - given_before):.3g}",
        )
        gap = given_before - given_after - lost
        faults.require(abs(gap) <= allowed, f"the balance of energy is off by {nearest_float(gap):.3g}")


def _check_regime(
    faults: Faults, impact: Impact, right: exact.Answer, u_after: exact.Vec, pushed: Fraction, noise: Fraction
) -> None:
    """Check the regime where it is clear: not at the edge of the cone or where the slip vanishes."""
    if right.separating or noise > Fraction(1, 10**6):
        return
    law, regime, pair = impact.model.law, impact.regime, right.pair
    if law is Law.FRICTIONLESS:
        faults.require(regime in (Regime.SLIDING, Regime.REVERSED), f"regime is {regime!r} without friction")
        return
    if law is Law.COULOMB and abs(right.margin) > 1e-3:
        faults.require(
            (regime == Regime.STICKING) == right.sticks, f"regime is {regime!r}, but sticks: {right.sticks}"
        )
    if law is Law.COULOMB and not right.sticks and abs(right.margin) > 1e-3:
        slip = minus(pair.u, times(pair.n, pair.n_u / dot(pair.n, pair.n)))
        along = dot(slip, u_after)
        if abs(along) > length(slip) * (length(pair.u) + pushed) / 10**3:
            wanted = Regime.REVERSED if along < 0 else Regime.SLIDING
            faults.require(regime == wanted, f"regime is {regime!r}, not {wanted!r}")
    if law in (Law.ROUTH_POISSON, Law.ROUTH_STRONGE) and right.report is not None:
        faults.require(regime != Regime.SEPARATING, "regime is SEPARATING")
