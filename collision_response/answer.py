"""What an answer holds, and how it reads."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any, NamedTuple

from .model import Adjustment, Geometry, ImpactModel, Law, Precision
from .numbers.operations import Scalar
from .physics.body import Body, Twist
from .physics.contact import Contact
from .physics.laws import Regime
from .physics.vector import Vec3
from .status import StatusCode

NUMBERS = (
    "normal_impulse",
    "tangential_impulse",
    "normal_velocity_before",
    "normal_velocity_after",
    "effective_mass",
    "kinetic_energy_before",
    "kinetic_energy_after",
    "energy_lost_restitution",
    "energy_lost_friction",
    "error_bound",
)
"""Fields of :class:`Impact` that are one number; messages and recordings have them by the same names."""


class Impact(NamedTuple):
    """The answer to one request. ``print`` shows it as a table.

    Attributes:
        status: OK, SEPARATING or TOLERANCE_NOT_MET.
        contact: as used, its coefficients numbers. Friction that Routh's laws follow as a function of slip
            speed is given at first touch: a constant of that value would give another answer.
        model: as used, every AUTO decided.
        twist_a, twist_b: of the bodies' reference points after the impact, in world axes [m/s, rad/s].
        change_a, change_b: what the impact changed of them.
        impulse: on body_a, in world axes [N s].
        normal_impulse: its part along the normal, >= 0 [N s].
        tangential_impulse: the length of the rest [N s].
        normal_velocity_before, normal_velocity_after: of body_a relative to body_b at the contact
            [m/s]; negative when approaching.
        effective_mass: of the two bodies along the normal [kg].
        kinetic_energy_before, kinetic_energy_after: of the dynamic bodies [J]. Of an articulated body only
            the change is known: it counts as 0 before, and as its change after.
        energy_lost_restitution, energy_lost_friction: work done against the normal and against the
            tangential impulse [J].
        regime: what friction did.
        error_bound: upper bound on the relative error of the impulse, and of each twist change
            ``(dv, dw)`` in the norm ``(m dv.dv + tr(I)/3 dw.dw)^(1/2)``, from rounding and from what
            was not modelled. For an articulated body ``m`` is 1 over the trace of the linear part of its
            inverse inertia, and ``tr(I)/3`` 1 over that of the angular part. The bound is infinite where
            nothing can be said in this precision. Of numbers below 2.3e-308 it does not speak.
            Where friction is followed as a function of the slip speed, it is an estimate: four
            times what changes if the path is followed to ten times the tolerance, and eight tolerances of it.
        adjustments: what was changed from what was asked.
    """

    status: StatusCode
    contact: Contact
    model: ImpactModel
    twist_a: Twist
    twist_b: Twist
    change_a: Twist
    change_b: Twist
    impulse: Vec3
    normal_impulse: float
    tangential_impulse: float
    normal_velocity_before: float
    normal_velocity_after: float
    effective_mass: float
    kinetic_energy_before: float
    kinetic_energy_after: float
    energy_lost_restitution: float
    energy_lost_friction: float
    regime: Regime
    error_bound: float
    adjustments: Adjustment

    def __str__(self) -> str:
        """What happened, as a table."""
        return format_impact(self)

    def __repr__(self) -> str:
        """In one line: what to look at first. Every field has its name."""
        chosen = f"{self.status}, {self.model.law}, {self.regime}"
        return f"Impact({chosen}, impulse={format_vector(self.impulse)}, error_bound={self.error_bound:.2g})"


def make_impact(
    bodies: Iterable[Body],
    found: tuple[Any, Any, Any],
    contact: Contact,
    model: ImpactModel,
    error_bound: Scalar,
    limit: float,
    *,
    normalised: bool,
) -> Impact:
    """An answer, of the changes, the report and the flags that ``impact.py`` computes.

    Args:
        bodies: of the request.
        found: those three. A flag that is undecided counts as false.
        contact, model: as used, but for what the flags say.
        error_bound: of the changes.
        limit: the greatest that meets the tolerance.
        normalised: whether a quaternion was off unit length.
    """
    changes, report, flags = found
    slow, fell_back = flags.below_threshold is True, flags.fell_back is True
    status = StatusCode.SEPARATING if flags.separating is True else StatusCode.OK
    return Impact(
        status if error_bound <= limit else StatusCode.TOLERANCE_NOT_MET,
        contact._replace(restitution=report.restitution) if slow else contact,
        model._replace(law=Law.COULOMB) if fell_back else model,
        report.twist_a,
        report.twist_b,
        changes.change_a,
        changes.change_b,
        changes.impulse,
        **{name: getattr(report, name) for name in NUMBERS[:-1]},
        regime=Regime(round(report.regime)),
        error_bound=error_bound,
        adjustments=Adjustment(
            normalised * Adjustment.NORMALISED_ORIENTATION
            | slow * Adjustment.RESTITUTION_THRESHOLD
            | fell_back * Adjustment.LAW_FALLBACK
            | (flags.massless_spin is True) * Adjustment.MASSLESS_SPIN
            | any(body.inverse_inertia is not None for body in bodies) * Adjustment.ENERGY_CHANGE_ONLY
        ),
    )


def norm_components(body: Body, change: Twist) -> tuple[float, ...]:
    """The components of a body's twist change, each scaled so that their length is in proportion to the norm
    of ``error_bound``; one 0 if nothing moves the body.
    """
    if not body.is_movable():
        return (0.0,)
    if body.inverse_inertia is not None:
        L, _, W = body.inverse_inertia.blocks()
        linear, angular = (1 / math.sqrt(trace) if trace > 0 else 0.0 for trace in (L.trace(), W.trace()))
    else:
        linear = 1.0
        angular = math.sqrt((body.inertia[0] + body.inertia[3] + body.inertia[5]) / 3 / body.mass)
    return (*(linear * v for v in change.linear), *(angular * w for w in change.angular))


def format_impact(answer: Any, names: tuple[str, str] = ("body_a", "body_b")) -> str:
    """An :class:`Impact`, or a ``CollisionResult`` message: its fields have the same names.

    Args:
        answer: what to show.
        names: of the bodies.
    """
    model, contact = answer.model, answer.contact
    status = StatusCode(getattr(answer.status, "code", answer.status))
    chosen = Law(model.law), Geometry(model.geometry), Precision(model.precision)
    touch = [
        str(Regime(answer.regime)),
        *map(format_number, (contact.restitution, contact.friction)),
        *map(format_number, (answer.normal_velocity_before, answer.normal_velocity_after)),
        format_vector(answer.impulse),
    ]
    bodies = [
        [name, format_vector(twist.linear), format_vector(twist.angular)]
        for name, twist in zip(names, (answer.twist_a, answer.twist_b), strict=True)
    ]
    lines = [
        f"{status} by {chosen[0]} ({chosen[1]}, {chosen[2]}), "
        f"relative error at most {answer.error_bound:.2g}",
        *format_columns(["regime", "e", "mu", "u before [m/s]", "u after [m/s]", "impulse [N s]"], [touch]),
        *format_columns(["body", "velocity [m/s]", "angular velocity [rad/s]"], bodies),
        format_energies(answer),
    ]
    if answer.adjustments:
        lines.append(f"adjusted: {Adjustment(answer.adjustments)}")
    return "\n".join(lines)


def format_energies(answer: Any) -> str:
    """Before and after, and what is lost."""
    before, after = format_number(answer.kinetic_energy_before), format_number(answer.kinetic_energy_after)
    lost = format_number(answer.energy_lost_restitution), format_number(answer.energy_lost_friction)
    return f"energy {before} -> {after} J; lost: {lost[0]} restitution, {lost[1]} friction"


def format_number(x: Scalar) -> str:
    """A number of six digits; 0 without its sign."""
    return f"{float(x) + 0.0:.6g}"


def format_vector(v: Any) -> str:
    """A vector."""
    return "(" + ", ".join(map(format_number, (v.x, v.y, v.z))) + ")"


def format_columns(head: list[str], rows: list[list[str]]) -> list[str]:
    """The lines of a table."""
    widths = [max(map(len, column)) for column in zip(head, *rows, strict=True)]
    return [
        "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
        for row in (head, *rows)
    ]
