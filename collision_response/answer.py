"""The answer to a request for one impact, and its presentation as text."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from decimal import Decimal
from typing import Any, NamedTuple

from .impact import Changes, ImpactNumbers
from .model import Adjustment, Geometry, ImpactModel, Precision
from .numbers.operations import Scalar, certain, square_root
from .physics.body import Body, Twist
from .physics.contact import Contact
from .physics.laws import Law, Regime
from .physics.vector import Vec3
from .status import StatusCode
from .validity import is_not_normalised

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
"""The fields of :class:`Impact` that are single numbers. Messages and recordings use the same names."""


class Impact(NamedTuple):
    """The answer to a request for one impact. ``print`` shows it as a table.

    Attributes:
        status: OK, SEPARATING or TOLERANCE_NOT_MET.
        contact: the contact with the coefficients that were used, as numbers. For friction that Routh's laws
            follow as a function of the slip speed, this is its value at the initial slip speed; a constant
            friction of that value would give another answer.
        model: the model that was used, with every AUTO decided.
        twist_a, twist_b: twists of the bodies' reference points after the impact, in world axes [m/s, rad/s].
        change_a, change_b: changes of these twists by the impact.
        impulse: impulse on body_a, in world axes [N s]; the impulse on body_b is its negative.
        normal_impulse: component of the impulse along the normal, >= 0 [N s].
        tangential_impulse: length of the rest of the impulse [N s].
        normal_velocity_before, normal_velocity_after: normal velocity of body_a relative to body_b at the
            contact [m/s]; negative if the bodies approach.
        effective_mass: effective mass of the two bodies along the normal [kg].
        kinetic_energy_before, kinetic_energy_after: kinetic energy of the dynamic bodies [J]. Of an
            articulated body only the change is known: it counts as 0 before the impact, and as the change
            after it.
        energy_lost_restitution, energy_lost_friction: energy lost to the normal and to the tangential impulse
            [J]. Only their sum is measurable; how it is divided depends on the law.
        regime: what friction did, see :class:`Regime`.
        error_bound: upper bound on the relative error of the impulse, and of the twist change ``(dv, dw)`` of
            each body in the norm ``(m dv.dv + tr(I)/3 dw.dw)^(1/2)``. It includes rounding and what the
            geometry leaves out. For an articulated body, ``1/m`` is the trace of the linear part of its
            inverse inertia, and ``3/tr(I)`` the trace of the angular part. The bound is infinite if no
            digit is known. Numbers below 2.3e-308, which lose digits to underflow, are not covered. If
            friction is followed as a function of the slip speed, the bound is an estimate: four times the
            change of the answer when the path is followed with ten times the tolerance, plus eight times the
            tolerance.
        adjustments: how the impact that was computed differs from the request.
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
        """The answer as a table."""
        return format_impact(self)

    def __repr__(self) -> str:
        """The most important fields, in one line."""
        chosen = f"{self.status}, {self.model.law}, {self.regime}"
        return f"Impact({chosen}, impulse={format_vector(self.impulse)}, error_bound={self.error_bound:.2g})"


def make_impact(
    bodies: Sequence[Body],
    numbers: ImpactNumbers,
    contact: Contact,
    model: ImpactModel,
    error_bound: Scalar,
    bound_limit: float,
) -> Impact:
    """Make an answer from what ``impact.py`` computes, for the requests that Python answers.

    For all others, ``make_impact`` of ``kernels/resolve.cpp`` does this.

    Args:
        bodies: the bodies of the request, in floats or fractions.
        numbers: as they are to appear in the answer. A flag that is undecided counts as false.
        contact, model: as used, before the flags change their restitution and their law.
        error_bound: of the changes.
        bound_limit: the largest error bound that meets the tolerance.
    """
    changes, report, flags, _ = numbers
    below_threshold, fell_back = flags.below_threshold is True, flags.fell_back is True
    status = StatusCode.SEPARATING if flags.separating is True else StatusCode.OK
    return Impact(
        status if error_bound <= bound_limit else StatusCode.TOLERANCE_NOT_MET,
        contact._replace(restitution=report.restitution) if below_threshold else contact,
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
            any(map(is_not_normalised, bodies)) * Adjustment.NORMALISED_ORIENTATION
            | below_threshold * Adjustment.RESTITUTION_THRESHOLD
            | fell_back * Adjustment.LAW_FALLBACK
            | (flags.massless_spin is True) * Adjustment.MASSLESS_SPIN
            | any(body.inverse_inertia is not None for body in bodies) * Adjustment.ENERGY_CHANGE_ONLY
        ),
    )


def relative_difference(impact: Impact, other: Impact, body_a: Body, body_b: Body) -> float:
    """Return how far an answer is from another one, in the norms of ``error_bound``; infinite if unknown.

    It is the largest distance of the vectors whose relative errors ``error_bound`` bounds, each relative to
    the vector of the other answer.
    """
    ratios = []
    vectors = (bounded_vectors((body_a, body_b), answer) for answer in (impact, other))
    try:
        for pair in zip(*vectors, strict=True):
            x, y = ([number * weight for number, weight in vector] for vector in pair)
            distance, size = math.dist(x, y), math.hypot(*y)
            ratios.append(0.0 if distance == 0 else distance / size if size else math.inf)
    except OverflowError:  # a fraction beyond float64
        return math.inf
    return max(ratios) if all(ratio < math.inf for ratio in ratios) else math.inf


def bounded_vectors(bodies: Sequence[Body], changes: Changes | Impact) -> Iterator[list[tuple[Any, Any]]]:
    """Yield the vectors that ``error_bound`` is about, with the weights of their components in its norms."""
    yield [(x, 1) for x in changes.impulse]
    for body, change in zip(bodies, (changes.change_a, changes.change_b), strict=True):
        yield weighted_components(body, change)


def weighted_components(body: Body, change: Twist) -> list[tuple[Any, Any]]:
    """The components of a body's twist change, each with its weight in the norm of ``error_bound``.

    The norm is in proportion to the length of the vector of their products. An immovable body has none.
    """
    linear: Any = 1
    if body.inverse_inertia is not None:
        L, _, W = body.inverse_inertia.blocks()
        traces = L.trace(), W.trace()
        linear, angular = (1 / square_root(x) if certain(x) > 0 else 0 for x in traces)
    elif body.has_mass():
        xx, _, _, yy, _, zz = body.inertia
        angular = square_root((xx + yy + zz) / 3) / square_root(body.mass)
    else:
        return []
    return [*((x, linear) for x in change.linear), *((x, angular) for x in change.angular)]


def norm_components(body: Body, change: Twist) -> tuple[float, ...]:
    """The products of :func:`weighted_components`."""
    return tuple(x * weight for x, weight in weighted_components(body, change))


def format_impact(answer: Any, names: tuple[str, str] = ("body_a", "body_b")) -> str:
    """Format an answer as a table.

    Args:
        answer: an :class:`Impact` or a ``CollisionResult`` message, whose fields have the same names.
        names: names of the two bodies.
    """
    model, contact = answer.model, answer.contact
    status = StatusCode(getattr(answer.status, "code", answer.status))
    law, geometry, precision = Law(model.law), Geometry(model.geometry), Precision(model.precision)
    before, after = answer.normal_velocity_before, answer.normal_velocity_after
    lines = [
        f"{status} by {law} ({geometry}, {precision}), relative error at most {answer.error_bound:.2g}",
        *format_columns(CONTACT_HEAD, [contact_row(answer.regime, contact, before, after, answer.impulse)]),
        *format_columns(BODY_HEAD, map(body_row, names, (answer.twist_a, answer.twist_b))),
        format_energies(answer),
    ]
    if answer.adjustments:
        lines.append(f"adjusted: {Adjustment(answer.adjustments)}")
    return "\n".join(lines)


CONTACT_HEAD = ["regime", "e", "mu", "u before [m/s]", "u after [m/s]", "impulse [N s]"]
BODY_HEAD = ["body", "velocity [m/s]", "angular velocity [rad/s]"]


def contact_row(regime: int, contact: Any, before: Scalar, after: Scalar, impulse: Any) -> list[str]:
    """Return a row below ``CONTACT_HEAD``, with the normal velocities before and after."""
    numbers = contact.restitution, contact.friction, before, after
    return [str(Regime(regime)), *map(format_number, numbers), format_vector(impulse)]


def body_row(name: str, twist: Any) -> list[str]:
    """Return a row below ``BODY_HEAD``."""
    return [name, format_vector(twist.linear), format_vector(twist.angular)]


def format_energies(answer: Any) -> str:
    """Format the kinetic energies before and after, or the change if only that is known, and the losses."""
    before, after = answer.kinetic_energy_before, answer.kinetic_energy_after
    energies = f"energy {format_number(before)} -> {format_number(after)} J"
    if Adjustment.ENERGY_CHANGE_ONLY in Adjustment(answer.adjustments):
        energies = f"energy changed by {format_number(after - before)} J"
    lost = format_number(answer.energy_lost_restitution), format_number(answer.energy_lost_friction)
    return f"{energies}; lost: {lost[0]} restitution, {lost[1]} friction"


def format_name(name: str) -> str:
    """Format a name so that it does nothing to a terminal: its control characters are escaped."""
    return name if name.isprintable() else repr(name)[1:-1]


def format_number(x: Scalar) -> str:
    """Format a number with six digits, and -0 as 0."""
    try:
        number: float | Decimal = float(x)
    except OverflowError:  # a fraction beyond float64
        number = Decimal(x.numerator) / x.denominator
    return f"{number + 0:.6g}"


def format_vector(v: Any) -> str:
    """Format a vector as "(x, y, z)". A component below the rounding of the largest is shown as 0."""
    components = v.x, v.y, v.z
    size = max(map(abs, components))
    return "(" + ", ".join(format_number(0.0 if abs(x) * 2**53 < size else x) for x in components) + ")"


def format_columns(head: list[str], rows: Iterable[list[str]]) -> list[str]:
    """Format a table as lines of left-aligned columns."""
    lines = [head, *rows]
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    return [
        "  ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)).rstrip()
        for line in lines
    ]
