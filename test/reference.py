"""Exact answers, to many more digits than float64 has, and how far a rounded one is from them.

The law is the package's own, run on balls of a fixed, large precision whose radii prove the digits;
that the law itself is right is for ``test_laws.py`` and the oracle to show.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from flint import arb, ctx

from collision_response import Body, Contact, Impact, ImpactModel
from collision_response.numerics.extended import lift, with_inverse_mass
from collision_response.physics.vector import Vec3
from collision_response.tiers import GEOMETRIES, answer

BITS = 2600
"""Some 780 digits: exact for every sum of products of two float64, ample for every quotient."""


class Truth(NamedTuple):
    """The exact answer to a request, with the bodies that its norms need."""

    impact: Impact
    body_a: Body
    body_b: Body


def exact_answer(body_a: Body, body_b: Body, contact: Contact, model: ImpactModel) -> Truth:
    """The answer of the law and geometry named in ``model`` to the inputs as given."""
    with ctx.workprec(BITS):
        a, b = with_inverse_mass(lift(body_a)), with_inverse_mass(lift(body_b))
        lifted = lift(contact)
        approach = GEOMETRIES[model.geometry].prepare(a, b, lifted)
        return Truth(answer(a, b, lifted, lift(model), approach)[0], a, b)


def true_error(impact: Impact, truth: Truth) -> float:
    """The greatest relative error of the impulse and the twist changes, in the norms of the error bound.

    Each number is given the half unit of the smallest subnormal that no float64 can be nearer to.
    """
    with ctx.workprec(BITS):
        exact = truth.impact
        errors = [_relative(impact.impulse, exact.impulse, _euclidean)]
        for body, change, exactly in (
            (truth.body_a, impact.change_a, exact.change_a),
            (truth.body_b, impact.change_b, exact.change_b),
        ):
            if body.mass != 0:
                spread = [_difference(given, wanted) for given, wanted in zip(change, exactly, strict=True)]
                errors.append(_quotient(_twist_norm(body, *spread), _twist_norm(body, *exactly)))
        return max(errors)


def _relative(given: Vec3, exact: Vec3, norm) -> float:
    return _quotient(norm(_difference(given, exact)), norm(exact))


def _quotient(error: arb, size: arb) -> float:
    if error == 0:
        return 0.0
    return float((error / size).mid()) if size > 0 else math.inf


def _difference(given: Vec3, exact: Vec3) -> Vec3:
    half = arb(2) ** -1075
    apart = [arb(g) - e for g, e in zip(given, exact, strict=True)]
    return Vec3(*(arb(0) if abs(d) <= half else d for d in apart))


def _euclidean(v: Vec3) -> arb:
    return v.dot(v).sqrt()


def _twist_norm(body: Body, dv: Vec3, dw: Vec3) -> arb:
    return (body.mass * dv.dot(dv) + body.inertia.trace() / 3 * dw.dot(dw)).sqrt()
