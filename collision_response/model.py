"""What to model and how exactly, by the names of ``msg/ImpactModel.msg``; and what each AUTO stands for.

AUTO is decided in two places: the law and the precisions here, in :func:`plan_model`, because the model and
whether there is friction decide them; the geometry in :mod:`~collision_response.geometry`, because the bodies
and the contact decide it.
"""

from __future__ import annotations

import math
from enum import IntFlag
from numbers import Number
from typing import Any, NamedTuple

from .arguments import check_number
from .named_enum import NamedEnum
from .numbers.operations import ROUNDOFF, of_python
from .physics.laws import PATHS, STEPPED, Law, Settings
from .physics.stiffness import METAL_ON_METAL
from .status import ImpactError, StatusCode, format_value


class Geometry(NamedEnum):
    """Which motion is modelled.

    If a request needs more than the geometry that it asks for, the answer is that of the smaller model, in
    which the bodies keep the momenta that it has. The error bound counts what is left out.
    """

    AUTO = 1
    """The smallest geometry that leaves out nothing, for the bodies and the contact of the request."""
    POINT = 2
    """Translation only; bodies do not rotate."""
    PLANAR = 3
    """Translation in the x-y plane, and rotation about z."""
    SPATIAL = 4
    """Translation and rotation in space."""


class Precision(NamedEnum):
    """The arithmetic of the computation. Each kind bounds its own rounding error."""

    AUTO = 1
    """DOUBLE; EXTENDED where the error bound of DOUBLE is above the tolerance, or, without a tolerance, so
    large that it says nothing."""
    SINGLE = 2
    """float32, about 7 digits. Laws that follow a path of the impulse run in DOUBLE, whose digits they need.
    One impact takes about as long as in DOUBLE; a batch of float32 takes half as long."""
    DOUBLE = 3
    """float64, about 16 digits."""
    EXTENDED = 4
    """Right to one unit in the last place of float64: with about 32 digits, and where these are not enough,
    with as many as it takes if python-flint is installed. A law that integrates in steps still has the error
    of its steps, which the bound includes."""


ENUMERATIONS: dict[str, type[NamedEnum]] = {"law": Law, "geometry": Geometry, "precision": Precision}
"""The enumerations of an :class:`ImpactModel`, by its fields."""


class Adjustment(IntFlag):
    """How the impact that was computed differs from the request."""

    NONE = 0
    NORMALISED_ORIENTATION = 1
    """A quaternion did not have unit length and was normalised."""
    RESTITUTION_THRESHOLD = 2
    """The approach was slower than ``restitution_threshold``, so restitution was taken as 0; in
    scenes by ROUTH_STRONGE as 0.05, the least that it can have."""
    LAW_FALLBACK = 4
    """COULOMB answered in place of the law; in a scene without friction, FRICTIONLESS. Either MOREAU has no
    solution or would create energy, or friction acts on a mechanism that moves in one direction only, or
    wedges."""
    MASSLESS_SPIN = 8
    """A body turned about an axis without inertia. That rotation moves no contact and was left out."""
    ENERGY_CHANGE_ONLY = 16
    """A body is articulated: only the change of its kinetic energy is known, so its energy counts from 0."""
    NO_REBOUND = 32
    """In a scene, bodies would rebound without end, such as a box between the fingers of a gripper.
    Restitution was taken as 0."""

    def __str__(self) -> str:
        """The names of the flags that are set."""
        return ", ".join(flag.name or "" for flag in Adjustment if flag & self) or "NONE"


class ImpactModel(NamedTuple):
    """What to model, and how exactly.

    Attributes:
        law: the impact law, see :class:`Law`.
        geometry: which motion is modelled, see :class:`Geometry`.
        precision: the arithmetic, see :class:`Precision`.
        tolerance: largest acceptable relative error of the impulse and of the twist changes, >= 0. An answer
            whose error bound is above it has the status TOLERANCE_NOT_MET. 0 accepts every finite bound; AUTO
            then tries EXTENDED if the bound is above 2^-20.
        tangential_restitution: ``e_t`` in [-1, 1], for COULOMB.
        restitution_threshold: approach speed [m/s] below which restitution is taken as 0, >= 0.
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
"""The range of ``stiffness_ratio``. Beyond it COMPLIANT differs from ROUTH_STRONGE, or from FRICTIONLESS, by
less than any measurement shows."""


class ModelPlan(NamedTuple):
    """What a model asks of the kernels, with AUTO decided as far as the model alone decides it.

    Attributes:
        law_without_friction, law_with_friction: the laws for contacts without and with friction.
        geometry: as in the model. AUTO becomes what the bodies and the contact require, see
            :mod:`~collision_response.geometry`.
        first_precision, last_precision: the precisions to try, from the first up to the last, until the error
            bound is at most ``target_bound``.
        target_bound: the error bound to aim for.
        bound_limit: the error bound above which the answer does not meet the tolerance; >= ``target_bound``.
        settings: the numbers of the model, as floats.
        settings_errors: the rounding errors of those conversions to float.
        may_be_kept: whether the plan holds for later calls with the same model, because its numbers never
            change. An array of no dimensions may.
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
    may_be_kept: bool


def plan_model(model: ImpactModel) -> ModelPlan:
    """Decide what a model asks of the kernels.

    Raises:
        ImpactError: NOT_FINITE, INVALID_MODEL or INVALID_COEFFICIENT, as :func:`check_model`.
        TypeError: if ``model`` is not an :class:`ImpactModel`, or a number of it is not a real number.
    """
    check_model(model)
    law, geometry, precision = model[:3]
    given = [getattr(model, name) for name in Settings._fields]
    settings = Settings(*map(float, given))
    limit = bound_limit(model)
    return ModelPlan(
        law_without_friction=law_for(law, has_friction=False),
        law_with_friction=law_for(law, has_friction=True),
        geometry=geometry,
        first_precision=_first_precision(precision, settings.tolerance),
        last_precision=Precision.EXTENDED if precision is Precision.AUTO else precision,
        target_bound=_target_bound(precision, limit),
        bound_limit=limit,
        settings=settings,
        settings_errors=Settings(*map(_conversion_error, settings, given)),
        may_be_kept=all(isinstance(number, Number) for number in given),
    )


def bound_limit(model: ImpactModel) -> float:
    """Return the error bound above which an answer does not meet the tolerance of a valid model."""
    return float(model.tolerance) if model.tolerance > 0 else LARGEST_BOUND  # 1e-400 is 0 as a float


def law_for(law: Law, *, has_friction: bool) -> Law:
    """Return the law that AUTO stands for; any other law as it is.

    ``has_friction``: whether the contact has friction; in a scene, whether one of its contacts has; in a
    table, whether it has a row of friction, even of zeros; for derivatives, also if one is by friction.
    """
    if law is not Law.AUTO:
        return law
    return Law.COULOMB if has_friction else Law.FRICTIONLESS


def integrates_in_steps(model: ImpactModel) -> bool:
    """Whether a model without AUTO may integrate a path in steps. More digits do not make it more exact."""
    return model.law in STEPPED or (model.law in PATHS and model.geometry is Geometry.SPATIAL)


def in_finest_steps(model: ImpactModel) -> ImpactModel | None:
    """Return a model without AUTO with the finest path, if that is finer than for its own tolerance.

    A tolerance also makes the steps of a path coarser. Where errors grow, its bound may then miss it.
    """
    if not (integrates_in_steps(model) and model.tolerance > FINEST_TOLERANCE):
        return None
    return model._replace(tolerance=FINEST_TOLERANCE)


def settled_bound(model: ImpactModel) -> float:
    """Return the error bound below which more digits change nothing, for a model without AUTO; mostly 0.

    Where a path is integrated in steps, they only decide whether the bodies approach, which is known if the
    error is below 1, and whether they do so below the threshold.
    """
    if not integrates_in_steps(model):
        return 0.0
    return USEFUL_BOUND if model.restitution_threshold > 0 else 1.0


def _first_precision(precision: Precision, tolerance: float) -> Precision:
    if precision is not Precision.AUTO:
        return precision
    return Precision.EXTENDED if 0 < tolerance < LEAST_DOUBLE_BOUND else Precision.DOUBLE


def _target_bound(precision: Precision, limit: float) -> float:
    if precision is Precision.EXTENDED:
        return min(limit, ULP)
    has_tolerance = limit < LARGEST_BOUND
    return USEFUL_BOUND if precision is Precision.AUTO and not has_tolerance else limit


def _conversion_error(x: float, given: Any) -> float:
    """Bound the error of ``x = float(given)``."""
    return 0.0 if x == given else abs(x) * ROUNDOFF


LEAST_DOUBLE_BOUND = 2.0**-48
"""DOUBLE rarely reaches an error bound below this, so AUTO does not try it for a smaller tolerance."""

USEFUL_BOUND = 2.0**-20
"""An error bound above this says little, so AUTO tries a better precision if no tolerance is given."""

FINEST_TOLERANCE = 1e-11
"""Smaller tolerances do not make the steps of a path finer."""

LARGEST_BOUND = math.nextafter(math.inf, 0.0)
"""The largest finite error bound."""

ULP = 2.0**-52
"""One unit in the last place of a float64, at most, relative to the number: what EXTENDED aims for."""


def model_as_used(model: ImpactModel, law: int, geometry: int, precision: int) -> ImpactModel:
    """Return the model with the law, geometry and precision that were used, and numbers that never change."""
    numbers: list[Any] = [x if isinstance(x, Number) else of_python(x) for x in model[3:]]
    return ImpactModel(Law(law), Geometry(geometry), Precision(precision), *numbers)


def check_model(model: Any) -> None:
    """Check that a model can be used.

    Raises:
        ImpactError: NOT_FINITE, if a number is not finite. INVALID_MODEL, if ``law``, ``geometry`` or
            ``precision`` is not a member of its enumeration, or ``tolerance`` or ``restitution_threshold`` is
            negative. INVALID_COEFFICIENT, if ``tangential_restitution`` or ``stiffness_ratio`` is out of
            range.
        TypeError: if ``model`` is not an :class:`ImpactModel`, or a number of it is not a real number.
    """
    if not isinstance(model, ImpactModel):
        hint = f": write ImpactModel(law=Law.{model})" if isinstance(model, Law) else ""
        raise TypeError(f"model: must be an ImpactModel, is {format_value(model)}{hint}")
    for field, kind in ENUMERATIONS.items():
        value = getattr(model, field)
        if not isinstance(value, kind):
            known = ", ".join(f"{member.name} ({member.value})" for member in kind)
            reason = f"must be one of {known}; is {format_value(value)}"
            raise ImpactError(StatusCode.INVALID_MODEL, f"model.{field}", reason)
    for field, least, most, code in (
        ("tangential_restitution", -1, 1, StatusCode.INVALID_COEFFICIENT),
        ("tolerance", 0, math.inf, StatusCode.INVALID_MODEL),
        ("restitution_threshold", 0, math.inf, StatusCode.INVALID_MODEL),
        ("stiffness_ratio", *STIFFNESS_RATIOS, StatusCode.INVALID_COEFFICIENT),
    ):
        check_number(f"model.{field}", getattr(model, field), least, most, code)
