"""Batches with an error bound for every contact: that of :mod:`~collision_response.numerics.error_bound`."""

from __future__ import annotations

import math
from functools import cache
from typing import Any

from ..model import Law
from ..numerics.error_bound import UNIT_ROUNDOFF, closed_form_bound, survey
from ..numerics.program import Program, Slot
from ..physics.body import Body
from ..physics.effective_mass import Response
from ..physics.laws import Parameters
from ..physics.laws.chatterjee_ruina import Split, split
from ..physics.number import Scalar, choose
from ..tiers import GEOMETRIES
from .kernels import collide, outputs_of, trace_general, trace_ordinary
from .problem import Inputs, Problem

BOUND = Slot("error_bound", 0)


@cache
def general(problem: Problem) -> Program:
    """The program for every contact: see :func:`kernels.general`."""
    return trace_general(problem, resolve)


@cache
def ordinary(problem: Problem) -> Program:
    """The program for most contacts: see :func:`kernels.ordinary`."""
    return trace_ordinary(problem, resolve)


def resolve(problem: Problem, inputs: Inputs) -> dict[Slot, Scalar]:
    """The results of plain arithmetic, and their error bound."""
    tape = inputs.scene.body_a.mass.tape
    approach = GEOMETRIES[problem.geometry].prepare(*inputs.scene[:3])
    motion, response, parameters = collide(problem, inputs, approach)
    parts = split(approach) if problem.law is Law.COULOMB else None
    approach = approach._replace(body_a=_with_mass(approach.body_a), body_b=_with_mass(approach.body_b))
    outputs = outputs_of(problem, motion)
    with tape.assuming_nothing():
        outputs[BOUND] = error_bound(approach, response, parameters, parts, inputs.threshold)
    return outputs


def error_bound(
    approach: Any,
    response: Response,
    parameters: Parameters,
    parts: Split | None,
    threshold: Scalar | None,
    roundoff: float = UNIT_ROUNDOFF,
) -> Scalar:
    """The bound on the relative error of an answer, as :class:`~collision_response.Impact` has it.

    Args:
        approach: of bodies whose mass is 0 if they are immovable.
        response: to the impulse.
        parameters: of the law.
        parts: of the impulse, if the law is COULOMB.
        threshold: the approach speed under which restitution was taken as 0.
        roundoff: relative error of one operation.
    """
    sizes = survey(approach)
    u_n_error = sizes.u_n_error * roundoff

    def colliding() -> Scalar:
        changes = response.change_a, response.change_b
        return closed_form_bound(approach, sizes, parts, parameters, response.impulse, changes, roundoff)

    def separating() -> Scalar:
        return choose(sizes.u_n >= u_n_error, lambda: 0.0, lambda: math.inf)

    bound = choose(approach.n_u < 0, colliding, separating)
    if threshold is None:
        return bound
    rounding = 8 * UNIT_ROUNDOFF * threshold  # of -u_n, which is compared with it
    is_clear = abs(sizes.u_n + threshold) > u_n_error + rounding
    return choose(is_clear, lambda: bound, lambda: math.inf)


def _with_mass(body: Body) -> Body:
    """A body whose mass is 0 if it is immovable."""
    return body._replace(mass=choose(body.mass < math.inf, lambda: body.mass, lambda: 0.0))
