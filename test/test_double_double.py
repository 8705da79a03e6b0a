"""The number types of the kernels against fractions: double-doubles, and error bounds."""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable
from fractions import Fraction as F
from itertools import product

import pytest
from compile_cpp import compile_library
from hypothesis import example, given
from hypothesis import strategies as st

ROUNDOFF = F(2) ** -102
"""The relative accuracy of every operation on double-doubles."""

SOURCE = """
#include "numbers.hpp"
#include "scene/vectors.hpp"

template <class N> N calculated(int op, const N& a, const N& b) {
  switch (op) {
    case '+': return a + b;
    case '-': return a - b;
    case '*': return a * b;
    case '/': return a / b;
    case 'n': return -a;
    default: return root(a);
  }
}
template <class N> auto compared(int op, const N& a, const N& b) {
  return op == '<' ? less(a, b) : op == 'l' ? less_equal(a, b) : equal(a, b);
}

using Pair = DoubleDouble<double>;

extern "C" void on_pairs(int op, const double* x, double* y) {
  Pair z = calculated<Pair>(op, {x[0], x[1]}, {x[2], x[3]});
  y[0] = z.h; y[1] = z.l;
}
extern "C" void inner_product(int count, const double* x, double* y) {
  std::vector<Pair> a, b;
  for (int i = 0; i < count; ++i, x += 4) {
    a.push_back({x[0], x[1]});
    b.push_back({x[2], x[3]});
  }
  Pair z = dot(a, b);
  y[0] = z.h; y[1] = z.l;
}
extern "C" int compare_pairs(int op, const double* x) {
  return compared<Pair>(op, {x[0], x[1]}, {x[2], x[3]});
}

#define BOUNDED(name, T)                                                                          \\
  extern "C" void on_##name(int op, const double* x, double* y) {                                 \\
    auto z = calculated<Bounded<T>>(op, {T(x[0]), T(x[1])}, {T(x[2]), T(x[3])});                  \\
    y[0] = z.value; y[1] = z.error;                                                               \\
  }                                                                                               \\
  extern "C" int compare_##name(int op, const double* x) {                                        \\
    auto truth = compared<Bounded<T>>(op, {T(x[0]), T(x[1])}, {T(x[2]), T(x[3])});                \\
    return truth.value + 2 * truth.certain;                                                          \\
  }                                                                                               \\
  extern "C" void choose_##name(int truth, const double* x, double* y) {                          \\
    Truth<T> c{truth % 2 == 1, truth >= 2};                                                       \\
    auto z = choose<T>(c, Bounded<T>{T(x[0]), T(x[1])}, Bounded<T>{T(x[2]), T(x[3])});            \\
    y[0] = z.value; y[1] = z.error;                                                               \\
  }
BOUNDED(doubles, double)
BOUNDED(floats, float)
extern "C" void on_bounded_pairs(int op, const double* x, double* y) {
  auto z = calculated<Bounded<Pair>>(op, {{x[0], x[1]}, x[2]}, {{x[3], x[4]}, x[5]});
  y[0] = z.value.h; y[1] = z.value.l; y[2] = z.error;
}
extern "C" int both(int a, int b, int op) {
  Truth<double> x{a % 2 == 1, a >= 2}, y{b % 2 == 1, b >= 2};
  auto z = op == '&' ? x & y : op == '|' ? x | y : negation(x);
  return z.value + 2 * z.certain;
}
"""


@pytest.fixture(scope="module")
def numbers(tmp_path_factory) -> ctypes.CDLL:
    return compile_library(SOURCE, tmp_path_factory.mktemp("numbers"))


def call(function, op: str | int, *x: float, count: int = 2) -> list[float]:
    """Apply a function to double-doubles or bounded numbers."""
    result = (ctypes.c_double * count)()
    function(ord(op) if isinstance(op, str) else op, (ctypes.c_double * len(x))(*x), result)
    return list(result)


def ask(function, op: str, *x: float) -> int:
    return function(ord(op), (ctypes.c_double * len(x))(*x))


sizes = st.floats(2.0**-200, 2.0**200)
"""Products of these, and the errors of the products, neither overflow nor underflow."""
plain = sizes | sizes.map(lambda x: -x) | st.just(0.0)


def pair(high: float, share: float) -> tuple[float, float]:
    """A double-double: ``high`` plus ``share`` times half its last place."""
    low = high * share * 2.0**-53
    total = high + low
    return total, low - (total - high)


shares = st.floats(-0.99, 0.99)
pairs = st.builds(pair, plain, shares)
"""In sums of these, parts may cancel."""


def value(number) -> F:
    return F(number[0]) + F(number[1])


def assert_close(result, exact: F) -> None:
    assert result[0] == result[0] + result[1]
    assert abs(value(result) - exact) <= abs(exact) * ROUNDOFF


@given(x=pairs, y=pairs)
def test_operations(numbers, x, y):
    a, b = value(x), value(y)
    assert_close(call(numbers.on_pairs, "+", *x, *y), a + b)
    assert_close(call(numbers.on_pairs, "-", *x, *y), a - b)
    assert_close(call(numbers.on_pairs, "*", *x, *y), a * b)
    assert value(call(numbers.on_pairs, "n", *x, *y)) == -a
    if b:
        assert_close(call(numbers.on_pairs, "/", *x, *y), a / b)


@given(x=pairs, share=shares, tail=shares)
def test_a_sum_that_cancels(numbers, x, share, tail):
    y = pair(-x[0] * (1 + share * 2.0**-50), tail)
    assert_close(call(numbers.on_pairs, "+", *x, *y), value(x) + value(y))


@given(terms=st.lists(st.tuples(pairs, pairs), max_size=14), order=st.randoms())
def test_inner_products_are_as_exact_as_their_terms(numbers, terms, order):
    """Also where all terms but one cancel: the error is that of the roundings of the terms."""
    opposite = [((-a[0], -a[1]), b) for a, b in terms[1:]]
    for summed in (terms, order.sample(terms + opposite, len(terms + opposite))):
        exact = [value(a) * value(b) for a, b in summed]
        found = call(numbers.inner_product, len(summed), *(x for a, b in summed for x in (*a, *b)))
        assert abs(value(found) - sum(exact)) <= len(summed) * ROUNDOFF * sum(map(abs, exact))


@given(x=pairs)
def test_the_square_root(numbers, x):
    x = (abs(x[0]), x[1] if x[0] > 0 else -x[1])
    root = call(numbers.on_pairs, "r", *x, 0.0, 0.0)
    # The square of a root that is off by r is off by 2 r + r^2.
    assert abs(value(root) ** 2 - value(x)) <= value(x) * (2 * ROUNDOFF + ROUNDOFF**2)


@given(x=pairs, y=pairs)
def test_comparisons(numbers, x, y):
    for one, other in ((x, y), (y, x), (x, x), (x, pair(x[0], 0.5))):
        a, b = value(one), value(other)
        found = [ask(numbers.compare_pairs, op, *one, *other) for op in "<l="]
        assert found == [a < b, a <= b, a == b]


# Bounds.

OPERATIONS: dict[str, Callable[[F, F], F]] = {
    "+": lambda a, b: a + b,
    "-": lambda a, b: a - b,
    "*": lambda a, b: a * b,
    "/": lambda a, b: a / b,
}
anything = st.floats(allow_nan=False, allow_infinity=False)
errors = st.just(0.0) | st.floats(0, 1e-3) | st.floats(0, 1e-300) | st.floats(0, 10)


def with_slack(error: float, kind: str) -> F:
    """The error plus the rounding of its own arithmetic: the slack added where bounds are used."""
    return F(error) * (1 + (F(2) ** -50 if kind == "doubles" else F(2) ** -21))


def narrowed(x: float, kind: str) -> float:
    return x if kind == "doubles" else ctypes.c_float(x).value


def within(number: float, error: float) -> list[F]:
    return [F(number) - F(error), F(number), F(number) + F(error)]


both_kinds = pytest.mark.parametrize("kind", ["doubles", "floats"])


@both_kinds
@given(a=anything | plain, b=anything | plain, relative=st.tuples(errors, errors))
@example(6.6571406e-316, 1.52587890625e-05, (0.0, 0.000999994575977328))  # |a / b| db underflows
def test_no_error_exceeds_its_bound(numbers, kind, a, b, relative):
    """For all operands within their errors, down into the subnormals."""
    a, b = narrowed(a, kind), narrowed(b, kind)
    errors = [narrowed(min(abs(x) * e, 1e300), kind) for x, e in zip((a, b), relative, strict=True)]
    if not all(map(math.isfinite, (a, b, *errors))):
        return
    function = getattr(numbers, f"on_{kind}")
    for op, exact in OPERATIONS.items():
        result, error = call(function, op, a, errors[0], b, errors[1])
        if not error < math.inf or not math.isfinite(result):
            continue
        for x, y in product(within(a, errors[0]), within(b, errors[1])):
            assert op != "/" or y != 0, "a quotient by what may be 0 has no bound"
            assert abs(exact(x, y) - F(result)) <= with_slack(error, kind)


@both_kinds
@given(a=plain, relative=errors)
def test_the_bound_of_a_root(numbers, kind, a, relative):
    a = narrowed(abs(a), kind)
    error_of_a = narrowed(a * relative, kind)
    if not math.isfinite(error_of_a):  # or if a is not
        return
    root, error = call(getattr(numbers, f"on_{kind}"), "r", a, error_of_a, 0.0, 0.0)
    for x in within(a, error_of_a):
        if x >= 0:
            spread = with_slack(error, kind)
            low, high = max(F(root) - spread, F(0)), F(root) + spread
            assert low**2 <= x <= high**2


@given(a=pairs, b=pairs, relative=st.tuples(errors, errors))
def test_the_bounds_of_double_doubles(numbers, a, b, relative):
    errors = [abs(x[0]) * e * 2.0**-60 for x, e in zip((a, b), relative, strict=True)]
    for op, exact in OPERATIONS.items():
        if op == "/" and b[0] == 0:
            continue
        *result, error = call(numbers.on_bounded_pairs, op, *a, errors[0], *b, errors[1], count=3)
        for x, y in product((-1, 0, 1), repeat=2):
            meant = exact(value(a) + x * F(errors[0]), value(b) + y * F(errors[1]))
            assert abs(meant - value(result)) <= with_slack(error, "doubles")


LOWS = (0.0, 2.0**-60, 0.3, 0.5, 1 - 2.0**-52, 1.0, -(2.0**-60), -0.3, -0.5, -(1 - 2.0**-52), -1.0)


@pytest.mark.parametrize("x", [1.0, 1 + 2.0**-52, 2 - 2.0**-52, 1.3, 2.0**200 / 3, 2.0**-200 / 3])
@pytest.mark.parametrize("steps", [*range(-4, 5), 2.0**20, -(2.0**51), 2.0**52])
def test_the_bound_of_a_sum_that_cancels(numbers, x, steps):
    """High parts that differ by a few last places; low parts that add up, cancel, tie or are 0."""
    for a_low, b_low in product(LOWS, repeat=2):
        a, b = pair(x, a_low), pair(-(x + steps * math.ulp(x)), b_low)
        for op, exact in (("+", value(a) + value(b)), ("-", value(a) - value(b))):
            *result, error = call(numbers.on_bounded_pairs, op, *a, 0.0, *b, 0.0, count=3)
            assert abs(exact - value(result)) <= with_slack(error, "doubles")
            assert F(error) <= (abs(F(a[1])) + abs(F(b[1]))) * 2 * F(2) ** -53 + abs(exact) * 2 * ROUNDOFF


@both_kinds
@given(a=plain, b=plain, relative=st.tuples(errors, errors), near=st.booleans())
def test_a_certain_comparison_holds_for_all_values_within_the_errors(numbers, kind, a, b, relative, near):
    b = a * (1 + relative[0] / 2) if near else b
    a, b = narrowed(a, kind), narrowed(b, kind)
    errors = [narrowed(abs(x) * e, kind) for x, e in zip((a, b), relative, strict=True)]
    if not all(map(math.isfinite, (a, b, *errors))):
        return
    for op, exact in (("<", F.__lt__), ("l", F.__le__), ("=", F.__eq__)):
        truth = ask(getattr(numbers, f"compare_{kind}"), op, a, errors[0], b, errors[1])
        assert truth % 2 == exact(F(a), F(b))
        if truth >= 2:
            meant = product(within(a, errors[0]), within(b, errors[1]))
            assert {exact(x, y) for x, y in meant} == {truth % 2 == 1}
        else:
            assert errors != [0, 0]


@both_kinds
@given(a=plain, b=plain, relative=st.tuples(errors, errors), truth=st.integers(0, 3))
def test_an_uncertain_choice_covers_both_branches(numbers, kind, a, b, relative, truth):
    a, b = narrowed(a, kind), narrowed(b, kind)
    errors = [narrowed(abs(x) * e, kind) for x, e in zip((a, b), relative, strict=True)]
    if not all(map(math.isfinite, (a, b, *errors))):
        return
    result, error = call(getattr(numbers, f"choose_{kind}"), truth, a, errors[0], b, errors[1])
    taken, other = (0, 1) if truth % 2 else (1, 0)
    assert result == (a, b)[taken]
    if truth >= 2:
        assert error == errors[taken]
    elif error < math.inf:
        for x in (*within(a, errors[0]), *within(b, errors[1])):
            assert abs(x - F(result)) <= with_slack(error, kind)
    assert error >= errors[taken] or error >= errors[other]


def test_uncertain_truth_values_follow_kleene_logic(numbers):
    """A result is certain only if it holds whatever the uncertain operands are."""

    def possible(truth: int) -> set[bool]:
        return {truth % 2 == 1} if truth >= 2 else {False, True}

    for a, b in product(range(4), repeat=2):
        for op, exact in (("&", bool.__and__), ("|", bool.__or__), ("~", lambda x, _: not x)):
            result = numbers.both(a, b, ord(op))
            assert result % 2 == exact(a % 2 == 1, b % 2 == 1)
            assert (result >= 2) == (len({exact(x, y) for x in possible(a) for y in possible(b)}) == 1)
