"""EXTENDED for batches: the programs of :mod:`~collision_response.batch.kernels` in double-double arithmetic.

The inputs are taken as exact. The impulse and the velocities after the impact are rounded once, at the
end. Every contact also gets its ``error_bound``: as many roundings as
:mod:`~collision_response.numerics.error_bound` counts for plain arithmetic, each of them now at most one
of a double-double, and the last one, to float64.

EXTENDED's guarantee, one unit in the last place, holds where the bound is at most ``ULP``. Elsewhere it
takes more digits: where rounding decides whether bodies approach, or whether they have inertia about some
axis; where numbers are so large or small that products over- or underflow, which may be called
OUT_OF_RANGE here though the answer is not.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import cache
from typing import Any

from ..model import Law
from ..numerics.double_double import ROUNDOFF, lift, lower
from ..numerics.error_bound import UNIT_ROUNDOFF, are_in_range
from ..numerics.program import Program, Slot
from ..physics.body import Body
from ..physics.laws.chatterjee_ruina import split
from ..physics.number import Scalar, choose, square_root
from ..tiers import GEOMETRIES
from .bounded import BOUND, error_bound
from .kernels import collide, outputs_of, trace_general, trace_ordinary
from .problem import Inputs, Problem

ULP = 2 * UNIT_ROUNDOFF
"""A unit in the last place, at its largest relative to a number."""


@cache
def general(problem: Problem, *, fused: bool = False) -> Program:
    """The program for every contact. Where its status is no answer, the other results are NaN.

    Args:
        fused: with fused multiply-adds. The results are the same.
    """
    return trace_general(problem, resolve, fused=fused)


@cache
def ordinary(problem: Problem, *, fused: bool = False) -> Program:
    """The program for most contacts: see :func:`kernels.ordinary`."""
    return trace_ordinary(problem, resolve, fused=fused)


def resolve(problem: Problem, inputs: Inputs) -> dict[Slot, Scalar]:
    """The results in twice the digits, rounded, and their error bound."""
    tape = inputs.scene.body_a.mass.tape
    inputs = _lifted(inputs)
    approach = GEOMETRIES[problem.geometry].prepare(*inputs.scene[:3])
    motion, response, parameters = collide(problem, inputs, approach)
    parts = split(approach) if problem.law is Law.COULOMB else None
    given = [lower(part) for part in (approach, response, parameters, parts, inputs.threshold)]
    outputs = outputs_of(problem, lower(motion))
    with tape.assuming_nothing():
        bound = error_bound(*given, ROUNDOFF) + UNIT_ROUNDOFF
        is_sure = are_in_range(_further_sizes(given[0]))
        outputs[BOUND] = choose(is_sure, lambda: bound, lambda: math.inf)
    return outputs


def _further_sizes(approach: Any) -> Iterator[Scalar]:
    """What else must be in range, for the errors of products not to underflow."""
    for body in (approach.body_a, approach.body_b):
        yield square_root(body.inertia.trace())
        if body.orientation is not None:
            yield body.orientation.squared_length()


def _lifted(inputs: Inputs) -> Inputs:
    scene = lift(inputs.scene)
    scene = scene._replace(body_a=_with_masses(scene.body_a), body_b=_with_masses(scene.body_b))
    return inputs._replace(scene=scene, threshold=lift(inputs.threshold))


def _with_masses(body: Body) -> Body:
    """A body with its inverse mass in twice the digits; both masses are 0 if it is immovable."""
    is_movable, mass = body.mass.high < math.inf, body.mass
    return body._replace(
        mass=choose(is_movable, lambda: mass, lambda: 0.0),
        inverse_mass=choose(is_movable, lambda: 1 / mass, lambda: 0.0),
    )
