"""Traced formulas: what the tape may simplify, and that programs are the laws they were traced from."""

from __future__ import annotations

import math
from fractions import Fraction as F
from itertools import product

import numpy as np
import pytest
from batches import IMMOVABLE, N, scene_of, some

from collision_response import Geometry, Law
from collision_response.batch.kernels import bare, general, ordinary, unchecked
from collision_response.batch.problem import Problem
from collision_response.model import EXACT_LAWS
from collision_response.numerics.emit_blocks import emit_blocks
from collision_response.numerics.emit_scalar import emit_scalar
from collision_response.numerics.program import Program, Slot
from collision_response.numerics.tape import Tape
from collision_response.physics.laws import Parameters
from collision_response.physics.number import choose, square_root
from collision_response.tiers import GEOMETRIES, LAWS

PROBLEMS = [Problem(*both) for both in product(GEOMETRIES, EXACT_LAWS)]


def ids(problem: Problem) -> str:
    return f"{problem.geometry.name}-{problem.law.name}"


def function(program: Program):
    names = {"inf": math.inf, "nan": math.nan, "sqrt": math.sqrt}
    exec(emit_scalar(program), names)
    return names["kernel"]


def small_program(formula) -> Program:
    """A formula of x and y, from x and y to ``result``."""
    tape, inputs = Tape(), (Slot("x", 0), Slot("y", 0))
    result = formula(*(tape.input(slot) for slot in inputs))
    return Program(tape, inputs, {Slot("result", 0): tape.symbol(result).place})


def less(x, y, if_true, if_false):
    return choose(x < y, lambda: if_true, lambda: if_false)


@pytest.mark.parametrize(
    ("formula", "simpler"),
    [
        (lambda x, y: x * 0 + y, lambda x, y: y),
        (lambda x, y: 0 + x * 1 - 0, lambda x, y: x),
        (lambda x, y: x * y + y * x, lambda x, y: x * y + x * y),
        (lambda x, y: -x * y, lambda x, y: -(x * y)),
        (lambda x, y: x / -y, lambda x, y: -(x / y)),
        (lambda x, y: -x + y, lambda x, y: y - x),
        (lambda x, y: x - -y, lambda x, y: x + y),
        (lambda x, y: 0 - (0 - x), lambda x, y: x),
        (lambda x, y: x / 4, lambda x, y: x * 0.25),
        (lambda x, y: x + (2 * 3.0 + 1), lambda x, y: x + 7),
        (lambda x, y: choose(x < y, lambda: x, lambda: x), lambda x, y: x),
        (
            lambda x, y: choose(x < y, lambda: -x, lambda: -y),
            lambda x, y: -choose(x < y, lambda: x, lambda: y),
        ),
        (
            lambda x, y: choose(~~(x < y), lambda: x, lambda: y),
            lambda x, y: choose(y > x, lambda: x, lambda: y),
        ),
    ],
)
def test_the_tape_simplifies(formula, simpler):
    def tree(program: Program, place: int) -> tuple:
        node = program.tape.nodes[place]
        return (node.op, node.value, *(tree(program, arg) for arg in node.args))

    written, wanted = small_program(formula), small_program(simpler)
    assert tree(written, *written.outputs.values()) == tree(wanted, *wanted.outputs.values())


@pytest.mark.parametrize(
    "formula", [lambda x, y: x / x, lambda x, y: x - x, lambda x, y: x / 3, lambda x, y: 0 / x]
)
def test_the_tape_does_not_simplify_what_would_change_an_answer(formula):
    program = small_program(formula)
    assert any(program.tape.nodes[place].args for place in program.needed())


def test_a_traced_number_has_no_truth_value():
    x = Tape().input("x")
    with pytest.raises(TypeError, match=r"choose\(\)"):
        bool(x < 1)
    with pytest.raises(ValueError, match="two tapes"):
        x + Tape().input("x")


def test_a_division_by_zero_that_the_formula_avoids_is_avoided():
    kernel = function(
        small_program(lambda x, y: choose(y != 0, lambda: square_root(x / y) + x / y, lambda: x))
    )
    assert kernel(2.0, 0.0) == (2.0,)
    assert kernel(2.0, 0.5) == (6.0,)


def test_choices_by_one_condition_that_follow_each_other():
    def formula(x, y):
        first = choose(x < y, lambda: x / y, lambda: y)
        other = choose(y < 2, lambda: first * 3, lambda: x)
        return choose(x < y, lambda: first + other, lambda: first - other) + first

    program = small_program(formula)
    for x, y in product((1.0, 2.5, 3.0), repeat=2):
        assert function(program)(x, y) == (
            program.run({Slot("x", 0): x, Slot("y", 0): y})[Slot("result", 0)],
        )


def test_blocks_of_both_lanes_are_one_call_and_buffers_are_used_again():
    blocks = emit_blocks(ordinary(Problem(Geometry.SPATIAL, Law.FRICTIONLESS)))
    assert blocks.source.count("divide(") == 8  # seven of both bodies, one of the pair
    assert len(blocks.buffers) < 30


def given(problem: Problem, i: int, number) -> dict[Slot, object]:
    """The inputs of a contact of the shared batch, as numbers of any make."""
    bodies, contacts = some(problem.geometry, oriented=problem.oriented)
    arrays = {"bodies": bodies, "contacts": contacts}
    return {
        slot: number(arrays[slot.array][slot.row][i] if slot.lane is None else bodies[slot.row, slot.lane, i])
        for slot in unchecked(problem).inputs
    }


def by_the_law(problem: Problem, i: int, number) -> dict[Slot, object]:
    """What a program should compute, by the formulas it was traced from."""
    a, b, contact = scene_of(problem.geometry, *some(problem.geometry, oriented=problem.oriented), i, number)
    approach = GEOMETRIES[problem.geometry].prepare(a, b, contact)
    impulse = approach.n * number(0)
    if approach.n_u < 0:
        impulse = LAWS[problem.law](approach, Parameters(contact.restitution, contact.friction)).impulse
    response = approach.respond(impulse)
    after = a.moved_by(response.change_a), b.moved_by(response.change_b)
    first = 2 if problem.geometry is Geometry.PLANAR else 0
    results = {Slot("impulse", row): component for row, component in enumerate(response.impulse)}
    for lane, body in enumerate(after):
        results |= {Slot("velocity", row, lane): x for row, x in enumerate(body.velocity)}
        results |= {
            Slot("angular_velocity", row, lane): x for row, x in enumerate(body.angular_velocity[first:])
        }
    return results


ORIENTED = Problem(Geometry.SPATIAL, Law.FRICTIONLESS, oriented=True)
RATIONAL = [*(problem for problem in PROBLEMS if problem.law is Law.FRICTIONLESS), ORIENTED]
SOUND = range(12)
"""Contacts of the shared batch with which nothing is wrong."""


@pytest.mark.parametrize("program_of", [unchecked, general])
@pytest.mark.parametrize("problem", RATIONAL, ids=ids)
def test_in_exact_arithmetic_a_program_is_its_law(problem, program_of):
    for i in SOUND[IMMOVABLE:]:  # an infinite mass is no fraction
        expected = by_the_law(problem, i, F)
        results = program_of(problem).run(given(problem, i, F), F)
        assert {slot: value for slot, value in results.items() if slot.array != "status"} == {
            slot: value for slot, value in expected.items() if slot in results
        }


@pytest.mark.parametrize("problem", PROBLEMS, ids=ids)
def test_in_floats_a_program_rounds_as_its_law(problem):
    """But for the turning by an impulse along the normal, which it scales: one rounding for another."""
    program = unchecked(problem)
    kernel = function(program)
    for i in SOUND:
        expected = by_the_law(problem, i, float)
        results = dict(zip(program.outputs, kernel(*given(problem, i, float).values()), strict=True))
        for slot, value in results.items():
            if slot.array == "angular_velocity" and problem.law is Law.FRICTIONLESS:
                assert value == pytest.approx(expected[slot], rel=1e-13, abs=1e-13)
            elif slot.array != "status":
                assert value == expected[slot]


@pytest.mark.parametrize("problem", [*PROBLEMS, ORIENTED], ids=ids)
def test_ordinary_and_general_agree_where_both_hold(problem):
    usual, every = ordinary(problem), general(problem)
    flag = Slot("ordinary", 0)
    held = 0
    for i in range(N):
        inputs = given(problem, i, np.float64)  # which divide by zero as arrays do
        with np.errstate(all="ignore"):
            results = usual.run(inputs)
            if results.pop(flag):
                held += 1
                assert results == every.run(inputs)
    assert held > N / 3


def test_bare_is_ordinary_with_the_arms_given():
    problem = Problem(Geometry.SPATIAL, Law.FRICTIONLESS)
    for i in SOUND[IMMOVABLE + 1 :]:
        numbers = given(problem, i, float)
        a, b, contact = scene_of(problem.geometry, *some(problem.geometry), i)
        for lane, body in enumerate((a, b)):
            arm = (contact.position - body.position).cross(contact.normal)
            numbers |= {Slot("arms", row, lane): x for row, x in enumerate(arm)}
        assert bare(problem).run(numbers).items() <= ordinary(problem).run(numbers).items()


@pytest.mark.parametrize("problem", [PROBLEMS[-1], ORIENTED], ids=ids)
def test_scalar_code_gives_what_the_program_says(problem):
    program = general(problem)
    kernel = function(program)
    for i in range(N):
        inputs = given(problem, i, float)
        with np.errstate(all="ignore"):
            expected = program.run({slot: np.float64(number) for slot, number in inputs.items()})
        np.testing.assert_array_equal(kernel(*inputs.values()), tuple(expected.values()))
