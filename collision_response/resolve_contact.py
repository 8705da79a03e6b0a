"""Resolve an impact given by its inverse effective mass: for mechanisms, soft robots, two links of one arm.

    >>> K = [[3.5, 0, 0], [0, 3.5, 0], [0, 0, 1]]  # a solid sphere of 1 kg
    >>> impact = resolve_contact(K, u=(0.2, 0, -1), n=(0, 0, 1), restitution=0.5, friction=0.3)
    >>> impact.velocity_after.z, impact.regime.name
    (0.5, 'STICKING')

It calls ``resolve`` for an articulated body that has the contact at its origin and ``K`` as its inverse
inertia there.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import NamedTuple

from .answer import format_columns, format_number, format_vector
from .model import DEFAULT, Adjustment, ImpactModel
from .physics.body import Body
from .physics.contact import Contact
from .physics.laws import Regime
from .physics.vector import ZERO, Vec3, as_vector
from .resolve import resolve
from .status import ImpactError, StatusCode, format_value, raise_renamed


class ContactImpact(NamedTuple):
    """The answer of :func:`resolve_contact`. ``print`` shows it as a table.

    Attributes:
        status: OK, SEPARATING or TOLERANCE_NOT_MET.
        model: the model that was used, with every AUTO decided.
        velocity_after: relative velocity at the contact after the impact, ``u + K P`` [m/s].
        velocity_change: ``K P`` [m/s].
        impulse: ``P``, the impulse on the body that the normal points to [N s].
        normal_impulse: component of the impulse along the normal, >= 0 [N s].
        tangential_impulse: length of the rest of the impulse [N s].
        energy_change: change of the kinetic energy of the whole system, ``P.(u + u_after) / 2``; <= 0 except
            for rounding [J].
        energy_lost_restitution, energy_lost_friction: as in :class:`Impact` [J].
        regime: what friction did, see :class:`Regime`.
        error_bound: upper bound on the relative errors of the impulse and of the velocity change, in the
            Euclidean norm. It includes rounding, also that of inputs that are not floats. If friction is
            followed as a function of the slip speed, it is an estimate, as in :class:`Impact`.
        adjustments: how the impact that was computed differs from the request.
    """

    status: StatusCode
    model: ImpactModel
    velocity_after: Vec3
    velocity_change: Vec3
    impulse: Vec3
    normal_impulse: float
    tangential_impulse: float
    energy_change: float
    energy_lost_restitution: float
    energy_lost_friction: float
    regime: Regime
    error_bound: float
    adjustments: Adjustment

    def __str__(self) -> str:
        """The answer as a table."""
        touch = [str(self.regime), format_vector(self.velocity_after), format_vector(self.impulse)]
        lost = map(
            format_number, (self.energy_change, self.energy_lost_restitution, self.energy_lost_friction)
        )
        lines = [
            f"{self.status} by {self.model.law} ({self.model.precision}), "
            f"relative error at most {self.error_bound:.2g}",
            *format_columns(["regime", "velocity after [m/s]", "impulse [N s]"], [touch]),
            "energy changed by {} J; lost: {} restitution, {} friction".format(*lost),
        ]
        if self.adjustments:
            lines.append(f"adjusted: {self.adjustments}")
        return "\n".join(lines)

    def __repr__(self) -> str:
        """The most important fields, in one line."""
        chosen = f"{self.status}, {self.model.law}, {self.regime}"
        bound = f"error_bound={self.error_bound:.2g}"
        return f"ContactImpact({chosen}, impulse={format_vector(self.impulse)}, {bound})"


def resolve_contact(
    K: Iterable[Iterable[float]],
    u: Iterable[float],
    n: Iterable[float],
    restitution: float | Callable[[float], float] = 1.0,
    friction: float | Callable[[float], float] = 0.0,
    model: ImpactModel = DEFAULT,
) -> ContactImpact:
    """Compute the impulse at a contact from its inverse effective mass, instead of from two bodies.

    Args:
        K: inverse effective mass at the contact, 3x3, symmetric and positive semi-definite [1/kg]. An impulse
            ``P`` changes the relative velocity by ``K P``. For a mechanism it is ``J M^-1 J^T``, where ``J``
            is the Jacobian of the relative velocity at the contact. ``K`` may be singular as long as
            ``n.K n`` is not 0 and, with friction, ``u`` is in its range. It counts as singular if its
            determinant is at most 2^-40 times the product of its diagonal, or an eigenvalue at most 2^-70
            times its trace.
        u: velocity of the first body relative to the second at the contact [m/s].
        n: normal from the second body to the first, of any length except 0.
        restitution: ``e`` in [0, 1], or a function of the approach speed [m/s].
        friction: Coulomb's coefficient, >= 0, or a function of the slip speed [m/s], as in :class:`Contact`.
        model: what to model, and how exactly. Its geometry must be AUTO or SPATIAL.

    Returns:
        The impulse on the first body, the relative velocity after the impact, the energies, and a bound on
        the relative error.

    Raises:
        ImpactError: if the request cannot be answered. ``field`` is the name of an argument.
        TypeError: if an argument has the wrong type.
    """
    try:
        rows = [[*row, 0.0, 0.0, 0.0] for row in K]
    except TypeError:
        raise TypeError(f"K: must be 3 x 3 numbers, is {format_value(K)}") from None
    if [len(row) for row in rows] != [6, 6, 6]:
        raise ImpactError(StatusCode.INVALID_INERTIA, "K", f"must be 3 x 3 numbers, is {format_value(K)}")
    contact, velocity = Contact(ZERO, as_vector("n", n), restitution, friction), as_vector("u", u)
    try:
        body = Body.articulated([*rows, *[[0.0] * 6] * 3], velocity=velocity)
        impact = resolve(body, Body.static(), contact, model)
    except ImpactError as error:
        if error.code is StatusCode.NO_DYNAMIC_BODY:
            raise ImpactError(error.code, "K", "must not be 0") from None
        error = error.renamed(_ARGUMENTS)
        if error.field == "K":
            reason = f"{error.reason.partition('; is ')[0]}; is {format_value(K)}"
            raise ImpactError(error.code, "K", reason) from None
        raise error from None
    except TypeError as error:
        raise_renamed(error, _ARGUMENTS)
    return ContactImpact(
        impact.status,
        impact.model,
        impact.twist_a.linear,
        impact.change_a.linear,
        impact.impulse,
        impact.normal_impulse,
        impact.tangential_impulse,
        impact.kinetic_energy_after,
        impact.energy_lost_restitution,
        impact.energy_lost_friction,
        impact.regime,
        impact.error_bound,
        impact.adjustments & ~Adjustment.ENERGY_CHANGE_ONLY,
    )


_ARGUMENTS = {
    "inverse_inertia": "K",
    "body_a.inverse_inertia": "K",
    "body_a.velocity": "u",
    "body_a": "K",
    "contact.normal": "n",
    "contact.restitution": "restitution",
    "contact.friction": "friction",
}
"""The fields of ``resolve``, and the arguments of :func:`resolve_contact` that they come from."""
