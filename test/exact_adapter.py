"""The exact answers of ``exact.py`` to requests of the package, and how far a rounded one is from them."""

from __future__ import annotations

import math
from collections.abc import Sequence

import exact

from collision_response import Body, Contact, Impact, ImpactModel, Law


def as_exact(body_a: Body, body_b: Body, contact: Contact) -> exact.PlainCollision:
    """A request of the package, as ``exact.py`` takes it."""
    a, b = (
        exact.PlainBody(None if body.mass == math.inf else body.mass, *body[1:7]) for body in (body_a, body_b)
    )
    return exact.PlainCollision(a, b, exact.PlainContact(*contact[:4]))


def as_request(collision: exact.PlainCollision) -> tuple[Body, Body, Contact]:
    """The other way round."""

    def body(solid: exact.PlainBody) -> Body:
        if solid.mass is None:
            return Body.kinematic(solid.position, solid.velocity, solid.spin)
        return Body.dynamic(*solid)

    return body(collision.a), body(collision.b), Contact.of(*collision.contact)


def exact_answer(body_a: Body, body_b: Body, contact: Contact, model: ImpactModel) -> exact.Answer:
    """By the law of a model, to the inputs as given, in space."""
    law = model.law
    if law is Law.AUTO:
        law = Law.COULOMB if contact.friction > 0 else Law.FRICTIONLESS
    collision = as_exact(body_a, body_b, contact)
    return exact.answer(collision, law.name, model.tangential_restitution, model.restitution_threshold)


def true_error(impact: Impact, truth: exact.Answer) -> float:
    """What ``error_bound`` is about: the greatest relative error of the impulse and of both twist changes.

    Of several answers that a law allows, the nearest counts.
    """
    return min(max(errors_of(impact, truth, P)) for P in truth.impulses)


def errors_of(impact: Impact, truth: exact.Answer, impulse: exact.Vec) -> Sequence[float]:
    """Those of the impulse, and of the twist changes of body_a and body_b, if this is the right impulse."""
    opposite = exact.times(impulse, exact.Fraction(-1))
    return (
        exact.impulse_error(impact.impulse, impulse),
        exact.twist_error(truth.pair.a, *impact.change_a, impulse),
        exact.twist_error(truth.pair.b, *impact.change_b, opposite),
    )
