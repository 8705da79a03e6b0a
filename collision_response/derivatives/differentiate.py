"""The Jacobian of an impact, by dual numbers through the one formula.

What is differentiated by, ``PARAMETERS``, and what is differentiated, ``RESULTS``, have their places here. An
orientation is turned about the axes of the world: ``R <- exp([theta]x) R``. A product of inertia counts as
both ``xy`` and ``yx``. The contact point and the normal stay where they are when a body moves: how they move
with it is a matter of its surface, see ``surfaces.py``. The normal is differentiated as given, of its length.
"""

from __future__ import annotations

from collections.abc import Iterable
from enum import IntEnum
from functools import lru_cache
from operator import attrgetter
from typing import Any, NamedTuple

import numpy as np

from ..answer import Impact
from ..batch import BatchResult, resolve_batch
from ..batch.other_arrays import as_numpy
from ..batch.rows import slices_of
from ..kernels import _derivatives, library  # type: ignore[attr-defined]  # made by the build
from ..kernels.layout import Layout, names_of_body, names_of_contact
from ..model import DEFAULT, Geometry, ImpactModel, law_for
from ..physics.body import Body
from ..physics.contact import Contact
from ..physics.laws import Settings
from ..resolve import resolve
from ..status import ImpactError, StatusCode, format_value

Array = np.ndarray[Any, Any]

_settings_of = attrgetter(*Settings._fields)


def _parameters() -> dict[str, int]:
    of_body, of_contact = (
        {name: len(axes) for name, axes in fields.items()}
        for fields in (Layout.EVERYTHING.body_fields, Layout.EVERYTHING.contact_fields)
    )
    of_body["orientation"] = 3
    of_contact |= {"restitution": 1, "friction": 1}
    widths = {f"{body}.{name}": width for body in ("body_a", "body_b") for name, width in of_body.items()}
    widths |= {f"contact.{name}": width for name, width in of_contact.items()}
    return widths | {"model.tangential_restitution": 1, "model.stiffness_ratio": 1}


PARAMETERS = slices_of(_parameters())
"""What may be differentiated by, and its places in a direction."""

RESULTS = slices_of(
    {"twist_a.linear": 3, "twist_a.angular": 3, "twist_b.linear": 3, "twist_b.angular": 3, "impulse": 3}
)
"""What is differentiated, and its rows in a Jacobian. Twists are those after the impact."""

COUNT = max(place.stop for place in PARAMETERS.values())
ROWS = max(place.stop for place in RESULTS.values())


class Smoothness(IntEnum):
    """What a derivative is worth where it is taken."""

    SMOOTH = 0
    """It holds all around."""
    KINK = 1
    """On an edge, to rounding: it holds on the side of the answer's regime, not on the other."""
    JUMP = 2
    """At a jump: next to here the answer itself is another."""


class Derivatives(NamedTuple):
    """An impact and its Jacobian.

    Attributes:
        impact: the answer.
        jacobian: of :data:`RESULTS`, in SI units, shape ``(15, columns)``.
        smoothness: a :class:`Smoothness` for each column, uint8, shape ``(columns,)``.
        columns: of what was asked for, by name.
    """

    impact: Impact
    jacobian: Array
    smoothness: Array
    columns: dict[str, slice]

    def __eq__(self, other: object) -> bool:
        """Whether these are the same numbers of the same answer."""
        if not isinstance(other, Derivatives):
            return NotImplemented
        arrays = zip(self[1:3], other[1:3], strict=True)
        rest = (self.impact, self.columns) == (other.impact, other.columns)
        return rest and all(np.array_equal(*pair) for pair in arrays)

    def __ne__(self, other: object) -> bool:
        """Whether they are not: a tuple would ask its parts."""
        return not self == other

    def of(self, result: str, parameter: str) -> Array:
        """The part for one of :data:`RESULTS` and one of :data:`PARAMETERS`."""
        part: Array = self.jacobian[RESULTS[result], self.columns[parameter]]
        return part


class BatchDerivatives(NamedTuple):
    """Many impacts and their derivatives.

    Attributes:
        result: what :func:`~collision_response.batch.resolve_batch` answers.
        jacobian: of :data:`RESULTS` in each direction, shape ``(15, K, N)``; NaN where there is no answer.
        smoothness: a :class:`Smoothness` for each direction and contact, uint8, shape ``(K, N)``.
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
    """The Jacobian of the twists after an impact and of its impulse, in double precision.

    Args:
        body_a, body_b, contact, model: as for :func:`~collision_response.resolve`; the restitution is a
            number, the geometry AUTO or SPATIAL.
        with_respect_to: names of :data:`PARAMETERS`, in the order of the columns wanted.

    Raises:
        ImpactError: as :func:`~collision_response.resolve`, or INVALID_COEFFICIENT, INVALID_MODEL: what is
            asked for has no derivative here; or OUT_OF_RANGE: it is beyond float64, or the path of COMPLIANT
            too long.
    """
    directions, columns = _unit(tuple(with_respect_to))
    for name in ("restitution", "friction"):
        if callable(getattr(contact, name)):
            reason = "must be a number here: differentiate by it, and multiply by the slope of the function"
            raise ImpactError(StatusCode.INVALID_COEFFICIENT, f"contact.{name}", reason)
    impact = resolve(body_a, body_b, contact, model)
    if model.geometry not in (Geometry.AUTO, Geometry.SPATIAL):
        reason = f"must be AUTO or SPATIAL: derivatives look out of {model.geometry.name}"
        raise ImpactError(StatusCode.INVALID_MODEL, "model.geometry", reason)
    law = law_for(model.law, has_friction=contact.friction > 0)
    _check(body_a, body_b)
    if contact.tangential_restitution is not None:
        model = model._replace(tangential_restitution=contact.tangential_restitution)
    settings = _settings_of(model)
    count = directions.shape[1]
    jacobian, smoothness = np.empty((ROWS, count)), np.empty(count, np.uint8)
    inputs = library.input_bytes(body_a, body_b, contact, settings)
    if not _derivatives.differentiate(law, 1, count, True, inputs, directions, jacobian, smoothness):
        raise ImpactError(
            StatusCode.OUT_OF_RANGE, "result", "a derivative is beyond float64, or there is none"
        )
    return Derivatives(impact, jacobian, smoothness, columns)


def _check(body_a: Body, body_b: Body) -> None:
    """Raises: ImpactError: there are no derivatives of such."""
    for name, body in (("body_a", body_a), ("body_b", body_b)):
        if body.inverse_inertia is not None:
            reason = "is not differentiated: give the rigid body"
            raise ImpactError(StatusCode.INVALID_INERTIA, f"{name}.inverse_inertia", reason)


def unit_directions(*with_respect_to: str) -> Array:
    """The directions of these parameters alone, shape ``(54, K)``."""
    return _unit(with_respect_to)[0].copy()


def differentiate_batch(
    bodies: Array, contacts: Array, directions: Array, model: ImpactModel = DEFAULT
) -> BatchDerivatives:
    """The derivatives of many impacts in chosen directions.

    Args:
        bodies, contacts, model: as for :func:`~collision_response.batch.resolve_batch`, of float64.
        directions: how the parameters change, ``K`` directions by the places of :data:`PARAMETERS`: one and
            all, shape ``(54, K)``, or for each contact, shape ``(54, K, N)``. What the tables of a geometry
            leave out may be differentiated by all the same.

    Raises:
        ImpactError, ValueError: as ``resolve_batch``, or an array has not the right shape or type.
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
        or directions.shape[0] != COUNT
        or directions.shape[2:] not in ((), (n,))
    ):
        raise ValueError(
            f"directions: must be of shape ({COUNT}, K) or ({COUNT}, K, {n}), is {directions.shape}"
        )
    inputs = _inputs_of(bodies, contacts, model)
    has_friction = contacts.shape[0] > names_of_contact(_layout_of(bodies)).index("friction.")
    law = law_for(model.law, has_friction=has_friction)
    count, one_for_all = directions.shape[1], directions.ndim == 2
    jacobian, smoothness = np.empty((ROWS, count, n)), np.empty((count, n), np.uint8)
    arrays = np.ascontiguousarray(inputs), np.ascontiguousarray(directions), jacobian, smoothness
    _derivatives.differentiate(law, n, count, one_for_all, *arrays)
    jacobian[..., result.status > StatusCode.SEPARATING] = np.nan
    return BatchDerivatives(result, jacobian, smoothness)


@lru_cache
def _unit(names: tuple[str, ...]) -> tuple[Array, dict[str, slice]]:
    for name in names:
        if name not in PARAMETERS:
            reason = f"must be names of {', '.join(PARAMETERS)}; is {format_value(name)}"
            raise ImpactError(StatusCode.INVALID_MODEL, "with_respect_to", reason)
    places = [i for name in names for i in range(COUNT)[PARAMETERS[name]]]
    columns = slices_of({name: PARAMETERS[name].stop - PARAMETERS[name].start for name in names})
    return np.ascontiguousarray(np.eye(COUNT)[:, places]), columns


def _layout_of(bodies: Array) -> Layout:
    return next(layout for layout in Layout if len(names_of_body(layout)) == bodies.shape[0])


def _inputs_of(bodies: Array, contacts: Array, model: ImpactModel) -> Array:
    """What the kernels read, from tables that may leave some of it out."""
    layout = _layout_of(bodies)
    zeros = np.zeros(bodies.shape[2])
    rows = names_of_body(layout)
    missing = {"orientation.w": zeros + 1}

    def of_body(side: int, name: str) -> Array:
        if name.startswith("inertia") and rows.count("inertia.zz") and not rows.count("inertia.xx"):
            name = "inertia.zz" if name[-2] == name[-1] else ""  # of which only that matters
        row: Array = bodies[rows.index(name), side] if name in rows else missing.get(name, zeros)
        return row

    contact = dict(zip([*names_of_contact(layout), Settings._fields[0]], contacts, strict=False))
    everything = [of_body(side, name) for side in (0, 1) for name in names_of_body(Layout.EVERYTHING)]
    everything += [contact.get(name, zeros) for name in names_of_contact(Layout.EVERYTHING)]
    everything += [contact.get(name, zeros + getattr(model, name)) for name in Settings._fields]
    return np.array(everything)
