"""Hard impacts, in families: ``attacks.py`` has the requests, ``answer_faults.py`` checks the answers."""

from __future__ import annotations

import inspect
import math
from fractions import Fraction
from typing import Any

import pytest

pytest.importorskip("flint")  # EXTENDED must be exact here

import attacks
from answer_faults import (
    ROUNDINGS,
    SCALARS,
    UNIT,
    faults_of,
    faults_of_answer,
    model_of,
    pair_of,
    resolved,
    right_answer,
)
from attacks import Case
from exact import PlainCollision, dot, length, minus, plus, vec
from exact_adapter import as_request

from collision_response import ImpactError, ImpactModel, Law, Precision, resolve
from collision_response.kernels import library

pytestmark = pytest.mark.filterwarnings("error::RuntimeWarning")  # NumPy must not warn


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
        if not faults_of_answer(wrong, case, requested, Law.COULOMB, right):
            unseen.append(name)
    wrong = impact._replace(impulse=impact.impulse * (1 + 2.0**-50))
    if not faults_of_answer(wrong, case, requested, Law.COULOMB, right):
        unseen.append("impulse")
    for name in ("change_a", "change_b", "twist_a", "twist_b"):
        twist = getattr(impact, name)
        wrong = impact._replace(**{name: twist._replace(angular=twist.angular * (1 + 1e-12))})
        if not faults_of_answer(wrong, case, requested, Law.COULOMB, right):
            unseen.append(name)
    assert not unseen


# restitution functions


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
