"""Exact answers, to many more digits than float64 has, and how far a rounded one is from them.

The law is the package's own, run on balls of a fixed, large precision whose radii prove the digits;
that the law itself is right is for ``test_laws.py`` and the oracle to show.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import pytest

pytest.importorskip("flint")

from flint import arb, ctx

from collision_response import Body, Contact, Impact, ImpactModel, Law
from collision_response.impact import Changes, Report, impact
from collision_response.in_python.on_balls import read
from collision_response.model import plan
from collision_response.numbers.balls import Ball
from collision_response.physics.laws import Settings
from collision_response.physics.vector import Vec3

BITS = 2600
"""Some 780 digits: exact for every sum of products of two float64, ample for every quotient."""


class Truth(NamedTuple):
    """The exact answer to a request, with the bodies that its norms need."""

    impact: Changes
    report: Report
    body_a: Body
    body_b: Body


def exact_answer(body_a: Body, body_b: Body, contact: Contact, model: ImpactModel) -> Truth:
    """The answer of the law named in ``model``, which has no loops, to the inputs as given, in space."""
    with ctx.workprec(BITS):
        a, b, touch = read(body_a, body_b, contact, _ball)
        chosen = plan(model)
        law = chosen.law_with_friction if contact.friction > 0 else chosen.law_without_friction
        assert law in (Law.FRICTIONLESS, Law.COULOMB)
        answer = impact(a, b, touch, law, Settings(*map(Ball, chosen.settings)))
        return Truth(answer.changes, answer.report, a, b)


def true_error(impact: Impact, truth: Truth) -> float:
    """The greatest relative error of the impulse and the twist changes, in the norms of the error bound.

    Each number is given the half unit of the smallest subnormal that no float64 can be nearer to.
    """
    with ctx.workprec(BITS):
        exact = truth.impact
        errors = [_relative(impact.impulse, exact.impulse)]
        for body, change, exactly in (
            (truth.body_a, impact.change_a, exact.change_a),
            (truth.body_b, impact.change_b, exact.change_b),
        ):
            if body.is_movable() is True:
                spread = [_difference(given, wanted) for given, wanted in zip(change, exactly, strict=True)]
                errors.append(_quotient(_twist_norm(body, *spread), _twist_norm(body, *exactly)))
        return max(errors)


def _ball(x: float, error: float) -> Ball | float:
    assert error == 0
    return Ball(x) if math.isfinite(x) else x


def _relative(given: Vec3, exact: Vec3) -> float:
    difference = _difference(given, exact)
    return _quotient(difference.dot(difference).sqrt(), exact.dot(exact).sqrt())


def _quotient(error: Ball, size: Ball) -> float:
    if (error == 0) is True:
        return 0.0
    return float((error / size).midpoint()) if (size > 0) is True else math.inf


def _difference(given: Vec3, exact: Vec3) -> Vec3:
    half = Ball(arb(2) ** -1075)
    apart = [Ball(g) - e for g, e in zip(given, exact, strict=True)]
    return Vec3(*(Ball(0) if (abs(d) <= half) is True else d for d in apart))


def _twist_norm(body: Body, dv: Vec3, dw: Vec3) -> Ball:
    return (body.mass * dv.dot(dv) + body.inertia.trace() / 3 * dw.dot(dw)).sqrt()
