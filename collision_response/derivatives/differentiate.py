"""The Jacobian of an impact, from dual numbers in the formula that also computes the impact.

A change of an orientation is a rotation about the world axes: ``R <- exp([theta]x) R``. A change of a
product of inertia changes both ``xy`` and ``yx``. A change of a pose leaves the contact point and the
normal where they are, because how they move depends on the surfaces: see ``surfaces.py``. The normal is
differentiated with the length that it has.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable
from functools import lru_cache
from operator import attrgetter
from struct import Struct
from typing import NamedTuple

import numpy as np

from ..answer import Impact
from ..arguments import as_list
from ..batch import BatchResult, resolve_batch
from ..batch.arrays import Array, as_numpy, compared_by_identity
from ..batch.pairs import IS_ANSWER
from ..batch.rows import TABLE_LAYOUTS
from ..kernels import _derivatives, library
from ..kernels.layout import (
    ALL_ONE,
    ALL_ZERO,
    Layout,
    names_of_body,
    names_of_contact,
    rows_in_everything,
    slices_of,
    widths_of,
)
from ..model import DEFAULT, Adjustment, Geometry, ImpactModel, law_for, plan_model
from ..named_enum import NamedEnum
from ..physics.body import Body
from ..physics.contact import Contact
from ..physics.laws import Settings
from ..resolve import resolve
from ..status import ImpactError, StatusCode, format_value

_settings_of = attrgetter(*Settings._fields)
_PACKED_SETTINGS = Struct(f"{len(Settings._fields)}d")
_BYTES_BEFORE_SETTINGS = 8 * (
    2 * len(names_of_body(Layout.EVERYTHING)) + len(names_of_contact(Layout.EVERYTHING))
)


def _parameter_widths() -> dict[str, int]:
    """Number of components of each parameter."""
    of_body = widths_of(Layout.EVERYTHING.body_fields) | {"orientation": 3}  # a rotation vector
    widths = {f"{body}.{name}": width for body in ("body_a", "body_b") for name, width in of_body.items()}
    widths |= {f"contact.{name}": n for name, n in widths_of(Layout.EVERYTHING.contact_fields).items()}
    return widths | {"model.tangential_restitution": 1, "model.stiffness_ratio": 1}


PARAMETERS = slices_of(_parameter_widths())
"""The inputs to differentiate by, and their components in a direction of 54 numbers."""

RESULTS = slices_of(
    {"twist_a.linear": 3, "twist_a.angular": 3, "twist_b.linear": 3, "twist_b.angular": 3, "impulse": 3}
)
"""The results to differentiate, and their rows in a Jacobian. The twists are those after the impact."""

PARAMETER_COUNT = max(components.stop for components in PARAMETERS.values())
RESULT_COUNT = max(rows.stop for rows in RESULTS.values())


class Smoothness(NamedEnum):
    """Where a derivative is valid."""

    SMOOTH = 0
    """In a neighbourhood."""
    KINK = 1
    """On one side only: the input lies, within rounding, on the edge of the regime of the answer."""
    JUMP = 2
    """Nowhere nearby: the answer itself jumps at this input."""


class Derivatives(NamedTuple):
    """An impact and its Jacobian.

    Attributes:
        impact: the answer.
        jacobian: of :data:`RESULTS` by the requested parameters, in SI units, shape ``(15, K)``.
        smoothness: a :class:`Smoothness` for each column, uint8, shape ``(K,)``.
        columns: the columns of each requested parameter, by its name.
    """

    impact: Impact
    jacobian: Array
    smoothness: Array
    columns: dict[str, slice]

    def __eq__(self, other: object) -> bool:
        """Whether both have the same numbers for the same answer."""
        if not isinstance(other, Derivatives):
            return NotImplemented
        arrays = zip(self[1:3], other[1:3], strict=True)
        same_answer = (self.impact, self.columns) == (other.impact, other.columns)
        return same_answer and all(np.array_equal(*pair) for pair in arrays)

    def __ne__(self, other: object) -> bool:
        """Whether they differ. The method of tuples would compare the arrays."""
        return not self == other

    def of(self, result: str, parameter: str) -> Array:
        """Return the derivative of one of :data:`RESULTS` by one of the requested :data:`PARAMETERS`.

        Its shape is that of the two: ``(3, 1)`` for the impulse by a mass.

        Raises:
            KeyError: if there is no such result, or the parameter was not requested.
        """
        for field, name, known in (("result", result, RESULTS), ("parameter", parameter, self.columns)):
            if name not in known:
                raise KeyError(f"{field}: must be one of {', '.join(known)}; is {format_value(name)}")
        return self.jacobian[RESULTS[result], self.columns[parameter]]


@compared_by_identity
class BatchDerivatives(NamedTuple):
    """Many impacts and their derivatives.

    Attributes:
        result: as :func:`~collision_response.batch.resolve_batch` returns it.
        jacobian: of :data:`RESULTS` in each direction, shape ``(15, K, N)``. NaN if a contact has no answer;
            infinite or NaN where a derivative is beyond float64.
        smoothness: a :class:`Smoothness` for each direction and contact, uint8, shape ``(K, N)``; without a
            meaning if a contact has no answer.
    """

    result: BatchResult
    jacobian: Array
    smoothness: Array


def differentiate(
    body_a: Body,
    body_b: Body,
    contact: Contact,
    model: ImpactModel = DEFAULT,
    with_respect_to: Iterable[str] = tuple(PARAMETERS),
) -> Derivatives:
    """Return the Jacobian of the twists after an impact and of its impulse, in double precision.

    Args:
        body_a, body_b, contact, model: as for :func:`~collision_response.resolve`, with restitution and
            friction as numbers, bodies that are not articulated, and the geometry AUTO or SPATIAL.
        with_respect_to: different names of :data:`PARAMETERS`, in the order of the columns.

    Raises:
        ImpactError: as :func:`~collision_response.resolve`, or with the status INVALID_COEFFICIENT if a
            coefficient is a function, INVALID_MODEL if the geometry is another one or a name is not in
            :data:`PARAMETERS` or there twice, INVALID_INERTIA if a body is articulated, OUT_OF_RANGE if a
            derivative is beyond float64, the path of COMPLIANT has too many steps, or the inverse mass at the
            contact is singular in float64, as with a lever arm 1e8 times as long as the radius of gyration.
        TypeError: as :func:`~collision_response.resolve`, or if ``with_respect_to`` does not hold names.
    """
    directions, columns = _directions_and_columns(with_respect_to)
    check_coefficients(contact)
    impact = resolve(body_a, body_b, contact, model)
    if model.geometry is not Geometry.AUTO and model.geometry is not Geometry.SPATIAL:
        reason = f"must be AUTO or SPATIAL for derivatives, is {model.geometry.name}"
        raise ImpactError(StatusCode.INVALID_MODEL, "model.geometry", reason)
    # At 0, the derivative by friction is that of the law of contacts with friction, also in a batch.
    law = law_for(model.law, has_friction=contact.friction > 0 or "contact.friction" in columns)
    for name, body in (("body_a", body_a), ("body_b", body_b)):
        if body.inverse_inertia is not None:
            reason = "must be None for derivatives: articulated bodies have none"
            raise ImpactError(StatusCode.INVALID_INERTIA, f"{name}.inverse_inertia", reason)
    if contact.tangential_restitution is not None:
        model = model._replace(tangential_restitution=contact.tangential_restitution)
    count = directions.shape[1]
    numbers, _ = library.numbers_with_errors(body_a, body_b, contact)

    def found_with(model: ImpactModel) -> tuple[Array, Array]:
        jacobian, smoothness = np.empty((RESULT_COUNT, count)), np.empty(count, np.uint8)
        inputs = numbers[:_BYTES_BEFORE_SETTINGS] + _PACKED_SETTINGS.pack(*_settings_of(model))
        if not _derivatives.differentiate(law, 1, count, True, inputs, directions, jacobian, smoothness):
            reason = "a derivative is beyond float64 or could not be computed"
            raise ImpactError(StatusCode.OUT_OF_RANGE, "result", reason)
        return jacobian, smoothness

    jacobian, smoothness = found_with(model)
    if model.restitution_threshold > 0 and contact.restitution > 0 and Smoothness.JUMP in smoothness:
        # Rounding may have decided otherwise than for the answer: now no approach is near the threshold.
        is_slow = Adjustment.RESTITUTION_THRESHOLD in impact.adjustments
        jacobian, _ = found_with(model._replace(restitution_threshold=sys.float_info.max if is_slow else 0.0))
    return Derivatives(impact, jacobian, smoothness, dict(columns))


def check_coefficients(contact: Contact) -> None:
    """Refuse a coefficient that is a function.

    Raises:
        ImpactError: INVALID_COEFFICIENT.
    """
    for name in ("restitution", "friction"):
        if callable(getattr(contact, name, None)):  # resolve() refuses what is not a Contact
            reason = "must be a number for derivatives: multiply the derivative by the slope of the function"
            raise ImpactError(StatusCode.INVALID_COEFFICIENT, f"contact.{name}", reason)


def unit_directions(*with_respect_to: str) -> Array:
    """Return the unit directions along the components of these :data:`PARAMETERS`, shape ``(54, K)``.

    Raises:
        ImpactError: INVALID_MODEL if a name is not in :data:`PARAMETERS` or there twice.
        TypeError: if something is no name.
    """
    if len(with_respect_to) == 1 and isinstance(with_respect_to[0], (list, tuple)):
        (names,) = with_respect_to
        if names and all(isinstance(name, str) for name in names):
            raise TypeError(f"with_respect_to: must be names one by one, as unit_directions(*{names!r})")
    return _directions_and_columns(with_respect_to)[0].copy()


def _directions_and_columns(with_respect_to: Iterable[str]) -> tuple[Array, dict[str, slice]]:
    try:
        is_tuple = type(with_respect_to) is tuple  # then a copy takes time for nothing
        names = with_respect_to if is_tuple else as_list("with_respect_to", with_respect_to)
        return _unit_directions(tuple(names))
    except TypeError:  # it is not iterable, one name, or holds something else
        reason = f"must be a sequence of names of parameters, is {format_value(with_respect_to)}"
        raise TypeError(f"with_respect_to: {reason}") from None


def differentiate_batch(
    bodies: Array, contacts: Array, directions: Array, model: ImpactModel = DEFAULT
) -> BatchDerivatives:
    """Return the derivatives of many impacts in chosen directions.

    Args:
        bodies, contacts, model: as for :func:`~collision_response.batch.resolve_batch`; the arrays are of
            float64.
        directions: ``K`` directions, with the components of :data:`PARAMETERS` as rows: shape ``(54, K)`` for
            the same directions at every contact, or ``(54, K, N)`` for directions of each contact, float64.
            They may have components that the tables of a geometry leave out.

    Raises:
        ImpactError, TypeError: as ``resolve_batch``.
        ValueError: as ``resolve_batch``, or if an array is not float64 or ``directions`` has another shape.
    """
    given = {"bodies": bodies, "contacts": contacts, "directions": directions}
    bodies, contacts, directions = (as_numpy(name, array) for name, array in given.items())
    result = resolve_batch(bodies, contacts, model)
    n = bodies.shape[2]
    for name, array in (("bodies", bodies), ("contacts", contacts), ("directions", directions)):
        if array.dtype != float:
            raise ValueError(f"{name}: must be float64, is {array.dtype}")
    if (
        directions.ndim not in (2, 3)
        or directions.shape[0] != PARAMETER_COUNT
        or directions.shape[2:] not in ((), (n,))
    ):
        raise ValueError(
            f"directions: must be of shape ({PARAMETER_COUNT}, K) or ({PARAMETER_COUNT}, K, {n}), "
            f"is {directions.shape}"
        )
    inputs = _kernel_inputs(bodies, contacts, model)
    has_row = contacts.shape[0] >= TABLE_LAYOUTS[bodies.shape[0]].contacts.height
    law = law_for(model.law, has_friction=has_row or bool(directions[PARAMETERS["contact.friction"]].any()))
    count, same_for_all = directions.shape[1], directions.ndim == 2
    jacobian, smoothness = np.empty((RESULT_COUNT, count, n)), np.empty((count, n), np.uint8)
    directions = np.ascontiguousarray(directions)
    _derivatives.differentiate(law, n, count, same_for_all, inputs, directions, jacobian, smoothness)
    jacobian[..., ~IS_ANSWER[result.status]] = np.nan
    return BatchDerivatives(result, jacobian, smoothness)


@lru_cache
def _unit_directions(names: tuple[str, ...]) -> tuple[Array, dict[str, slice]]:
    """Return the unit directions of these parameters, and the columns of each of them."""
    if not all(isinstance(name, str) for name in names):
        raise TypeError
    for name in names:
        if name not in PARAMETERS or names.count(name) > 1:
            reason = f"must be different names from {', '.join(PARAMETERS)}; one is {format_value(name)}"
            raise ImpactError(StatusCode.INVALID_MODEL, "with_respect_to", reason)
    components = [i for name in names for i in range(PARAMETER_COUNT)[PARAMETERS[name]]]
    columns = slices_of({name: PARAMETERS[name].stop - PARAMETERS[name].start for name in names})
    return np.ascontiguousarray(np.eye(PARAMETER_COUNT)[:, components]), columns


def _kernel_inputs(bodies: Array, contacts: Array, model: ImpactModel) -> Array:
    """Return the rows that the kernels read: from the tables, or defaults for rows that these leave out."""
    layout = TABLE_LAYOUTS[bodies.shape[0]]
    zeros = np.zeros(bodies.shape[2])
    defaults = {ALL_ZERO: zeros, ALL_ONE: zeros + 1}
    rows, _ = rows_in_everything(layout)
    contact = dict(zip([*names_of_contact(layout), "tangential_restitution"], contacts, strict=False))
    everything = [defaults[i] if i in defaults else bodies[i, side] for side in (0, 1) for i in rows]
    everything += [contact.get(name, zeros) for name in names_of_contact(Layout.EVERYTHING)]
    settings = plan_model(model).settings._asdict().items()
    everything += [contact.get(name, zeros + number) for name, number in settings]
    return np.array(everything)
