"""Hard impacts: every field of their answers, against exact arithmetic and against physical laws.

``attacks.py`` has the requests, ``exact.py`` the right answers. Where a tolerance is not ``error_bound``
itself, it allows for the rounding of the number in question: ``ROUNDINGS`` units of the precision used, times
the size of the terms that the number is a sum of.
"""

from __future__ import annotations

import inspect
import math
import random
from fractions import Fraction
from functools import lru_cache
from itertools import product
from typing import Any

import pytest

pytest.importorskip("flint")  # EXTENDED must be exact here

import attacks
import exact
import numpy as np
from attacks import Case
from batch_cases import GEOMETRIES, batch_of, collision_at
from exact import PlainCollision, cross, dot, length, minus, nearest_float, plus, times, vec
from exact_adapter import as_request, errors_of

from collision_response import (
    Adjustment,
    Body,
    Contact,
    Geometry,
    Impact,
    ImpactError,
    ImpactModel,
    Law,
    Precision,
    Regime,
    SceneContact,
    SceneImpact,
    StatusCode,
    Twist,
    resolve,
    resolve_scene,
    scene_requirements,
)
from collision_response.batch import resolve_batch
from collision_response.batch.rows import body_rows, contact_rows
from collision_response.derivatives import propagate_covariance, sphere_on_plane
from collision_response.identify import Impacts
from collision_response.kernels import library
from collision_response.physics.laws import PATHS
from collision_response.physics.vector import ZERO

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

pytestmark = pytest.mark.filterwarnings("error::RuntimeWarning")  # NumPy must not warn

FORMULAS = (Law.FRICTIONLESS, Law.COULOMB)
ANSWERS = (StatusCode.OK, StatusCode.SEPARATING, StatusCode.TOLERANCE_NOT_MET)
KNOWN = Adjustment.NORMALISED_ORIENTATION | Adjustment.RESTITUTION_THRESHOLD | Adjustment.LAW_FALLBACK
ENUMS = {"law": Law, "geometry": Geometry, "precision": Precision}
SCALARS = Impact._fields[Impact._fields.index("impulse") + 1 : Impact._fields.index("regime")]


# requests


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


# what is wrong with an answer


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
    return _faults_of_answer(impact, case, requested, law, right)


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


def _faults_of_answer(
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
        faults.require(int(impact.adjustments) & ~int(KNOWN), "spin that was left out is not said")


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


# one test for each family


FAMILIES = {family.replace(" ", "_"): list(generate()) for family, generate in attacks.FAMILIES.items()}


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    if "case" in metafunc.fixturenames:
        family = metafunc.function.__name__.removeprefix("test_")
        metafunc.parametrize("case", FAMILIES[family], ids=lambda case: case.name)


def _of_family(family: str) -> Any:
    def test(case: Case) -> None:
        found = faults_of(case)
        assert not found, "\n".join(found)

    test.__name__ = f"test_{family}"
    test.__doc__ = inspect.getdoc(attacks.FAMILIES[family.replace("_", " ")])
    return test


for _family in FAMILIES:
    globals()[f"test_{_family}"] = _of_family(_family)


@pytest.mark.parametrize("family", FAMILIES)
def test_every_vector_width_gives_the_same_answer(family):
    for case in FAMILIES[family]:
        answers = []
        for bits in (512, 256, 0):
            library.limit_vectors(bits)
            try:
                answers.append(resolved(case.collision, model_of(case.model)))
            except ImpactError as error:
                answers.append(str(error))
            finally:
                library.limit_vectors(512)
        assert answers == answers[:1] * 3, case.name


@pytest.mark.parametrize("family", FAMILIES)
def test_families_have_distinct_names(family):
    names = [case.name for case in FAMILIES[family]]
    assert len(names) == len(set(names)) >= 20


def test_the_checks_notice_wrong_digits():
    """A wrong digit in any number of a right answer must be found."""
    case = Case("", attacks.TUMBLING, attacks.model("COULOMB", "EXTENDED"))
    requested = model_of(case.model)
    right = right_answer(case.collision, "COULOMB", 0.0, 0.0)
    impact = resolved(case.collision, requested)
    unseen = []
    for name in SCALARS:
        wrong = impact._replace(**{name: getattr(impact, name) * (1 + 1e-9) + 1e-9})
        if not _faults_of_answer(wrong, case, requested, Law.COULOMB, right):
            unseen.append(name)
    wrong = impact._replace(impulse=impact.impulse * (1 + 2.0**-50))
    if not _faults_of_answer(wrong, case, requested, Law.COULOMB, right):
        unseen.append("impulse")
    for name in ("change_a", "change_b", "twist_a", "twist_b"):
        twist = getattr(impact, name)
        wrong = impact._replace(**{name: twist._replace(angular=twist.angular * (1 + 1e-12))})
        if not _faults_of_answer(wrong, case, requested, Law.COULOMB, right):
            unseen.append(name)
    assert not unseen


# other number types


GOOD = dict.fromkeys(attacks.FIELDS, 0.5)
NAMES = {"spin": "angular_velocity", "e_t": "tangential_restitution", "threshold": "restitution_threshold"}


def _answer_with(field: str, value: Any) -> Impact:
    """The answer to a request with one value of another type."""
    g = {**GOOD, field: value}
    body = Body.dynamic(
        g["mass"],
        (g["inertia"], 0.0, 0.0, 0.6, 0.0, 0.7),
        (0.25, g["position"], 0.5),
        None,
        (0.25, g["velocity"], -3.0),
        (g["spin"], 0.25, 0.125),
    )
    contact = Contact.of((0.0, 0.0, 0.0), (0.25, g["normal"], 1.0), g["restitution"], g["friction"])
    model = ImpactModel(
        tolerance=g["tolerance"], tangential_restitution=g["e_t"], restitution_threshold=g["threshold"]
    )
    return resolve(body, Body.static((0.1, 0.2, -1.0)), contact, model)


@pytest.mark.parametrize("given", list(attacks.kinds_of_number()), ids=lambda given: given.name)
def test_number_types(given):
    """A value is used as the float that it equals, to the bit, or refused by name."""
    try:
        impact = _answer_with(given.field, given.value)
    except (TypeError, ImpactError) as refusal:
        name = NAMES.get(given.field, given.field)
        assert name in str(refusal), f"the refusal does not name {name}: {refusal}"
        return
    assert given.is_number, f"{given.value!r} was taken for a number"
    assert numbers_of(impact) == numbers_of(_answer_with(given.field, float(given.value)))
    wrong = {name: type(x).__name__ for name, x in numbers_of(impact).items() if type(x) is not float}
    assert not wrong
    assert type(impact.error_bound) is float


TURNED = Body.dynamic(
    1.0, (1.0, 0.0, 0.0, 2.0, 0.0, 2.5), (0.25, 1.0, 0.125), (0.0, 0.0, 0.6, 0.8), (0.5, -1.0, 0.25),
    (1.0, 0.5, 0.25), (0.125, 0.0625, 0.125),
)  # fmt: skip
REQUEST = {
    "body_a": TURNED,
    "body_b": Body.kinematic((0.0, 0.0, 0.0), (0.125, 0.0, 0.0), (0.0, 0.0, 0.5)),
    "contact": Contact.of((0.0, 0.0, 0.0), (0.0, 1.0, 0.0), 0.5, 0.25),
}
CALLS = {
    "point": lambda a, b, c: resolve(a, b, c, ImpactModel(geometry=Geometry.POINT)),
    "planar": lambda a, b, c: resolve(a, b, c, ImpactModel(geometry=Geometry.PLANAR)),
    "more digits": lambda a, b, c: resolve(a, b, c, ImpactModel(tolerance=1e-30)),
    "functions": lambda a, b, c: resolve(a, b, c._replace(restitution=lambda v: v / 8, friction=lambda v: v)),
    "a path": lambda a, b, c: resolve(
        a, b, c._replace(friction=lambda v: 0.1), ImpactModel(Law.ROUTH_STRONGE)
    ),
    "requirements": lambda a, b, c: scene_requirements({"a": a, "b": b}, [SceneContact("a", "b", c)], 0.5),
    "scene": lambda a, b, c: resolve_scene(
        [a, b], [(0, 1)] * 2, [c, c._replace(position=(0.25, 0.0, 0.125))]
    ),
    "covariance": lambda a, b, c: propagate_covariance(
        a, b, c, ImpactModel(), np.eye(12) / 64, sphere_on_plane(0.125), normal_sd=0.125
    ),
    "measurements": lambda a, b, c: (
        Impacts.of([a], [b], [c], [Twist(ZERO, ZERO)], [Twist(ZERO, ZERO)]).bodies
    ),
}


@pytest.mark.parametrize("call", CALLS.values(), ids=CALLS)
@pytest.mark.parametrize("kind", [tuple, list, np.array])
def test_vectors_may_be_any_sequence(kind, call):
    expected = call(*REQUEST.values())
    for owner, part in REQUEST.items():
        for field, value in part._asdict().items():
            if isinstance(value, tuple):
                given = REQUEST | {owner: part._replace(**{field: kind(value)})}
                np.testing.assert_equal(_without_contacts(call(*given.values())), _without_contacts(expected))


def _without_contacts(answer: Any) -> Any:
    """The answer without the contacts of the request, which it returns as they were given."""
    if isinstance(answer, SceneImpact):
        return answer._replace(contacts=())
    return answer._replace(contact=None) if isinstance(answer, Impact) else answer


# restitution functions


@pytest.mark.parametrize(
    "precision", [Precision.AUTO, Precision.SINGLE, Precision.DOUBLE, Precision.EXTENDED]
)
@pytest.mark.parametrize("law", [Law.COULOMB, Law.FRICTIONLESS, Law.ROUTH_STRONGE])
@pytest.mark.parametrize(
    "restitution", list(attacks.restitutions()), ids=lambda restitution: restitution.name
)
def test_restitution_functions(restitution, law, precision):
    if law is Law.ROUTH_STRONGE and precision is Precision.EXTENDED:
        return
    plane = attacks.rod_in_plane(0.6, 0.8, 1.0, -2.0, 0.5, 0.3)
    for collision in (plane,) if law is Law.ROUTH_STRONGE else (plane, attacks.ON_FLOOR):
        given = attacks.with_contact(collision, restitution=restitution.function)
        model = ImpactModel(law, precision=precision)
        if restitution.code:
            with pytest.raises(ImpactError) as refusal:
                resolved(given, model)
            assert refusal.value.code.name == restitution.code
            assert "restitution" in refusal.value.field
            continue
        impact = resolved(given, model)
        used = impact.contact.restitution
        assert isinstance(used, (float, int))
        speed = nearest_float(pair_of(collision).approach_speed)
        if impact.error_bound < math.inf:
            # the function gets the speed rounded to the precision used
            near = speed * 4 * float(UNIT[impact.model.precision])
            possible = [float(restitution.function(v)) for v in (speed - near, speed, speed + near)]
            assert min(possible) <= used <= max(possible)
        fixed = attacks.with_contact(collision, restitution=float(used))
        as_number = Case("", fixed, {"law": law.name, "precision": precision.name})
        right = right_answer(fixed, law.name, 0.0, 0.0)
        found = _faults_of_answer(impact, as_number, model, law, right)
        assert not found, "\n".join(found)


@pytest.mark.parametrize(
    "precision", [Precision.AUTO, Precision.SINGLE, Precision.DOUBLE, Precision.EXTENDED]
)
@pytest.mark.parametrize("error", attacks.USER_ERRORS, ids=lambda error: type(error).__name__)
def test_an_error_in_the_users_function_is_raised_unchanged(error, precision):
    def restitution(v: float) -> float:
        raise error

    collision = attacks.with_contact(attacks.ON_FLOOR, restitution=restitution)
    with pytest.raises(type(error)) as raised:
        resolved(collision, ImpactModel(precision=precision))
    assert raised.value is error


# bodies with a replaced mass


@pytest.mark.parametrize("factor", [2.0, 0.3, 1e6, 1e-6, 1e100])
@pytest.mark.parametrize(
    "precision", [Precision.AUTO, Precision.SINGLE, Precision.DOUBLE, Precision.EXTENDED]
)
@pytest.mark.parametrize("law", [Law.FRICTIONLESS, Law.COULOMB])
def test_a_replaced_mass_is_used(law, precision, factor):
    for collision in (attacks.TUMBLING, attacks.ON_FLOOR):
        body_a, body_b, contact = as_request(collision)
        heavier = collision._replace(a=collision.a._replace(mass=collision.a.mass * factor))
        model = ImpactModel(law, precision=precision)
        replaced = resolve(body_a._replace(mass=body_a.mass * factor), body_b, contact, model)
        assert replaced == resolved(heavier, model)


@pytest.mark.parametrize(
    "precision", [Precision.AUTO, Precision.SINGLE, Precision.DOUBLE, Precision.EXTENDED]
)
@pytest.mark.parametrize("mass", [0.0, -0.0, -1.0, math.nan, -math.inf])
def test_an_invalid_mass_is_refused(mass, precision):
    """Even if it was written into an existing body, and in every precision."""
    body_a, body_b, contact = as_request(attacks.TUMBLING)
    with pytest.raises(ImpactError) as refusal:
        resolve(body_a._replace(mass=mass), body_b, contact, ImpactModel(precision=precision))
    assert "mass" in refusal.value.field


# batches


def pack(geometry: Geometry, collisions: list[PlainCollision]) -> tuple[np.ndarray, np.ndarray]:
    """The arrays of some collisions; spatial ones have orientations."""
    return batch_of(map(as_request, collisions), geometry, oriented=geometry is Geometry.SPATIAL)


def reduced_to(geometry: Geometry, collision: PlainCollision) -> PlainCollision:
    """The collision without what a batch of this geometry has no rows for, so that AUTO means the same."""
    if geometry is Geometry.SPATIAL:
        return collision
    flat = [solid._replace(orientation=None, inertia=_about_z(solid.inertia)) for solid in collision[:2]]
    if geometry is Geometry.POINT:
        here = collision.contact.position
        flat = [s._replace(inertia=(0.0,) * 6, spin=(0.0,) * 3, position=here) for s in flat]
    return PlainCollision(*flat, collision.contact)


def _about_z(inertia: tuple[float, ...]) -> tuple[float, ...]:
    """The tensor of a PLANAR batch, which has only the moment about z."""
    zz = inertia[5]
    return zz, 0.0, 0.0, zz, 0.0, zz


def differences_to_impact(geometry: Geometry, result: Any, i: int, impact: Impact) -> list[str]:
    """How the numbers of a column differ from those of a single impact, to the bit."""
    axes = len(result.impulse)
    first = {Geometry.POINT: 3, Geometry.PLANAR: 2, Geometry.SPATIAL: 0}[geometry]
    found = []
    if result.status[i] != impact.status:
        found.append(f"status {result.status[i]}, not {impact.status!r}")
    pairs = [("impulse", result.impulse[:, i], impact.impulse[:axes])]
    for lane, twist in enumerate((impact.twist_a, impact.twist_b)):
        pairs.append((f"velocity {lane}", result.velocity[:, lane, i], twist.linear[:axes]))
        pairs.append((f"spin {lane}", result.angular_velocity[:, lane, i], twist.angular[first:]))
    if result.error_bound is not None:
        pairs.append(("error_bound", result.error_bound[i : i + 1], (impact.error_bound,)))
    for name, row, one in pairs:
        if row.tolist() != list(one):
            found.append(f"{name} is {row.tolist()}, not {list(one)}")
    return found


def sound_collisions(geometry: Geometry) -> list[PlainCollision]:
    draw = random.Random("good rows")
    return [
        reduced_to(geometry, attacks.random_boxes(draw, planar=geometry is not Geometry.SPATIAL))
        for _ in range(8)
    ]


BATCH_MODELS = {
    "double": {"precision": Precision.DOUBLE},
    "extended": {"precision": Precision.EXTENDED},
    "tolerance 1e-6": {"tolerance": 1e-6},
    "tolerance 1e-15": {"tolerance": 1e-15},
    "threshold": {"precision": Precision.DOUBLE, "restitution_threshold": 1.0},
    "e_t": {"precision": Precision.DOUBLE, "tangential_restitution": 0.5},
}


@pytest.mark.parametrize("fields", BATCH_MODELS.values(), ids=BATCH_MODELS)
@pytest.mark.parametrize("law", [Law.FRICTIONLESS, Law.COULOMB])
@pytest.mark.parametrize("geometry", GEOMETRIES)
@pytest.mark.parametrize("repeats", [1, 8])
def test_a_column_equals_a_single_impact(geometry, law, fields, repeats):
    """The status and the numbers, in the same model."""
    collisions = sound_collisions(geometry) * repeats
    model = ImpactModel(law, **fields)
    result = resolve_batch(*pack(geometry, collisions), model)
    found = []
    impacts = [resolved(collision, model._replace(geometry=geometry)) for collision in collisions[:8]]
    for i in range(len(collisions)):
        impact = impacts[i % 8]
        found += [f"row {i}: {fault}" for fault in differences_to_impact(geometry, result, i, impact)]
    assert not found, "\n".join(found)


def faulty_values(geometry: Geometry) -> list[tuple[str, str, Any, float]]:
    """Faults: a name, ``bodies`` or ``contacts``, the rows of that table, and the wrong value."""
    body_row, contact_row = body_rows(geometry, oriented=geometry is Geometry.SPATIAL), contact_rows(geometry)
    faults: list[tuple[str, str, Any, float]] = []
    for field in ("mass", "inertia", "position", "velocity", "angular_velocity", "orientation"):
        rows = getattr(body_row, field)
        if rows.stop > rows.start:
            bad = (math.nan, -math.inf) if field == "mass" else (math.nan, -math.inf, math.inf)
            faults += [(f"{field} {value}", "bodies", rows.start, value) for value in bad]
    for field in ("position", "normal", "restitution", "friction"):
        rows = getattr(contact_row, field)
        bad = (math.nan, math.inf, -math.inf)
        faults += [(f"{field} {value}", "contacts", rows.start, value) for value in bad]
    faults += [
        ("mass -1", "bodies", body_row.mass, -1.0),
        ("mass 0", "bodies", body_row.mass, 0.0),
        ("restitution 1.5", "contacts", contact_row.restitution, 1.5),
        ("friction -1", "contacts", contact_row.friction, -1.0),
        ("normal of length 0", "contacts", contact_row.normal, 0.0),
    ]
    if geometry is not Geometry.POINT:
        faults.append(("inertia -1", "bodies", body_row.inertia.start, -1.0))
    if geometry is Geometry.SPATIAL:
        faults.append(("inertia 9", "bodies", body_row.inertia.start, 9.0))
        faults.append(("quaternion of length 0", "bodies", body_row.orientation, 0.0))
    return faults


def with_faulty_columns(geometry: Geometry) -> tuple[np.ndarray, np.ndarray, np.ndarray, list[str]]:
    """Bodies and contacts with a fault in every other column, which columns are sound, and the faults."""
    sound, faults = sound_collisions(geometry), faulty_values(geometry)
    count = 2 * len(faults)
    bodies, contacts = pack(geometry, [sound[i % len(sound)] for i in range(count)])
    names = [""] * count
    for k, (name, table, rows, value) in enumerate(faults):
        names[2 * k] = name
        if table == "bodies":
            bodies[rows, k % 2, 2 * k] = value
        else:
            contacts[rows, 2 * k] = value
    return bodies, contacts, np.array([not name for name in names]), names


@pytest.mark.parametrize("fields", BATCH_MODELS.values(), ids=BATCH_MODELS)
@pytest.mark.parametrize("law", [Law.FRICTIONLESS, Law.COULOMB])
@pytest.mark.parametrize("geometry", GEOMETRIES)
def test_faulty_columns_do_not_affect_others(geometry, law, fields):
    """Sound columns have the bits that they have alone; faulty ones have no numbers."""
    bodies, contacts, is_good, names = with_faulty_columns(geometry)
    model = ImpactModel(law, **fields)
    together = resolve_batch(bodies, contacts, model)
    alone = resolve_batch(bodies[..., is_good].copy(), contacts[..., is_good].copy(), model)
    for field, mixed, clean in zip(together._fields, together, alone, strict=True):
        if mixed is not None:
            np.testing.assert_array_equal(mixed[..., is_good], clean, err_msg=field)
    for i, name in enumerate(names):
        if name and together.status[i] not in ANSWERS:
            assert np.isnan(together.impulse[:, i]).all(), name
            assert np.isnan(together.velocity[:, :, i]).all(), name
    one = resolve_batch(bodies[..., 1:2].copy(), contacts[..., 1:2].copy(), model)
    np.testing.assert_array_equal(one.impulse[:, 0], together.impulse[:, 1])


@pytest.mark.parametrize("precision", [Precision.DOUBLE, Precision.EXTENDED])
@pytest.mark.parametrize("law", [Law.FRICTIONLESS, Law.COULOMB])
@pytest.mark.parametrize("geometry", GEOMETRIES)
def test_a_faulty_column_has_the_code_of_a_single_impact(geometry, law, precision):
    bodies, contacts, _, names = with_faulty_columns(geometry)
    model = ImpactModel(law, precision=precision)
    status = resolve_batch(bodies, contacts, model).status
    found = []
    for i, name in enumerate(names):
        try:
            code = resolve(
                *collision_at(geometry, bodies, contacts, i), model._replace(geometry=geometry)
            ).status
        except ImpactError as refusal:
            code = refusal.code
        if status[i] != code:
            found.append(f"{name or 'good'}: {StatusCode(status[i]).name}, one impact: {code.name}")
    assert not found, "\n".join(found)


@pytest.mark.parametrize(
    ("geometry", "size"), [*product(GEOMETRIES, (1, 20)), (Geometry.POINT, 600), (Geometry.SPATIAL, 600)]
)
def test_extended_batches_with_much_friction(geometry, size):
    """Each column is within its bound, in batches of any size."""
    cases = list(attacks.batches_with_much_friction())
    cases = (cases * (1 + size // len(cases)))[:size]
    collisions = [case.collision for case in cases]
    if geometry is not Geometry.SPATIAL:
        flat = [attacks.random_boxes(random.Random(case.name), planar=True) for case in cases]
        collisions = [
            attacks.with_contact(reduced_to(geometry, collision), friction=case.collision.contact.friction)
            for collision, case in zip(flat, cases, strict=True)
        ]
    model = ImpactModel(Law.COULOMB, precision=Precision.EXTENDED)
    result = resolve_batch(*pack(geometry, collisions), model)
    found = []
    for field, array in zip(result._fields, result, strict=True):
        if array is None:  # no report was requested
            continue
        for start in range(20, size, 20):  # the same rows again
            np.testing.assert_array_equal(array[..., start : start + 20], array[..., :20], err_msg=field)
    for i, collision in enumerate(collisions[:20]):
        right = right_answer(collision, "COULOMB", 0.0, 0.0)
        row = [*result.impulse[:, i].tolist(), 0.0][:3]
        error = exact.impulse_error(row, right.impulses[0])
        bound, status = result.error_bound[i], result.status[i]
        expected = StatusCode.SEPARATING if right.separating else StatusCode.OK
        if not error <= bound <= LAST_PLACE or status != expected:
            found.append(f"{cases[i].name}: error {error:.3g}, bound {bound:.3g}, status {status}")
    assert not found, "\n".join(found)


@pytest.mark.parametrize("kind", [np.float64, np.float32, Fraction])
@pytest.mark.parametrize("field", ["restitution_threshold", "tolerance", "tangential_restitution"])
@pytest.mark.parametrize("geometry", GEOMETRIES)
def test_batch_models_with_other_number_types(geometry, field, kind):
    """As with plain floats, bit for bit, or refused by name."""
    arrays = pack(geometry, sound_collisions(geometry))
    plain = resolve_batch(*arrays, ImpactModel(**{field: 0.5}))
    try:
        other = resolve_batch(*arrays, ImpactModel(**{field: kind(0.5)}))
    except (TypeError, ImpactError) as refusal:
        assert kind is not np.float64, refusal  # it is a float
        assert field in str(refusal)
        return
    for name, a, b in zip(plain._fields, plain, other, strict=True):
        np.testing.assert_array_equal(a, b, err_msg=name)


# swapped bodies


def swapped(collision: PlainCollision) -> PlainCollision:
    turned = collision.contact._replace(normal=tuple(-c for c in collision.contact.normal))
    return PlainCollision(collision.b, collision.a, turned)


@pytest.mark.parametrize("mirrored", list(attacks.swaps()), ids=lambda case: case.name)
def test_swapped_bodies_have_the_mirrored_answer(mirrored):
    """Up to both bounds, or 1e-9 without bounds: the collisions are well-conditioned."""
    model = model_of(mirrored.model)
    one, other = resolved(mirrored.collision, model), resolved(swapped(mirrored.collision), model)
    assert one.regime == other.regime
    assert one.model == other.model
    assert one.status == other.status
    bounds = one.error_bound + other.error_bound
    allowed = Fraction(bounds if 0 <= bounds < math.inf else 1e-9)
    apart = plus(vec(one.impulse), vec(other.impulse))
    assert length(apart) <= allowed * length(vec(one.impulse))
    pair = pair_of(mirrored.collision)
    for side, a, b in ((pair.a, one.change_a, other.change_b), (pair.b, one.change_b, other.change_a)):
        size = error = Fraction(0)
        for weight, x, y in ((side.mass, a.linear, b.linear), (side.trace / 3, a.angular, b.angular)):
            off = minus(vec(x), vec(y))
            size, error = size + weight * dot(vec(x), vec(x)), error + weight * dot(off, off)
        assert error <= allowed**2 * size
    for name in SCALARS:
        x, y = getattr(one, name), getattr(other, name)
        scale = max(abs(x), abs(y), one.kinetic_energy_before if "energy" in name else 10.0)
        # 10: the terms of the velocities and impulses here
        assert abs(x - y) <= (float(allowed) + ROUNDINGS * float(UNIT[one.model.precision])) * 10 * scale, (
            name
        )


# units, bit for bit


@pytest.mark.parametrize("law", [Law.FRICTIONLESS, Law.COULOMB])
@pytest.mark.parametrize("exponents", [(100, 0, 0), (0, 100, 0), (0, 0, 100), (-60, 40, 30), (-200, 0, 100)])
def test_powers_of_two_change_no_digit(exponents, law):
    """Without overflow and underflow no rounding depends on units, so the impulse scales exactly."""
    factors = [2.0**k for k in exponents]
    model = ImpactModel(law, precision=Precision.DOUBLE)
    plain = resolved(attacks.TUMBLING, model)
    changed = resolved(attacks.in_units(attacks.TUMBLING, *factors), model)
    size = factors[0] * factors[1] / factors[2]
    assert [x * size for x in plain.impulse] == list(changed.impulse)
    assert changed.regime == plain.regime
