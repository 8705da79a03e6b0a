"""The impact itself: from two bodies, a contact and a decided model to an answer, for any number type.

It is what is traced and compiled, what exact rationals and balls run on, and what a gradient runs through:

    kinematics   the bodies as seen from their contact      physics/effective_mass.py
                 rigid, or given by their inverse inertia   physics/inverse_inertia.py
    law          the impulse                                physics/laws/
    response     what it changes of the twists
    report       velocities, energies, what was adjusted

It takes what :mod:`~collision_response.validity` accepts.
"""

from __future__ import annotations

from typing import NamedTuple

from .numbers.operations import Condition, Scalar, choose, is_out_of_range, negation, square_root
from .physics.body import Body, Twist
from .physics.contact import Contact
from .physics.effective_mass import ContactKinematics
from .physics.energy import kinetic_energy
from .physics.laws import BY_SPEED, LAWS, Coefficients, Law, Outcome, Regime, Settings
from .physics.laws.chatterjee_ruina import fallback_where
from .physics.laws.law import Solution
from .physics.vector import Vec3

KEEPS_RESTITUTION = (Law.FRICTIONLESS, Law.COULOMB, Law.MOREAU)
"""The laws by which the normal velocity after is ``-e`` times that before."""

FOLLOWS_SLIP = tuple(law for law in LAWS if law not in (Law.FRICTIONLESS, Law.COULOMB))
"""The laws that need impulses to change slip and approach apart from each other."""


class Changes(NamedTuple):
    """What an impact changes: the numbers that ``error_bound`` is about.

    Attributes:
        impulse: on body_a, in world axes [N s].
        change_a, change_b: of the twists of the bodies' reference points [m/s, rad/s].
    """

    impulse: Vec3
    change_a: Twist
    change_b: Twist


class Report(NamedTuple):
    """What follows from the changes: see :class:`~collision_response.Impact`."""

    twist_a: Twist
    twist_b: Twist
    normal_impulse: Scalar
    tangential_impulse: Scalar
    normal_velocity_before: Scalar
    normal_velocity_after: Scalar
    effective_mass: Scalar
    kinetic_energy_before: Scalar
    kinetic_energy_after: Scalar
    energy_lost_restitution: Scalar
    energy_lost_friction: Scalar
    restitution: Scalar
    regime: Scalar


class Flags(NamedTuple):
    """What else is to be said of an answer.

    Attributes:
        separating: the bodies do not approach each other.
        below_threshold: the approach was slower than the threshold, and restitution is 0.
        fell_back: the law had no sound answer, and this is COULOMB's.
        massless_spin: a body turned about an axis without inertia, which moved no contact.
        unfinished: a loop of the law ended by its budget.
        out_of_range: a number that the answer hangs on is beyond the range, or among the least, which have
            few digits.
        unphysical: beyond its error the answer adds energy, pulls, leaves the friction cone, or misses
            the restitution asked for: a fault of this package.
    """

    separating: Condition
    below_threshold: Condition
    fell_back: Condition
    massless_spin: Condition
    unfinished: Condition
    out_of_range: Condition
    unphysical: Condition


class LawResult(NamedTuple):
    """The impulse, seen from the contact alone.

    Attributes:
        approaching: whether the bodies approach each other.
        is_slow: whether they do so more slowly than the threshold.
        restitution: used.
        outcome: of the law; it means something only if they approach.
        impulse: on body_a; 0 if they do not approach.
    """

    approaching: Condition
    is_slow: Condition
    restitution: Scalar
    outcome: Outcome
    impulse: Vec3

    def if_approaching(self, x: Scalar) -> Scalar:
        """``x``, or 0."""
        return choose(self.approaching, lambda: x, lambda: self.restitution * 0)

    def and_approaching(self, condition: Condition) -> Condition:
        """Whether they approach and a condition holds; only if they do is it computed."""
        return choose(self.approaching, lambda: condition, lambda: self.approaching)


class ImpactNumbers(NamedTuple):
    """The numbers of an answer.

    Attributes:
        changes, report, flags: see there.
        estimated_error: an estimate of the error of the changes, by a law that can give no bound.
    """

    changes: Changes
    report: Report
    flags: Flags
    estimated_error: Changes | None = None


DEFAULT = Settings()


def impact(
    body_a: Body, body_b: Body, contact: Contact, law: Law, settings: Settings = DEFAULT
) -> ImpactNumbers:
    """What becomes of two bodies that collide.

    Args:
        body_a, body_b: of numbers of one type, sound by :mod:`~collision_response.validity`.
        contact: where they touch; its restitution is a number, and so is its friction but for the laws of
            ``BY_SPEED``.
        law: not AUTO.
        settings: the numbers of the model.
    """
    kinematics = ContactKinematics.of(body_a, body_b, contact)
    n, u = kinematics.n, kinematics.u
    length = square_root(n.dot(n))
    friction = contact.friction * 0 if law is Law.FRICTIONLESS else contact.friction
    by_speed = callable(friction)
    law_result = apply_law(kinematics, Coefficients(contact.restitution, friction, settings), law)
    approaching, is_slow, e, outcome, impulse = law_result
    change_a, change_b = kinematics.twist_changes(impulse)
    if outcome.normal_factor is not None:
        along = law_result.if_approaching(outcome.normal_factor)
        change_a, change_b = kinematics.twist_changes_along_normal(impulse, along)
    a, b = _moved(body_a, change_a), _moved(body_b, change_b)
    u_after = u + kinematics.velocity_change(change_a, change_b)
    normal_impulse = impulse.dot(n) / length
    tangential = impulse - n * (normal_impulse / length)
    report = Report(
        twist_a=Twist(a.velocity, a.angular_velocity),
        twist_b=Twist(b.velocity, b.angular_velocity),
        normal_impulse=normal_impulse,
        tangential_impulse=square_root(tangential.dot(tangential)),
        normal_velocity_before=kinematics.n_u / length,
        normal_velocity_after=n.dot(u_after) / length,
        effective_mass=n.dot(n) / kinematics.n_Kn,
        kinetic_energy_before=kinetic_energy(body_a) + kinetic_energy(body_b),
        kinetic_energy_after=kinetic_energy(a)
        + kinetic_energy(b)
        + kinematics.body_a.energy_gained(body_a.velocity, impulse, change_a)
        + kinematics.body_b.energy_gained(body_b.velocity, -impulse, change_b),
        energy_lost_restitution=law_result.if_approaching(outcome.energy_lost_restitution),
        energy_lost_friction=law_result.if_approaching(outcome.energy_lost_friction),
        restitution=e,
        regime=choose(approaching, lambda: outcome.regime, lambda: 1.0 * Regime.SEPARATING),
    )
    flags = Flags(
        separating=negation(approaching),
        below_threshold=is_slow & (contact.restitution > 0),
        fell_back=approaching & outcome.fell_back,
        massless_spin=_is_nonzero(kinematics.body_a.massless_spin)
        | _is_nonzero(kinematics.body_b.massless_spin),
        unfinished=approaching & outcome.unfinished,
        out_of_range=is_out_of_range(n.dot(n), kinematics.n_Kn)
        | law_result.and_approaching(
            outcome.out_of_range | is_out_of_range(-kinematics.n_u, -kinematics.n_u / kinematics.n_Kn)
        ),
        unphysical=not by_speed
        and _is_unphysical(law, kinematics, u_after, impulse, friction, e * kinematics.n_u, approaching),
    )
    error = outcome.estimated_error
    estimated_error = error and Changes(error, *kinematics.twist_changes(error))
    return ImpactNumbers(Changes(impulse, change_a, change_b), report, flags, estimated_error)


def apply_law(contact: ContactKinematics, coefficients: Coefficients, law: Law) -> LawResult:
    """What a law makes of a contact, seen from there."""
    n, n_u, settings = contact.n, contact.n_u, coefficients.settings
    approaching = n_u < 0
    threshold = settings.restitution_threshold
    is_slow = approaching & (  # -n_u / |n| < threshold, without the root
        n_u * n_u < threshold * threshold * n.dot(n)
    )
    e = choose(is_slow, lambda: coefficients.restitution * 0, lambda: coefficients.restitution)
    laws = BY_SPEED if callable(coefficients.friction) else LAWS
    if settings.law is None:
        settings = settings._replace(law=1.0 * law)
    coefficients = coefficients._replace(restitution=e, settings=settings)
    outcome = laws[law](contact, coefficients)
    if law in FOLLOWS_SLIP and laws is LAWS and not contact.is_rigid():
        outcome = _or_coulomb(contact, coefficients, outcome)
    impulse = choose(
        approaching, lambda: outcome.impulse, lambda: n * 0
    )  # whatever the law makes of the rest
    return LawResult(approaching, is_slow, e, outcome, impulse)


def _or_coulomb(contact: ContactKinematics, coefficients: Coefficients, outcome: Outcome) -> Outcome:
    """The answer of a law; COULOMB's where a mechanism moves one way only, or wedges."""
    fails = contact.is_confined_to_a_line() | contact.has_locked_direction_in_cone(coefficients.friction)
    error = outcome.estimated_error
    return Outcome(
        *fallback_where(fails, contact, coefficients, Solution(*outcome[:4])),
        fell_back=outcome.fell_back | fails,
        unfinished=outcome.unfinished & negation(fails),
        estimated_error=None if error is None else choose(fails, lambda: error * 0, lambda: error),
    )


def _moved(body: Body, change: Twist) -> Body:
    return body._replace(
        velocity=body.velocity + change.linear, angular_velocity=body.angular_velocity + change.angular
    )


def _is_nonzero(spin: Vec3) -> Condition:
    return spin.dot(spin) > 0


def _is_unphysical(
    law: Law,
    contact: ContactKinematics,
    u_after: Vec3,
    P: Vec3,
    mu: Scalar,
    e_n_u: Scalar,
    approaching: Condition,
) -> Condition:
    """Whether the answer breaks what every answer keeps, seen from the changes of the twists alone."""
    n, (work, speed) = contact.n, contact.tolerated_error(P)
    n_P, nn = n.dot(P), n.dot(n)
    tangential = P * nn - n * n_P
    gains = P.dot(contact.u + u_after) > work
    pulls = n_P < 0
    outside = tangential.dot(tangential) > mu * mu * n_P * n_P * nn
    fault = gains | pulls | outside
    if law in KEEPS_RESTITUTION:
        rebound = n.dot(u_after) + e_n_u
        fault = fault | (rebound > speed) | (rebound < -speed)
    return approaching & fault
