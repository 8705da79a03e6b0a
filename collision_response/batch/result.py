"""The results of a batch."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from ..model import Adjustment, ImpactModel, Precision
from ..status import StatusCode
from .arrays import compared_by_identity
from .rows import BodyRows

UINT8 = np.dtype(np.uint8)
FLOAT64 = np.dtype(np.float64)


@compared_by_identity
class BatchResult(NamedTuple):
    """The results of :func:`~collision_response.batch.resolve_batch`.

    Attributes:
        velocity: of the centres of mass after the impact [m/s], shape ``(3, 2, N)``; in PLANAR ``(2, 2, N)``.
        angular_velocity: after the impact [rad/s], shape ``(3, 2, N)``; in PLANAR, about z, ``(1, 2, N)``; in
            POINT ``(0, 2, N)``.
        impulse: on body_a [N s], shape ``(3, N)``; in PLANAR ``(2, N)``.
        status: a :class:`~collision_response.StatusCode` for each contact, uint8, shape ``(N,)``.
        error_bound: of each contact, as in :class:`~collision_response.Impact`, shape ``(N,)``; NaN where
            there is no answer. ``None`` without a tolerance, unless the precision is EXTENDED.
        precision: the :class:`~collision_response.Precision` used for each contact, uint8, shape ``(N,)``;
            ``None`` without error bounds.
        regime: what friction did at each contact, a :class:`~collision_response.Regime`, uint8, shape
            ``(N,)``; 0 where there is no answer. ``None`` without a report, like all that follow.
        kinetic_energy_before, kinetic_energy_after: of the movable bodies of each contact [J], shape
            ``(N,)``.
        energy_lost_restitution, energy_lost_friction: energy lost at each contact to the normal and to the
            tangential impulse [J], shape ``(N,)``.
        adjustments: how the impact of each contact differs from the request, an
            :class:`~collision_response.Adjustment`, uint8, shape ``(N,)``; 0 where there is no answer. Tables
            take quaternions of any length, so NORMALISED_ORIENTATION is not among them.
    """

    velocity: Any
    angular_velocity: Any
    impulse: Any
    status: Any
    error_bound: Any = None
    precision: Any = None
    regime: Any = None
    kinetic_energy_before: Any = None
    kinetic_energy_after: Any = None
    energy_lost_restitution: Any = None
    energy_lost_friction: Any = None
    adjustments: Any = None

    def mapped(self, function: Callable[[Any], Any]) -> BatchResult:
        """Return the result with ``function`` applied to each array that is there."""
        return BatchResult(*(None if array is None else function(array) for array in self))


REPORT = BatchResult._fields[BatchResult._fields.index("regime") :]
"""The fields that are there only with a report: the regime, the energies and the adjustments."""

ENERGIES = REPORT[1:-1]

REPORTED_ADJUSTMENTS = ~Adjustment.NORMALISED_ORIENTATION
"""Tables take quaternions of any length."""


def names_bodies(status: Any) -> Any:
    """Whether the pair of each contact names two bodies of the table, by the status of the contact."""
    return ~np.isin(status, (StatusCode.SAME_BODY, StatusCode.UNKNOWN_BODY))


def is_bounded(model: ImpactModel) -> bool:
    """Whether the results of a batch with this model have error bounds."""
    return bool(model.tolerance) or model.precision is Precision.EXTENDED


def result_fields(
    rows: BodyRows, n: int, *, bounded: bool, report: bool, real: np.dtype[Any] = FLOAT64
) -> BatchResult:
    """Return the shape and type of each array of a result for ``n`` contacts, in its place.

    Args:
        rows: the rows of the table of bodies.
        n: the number of contacts.
        bounded: whether there are error bounds.
        report: whether there are the fields of a report.
        real: the type of numbers.
    """
    numbers, codes = ((n,), real), ((n,), UINT8)
    linear, angular = (each.stop - each.start for each in (rows.velocity, rows.angular_velocity))
    motion = ((linear, 2, n), real), ((angular, 2, n), real), ((linear, n), real), codes
    bounds = (numbers, codes) if bounded else (None, None)
    return BatchResult(*motion, *bounds, *((codes, *[numbers] * 4, codes) if report else ()))
