"""Formulas as data: what tapes may simplify, how they are emitted, and that kernels compute the formulas."""

from __future__ import annotations

import ctypes
import math
import re
import subprocess
import sys
from itertools import product
from pathlib import Path
from typing import Any, NamedTuple

import pytest
from batch_cases import FIRST_FAULTY, collision_at, shared_batch
from collisions import LAWS_WITH_ORACLE, PATH_LAWS, Collision, collisions, planar_collisions, random_collision
from compile_cpp import compile_library
from extremes import extremes
from hypothesis import given, settings
from hypothesis import strategies as st
from random_impacts import RandomImpacts

from collision_response import Geometry, ImpactError, ImpactModel, Law, Precision, resolve
from collision_response.impact import ImpactNumbers, impact
from collision_response.kernels.layout import Layout, names_of_body
from collision_response.kernels.tracer import headers, trace
from collision_response.kernels.tracer.branches import LEAST_SAVING
from collision_response.kernels.tracer.constants import FORMULAS
from collision_response.kernels.tracer.emit import emit
from collision_response.kernels.tracer.headers import FALLBACK_ARGUMENTS
from collision_response.kernels.tracer.inputs import kernel_inputs
from collision_response.kernels.tracer.simd_pairs import PAIR, pair_bodies
from collision_response.kernels.tracer.symbol import Loop, Node, Tape
from collision_response.model import plan_model
from collision_response.numbers.operations import (
    certain,
    choose,
    error_of,
    fixed,
    iterate,
    maximum,
    minimum,
    negation,
    numbers_in,
    rebuilt,
    square_root,
    varying_as,
    widened,
)
from collision_response.physics.effective_mass import ContactKinematics
from collision_response.physics.laws import LAWS, Settings
from collision_response.physics.laws.coulomb import fallback
from collision_response.status import StatusCode


def traced(formula) -> tuple[Tape, int]:
    """A formula of x and y on a tape, and the index of its result."""
    tape = Tape()
    return tape, tape.symbol(formula(tape.input("x"), tape.input("y"))).index


def tree(tape: Tape, place: int) -> tuple:
    node = tape.nodes[place]
    return (node.op, node.value, *(tree(tape, arg) for arg in node.args))


def less(x, y, if_true, if_false):
    return choose(x < y, lambda: if_true, lambda: if_false)


@pytest.mark.parametrize(
    ("formula", "simpler"),
    [
        (lambda x, y: x * 0 + y, lambda x, y: y),
        (lambda x, y: 0 + x * 1 - 0, lambda x, y: x),
        (lambda x, y: x * y + y * x, lambda x, y: x * y + x * y),
        (lambda x, y: (x + y) * (y + x), lambda x, y: (x + y) * (x + y)),
        (lambda x, y: -x * y, lambda x, y: -(x * y)),
        (lambda x, y: -x * -y, lambda x, y: x * y),
        (lambda x, y: x * -1, lambda x, y: -x),
        (lambda x, y: x / -y, lambda x, y: -(x / y)),
        (lambda x, y: -x / y, lambda x, y: -(x / y)),
        (lambda x, y: -x + y, lambda x, y: y - x),
        (lambda x, y: x - -y, lambda x, y: x + y),
        (lambda x, y: -x - y, lambda x, y: -(x + y)),
        (lambda x, y: 0 - (0 - x), lambda x, y: x),
        (lambda x, y: (x - y) * (y - x), lambda x, y: -((x - y) * (x - y))),
        (lambda x, y: x / 4, lambda x, y: x * 0.25),
        (lambda x, y: 0 / x, lambda x, y: 0.0),
        (lambda x, y: x + (2 * 3.0 + 1), lambda x, y: x + 7),
        (lambda x, y: less(x, y, x, x), lambda x, y: x),
        (lambda x, y: choose(~~(x < y), lambda: x, lambda: y), lambda x, y: less(x, y, x, y)),
        (lambda x, y: choose((x < y) | True, lambda: x, lambda: y), lambda x, y: x),
        (lambda x, y: choose((x < y) & False, lambda: x, lambda: y), lambda x, y: y),
        (lambda x, y: choose((x < y) & True & (x < y), lambda: x, lambda: y), lambda x, y: less(x, y, x, y)),
        (lambda x, y: choose(y > x, lambda: x, lambda: y), lambda x, y: less(x, y, x, y)),
        (lambda x, y: certain(certain(x)), lambda x, y: certain(x)),
        (lambda x, y: error_of(certain(x)) + y, lambda x, y: y),
        (lambda x, y: widened(x, 0), lambda x, y: x),
    ],
)
def test_the_tape_simplifies(formula, simpler):
    assert tree(*traced(formula)) == tree(*traced(simpler))


@pytest.mark.parametrize(
    "formula",
    [
        lambda x, y: x / x,
        lambda x, y: x - x,
        lambda x, y: x / 3,
        lambda x, y: (x + y) - y,
        lambda x, y: x * 0.1 * 10,
        lambda x, y: square_root(x * x),
        lambda x, y: choose(x == x, lambda: x, lambda: y),
    ],
)
def test_the_tape_does_not_simplify_what_would_change_an_answer(formula):
    tape, place = traced(formula)
    assert tape.nodes[place].args


def test_a_traced_number_has_no_truth_value():
    x = Tape().input("x")
    with pytest.raises(TypeError, match=r"choose\(\)"):
        bool(x < 1)
    with pytest.raises(ValueError, match="two tapes"):
        x + Tape().input("x")


# A tape evaluated in Python: an independent version of the emitted code.


def run(tape: Tape, inputs: dict, place: int, outside: dict | None = None, state: tuple = ()) -> Any:
    """Evaluate the node at ``place``, and all that it depends on, in plain floats."""
    return _Run(tape, inputs, outside, state)[place]


class _Run(dict):
    def __init__(self, tape: Tape, inputs: dict, outside: dict | None, state: tuple) -> None:
        super().__init__()
        self.tape, self.inputs, self.outside, self.state = tape, inputs, outside, state

    def __missing__(self, place: int) -> Any:
        node = self.tape.nodes[place]
        self[place] = result = self.value(node)
        return result

    def value(self, node: Node) -> Any:
        match node.op:
            case "input":
                return self.inputs[node.value]
            case "constant" | "truth":
                return node.value
            case "given_roundoff":
                return 2.0**-53
            case "outer":
                return self.outside[node.value]
            case "state":
                return self.state[node.value]
            case "call":
                numbers = (self[arg] for arg in node.args)
                return list(numbers_in(fallback(*(rebuilt(part, numbers) for part in FALLBACK_ARGUMENTS))))
            case "part" | "result":
                return self[node.args[0]][node.value]
            case "loop":
                return self.loop(node.value, tuple(self[arg] for arg in node.args))
            case "select":  # one branch: the other may divide by zero
                condition, if_true, if_false = node.args
                return self[if_true] if self[condition] else self[if_false]
        args = [self[arg] for arg in node.args]
        match node.op:
            case "add":
                return args[0] + args[1]
            case "sub":
                return args[0] - args[1]
            case "mul":
                return args[0] * args[1]
            case "div":
                return args[0] / args[1]
            case "neg":
                return -args[0]
            case "sqrt":
                return math.sqrt(args[0])
            case "lt":
                return args[0] < args[1]
            case "le":
                return args[0] <= args[1]
            case "eq":
                return args[0] == args[1]
            case "and":
                return args[0] and args[1]
            case "or":
                return args[0] or args[1]
            case "not":
                return not args[0]
            case "certain" | "widened":
                return args[0]
            case "error_of":
                return 0.0
        raise AssertionError(node)

    def loop(self, loop: Loop, state: tuple) -> tuple:
        for _ in range(loop.budget):
            turn = _Run(loop.tape, self.inputs, self, state)
            if not turn[loop.condition]:
                break
            state = tuple(turn[place] for place in loop.state_after)
        return state


numbers = st.floats(-1e6, 1e6)
constants = st.sampled_from([0, 1, -1, 2.0, 0.25, 3, -0.1, 1e-3])


@st.composite
def formulas(draw):
    """Random formulas as nested tuples, with many of the constants that tapes simplify."""
    leaves = st.sampled_from(["x", "y"]) | constants
    binary = st.sampled_from(["+", "-", "*", "/", "max", "min", "choose"])
    return draw(
        st.recursive(
            leaves,
            lambda part: (
                st.tuples(binary, part, part) | st.tuples(st.sampled_from(["neg", "root", "abs"]), part)
            ),
            max_leaves=14,
        )
    )


def evaluated(formula, x, y):
    if isinstance(formula, str):
        return {"x": x, "y": y}[formula]
    if not isinstance(formula, tuple):
        return formula
    op, *args = formula
    a, *rest = (evaluated(part, x, y) for part in args)
    if op == "neg":
        return -a
    if op == "abs":
        return abs(a)
    if op == "root":
        return square_root(abs(a) * 1.0)
    b = rest[0]
    if op == "max":
        return maximum(a, b)
    if op == "min":
        return minimum(a, b)
    if op == "choose":
        return choose((a < b) & (b != 0), lambda: a / b, lambda: b - a)
    return {"+": lambda: a + b, "-": lambda: a - b, "*": lambda: a * b, "/": lambda: a / b}[op]()


@settings(max_examples=150)
@given(formula=formulas(), x=numbers, y=numbers)
def test_no_simplification_changes_a_rounding(formula, x, y):
    try:
        expected = evaluated(formula, x, y)
    except ZeroDivisionError:
        return
    tape, place = traced(lambda x, y: evaluated(formula, x, y))
    if math.isfinite(expected):
        assert run(tape, {"x": x, "y": y}, place) == expected


class Newton(NamedTuple):
    """A state of two numbers."""

    root: Any
    before: Any


def newtons_root(x, y):
    """The root of ``x`` by Newton's method from above. Adding ``y`` makes the loop read an outside value."""
    start = Newton(maximum(x, 1.0 + 0 * x) + 1, 3 * (x + 2))

    def step(at: Newton) -> Newton:
        return Newton((at.root + x / at.root) / 2 + y, at.root)

    return iterate(start, lambda at: at.root < at.before, step, 60).root * 2


def nested(x, y):
    """A loop in a loop."""

    def outer(at: Newton) -> Newton:
        inner = iterate(
            Newton(at.root, 0 * x),
            lambda s: s.before < y,
            lambda s: Newton(s.root * 1.5, s.before + at.before),
            9,
        )
        return Newton(inner.root - y, at.before + 1)

    return iterate(Newton(x, 1.0 + 0 * x), lambda at: at.before < 4, outer, 10).root


@pytest.mark.parametrize("formula", [newtons_root, nested])
@pytest.mark.parametrize("x", [0.3, 2.0, 977.0])
@pytest.mark.parametrize("y", [0.0, 2.5])
def test_a_loop_is_written_once_and_runs_as_it_does_on_floats(formula, x, y):
    tape, place = traced(formula)
    assert len(tape.nodes) < 40
    assert run(tape, {"x": x, "y": y}, place) == formula(x, y)


def test_a_loop_that_never_runs_is_removed():
    start = Newton(1.0, 2.0)
    tape, _ = traced(lambda x, y: iterate(start, lambda at: (x < y) & False, lambda at: at, 5).root)
    assert not any(node.op == "loop" for node in tape.nodes)


def test_operations_on_both_bodies_are_paired():
    tape = Tape()
    a, b, shared = (tape.input(name) for name in ("body_a.x", "body_b.x", "contact.y"))
    of_a, of_b = a * shared + 1, b * shared + 1
    [[first, difference]] = pair_bodies([[of_a, of_a / shared - of_b]])
    ops = [(node.op, node.value == PAIR) for node in first.tape.nodes]
    assert ops.count(("mul", True)) == ops.count(("add", True)) == 1
    assert ops.count(("div", False)) == ops.count(("sub", False)) == 1
    assert not {("mul", False), ("add", False)} & set(ops)
    assert first.node.op == "first"
    assert [difference.tape.nodes[index].op for index in difference.node.args] == ["div", "second"]


# The emitter.


def emitted(bounded=(), reported=(), flags=(), certainties=(), **options) -> str:
    tape = Tape()
    x, y = tape.input("x"), tape.input("y")
    lists = ([tape.symbol(f(x, y)) for f in formulas] for formulas in (bounded, reported, flags, certainties))
    return emit("f", ["x", "y"], *lists, **options)


def lines(code: str) -> list[str]:
    return [line.strip() for line in code.splitlines()]


def test_reported_only_values_are_computed_without_errors():
    code = lines(emitted(bounded=[lambda x, y: x + y], reported=[lambda x, y: x * y]))
    assert "const auto t0 = in[0];" in code
    assert "const auto t2 = t0 + t1;" in code
    assert "const auto t3 = report(t0) * report(t1);" in code
    assert "bounded[0] = t2;" in code
    assert "reported[0] = t3;" in code


def test_reported_values_may_be_rounded_last():
    code = lines(emitted(bounded=[lambda x, y: x + y], reported=[lambda x, y: x * y], rounded_last=1))
    assert "const auto t3 = value(t0) * value(t1);" in code
    assert "reported[0] = report(t3);" in code


def test_values_whose_error_is_dropped_carry_none():
    code = lines(emitted(bounded=[lambda x, y: x + certain(x * y)]))
    assert "const auto t2 = value(t0) * t1;" in code
    assert any(line.startswith("const auto t1 = value(in[1])") for line in code)
    assert any("lifted<N>(t2)" in line for line in code)


def test_values_whose_error_is_read_carry_it():
    code = "\n".join(lines(emitted(reported=[lambda x, y: error_of(x * y)])))
    assert "const auto t2 = t0 * t1;" in code
    assert "error_of(t2)" in code


def test_constants_are_exact_and_unused_inputs_are_omitted():
    code = emitted(bounded=[lambda x, y: x * 0.1 + (y - y) * 0])
    assert f"constant<N>({(0.1).hex()})" in code
    assert "in[1]" not in code


def test_a_loop_has_plain_values_and_tests_its_condition_first():
    code = lines(emitted(bounded=[newtons_root]))
    start = code.index("for (int iteration = 0; iteration < 60; ++iteration) {")
    going = next(i for i, line in enumerate(code) if "_continues = " in line)
    assert code[going + 1].startswith("if (!any(")
    division = next(i for i, line in enumerate(code[start:], start) if " / " in line)
    assert start < going < division
    assert any(re.fullmatch(r"Value<N> t\d+_0, .*;", line) for line in code[:start])


def quotients(x, y):
    return x / (y * y + 1) - (x + y) / (x * x + 2) + choose(y < 1, lambda: x / 3 + y / 7, lambda: y)


def choices(x, y):
    return choose((x < y) & negation(y == 2.5), lambda: -x, lambda: square_root(y * y)) + abs(x)


FUNCTIONS = {
    "arithmetic": lambda x, y: (x - y) * (x + 3) / (y * y + 1) - x / 8,
    "choices": choices,
    "newtons_root": newtons_root,
    "branches": lambda x, y: choose(x < y, lambda: quotients(x, y), lambda: abs(x)),
    "mixed": lambda x, y: widened(certain(x) + y, abs(y)) * choose(certain(x) < y, lambda: y, lambda: 2.0),
}


@pytest.fixture(scope="module")
def library(tmp_path_factory) -> ctypes.CDLL:
    """Each function emitted, and compiled for some number types."""
    source = '#include "numbers.hpp"\n'
    types = {"double": "double", "bounded": "Bounded<double>", "long": "Bounded<DoubleDouble<double>>"}
    for name, formula in FUNCTIONS.items():
        tape = Tape()
        inputs = [tape.input(which) for which in ("x", "y")]
        result = tape.symbol(formula(*inputs))
        truth = tape.symbol(inputs[0] < inputs[1])
        straight = emit(f"{name}_straight", ["x", "y"], [result], [result], [truth], [truth])
        branched = emit(name, ["x", "y"], [result], [result], [truth], [truth], least_saving=LEAST_SAVING)
        assert ("if (may_be_true" in branched) is (name == "branches")
        source += straight + branched
        for (kind, number), way in product(types.items(), ("", "_straight")):
            source += f"""
extern "C" void {name}{way}_{kind}(double x, double y, double* to) {{
  using N = {number};
  N in[2] = {{Make<N>::read(x, 0), Make<N>::read(y, 0)}}, bounded[1];
  Report<N> reported[1];
  Mask<Base<N>> flags[2];
  {name}{way}<N>(in, bounded, reported, flags);
  to[0] = high(bounded[0]); to[1] = error_of(bounded[0]); to[2] = reported[0];
  to[3] = flags[0]; to[4] = flags[1];
}}
"""
    return compile_library(source, tmp_path_factory.mktemp("emitted"))


@pytest.mark.parametrize("kind", ["double", "bounded", "long"])
@pytest.mark.parametrize("name", FUNCTIONS)
def test_emitted_code_computes_its_formula(library, name, kind):
    formula = FUNCTIONS[name]
    for x, y in product((0.3, 1.0, 2.5, 40.0), (-1.0, 0.0, 2.5, 7.0)):
        if name == "newtons_root" and y < 0:
            continue
        to, same = (ctypes.c_double * 5)(), (ctypes.c_double * 5)()
        getattr(library, f"{name}_{kind}")(ctypes.c_double(x), ctypes.c_double(y), to)
        getattr(library, f"{name}_straight_{kind}")(ctypes.c_double(x), ctypes.c_double(y), same)
        assert bytes(to) == bytes(same)
        value, error, reported, below, surely = to
        expected = formula(x, y)
        assert below == (x < y)
        assert surely == (x < y and kind != "double")
        if kind == "long":
            assert value == pytest.approx(expected, rel=1e-14)
        else:
            assert (value, reported) == (expected, expected)
        if kind == "double" or name == "newtons_root":
            assert error <= abs(value) * 2.0**-52  # a loop carries no error, only what follows it does


DIFFERENTIATED = {
    "x + y": lambda x, y: x + y,
    "x + 2": lambda x, y: x + 2,
    "x - y": lambda x, y: x - y,
    "x - 2": lambda x, y: x - 2,
    "2 - x": lambda x, y: 2 - x,
    "-x": lambda x, y: -x,
    "x y": lambda x, y: x * y,
    "3 x": lambda x, y: 3 * x,
    "x / y": lambda x, y: x / y,
    "x / 3": lambda x, y: x / 3,
    "3 / x": lambda x, y: 3 / x,
    "root": lambda x, y: square_root(x),
    "either": lambda x, y: choose(x < y, lambda: x, lambda: y),
    "x or 2": lambda x, y: choose(x < y, lambda: x, lambda: 2.0),
    "2 or y": lambda x, y: choose(x < y, lambda: 2.0, lambda: y),
    "varying as": lambda x, y: varying_as(x, lambda: x * y),
    "fixed": lambda x, y: fixed(x) * y + fixed(2 * y),
    "branches": lambda x, y: choose(x < y, lambda: quotients(x, y), lambda: quotients(y, x) * x),
}


def once_in_a_loop(formula, x, y):
    """``formula(x, y)`` for ``y > 0``, by a loop that ends after one iteration."""
    return iterate(
        Newton(x, y), lambda at: at.before > 0, lambda at: Newton(formula(at.root, y), -at.before), 9
    ).root


@pytest.fixture(scope="module")
def derivatives(tmp_path_factory) -> ctypes.CDLL:
    """Each formula compiled for dual numbers, in a loop and without one."""
    source = '#include "dual.hpp"\nusing N = Dual<Bounded<double>, DenseDerivatives>;\n'
    ways = {"straight": lambda formula, x, y: formula(x, y), "loop": once_in_a_loop}
    for (i, formula), (way, compute) in product(enumerate(DIFFERENTIATED.values()), ways.items()):
        tape = Tape(of_derivatives=True)
        result = tape.symbol(compute(formula, tape.input("x"), tape.input("y")))
        assert any(node.op == "loop" for node in tape.nodes) is (way == "loop")
        source += emit(f"{way}_{i}", ["x", "y"], [result], least_saving=LEAST_SAVING)
        source += f"""
extern "C" void derive_{way}_{i}(double x, double y, double* to) {{
  N in[2] = {{{{{{x, 0}}}}, {{{{y, 0}}}}}}, bounded[1];
  in[0].d.d[0][1] = in[1].d.d[3][2] = 1;
  {way}_{i}<N>(in, bounded, nullptr, nullptr);
  to[0] = bounded[0].value.value; to[1] = bounded[0].d.d[0][1]; to[2] = bounded[0].d.d[3][2];
}}
"""
    return compile_library(source, tmp_path_factory.mktemp("derivatives"))


@pytest.mark.parametrize("name", DIFFERENTIATED)
def test_a_loop_has_the_derivatives_of_its_formula(derivatives, name):
    """A loop is differentiated by operators of its own. Both round each operation a few times."""
    for x, y in product((0.3, 1.0, 2.5), (0.7, 2.0, 40.0)):
        found = []
        for way in ("straight", "loop"):
            to = (ctypes.c_double * 3)()
            function = getattr(derivatives, f"derive_{way}_{[*DIFFERENTIATED].index(name)}")
            function(ctypes.c_double(x), ctypes.c_double(y), to)
            found.append(list(to))
        assert found[0][0] == found[1][0]
        assert found[1] == pytest.approx(found[0], rel=1e-14, abs=1e-15)


# The laws: traced, and compiled.


def inputs_of(collision: Collision, layout: Layout, settings: Settings) -> dict[str, float]:
    """The numbers of a request by their names."""
    found = {}
    for owner, body in (("body_a", collision.body_a), ("body_b", collision.body_b)):
        for name in names_of_body(layout):
            field, axis = name.split(".")
            part = getattr(body, field)
            if field == "orientation" and part is None:
                found[f"{owner}.{name}"] = 1.0 if axis == "w" else 0.0
            else:
                found[f"{owner}.{name}"] = getattr(part, axis) if axis else part
    contact = collision.contact
    for field, axis in product(("position", "normal"), "xyz"):
        found[f"contact.{field}.{axis}"] = getattr(getattr(contact, field), axis)
    return found | {
        "contact.restitution.": contact.restitution,
        "contact.friction.": contact.friction,
        **{f"model.{name}": value for name, value in settings._asdict().items()},
    }


def values(answer: ImpactNumbers) -> list[float]:
    return [float(x) for x in numbers_in((answer.changes, answer.report))]


@pytest.mark.parametrize("law", LAWS_WITH_ORACLE)
@pytest.mark.parametrize("layout", [Layout.SPATIAL, Layout.EVERYTHING])
def test_a_traced_law_gives_the_bits_of_the_law(law, layout):
    tape = Tape()
    asked = kernel_inputs(layout, tape)
    traced = impact(asked.body_a, asked.body_b, asked.contact, law, asked.settings)
    places = [tape.symbol(x).index for x in numbers_in((traced.changes, traced.report))]
    compared = 0
    for seed in range(6):
        collision = random_collision(seed, off_centre=layout is Layout.EVERYTHING)
        if layout is Layout.SPATIAL:
            collision = Collision(
                *(body._replace(orientation=None) for body in collision[:2]), collision.contact
            )
        direct = impact(*collision, law, Settings(0.25, 0.5))
        once = _Run(tape, inputs_of(collision, layout, Settings(0.25, 0.5, law=float(law))), None, ())
        assert [once[place] for place in places] == values(direct)
        compared += direct.flags.separating is False
    assert compared >= 3


TEST = re.compile(r"may_be_true\((?:(negation)\()?(t\d+)\)")
WRITTEN = re.compile(r"(?:const auto )?(t\d+) = ")


@pytest.mark.parametrize("formula", FORMULAS)
def test_no_branch_reads_a_value_that_was_not_computed(formula):
    """A value computed only where a condition may hold must be read only below that condition."""
    tests = 0
    for header in headers.headers_of(formula).values():
        known: dict[str, frozenset] = {}  # of each name: where it is computed
        blocks: list[frozenset] = [frozenset()]
        for line in lines(header()):
            if line.startswith("}"):
                blocks.pop()
            if line.startswith("template"):
                known = {}
            if name := WRITTEN.match(line):
                known[name[1]] = blocks[-1]
            asked = blocks[-1]
            is_choice = line.startswith(("if (!", "else"))
            for negated, name in TEST.findall(line):
                assert known[name] <= asked, line
                tests += 1
                if not is_choice:
                    asked |= {(name, not negated)}
            if line.endswith("{"):
                blocks.append(asked)
    assert tests > 100


def test_every_layout_of_every_law_is_generated():
    layouts = [one.name.lower() for one in Layout]
    written = {
        "validity": layouts,
        "frictionless": [*layouts, "derivatives"],
        "compliant": ["everything", "articulated", "derivatives"],
    }
    for what, kinds in written.items():
        assert [*headers.headers_of(what)] == [f"{what}_{kind}" for kind in kinds]
    kinds = [headers.FORMULA_LISTS[kind] for kind in ("formulas", "stepped_formulas")]
    assert {*kinds[0], *kinds[1]} == {formula.__name__ for formula in LAWS.values()}
    header = headers.headers_of("constants")["constants"]()
    assert all(f"LAW_{law.name} = {law.value}," in header for law in Law)


def slip_is_rounding(collision: Collision) -> bool:
    """Whether the contact slips before the impact, but by less than the rounding errors of the slip."""
    *bodies, contact = collision
    kinematics = ContactKinematics.of(*collision)
    n, u = kinematics.n, kinematics.u
    arms = [(contact.position - body.position).norm() for body in bodies]
    size = sum(
        body.velocity.norm() + body.angular_velocity.norm() * arm
        for body, arm in zip(bodies, arms, strict=True)
    )
    slip = u - n * (n.dot(u) / n.dot(n))
    return 0 < slip.norm() < 2.0**-45 * size  # a few dozen roundings of 2^-53 each


def same_bits(collision: Collision, model: ImpactModel) -> bool:
    """Whether the kernels answer a request, and then with the bits of the formulas on plain floats."""
    try:
        direct = impact(*collision, model.law, plan_model(model).settings)
    except (ZeroDivisionError, OverflowError):  # the kernels give infinities instead
        return False
    try:
        compiled = resolve(*collision, model._replace(precision=Precision.DOUBLE))
    except ImpactError as refusal:
        assert refusal.code is StatusCode.OUT_OF_RANGE or direct.flags.unfinished
        return False
    in_the_middle = all(x == 0 or 1e-120 < abs(x) < 1e120 for x in values(direct))
    if not in_the_middle or compiled.error_bound == math.inf:
        return False  # the kernels may rescale
    if model.law in PATH_LAWS and slip_is_rounding(collision):
        return False  # the kernels know that, plain floats do not
    changes = compiled.impulse, compiled.change_a, compiled.change_b
    report = compiled.twist_a, compiled.twist_b, compiled[8:17]
    assert list(numbers_in((changes, report))) == values(direct)[: 15 + 12 + 9]
    assert compiled.regime == direct.report.regime
    return True


each_law = pytest.mark.parametrize("law", LAWS_WITH_ORACLE, ids=lambda law: law.name)


@each_law
def test_kernels_give_the_bits_of_the_formulas_in_space(law):
    @settings(max_examples=40)
    @given(collision=collisions())
    def holds(collision: Collision) -> None:
        same_bits(collision, ImpactModel(law, tangential_restitution=0.25, restitution_threshold=0.1))

    holds()
    assert all(same_bits(random_collision(seed), ImpactModel(law)) for seed in range(10))


@each_law
def test_kernels_give_the_bits_of_the_formulas_in_the_plane(law):
    @settings(max_examples=40)
    @given(collision=planar_collisions())
    def holds(collision: Collision) -> None:
        same_bits(collision, ImpactModel(law, tolerance=1e-6))

    holds()


@each_law
@pytest.mark.parametrize("decades", [0, 1, 3, 10])
def test_kernels_give_the_bits_of_the_formulas_whatever_the_sizes(law, decades):
    impacts = RandomImpacts(seed=decades, decades=decades)
    drawn = (impacts.request(law) for _ in range(60))
    answered = sum(same_bits(collision, model._replace(geometry=Geometry.AUTO)) for collision, model in drawn)
    assert answered >= 30


@each_law
def test_kernels_give_the_bits_of_the_formulas_on_extremes(law):
    answered = [same_bits(extreme.collision, ImpactModel(law)) for extreme in extremes()]
    assert sum(answered) > 15  # the others are rescaled


@each_law
@pytest.mark.parametrize("geometry", [Geometry.POINT, Geometry.PLANAR, Geometry.SPATIAL])
def test_kernels_give_the_bits_of_the_formulas_on_the_contacts_of_batches(law, geometry):
    """``test_batch.py`` shows that the batch kernels give the same bits."""
    answered = [
        same_bits(collision_at(geometry, *shared_batch(geometry), i), ImpactModel(law))
        for i in range(FIRST_FAULTY)
    ]
    assert sum(answered) > 90


def test_what_is_traced_is_older_than_an_edit_meanwhile(tmp_path):
    """Otherwise the next build would leave out the edit."""
    tracer = Path(trace.__file__)
    package = tracer.parent.parent.parent
    subprocess.run([sys.executable, "-IB", tracer, package, tmp_path, "constants"], check=True)
    written = {path.suffix: path.stat().st_mtime_ns for path in tmp_path.iterdir()}
    assert written[".hpp"] == written[".stamp"] < written[".d"]
