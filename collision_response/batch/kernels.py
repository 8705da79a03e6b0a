"""Impacts as programs: geometries and laws of :mod:`~collision_response.physics`, traced once.

The arrays are those of :mod:`~collision_response.batch`; the lanes are body_a and body_b. There are two
programs for every geometry and law:

    ordinary   the formula as it is for most contacts: both bodies can move and turn, all numbers are
               sound. Its output ``ordinary`` says whether the others hold.
    general    every contact: immovable bodies, rods, points; and what is wrong with unsound numbers.

Where both hold their numbers are equal.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Iterable, Iterator
from functools import cache, reduce
from typing import Any, NamedTuple

from ..model import Geometry, Law
from ..numerics.program import Program, Slot
from ..numerics.tape import Symbol, Tape
from ..physics.body import PIVOT_LIMIT
from ..physics.effective_mass import Response
from ..physics.laws import Parameters
from ..physics.laws.frictionless import factor
from ..physics.number import Scalar, choose
from ..physics.vector import Vec3
from ..soundness import CLEARANCE, Scene, all_finite, are_coefficients, is_clearly_tensor, requirements
from ..status import StatusCode
from ..tiers import GEOMETRIES, LAWS
from .problem import Inputs, Problem, inputs_of
from .rows import body_rows

MOTION = ("velocity", "angular_velocity", "impulse")
"""The arrays of results that are numbers."""


class Motion(NamedTuple):
    """What a program computes."""

    velocity_a: Vec3
    velocity_b: Vec3
    angular_velocity_a: Vec3
    angular_velocity_b: Vec3
    impulse: Vec3
    status: Scalar


Resolve = Callable[[Problem, Inputs], dict[Slot, Scalar]]
"""What gives the results of a problem, by where they go."""


@cache
def general(problem: Problem) -> Program:
    """The program for every contact. Where its status is no answer, the other results are NaN."""
    return trace_general(problem, _resolve)


@cache
def ordinary(problem: Problem) -> Program:
    """The program for most contacts. What depends on mass and inertia alone is taken to be as usual."""
    return trace_ordinary(problem, _resolve)


def trace_general(problem: Problem, resolve: Resolve, *, fused: bool = False) -> Program:
    """What ``resolve`` does, where all that it takes is sound and all that it gives is finite."""
    tape = Tape(fused=fused)
    inputs = inputs_of(problem, tape)
    checks = list(requirements(inputs.scene, problem.geometry))
    fault: Scalar = StatusCode.INTERNAL_ERROR
    for holds, code in reversed(checks):
        fault = _pick(holds, fault, code)
    outputs = resolve(problem, inputs)
    in_range = all_finite(x for slot, x in outputs.items() if slot.array in MOTION)
    is_sound = _all(holds for holds, _ in checks)
    for slot, result in outputs.items():
        out_of_range, none = math.nan, math.nan
        if slot.array == "status":
            out_of_range, none = StatusCode.OUT_OF_RANGE, fault
        outputs[slot] = _pick(is_sound, _pick(in_range, result, out_of_range), none)
    return _program(tape, inputs, outputs)


def trace_ordinary(problem: Problem, resolve: Resolve, *, fused: bool = False) -> Program:
    """What ``resolve`` does for bodies that move and turn, with the output ``ordinary``."""
    rows = body_rows(problem.geometry)
    tape = Tape(assumes=lambda slot: slot.array == "bodies" and slot.row < rows.inertia.stop, fused=fused)
    inputs = inputs_of(problem, tape)
    outputs = resolve(problem, inputs)
    outputs[Slot("ordinary", 0)] = _all([*tape.assumed, *_is_ordinary(problem, inputs.scene, outputs)])
    return _program(tape, inputs, outputs)


@cache
def unchecked(problem: Problem) -> Program:
    """The program for one contact that is known to be sound: the formula, and nothing else."""
    tape = Tape()
    inputs = inputs_of(problem, tape)
    return _program(tape, inputs, _resolve(problem, inputs))


@cache
def bare(problem: Problem) -> Program:
    """The least that a law takes: two sound bodies that can move and turn, with their lever arms at hand.

    The arms ``r x n`` are given as the rows of ``arms``, instead of the positions. The results are the
    velocities.
    """
    program = ordinary(problem)
    approach = GEOMETRIES[problem.geometry].prepare(*inputs_of(problem, program.tape).scene[:3])
    arms = {
        Slot("arms", row, lane): component.place
        for lane, r in enumerate((approach.r_a, approach.r_b))
        for row, component in enumerate(r.cross(approach.n))
    }
    velocities = {slot: place for slot, place in program.outputs.items() if slot.array.endswith("velocity")}
    return program._replace(outputs=velocities).taking(arms)


def _is_ordinary(problem: Problem, scene: Scene, outputs: dict[Slot, Scalar]) -> Iterator[Any]:
    """What suffices, with the assumptions of the tape, for a sound contact and an answer in range."""
    for body in scene[:2]:
        yield body.inverse_mass > 0
        yield body.inverse_mass < math.inf
        if problem.geometry is Geometry.SPATIAL:
            yield is_clearly_tensor(body.inertia)
        if problem.geometry is Geometry.PLANAR:
            yield body.inertia.zz < math.inf
    approach = GEOMETRIES[problem.geometry].prepare(*scene[:3])
    yield approach.n.dot(approach.n) > 0
    if problem.law is not Law.FRICTIONLESS:  # whose impulse is NaN if the normal is
        yield approach.n_u - approach.n_u == 0
    yield from are_coefficients(scene)
    total = sum(result for slot, result in outputs.items() if slot.array in ("velocity", "angular_velocity"))
    yield total - total == 0


def _resolve(problem: Problem, inputs: Inputs) -> dict[Slot, Scalar]:
    approach = GEOMETRIES[problem.geometry].prepare(*inputs.scene[:3])
    return outputs_of(problem, collide(problem, inputs, approach)[0])


def collide(problem: Problem, inputs: Inputs, approach: Any) -> tuple[Motion, Response, Parameters]:
    """What becomes of the bodies; what the impact does to them, and by which parameters."""
    scene, contact = inputs.scene, inputs.scene.contact
    restitution = contact.restitution
    if inputs.threshold is not None:
        speed = -(approach.n_u / approach.n.norm())
        restitution = _pick((speed > 0) & (speed < inputs.threshold), 0.0, restitution)
    parameters = Parameters(restitution, contact.friction, scene.tangential_restitution)
    approaching = approach.n_u < 0
    if problem.law is Law.FRICTIONLESS:
        j = _pick(approaching, factor(approach, parameters), 0.0)
        response = _respond_along_normal(approach, j)
    else:
        impulse = LAWS[problem.law](approach, parameters).impulse
        response = approach.respond(_pick(approaching, impulse, impulse * 0))
    a, b = scene.body_a.moved_by(response.change_a), scene.body_b.moved_by(response.change_b)
    motion = Motion(
        a.velocity,
        b.velocity,
        a.angular_velocity,
        b.angular_velocity,
        response.impulse,
        _pick(approaching, StatusCode.OK, StatusCode.SEPARATING),
    )
    return motion, response, parameters


def _respond_along_normal(approach: Any, j: Scalar) -> Response:
    """What the impulse ``n j`` does. But for ``j``, the turning is in the effective mass already."""
    response, unit = approach.respond(approach.n * j), approach.respond(approach.n)
    return response._replace(
        change_a=response.change_a._replace(angular=unit.change_a.angular * j),
        change_b=response.change_b._replace(angular=unit.change_b.angular * j),
    )


def in_single(program: Program) -> Program:
    """The program with what it takes for rounding as that of float32."""
    return program.with_constants(
        {
            PIVOT_LIMIT: PIVOT_LIMIT * _SINGLE,
            1 + 2 * PIVOT_LIMIT: 1 + 2 * PIVOT_LIMIT * _SINGLE,
            1 + CLEARANCE: 1 + CLEARANCE * _SINGLE,
        }
    )


_SINGLE = 2.0**29
"""How much coarser float32 rounds."""


def outputs_of(problem: Problem, motion: Motion) -> dict[Slot, Scalar]:
    """The results as far as the geometry models them, by where they go."""
    axes = slice(2) if problem.geometry is Geometry.PLANAR else slice(3)
    turns = {Geometry.POINT: slice(0), Geometry.PLANAR: slice(2, 3), Geometry.SPATIAL: slice(3)}[
        problem.geometry
    ]
    velocity = motion.velocity_a[axes], motion.velocity_b[axes]
    spin = motion.angular_velocity_a[turns], motion.angular_velocity_b[turns]
    outputs: dict[Slot, Scalar] = {}
    for array, lanes in (("velocity", velocity), ("angular_velocity", spin)):
        for row, pair in enumerate(zip(*lanes, strict=True)):
            outputs |= {Slot(array, row, lane): component for lane, component in enumerate(pair)}
    outputs |= {Slot("impulse", row): component for row, component in enumerate(motion.impulse[axes])}
    outputs[Slot("status", 0)] = motion.status
    return outputs


def _program(tape: Tape, inputs: Inputs, outputs: dict[Slot, Scalar]) -> Program:
    places = {slot: tape.symbol(result).place for slot, result in outputs.items()}
    return Program(tape, inputs.slots, places, codes=frozenset({"status"}), uniform=frozenset({"model"}))


def _pick(condition: Any, if_true: Any, if_false: Any) -> Any:
    return choose(condition, lambda: if_true, lambda: if_false)


def _all(conditions: Iterable[Symbol]) -> Symbol:
    """Whether all hold; those of one body first among themselves, so that the lanes are alike."""
    by_lanes: dict[frozenset[int | None], dict[int, Symbol]] = {}
    for condition in conditions:
        if not isinstance(condition, Symbol):
            continue
        by_lanes.setdefault(_lanes(condition), {})[condition.place] = condition
    return reduce(operator.and_, (reduce(operator.and_, group.values()) for group in by_lanes.values()))


def _lanes(symbol: Symbol) -> frozenset[int | None]:
    nodes = (symbol.tape.nodes[place] for place in symbol.tape.needed_for([symbol.place]))
    return frozenset(node.value.lane for node in nodes if node.op == "input")
