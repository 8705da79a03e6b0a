"""Double-doubles: exact transforms, and errors below the bound, against fractions."""

from __future__ import annotations

import math
from fractions import Fraction as F

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from collision_response.numerics.double_double import (
    ROUNDOFF,
    DoubleDouble,
    double_double,
    lift,
    lower,
    two_product,
    two_sum,
)
from collision_response.numerics.emit_scalar import emit_scalar
from collision_response.numerics.program import Program, Slot
from collision_response.numerics.tape import Tape
from collision_response.physics.number import choose, square_root
from collision_response.physics.vector import Vec3

sizes = st.floats(2.0**-200, 2.0**200)
"""Whose products, and the errors of those, neither overflow nor underflow."""
numbers = sizes | sizes.map(lambda x: -x) | st.just(0.0)
doubled = st.builds(
    lambda high, share: two_sum(high, high * share * 2.0**-53), numbers, st.floats(-0.99, 0.99)
)
"""Of which some parts cancel: the second of a sum need not be smaller than the other's first."""


def value(number: DoubleDouble) -> F:
    return F(number.high) + F(number.low)


def assert_close(result: DoubleDouble, exact: F) -> None:
    assert result.high == result.high + result.low
    assert abs(value(result) - exact) <= abs(exact) * F(ROUNDOFF)


@given(numbers, numbers)
def test_the_transforms_lose_nothing(a, b):
    assert value(two_sum(a, b)) == F(a) + F(b)
    assert value(two_product(a, b)) == F(a) * F(b)


@given(doubled, doubled)
def test_operations(x, y):
    assert_close(x + y, value(x) + value(y))
    assert_close(x - y, value(x) - value(y))
    assert_close(x * y, value(x) * value(y))
    if y.high:
        assert_close(x / y, value(x) / value(y))


@given(doubled, st.floats(-0.999, 0.999))
def test_a_sum_that_cancels(x, share):
    y = two_sum(-x.high, x.high * share * 2.0**-52) + x.low * share
    assert_close(x + y, value(x) + value(y))


@given(doubled, numbers | st.sampled_from([0, 1, -1, 2, 3, 0.5]))
def test_operations_with_a_plain_number(x, y):
    assert_close(x + y, value(x) + F(y))
    assert_close(y - x, F(y) - value(x))
    assert_close(y * x, value(x) * F(y))
    if y:
        assert_close(x / y, value(x) / F(y))
    if x.high:
        assert_close(y / x, F(y) / value(x))


@given(doubled)
def test_the_square_root(x):
    x = -x if x.high < 0 else x
    root = square_root(x)
    # The square of a root that is off by r is off by 2 r + r^2.
    assert abs(value(root) ** 2 - value(x)) <= value(x) * (2 * F(ROUNDOFF) + F(ROUNDOFF) ** 2)


@given(doubled, doubled | numbers)
def test_comparisons(x, y):
    a, b = value(x), value(double_double(y))
    assert (x < y, x <= y, x > y, x >= y, x == y, x != y) == (a < b, a <= b, a > b, a >= b, a == b, a != b)
    assert x == x and x <= x and not x < x


def test_nearly_equal_numbers_are_told_apart():
    x = DoubleDouble(1.0, 2.0**-80)
    assert 1 < x < 1 + 2.0**-52 and x != 1 and x > DoubleDouble(1.0, 2.0**-81)


def test_named_tuples_of_numbers():
    v = Vec3(1.0, 2.0, DoubleDouble(3.0, 2.0**-60))
    assert all(isinstance(x, DoubleDouble) for x in lift(v))
    assert lower(lift(v)) == Vec3(1.0, 2.0, 3.0)


def formula(x, y):
    """One with everything in it."""
    larger = choose(x < y, lambda: y, lambda: x)
    return square_root(x * x + y * y / 3) - choose(larger > 0, lambda: larger * 2, lambda: 1.0) / (
        x - y * 0.3
    )


@given(numbers, numbers)
def test_on_floats_on_arrays_and_traced_it_is_the_same(x, y):
    tape, inputs = Tape(), (Slot("x", 0), Slot("y", 0))
    traced = formula(*(DoubleDouble(tape.input(slot)) for slot in inputs))
    outputs = {Slot("result", i): tape.symbol(part).place for i, part in enumerate(traced)}
    names = {"inf": math.inf, "nan": math.nan, "sqrt": math.sqrt}
    exec(emit_scalar(Program(tape, inputs, outputs)), names)
    if x - y * 0.3 == 0:
        return
    direct = formula(DoubleDouble(x), DoubleDouble(y))
    with np.errstate(all="ignore"):
        arrays = formula(*(DoubleDouble(np.array([number]), np.zeros(1)) for number in (x, y)))
    assert names["kernel"](x, y) == tuple(direct) == tuple(float(part[0]) for part in arrays)


def test_what_is_known_to_be_zero_is_not_computed():
    tape = Tape()
    x, y = tape.input("x"), tape.input("y")
    total = DoubleDouble(x, tape.symbol(0.0)) + DoubleDouble(y)
    assert len(tape.needed_for(part.place for part in total)) == 2 + 6  # Knuth's six operations


def test_a_fused_multiply_add_gives_the_error_of_a_product_at_once():
    tape = Tape(fused=True)
    x, y = tape.input("x"), tape.input("y")
    parts = [part for factor in (x, -x) for part in two_product(factor, y)]
    ops = [tape.nodes[place].op for place in tape.needed_for(part.place for part in parts)]
    assert ops.count("mul") == ops.count("fma") == 1  # the others are these, negated
    assert [part.is_value(0) for part in two_product(x, tape.symbol(0.0))] == [True, True]
