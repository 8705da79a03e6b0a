"""Rules that join the coefficients of two materials."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

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
def test_of_a_quarter_and_one(rule, expected):
    assert combine(rule, Fraction(1, 4), Fraction(1)) == expected
    assert combine(rule, 0.25, 1.0) == expected
    assert combine(rule, np.array([0.25, 1.0]), np.array([1.0, 0.25])).tolist() == [expected, expected]


@every_rule
@given(a=coefficients, b=coefficients)
def test_order_does_not_matter_and_the_range_is_kept(rule, a, b):
    joined = combine(rule, a, b)
    assert joined == combine(rule, b, a)
    assert 0 <= joined <= max(a, b)


@pytest.mark.parametrize("rule", [rule for rule in CombineRule if rule is not CombineRule.MULTIPLY])
@given(a=st.floats(1e-100, 1))
def test_two_of_one_material_have_its_coefficient(rule, a):
    assert combine(rule, a, a) == a
