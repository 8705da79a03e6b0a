"""What to model, and how exactly: the numbers of ``msg/ImpactModel.msg``, named; and what AUTO becomes."""

from __future__ import annotations

import math
from enum import IntFlag
from typing import Any, NamedTuple

from .named_enum import NamedEnum
from .physics.laws import Law as Law
from .physics.laws import Settings
from .physics.stiffness import METAL_ON_METAL
from .status import ImpactError, StatusCode, format_range, format_value


class Geometry(NamedEnum):
    """How much of the motion is modelled."""

    AUTO = 1
    """The cheapest that is exact for the bodies and the contact at hand."""
    POINT = 2
    """No rotation."""
    PLANAR = 3
    """Motion in the x-y plane, rotation about z."""
    SPATIAL = 4
    """Everything."""


class Precision(NamedEnum):
    """The kinds of arithmetic. Each bounds its own error."""

    AUTO = 1
    """DOUBLE, and where that does not meet the tolerance (without one: bounds nothing), EXTENDED."""
    SINGLE = 2
    """32 bits, some 7 digits; DOUBLE for the laws of paths, which need its digits. One impact takes about as
    long as in DOUBLE; batches of float32 take half as long."""
    DOUBLE = 3
    """64 bits, some 16 digits."""
    EXTENDED = 4
    """Right to a unit in the last place: by some 32 digits, and by as many as it takes where that is not
    enough and python-flint is installed. A law that takes steps leaves what they miss: the bound says how
    much."""


class Adjustment(IntFlag):
    """What was changed from what was asked."""

    NONE = 0
    NORMALISED_ORIENTATION = 1
    """A quaternion was not of unit length."""
    RESTITUTION_THRESHOLD = 2
    """The approach was slower than ``restitution_threshold``: restitution was taken as 0."""
    LAW_FALLBACK = 4
    """MOREAU has no solution, or would create energy; or a mechanism moves one way only, or wedges: COULOMB
    answered."""
    MASSLESS_SPIN = 8
    """A body turned about an axis without inertia: that rotation was left out, it moves no contact."""
    ENERGY_CHANGE_ONLY = 16
    """A body is articulated: of its kinetic energy only the change is known, so it counts from 0."""

    def __str__(self) -> str:
        """The names of what was changed."""
        return ", ".join(flag.name or "" for flag in Adjustment if flag & self) or "NONE"


class ImpactModel(NamedTuple):
    """What to model, and how exactly.

    Attributes:
        law: see :class:`Law`.
        geometry: see :class:`Geometry`.
        precision: see :class:`Precision`.
        tolerance: greatest relative error of the impulse wanted, >= 0; 0: any that is known. Without one
            AUTO tries harder above ``USEFUL_BOUND``.
        tangential_restitution: ``e_t`` in [-1, 1], for COULOMB.
        restitution_threshold: approach speed [m/s] under which restitution is taken as 0, >= 0.
        stiffness_ratio: tangential over normal stiffness of the contact, in [1e-6, 1e6], for COMPLIANT: see
            :func:`~collision_response.physics.stiffness.stiffness_ratio`.
    """

    law: Law = Law.AUTO
    geometry: Geometry = Geometry.AUTO
    precision: Precision = Precision.AUTO
    tolerance: float = 0.0
    tangential_restitution: float = 0.0
    restitution_threshold: float = 0.0
    stiffness_ratio: float = METAL_ON_METAL


DEFAULT = ImpactModel()

STIFFNESS_RATIOS = 1e-6, 1e6
"""Greater and smaller ones differ from ROUTH_STRONGE and FRICTIONLESS by less than any measurement shows."""


class ModelPlan(NamedTuple):
    """What a model asks of the kernels: what AUTO stands for, as far as the model decides it.

    Attributes:
        law_without_friction, law_with_friction: for a contact.
        geometry: AUTO becomes what the impact requires, see :mod:`~collision_response.geometry`.
        first_precision, last_precision: precisions to climb through until the bound is low enough.
        target_bound: error bound to climb to.
        bound_limit: error bound above which the tolerance is not met.
        settings: the numbers of the model, as floats.
        settings_errors: of those, where they were none.
    """

    law_without_friction: Law
    law_with_friction: Law
    geometry: Geometry
    first_precision: Precision
    last_precision: Precision
    target_bound: float
    bound_limit: float
    settings: Settings
    settings_errors: Settings


def plan_model(model: ImpactModel) -> ModelPlan:
    """What a model comes to.

    Raises:
        ImpactError: NOT_FINITE, INVALID_MODEL or INVALID_COEFFICIENT.
        TypeError: it is no model.
    """
    check_model(model)
    law, geometry, precision = model[:3]
    given = [getattr(model, name) for name in Settings._fields]
    settings = Settings(*map(float, given))
    limit = settings.tolerance or LARGEST_BOUND
    return ModelPlan(
        law_for(law, has_friction=False),
        law_for(law, has_friction=True),
        geometry,
        _first(precision, settings.tolerance),
        Precision.EXTENDED if precision is Precision.AUTO else precision,
        _wanted(precision, limit),
        limit,
        settings,
        Settings(*map(_lost, settings, given)),
    )


def _lost(x: float, given: Any) -> float:
    """What rounding to a float may have cost."""
    return 0.0 if x == given else abs(x) * 2.0**-53


def law_for(law: Law, *, has_friction: bool) -> Law:
    """What a law comes to, for contacts with friction or without."""
    if law is not Law.AUTO:
        return law
    return Law.COULOMB if has_friction else Law.FRICTIONLESS


def _first(precision: Precision, tolerance: float) -> Precision:
    if precision is not Precision.AUTO:
        return precision
    return Precision.EXTENDED if 0 < tolerance < LEAST_DOUBLE_BOUND else Precision.DOUBLE


LEAST_DOUBLE_BOUND = 2.0**-48
"""An error bound that DOUBLE hardly ever gets below: AUTO does not try."""


def _wanted(precision: Precision, limit: float) -> float:
    if precision is Precision.EXTENDED:
        return min(limit, ULP)
    return min(limit, USEFUL_BOUND) if precision is Precision.AUTO else limit


USEFUL_BOUND = 2.0**-20
"""An error bound above this hardly says anything: AUTO tries a better precision."""

LARGEST_BOUND = math.nextafter(math.inf, 0.0)
"""The greatest error bound that says anything."""

ULP = 2.0**-52
"""A unit in the last place, at its largest relative to a number: what EXTENDED promises."""


def model_as_used(model: ImpactModel, law: int, geometry: int, precision: int) -> ImpactModel:
    """The model as used."""
    return model._replace(law=Law(law), geometry=Geometry(geometry), precision=Precision(precision))


def check_model(model: Any) -> None:
    """Accept a model, or say what is wrong with it.

    Raises:
        ImpactError: NOT_FINITE, INVALID_MODEL or INVALID_COEFFICIENT.
        TypeError: it is no model.
    """
    if not isinstance(model, ImpactModel):
        hint = f": write ImpactModel(law=Law.{model})" if isinstance(model, Law) else ""
        raise TypeError(f"model: must be an ImpactModel, is {format_value(model)}{hint}")
    for field, kind in (("law", Law), ("geometry", Geometry), ("precision", Precision)):
        value = getattr(model, field)
        if not isinstance(value, kind):
            known = ", ".join(f"{member.name} ({member.value})" for member in kind)
            raise ImpactError(
                StatusCode.INVALID_MODEL,
                f"model.{field}",
                f"must be one of {known}; is {format_value(value)}",
            )
    for field, least, most, code in (
        ("tangential_restitution", -1, 1, StatusCode.INVALID_COEFFICIENT),
        ("tolerance", 0, math.inf, StatusCode.INVALID_MODEL),
        ("restitution_threshold", 0, math.inf, StatusCode.INVALID_MODEL),
        ("stiffness_ratio", *STIFFNESS_RATIOS, StatusCode.INVALID_COEFFICIENT),
    ):
        check_number(f"model.{field}", getattr(model, field), least, most, code)


def check_by_one_code(field: str, value: Any, least: float, most: float, code: StatusCode) -> None:
    """As :func:`check_number`, with one code for all that is wrong with a number."""
    try:
        check_number(field, value, least, most, code)
    except ImpactError as error:
        raise ImpactError(code, field, error.reason) from None


def check_number(field: str, value: Any, least: float, most: float, code: StatusCode) -> None:
    """Raises: ImpactError: NOT_FINITE, or ``code`` beyond the limits. TypeError: no real number."""
    is_truth = type(value).__name__.startswith(("bool", "Masked"))  # NumPy's; one that is masked is none
    is_number = hasattr(value, "__float__") and not getattr(value, "shape", ())
    if is_truth or isinstance(value, (complex, str)) or not is_number:
        raise TypeError(f"{field}: must be a real number, is {value!r}")
    try:
        finite = math.isfinite(value)
    except OverflowError:  # an integer beyond float64
        finite = False
    except TypeError:  # an array
        raise TypeError(f"{field}: must be a real number, is {value!r}") from None
    if not finite:
        raise ImpactError(StatusCode.NOT_FINITE, field, f"must be finite; is {format_value(value, str)}")
    if not least <= value <= most:
        raise ImpactError(code, field, f"must be {format_range(least, most)}; is {format_value(value, str)}")
