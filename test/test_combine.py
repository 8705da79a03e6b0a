"""Rules that combine the coefficients of two materials."""

from __future__ import annotations

import itertools
import math
import sys
from decimal import Decimal
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

pytest.importorskip("mpmath")
pytest.importorskip("yaml")

from mpmath import mp, mpf
from refusals import refused

from collision_response import StatusCode
from collision_response.numbers.operations import square_root
from collision_response.physics.combine import CombineRule, combine

coefficients = st.just(0.0) | st.floats(1e-100, 1)
every_rule = pytest.mark.parametrize("rule", CombineRule)


@pytest.mark.parametrize(
    ("rule", "expected"),
    [
        (CombineRule.AVERAGE, Fraction(5, 8)),
        (CombineRule.MULTIPLY, Fraction(1, 4)),
        (CombineRule.MINIMUM, Fraction(1, 4)),
        (CombineRule.MAXIMUM, Fraction(1)),
        (CombineRule.GEOMETRIC_MEAN, Fraction(1, 2)),
    ],
)
def test_combine_a_quarter_and_one(rule, expected):
    assert combine(rule, Fraction(1, 4), Fraction(1)) == expected
    assert combine(rule, 0.25, 1.0) == expected
    assert combine(rule, np.array([0.25, 1.0]), np.array([1.0, 0.25])).tolist() == [expected, expected]


@every_rule
@given(a=coefficients, b=coefficients)
def test_rules_are_symmetric_and_stay_below_the_larger_coefficient(rule, a, b):
    joined = combine(rule, a, b)
    assert joined == combine(rule, b, a)
    assert 0 <= joined <= max(a, b)


@pytest.mark.parametrize("rule", [rule for rule in CombineRule if rule is not CombineRule.MULTIPLY])
@given(a=st.floats(1e-100, 1))
def test_equal_coefficients_combine_to_themselves(rule, a):
    assert combine(rule, a, a) == a


@pytest.mark.parametrize("rule", [rule for rule in CombineRule if rule is not CombineRule.MULTIPLY])
@given(a=st.floats(5e-324, sys.float_info.max), b=st.floats(0, sys.float_info.max))
def test_no_intermediate_result_overflows(rule, a, b):
    """Means lie between their arguments at any magnitude, and are right to rounding."""
    joined = combine(rule, a, b)
    assert min(a, b) * (1 - 1e-15) - 5e-324 <= joined <= max(a, b)
    exact = _exact(rule, Fraction(a), Fraction(b))
    assert joined == pytest.approx(exact, rel=1e-15, abs=5e-324)


def _exact(rule, a, b):
    """The combined coefficient in fractions; roots are right to 2^-60."""
    joined = {
        CombineRule.AVERAGE: lambda: (a + b) / 2,
        CombineRule.MINIMUM: lambda: min(a, b),
        CombineRule.MAXIMUM: lambda: max(a, b),
        CombineRule.HARMONIC_MEAN: lambda: 2 * a * b / (a + b),
        CombineRule.GEOMETRIC_MEAN: lambda: square_root(a * b),
        CombineRule.ENERGETIC: lambda: square_root((a * a + b * b) / 2),
    }
    return float(joined[rule]())


@given(
    a=st.floats(1e-100, 1),
    b=st.floats(1e-100, 1),
    stiffness=st.tuples(*[st.floats(1e-300, sys.float_info.max)] * 2),
)
def test_the_energetic_rule_depends_on_the_ratio_of_the_stiffnesses(a, b, stiffness):
    k_a, k_b = map(Fraction, stiffness)
    joined = combine(CombineRule.ENERGETIC, a, b, *stiffness)
    exact = (Fraction(a) ** 2 * k_b + Fraction(b) ** 2 * k_a) / (k_a + k_b)
    assert joined == pytest.approx(float(square_root(exact)), rel=2e-15)
    assert joined == combine(CombineRule.ENERGETIC, b, a, *stiffness[::-1])


LEAST, GREATEST = 5e-324, sys.float_info.max


@pytest.mark.parametrize("rule", [rule for rule in CombineRule if rule is not CombineRule.MULTIPLY])
@pytest.mark.parametrize("a", [0.0, LEAST, 1e-310, 1e-300, 1e-160, 1 / 3, 1.0, 3.0, GREATEST])
def test_means_of_equal_numbers_of_any_size_are_exact(rule, a):
    assert combine(rule, a, a) == a
    assert combine(rule, np.array([a]), np.array([a])).tolist() == [a]


@pytest.mark.parametrize(("k_a", "k_b"), [*itertools.permutations([LEAST, 1e-300, 1.0, 1e300, GREATEST], 2)])
@pytest.mark.parametrize(("a", "b"), [*itertools.product([0.0, LEAST, 1e-200, 1e-160, 1 / 3, 1.0], repeat=2)])
def test_the_energetic_rule_does_not_underflow(a, b, k_a, k_b):
    """Restitutions and stiffnesses whose squares or quotients are below float64."""
    joined = combine(CombineRule.ENERGETIC, a, b, k_a, k_b)
    with mp.workdps(50):
        exact = mp.sqrt((mpf(a) ** 2 * k_b + mpf(b) ** 2 * k_a) / (mpf(k_a) + k_b))
        # The quotient of the roots of the greatest and the least number is itself below the normal range.
        assert abs(joined - exact) <= 4e-16 * exact + 2 * LEAST
    assert min(a, b) <= joined <= max(a, b)
    assert joined == combine(CombineRule.ENERGETIC, b, a, k_b, k_a)
    assert combine(CombineRule.ENERGETIC, np.array([a]), np.array([b]), k_a, k_b).tolist() == [joined]


def test_rules_are_exact_in_fractions():
    half, two, share = Fraction(1, 2), Fraction(2), Fraction(1, 3)
    assert combine(CombineRule.GEOMETRIC_MEAN, half, two) == 1
    assert combine(CombineRule.HARMONIC_MEAN, half, two) == Fraction(4, 5)
    assert combine(CombineRule.ENERGETIC, Fraction(1, 7), Fraction(1)) == Fraction(5, 7)
    assert combine(CombineRule.ENERGETIC, share, share, 2, 5) == share


@pytest.mark.parametrize("rule", ["average", "energetix", None, 1])
def test_an_unknown_rule_is_refused(rule):
    with pytest.raises(TypeError, match=r"^rule: must be one of CombineRule.AVERAGE, "):
        combine(rule, 0.5, 0.5)


NUMBERS = {"a": 0.5, "b": 0.25, "stiffness_a": 1.0, "stiffness_b": 2.0}


@every_rule
@pytest.mark.parametrize("name", NUMBERS)
def test_numbers_out_of_range_are_refused_by_name(rule, name):
    """Whether or not the rule uses them."""
    least = -5e-324 if name in ("a", "b") else 0.0
    for wrong in (least, -1, Fraction(-1, 3), Decimal("-1e-400"), -(10**300)):
        with refused(StatusCode.INVALID_COEFFICIENT, name):
            combine(rule, **NUMBERS | {name: wrong})
    for wrong in (
        math.inf,
        math.nan,
        10**400,
        Fraction(10) ** 400,
        Decimal("nan"),
        Decimal("inf"),
        np.float32("inf"),
    ):
        with refused(StatusCode.NOT_FINITE, name):
            combine(rule, **NUMBERS | {name: wrong})
    for wrong in (least, math.inf, math.nan):
        with refused(StatusCode.INVALID_COEFFICIENT, name):
            combine(rule, **NUMBERS | {name: np.array([1.0, wrong])})
    with pytest.raises(TypeError, match=f"^{name}: must be real numbers, is "):
        combine(rule, **NUMBERS | {name: np.array([1.0, None])})


@every_rule
@pytest.mark.parametrize("number", [Decimal, Fraction, np.float32, np.float16, np.longdouble, np.array, mpf])
@pytest.mark.parametrize("name", NUMBERS)
def test_types_of_numbers_may_be_mixed(rule, name, number):
    assert combine(rule, **NUMBERS | {name: number(NUMBERS[name])}) == combine(rule, **NUMBERS)
    assert combine(rule, **{key: number(x) for key, x in NUMBERS.items()}) == pytest.approx(
        combine(rule, **NUMBERS), rel=1e-15
    )


@every_rule
def test_a_fraction_below_float64_is_0_among_floats(rule):
    tiny = Fraction(1, 10**400)
    assert combine(rule, tiny, 0.5, 1.0, 2.0) == combine(rule, 0.0, 0.5, 1.0, 2.0)


@every_rule
def test_integers_of_numpy_do_not_overflow(rule):
    assert combine(rule, np.array([200, 3], np.uint8), 100).tolist() == [
        combine(rule, x, 100) for x in (200, 3)
    ]


def test_the_energetic_rule_gives_the_energy_lost_in_two_springs():
    """Spring a takes k_b / (k_a + k_b) of the energy of compression, and gives back e_a^2 of that."""
    k_a, k_b, e_a, e_b = map(Fraction, (2, 5, "3/5", "4/5"))
    kept = (k_b * e_a**2 + k_a * e_b**2) / (k_a + k_b)
    e = combine(CombineRule.ENERGETIC, float(e_a), float(e_b), float(k_a), float(k_b))
    assert e**2 == pytest.approx(float(kept), rel=1e-15)


def test_the_harmonic_mean():
    assert combine(CombineRule.HARMONIC_MEAN, 0.5, 0.125) == 0.2
    assert combine(CombineRule.HARMONIC_MEAN, 0.0, 0.0) == 0.0
    assert combine(CombineRule.HARMONIC_MEAN, 0.0, 0.7) == 0.0


@every_rule
def test_arrays_of_any_library_are_combined(rule):
    xp = pytest.importorskip("array_api_strict")
    a, b, k = [0.5, 0.2, 0.0, 0.7], [0.1, 0.2, 0.0, 1.0], [1.0, 2.0, 3.0, 1e-100]
    found = combine(rule, xp.asarray(a), xp.asarray(b), xp.asarray(k), 2.0)
    assert np.asarray(found).tolist() == [combine(rule, *one, 2.0) for one in zip(a, b, k, strict=True)]
    with refused(StatusCode.INVALID_COEFFICIENT, "b"):
        combine(rule, 0.5, xp.asarray([0.5, -0.5]))


@given(
    a=st.floats(1e-100, 1),
    part=st.floats(-1e-9, 1e-9),
    k_a=st.floats(1e-100, 1e100),
    k_b=st.floats(1e-100, 1e100),
)
@example(a=0.4272314549380658, part=-1.3e-16, k_a=0.005064440948269989, k_b=0.0027600905328768266)
@example(a=0.7, part=-0.8, k_a=0.5, k_b=1e-100)
def test_the_energetic_restitution_is_never_outside_the_two(a, part, k_a, k_b):
    b = a * (1 + part)
    assert min(a, b) <= combine(CombineRule.ENERGETIC, a, b, k_a, k_b) <= max(a, b)
