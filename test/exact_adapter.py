"""Convert between the package and ``exact.py``, and measure how far answers are from the exact ones."""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache

import exact

from collision_response import Body, Contact, Impact, ImpactModel, Law


def as_exact(body_a: Body, body_b: Body, contact: Contact) -> exact.PlainCollision:
    """A request of the package in the types of ``exact.py``."""
    a, b = (
        exact.PlainBody(None if body.mass == math.inf else body.mass, *body[1:7]) for body in (body_a, body_b)
    )
    return exact.PlainCollision(a, b, exact.PlainContact(*contact[:4]))


def as_request(collision: exact.PlainCollision) -> tuple[Body, Body, Contact]:
    """A collision of ``exact.py`` in the types of the package."""

    def body(solid: exact.PlainBody) -> Body:
        if solid.mass is None:
            return Body.kinematic(solid.position, solid.velocity, solid.spin)
        return Body.dynamic(*solid)

    return body(collision.a), body(collision.b), Contact.of(*collision.contact)


def exact_answer(body_a: Body, body_b: Body, contact: Contact, model: ImpactModel) -> exact.Answer:
    """The exact answer by the law of a model, in space, to the inputs as given."""
    law = model.law
    if law is Law.AUTO:
        law = Law.COULOMB if contact.friction > 0 else Law.FRICTIONLESS
    collision = as_exact(body_a, body_b, contact)
    return _exact_answer(collision, law.name, model.tangential_restitution, model.restitution_threshold)


_exact_answer = lru_cache(maxsize=1024)(exact.answer)
"""Many tests compare several answers to one request."""


def true_error(impact: Impact, truth: exact.Answer) -> float:
    """The quantity that ``error_bound`` bounds: the largest relative error of the impulse and both twist
    changes.

    If a law allows several answers, the nearest is used.
    """
    return min(max(errors_of(impact, truth, P)) for P in truth.impulses)


def errors_of(impact: Impact, truth: exact.Answer, impulse: exact.Vec) -> Sequence[float]:
    """The errors of the impulse and of both twist changes, if ``impulse`` is the right one."""
    opposite = exact.times(impulse, exact.Fraction(-1))
    return (
        exact.impulse_error(impact.impulse, impulse),
        exact.twist_error(truth.pair.a, *impact.change_a, impulse),
        exact.twist_error(truth.pair.b, *impact.change_b, opposite),
    )
