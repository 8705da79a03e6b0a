"""Contacts of one table of bodies: which may be answered at once, and the way back into the table.

A simulator that resolves its contacts one after another, each on what those before it left, goes through a
step by the set:

    >>> import numpy as np
    >>> from collision_response import Geometry
    >>> from collision_response.batch import body_rows, contact_rows, resolve_batch
    >>> rows, touch = body_rows(Geometry.POINT), contact_rows(Geometry.POINT)
    >>> bodies, contacts = np.zeros((rows.height, 3)), np.zeros((touch.height, 2))
    >>> bodies[rows.mass] = 1.0
    >>> bodies[rows.velocity][0] = [3.0, 0.0, 0.0]  # the first of three equal balls in a row moves
    >>> contacts[touch.normal][0], contacts[touch.restitution] = -1.0, 1.0
    >>> pairs = np.array([[0, 1], [1, 2]])
    >>> for some in independent_sets(pairs):
    ...     result = resolve_batch(bodies, contacts[:, some], pairs=pairs[:, some])
    ...     scatter_velocities(bodies, pairs[:, some], result)
    >>> bodies[rows.velocity][0]
    array([0., 0., 3.])
"""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from ..kernels import library
from ..status import StatusCode
from .other_arrays import as_numpy, is_lazy, maker
from .rows import rows_of

if TYPE_CHECKING:
    from .resolve_batch import BatchResult

Array = np.ndarray[Any, Any]

IS_ANSWER = np.zeros(256, np.bool_)
IS_ANSWER[[code for code in StatusCode if code.is_answer]] = True
"""By code, whether there are numbers."""

MOTION = ("status", "velocity", "angular_velocity")
"""What is scattered of a result."""


def as_pairs(pairs: Any) -> Array:
    """Columns of bodies, int64, shape ``(2, N)``. Raises: ValueError: they are not."""
    array = as_numpy("pairs", pairs)
    if array.ndim != 2 or array.shape[0] != 2 or (array.dtype.kind not in "iu" and array.size):
        raise ValueError(f"pairs: must be integers of shape (2, N), are {array.dtype} of {array.shape}")
    return np.require(array, np.int64, ("C", "ALIGNED"))


def independent_sets(pairs: Any, movable: Any = None) -> list[Array]:
    """Sets of contacts in which no movable body appears twice.

    Whoever answers the sets in turn answers the contacts of each body in the order given: a contact is in the
    set after the last one with which it shares a movable body, and no later.

    Args:
        pairs: the columns of both bodies of each contact, shape ``(2, N)``.
        movable: for each body whether impulses move it, bool, shape ``(B,)``: ``isfinite`` of its mass. Left
            out, all are. Immovable bodies, as a floor, part no contacts.

    Returns:
        Indices of contacts, in order.

    Raises:
        ValueError: an array has not the right shape or type, or a pair is not of two bodies.
    """
    given = pairs = as_pairs(pairs)
    n = pairs.shape[1]
    if movable is None:
        last = given.max(initial=-1)
        bodies, places = np.unique(given, return_inverse=True)  # of which the columns may be far apart
        pairs, movable = np.where(given < 0, -1, places.reshape(given.shape)), np.ones(bodies.size, np.bool_)
    else:
        last = np.size(movable) - 1
    movable = np.ascontiguousarray(movable)
    if movable.ndim != 1 or movable.dtype != np.bool_:
        raise ValueError(f"movable: must be bool of shape (B,), is {movable.dtype} of {movable.shape}")
    order, starts = np.empty(n, np.int64), np.empty(n + 1, np.int64)
    sets = library.independent_sets(pairs, movable, order, starts)
    if sets < 0:
        first = -1 - sets
        wrong = tuple(given[:, first].tolist())
        raise ValueError(f"pairs: must be columns of bodies, from 0 to {last}; contact {first} has {wrong}")
    return [order[start:stop] for start, stop in pairwise(starts[: sets + 1].tolist())]


def scatter_velocities(bodies: Array, pairs: Any, result: BatchResult) -> None:
    """Write the velocities of a result into the table of bodies.

    Bodies of contacts without an answer keep theirs.

    Args:
        bodies: the table, shape ``(rows, B)``. It is changed, so it must be an array that can be: NumPy's,
            or of another library with the Array API whose rows can be set.
        pairs: of the contacts, as given to :func:`~collision_response.batch.resolve_batch`. Of a movable body
            that is in several the last one counts, so let them be of one of the :func:`independent_sets`.
        result: what became of them.

    Raises:
        ValueError: an array has not the right shape or type; or ``bodies`` are lazy.
    """
    if not isinstance(bodies, np.ndarray):
        make = None if is_lazy(bodies) else maker(bodies)
        if make is None:
            raise ValueError(f"bodies: must be an array that can be changed, is {type(bodies).__name__}")
        table = as_numpy("bodies", bodies).copy()
        scatter_velocities(table, pairs, result)
        rows = rows_of(table.shape[0])
        for motion in (rows.velocity, rows.angular_velocity):
            bodies[motion, :] = make(table[motion])
        return
    if bodies.ndim != 2 or bodies.dtype.kind != "f":
        raise ValueError(f"bodies: must be floats of shape (rows, B), are {bodies.dtype} of {bodies.shape}")
    if not all(hasattr(result, name) for name in MOTION):
        raise ValueError(f"result: must be a BatchResult, is {type(result).__name__}")
    pairs, rows = as_pairs(pairs), rows_of(bodies.shape[0])
    status, velocity, spin = (as_numpy(f"result.{name}", getattr(result, name)) for name in MOTION)
    if status.shape != pairs.shape[1:]:
        raise ValueError(f"pairs: must be those of the {status.size} contacts, are {pairs.shape[1]}")
    answered = IS_ANSWER[status]
    if not answered.all():
        pairs, velocity, spin = pairs[:, answered], velocity[..., answered], spin[..., answered]
    if ((pairs < 0) | (pairs >= bodies.shape[1])).any():
        raise ValueError(f"pairs: must be columns of the {bodies.shape[1]} bodies")
    bodies[rows.velocity][:, pairs] = velocity
    bodies[rows.angular_velocity][:, pairs] = spin
