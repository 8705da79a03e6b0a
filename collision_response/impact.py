"""The formulas of one impact: from two bodies, a contact and a law to the numbers of an answer.

They take any number type: floats, fractions, balls, arrays, and the symbols from which the kernels are
compiled. The steps of :func:`impact` are:

    kinematics   the two bodies as seen from their contact         physics/effective_mass.py
                 articulated bodies, by their inverse inertia      physics/inverse_inertia.py
    law          the impulse, its regime, the energy lost          physics/laws/
    changes      how the impulse changes the twists
    report       velocities, energies and the rest of the answer
    flags        what else must be known about the answer

The bodies and the contact must be valid by :mod:`~collision_response.validity`.
"""

from __future__ import annotations

from typing import Any, NamedTuple

from .numbers.operations import (
    Condition,
    Scalar,
    add_up,
    certain,
    choose,
    given_roundoff,
    is_out_of_range,
    map_numbers,
    negation,
    positive_part,
    square_root,
    values,
    widened,
)
from .physics.body import Body, Twist
from .physics.contact import Contact
from .physics.effective_mass import ContactKinematics
from .physics.energy import kinetic_energy
from .physics.laws import BY_SPEED, LAWS, STEPPED, Coefficients, Law, Outcome, Regime, Settings
from .physics.laws.coulomb import fallback_where
from .physics.laws.law import Solution
from .physics.vector import Vec3

KEEPS_RESTITUTION = (Law.FRICTIONLESS, Law.COULOMB, Law.MOREAU)
"""The laws for which the normal velocity after the impact is ``-e`` times the one before."""

NEEDS_FREE_SLIP = tuple(law for law in LAWS if law not in (Law.FRICTIONLESS, Law.COULOMB))
"""The laws that have no answer at a mechanism whose slip and approach speed cannot change separately."""

GAIN_BY_ROUNDING = 2.0**13
"""The energy that rounding may add, in units of roundoff of the work against the approach.

Of 20,000 elastic contacts with lever arms of 1000 radii of gyration, where ``K`` cancels by 1e6, none gains
as much.
"""

GAIN_BY_STEPS = 2.0**-20
"""The part of that work which the steps of a law may add."""


class Changes(NamedTuple):
    """The impulse and the changes of the twists: the numbers whose error ``error_bound`` bounds.

    Attributes:
        impulse: impulse on body_a, in world axes [N s].
        change_a, change_b: changes of the twists of the bodies' reference points [m/s, rad/s].
    """

    impulse: Vec3
    change_a: Twist
    change_b: Twist


class Report(NamedTuple):
    """The numbers of an :class:`~collision_response.Impact` that follow from the changes; see there.

    ``restitution`` is the one that was used: 0 if the approach is slower than the threshold.
    """

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
    """Conditions on an answer.

    Attributes:
        separating: the bodies do not approach each other.
        below_threshold: the approach is slower than the restitution threshold, so restitution is taken as 0.
        fell_back: the law has no sound answer here, and COULOMB answered in its place.
        massless_spin: a body turns about an axis without inertia; that rotation was left out.
        unfinished: a loop of the law used up its budget of steps.
        out_of_range: a number that the answer depends on overflowed, or is so small that it lost digits.
        gains_energy: by more than :data:`GAIN_BY_ROUNDING`, the answer adds energy: if its numbers do not
            bound their error, they have too few digits. Always false for FRICTIONLESS, where no terms cancel,
            and for links of mechanisms.
        unphysical: by more than its error, the answer adds energy, pulls the bodies together, leaves the
            friction cone, or misses the requested restitution. That would be a fault of this package.
    """

    separating: Condition
    below_threshold: Condition
    fell_back: Condition
    massless_spin: Condition
    unfinished: Condition
    out_of_range: Condition
    gains_energy: Condition
    unphysical: Condition


class LawResult(NamedTuple):
    """The result of a law at a contact that may also be separating.

    Attributes:
        approaching: whether the bodies approach each other.
        below_threshold: whether they approach more slowly than the restitution threshold.
        restitution: the restitution that was used.
        outcome: the outcome of the law, which has a meaning only if the bodies approach.
        impulse: impulse on body_a, 0 if the bodies do not approach [N s].
    """

    approaching: Condition
    below_threshold: Condition
    restitution: Scalar
    outcome: Outcome
    impulse: Vec3

    def if_approaching(self, x: Scalar) -> Scalar:
        """Return ``x`` if the bodies approach, else 0."""
        return choose(self.approaching, lambda: x, lambda: self.restitution * 0)

    def and_approaching(self, condition: Condition) -> Condition:
        """Whether the bodies approach and ``condition`` holds, which may be meaningless if they do not."""
        return choose(self.approaching, lambda: condition, lambda: self.approaching)


class ImpactNumbers(NamedTuple):
    """All that :func:`impact` computes.

    Attributes:
        changes, report, flags: the parts of the answer; see the classes.
        estimated_error: estimated error of ``changes``, from a law that cannot bound it; else ``None``.
    """

    changes: Changes
    report: Report
    flags: Flags
    estimated_error: Changes | None = None

    def as_floats(self) -> ImpactNumbers:
        """Return the changes and the report, which are balls or fractions, rounded to the nearest float64.

        Raises:
            OverflowError: if a fraction is beyond float64.
        """
        changes, report = map_numbers(float, self.changes), map_numbers(float, self.report)
        return self._replace(changes=changes, report=report)


DEFAULT_SETTINGS = Settings()


def impact(
    body_a: Body, body_b: Body, contact: Contact, law: Law, settings: Settings = DEFAULT_SETTINGS
) -> ImpactNumbers:
    """Compute the impact of two bodies by a law, for any number type.

    Args:
        body_a, body_b: the bodies, all numbers of one type, valid by :mod:`~collision_response.validity`.
        contact: the contact. Its restitution is a number; its friction is a number or, for the laws of
            ``BY_SPEED``, a function of the slip speed.
        law: any law except AUTO.
        settings: the numbers of the model.
    """
    kinematics = ContactKinematics.of(body_a, body_b, contact)
    n, n_u = kinematics.n, kinematics.n_u
    length = square_root(n.dot(n))
    lengths = [q.squared_length() for q in (body_a.orientation, body_b.orientation) if q is not None]
    friction = contact.friction * 0 if law is Law.FRICTIONLESS else contact.friction
    result = evaluate_law(kinematics, Coefficients(contact.restitution, friction, settings), law)
    approaching, below_threshold, e, outcome, impulse = result

    moving = _moving_part(kinematics, impulse, friction)
    if outcome.normal_factor is None:
        change_a, change_b = kinematics.twist_changes(moving)
    else:
        j = result.if_approaching(outcome.normal_factor)
        change_a, change_b = kinematics.twist_changes_along_normal(impulse, j)
    after_a, after_b = with_change(body_a, change_a), with_change(body_b, change_b)
    u_after = kinematics.whole_u() + kinematics.velocity_change(change_a, change_b)
    normal_impulse = impulse.dot(n) / length
    tangential = impulse - n * (normal_impulse / length)
    report = Report(
        twist_a=after_a.twist,
        twist_b=after_b.twist,
        normal_impulse=positive_part(certain(normal_impulse)),  # below 0 only by rounding
        tangential_impulse=square_root(tangential.dot(tangential)),
        normal_velocity_before=n_u / length,
        normal_velocity_after=n.dot(u_after) / length,
        effective_mass=n.dot(n) / kinematics.n_Kn,
        kinetic_energy_before=kinetic_energy(body_a) + kinetic_energy(body_b),
        kinetic_energy_after=kinetic_energy(after_a)
        + kinetic_energy(after_b)
        + kinematics.body_a.energy_gained(body_a.velocity, moving, change_a)
        + kinematics.body_b.energy_gained(body_b.velocity, -moving, change_b),
        energy_lost_restitution=result.if_approaching(outcome.energy_lost_restitution),
        energy_lost_friction=result.if_approaching(outcome.energy_lost_friction),
        restitution=e,
        regime=choose(approaching, lambda: outcome.regime, lambda: 1.0 * Regime.SEPARATING),
    )
    flags = Flags(
        separating=negation(approaching),
        below_threshold=below_threshold & (contact.restitution > 0),
        fell_back=approaching & outcome.fell_back,
        massless_spin=kinematics.body_a.has_massless_spin() | kinematics.body_b.has_massless_spin(),
        unfinished=approaching & outcome.unfinished,
        out_of_range=is_out_of_range(n.dot(n), kinematics.n_Kn, *lengths)
        | result.and_approaching(
            outcome.out_of_range
            | is_out_of_range(-n_u, -n_u / kinematics.n_Kn)
            | (settings.restitution_threshold > 0) & is_out_of_range(n_u * n_u)
        ),
        gains_energy=law is not Law.FRICTIONLESS
        and kinematics.is_rigid()
        and _gains_energy(law, *values(((body_a, body_b), impulse.dot(kinematics.u), (change_a, change_b)))),
        unphysical=not callable(friction)
        and _is_unphysical(law, kinematics, u_after, impulse, friction, e * n_u, approaching),
    )
    error = outcome.estimated_error
    estimated_error = error and Changes(error, *kinematics.twist_changes(error))
    return ImpactNumbers(Changes(impulse, change_a, change_b), report, flags, estimated_error)


def _moving_part(contact: ContactKinematics, impulse: Vec3, friction: Any) -> Vec3:
    """The part of an impulse that counts: all of it without friction, where ``u`` may have a locked part."""
    acts = callable(friction) or friction > 0
    return choose(acts, lambda: contact.moving_part(impulse), lambda: impulse)


def evaluate_law(contact: ContactKinematics, coefficients: Coefficients, law: Law) -> LawResult:
    """Evaluate a law at a contact, with the restitution threshold. No impulse if the bodies separate."""
    n, n_u, settings = contact.n, contact.n_u, coefficients.settings
    approaching = n_u < 0
    threshold = settings.restitution_threshold
    # -n_u / |n| < threshold, without the root
    below_threshold = approaching & (n_u * n_u < threshold * threshold * n.dot(n))
    e = choose(below_threshold, lambda: coefficients.restitution * 0, lambda: coefficients.restitution)
    laws = BY_SPEED if callable(coefficients.friction) else LAWS
    if settings.law is None:
        settings = settings._replace(law=1.0 * law)
    coefficients = coefficients._replace(restitution=e, settings=settings)
    outcome = laws[law](contact, coefficients)
    if law in NEEDS_FREE_SLIP and laws is LAWS and not contact.is_rigid():
        outcome = _or_coulomb(contact, coefficients, outcome)
    impulse = choose(approaching, lambda: outcome.impulse, lambda: n * 0)
    if not contact.is_rigid():
        impulse = _with_locked_part(contact, impulse, coefficients.friction)
    return LawResult(approaching, below_threshold, e, outcome, impulse)


def _with_locked_part(contact: ContactKinematics, impulse: Vec3, friction: Any) -> Vec3:
    """Give an impulse the error of a mechanism whose ``u`` or normal is partly along locked directions."""
    part = contact.locked_part_of_approach() + contact.tilt_of_tangential_directions()
    acts = callable(friction) or friction > 0
    return impulse * widened(1 + 0 * part, choose(acts, lambda: part, lambda: 0 * part))


def has_no_free_slip(contact: ContactKinematics, friction: Scalar) -> Condition:
    """Whether a mechanism moves in one direction only, or wedges."""
    if contact.is_rigid():
        return False
    return contact.is_confined_to_a_line() | contact.has_locked_direction_in_cone(friction)


def _or_coulomb(contact: ContactKinematics, coefficients: Coefficients, outcome: Outcome) -> Outcome:
    """Replace the outcome by that of COULOMB where a mechanism has no free slip."""
    fails = has_no_free_slip(contact, coefficients.friction)
    error = outcome.estimated_error
    return Outcome(
        *fallback_where(fails, contact, coefficients, Solution(*outcome[:4])),
        fell_back=outcome.fell_back | fails,
        unfinished=outcome.unfinished & negation(fails),
        estimated_error=None if error is None else choose(fails, lambda: error * 0, lambda: error),
    )


def with_change(body: Body, change: Twist) -> Body:
    """Return a body whose twist has changed."""
    return body._replace(
        velocity=body.velocity + change.linear, angular_velocity=body.angular_velocity + change.angular
    )


def _gains_energy(
    law: Law, bodies: tuple[Body, Body], work: Scalar, changes: tuple[Twist, Twist]
) -> Condition:
    """Whether rigid bodies gain energy by more than rounding, or the steps of the law, explain.

    Args:
        law: the law.
        bodies: the two bodies.
        work: of the impulse against the approach, ``P.u``, below 0 [J].
        changes: of their twists. Their own kinetic energy is no difference of large numbers:
            ``E+ - E = P.u + (kinetic energy of the changes)``.
    """
    of_changes = (
        kinetic_energy(body.with_twist(change)) for body, change in zip(bodies, changes, strict=True)
    )
    part = GAIN_BY_STEPS if law in STEPPED else GAIN_BY_ROUNDING * given_roundoff(work)
    return work + add_up(of_changes) > -part * work


def _is_unphysical(
    law: Law,
    contact: ContactKinematics,
    u_after: Vec3,
    P: Vec3,
    mu: Scalar,
    e_n_u: Scalar,
    approaching: Condition,
) -> Condition:
    """Whether the changes of the twists violate what every answer must satisfy, by more than their error."""
    n, (work, speed) = contact.n, contact.tolerated_error(P)
    n_P, nn = n.dot(P), n.dot(n)
    tangential = P * nn - n * n_P
    gains_energy = P.dot(contact.whole_u() + u_after) > work
    pulls = n_P < 0
    leaves_cone = tangential.dot(tangential) > mu * mu * n_P * n_P * nn
    fault = gains_energy | pulls | leaves_cone
    if law in KEEPS_RESTITUTION:
        rebound = n.dot(u_after) + e_n_u
        fault = fault | (rebound > speed) | (rebound < -speed)
    return approaching & fault
