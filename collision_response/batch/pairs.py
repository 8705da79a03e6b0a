"""Contacts of one table of bodies: which may be resolved at once, and how results get into the table.

A simulator may resolve the contacts of a time step one after another, each with the velocities that the
earlier ones left. The same results come from resolving one independent set after another:

    >>> import numpy as np
    >>> from collision_response import Geometry
    >>> from collision_response.batch import body_rows, contact_rows, resolve_batch
    >>> rows, contact = body_rows(Geometry.POINT), contact_rows(Geometry.POINT)
    >>> bodies, contacts = np.zeros((rows.height, 3)), np.zeros((contact.height, 2))
    >>> bodies[rows.mass] = 1.0
    >>> bodies[rows.velocity][0] = [3.0, 0.0, 0.0]  # the first of three equal balls in a row moves
    >>> contacts[contact.normal][0], contacts[contact.restitution] = -1.0, 1.0
    >>> pairs = np.array([[0, 1], [1, 2]])
    >>> for some in independent_sets(pairs):
    ...     result = resolve_batch(bodies, contacts[:, some], pairs=pairs[:, some])
    ...     scatter_velocities(bodies, pairs[:, some], result)
    >>> bodies[rows.velocity][0]
    array([0., 0., 3.])
"""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np

from ..kernels import library
from ..status import StatusCode
from .arrays import Array, as_numpy, converter_like, is_lazy
from .result import BatchResult
from .rows import rows_of

IS_ANSWER = np.zeros(256, np.bool_)
IS_ANSWER[[code for code in StatusCode if code.is_answer]] = True
"""For each status code, whether the contact has results."""

MOTION = ("status", "velocity", "angular_velocity")
"""The fields of a result that :func:`scatter_velocities` reads."""


def as_pairs(pairs: Any) -> Array:
    """Return the columns of body_a and body_b, int64, shape ``(2, N)``.

    Raises:
        ValueError: if ``pairs`` does not hold integers, or has another shape.
    """
    array = as_numpy("pairs", pairs)
    check_pairs(array)
    return np.require(array, np.int64, ("C", "ALIGNED"))


def check_pairs(pairs: Any) -> None:
    """Raises: ValueError: if an array of NumPy or Dask does not hold integers, or is not of shape (2, N)."""
    if pairs.ndim != 2 or pairs.shape[0] != 2 or (pairs.dtype.kind not in "iu" and pairs.size):
        raise ValueError(f"pairs: must be integers of shape (2, N), are {pairs.dtype} of {pairs.shape}")


def independent_sets(pairs: Any, movable: Any = None) -> list[Array]:
    """Divide contacts into sets in which no movable body has two contacts.

    If the sets are resolved in turn, the contacts of each body are resolved in the order given: a contact
    is in the set right after the last earlier contact with which it shares a movable body.

    Args:
        pairs: for each contact the columns of its two bodies, integers, shape ``(2, N)``.
        movable: for each body whether impulses move it, bool, shape ``(B,)``, as
            ``np.isfinite(bodies[rows.mass])[0]``. If left out, all bodies are movable. Contacts that share
            only an immovable body, such as a floor, may be in one set.

    Returns:
        The indices of the contacts of each set, in increasing order.

    Raises:
        ValueError: if an array has the wrong shape or type, or an entry of ``pairs`` is no column of a body.
    """
    given = pairs = as_pairs(pairs)
    n = pairs.shape[1]
    if movable is None:
        last = given.max(initial=-1)
        bodies, places = np.unique(given, return_inverse=True)  # columns may be far apart
        pairs, movable = np.where(given < 0, -1, places.reshape(given.shape)), np.ones(bodies.size, np.bool_)
    else:
        movable = np.ascontiguousarray(as_numpy("movable", movable))
        last = movable.size - 1
    if movable.ndim != 1 or movable.dtype != np.bool_:
        raise ValueError(f"movable: must be bool of shape (B,), is {movable.dtype} of {movable.shape}")
    order, starts = np.empty(n, np.int64), np.empty(n + 1, np.int64)
    sets = library.find_independent_sets(pairs, movable, order, starts)
    if sets < 0:
        first = -1 - sets
        wrong = tuple(given[:, first].tolist())
        raise ValueError(f"pairs: must be columns of bodies, from 0 to {last}; contact {first} has {wrong}")
    return [order[start:stop] for start, stop in pairwise(starts[: sets + 1].tolist())]


def scatter_velocities(bodies: Array, pairs: Any, result: BatchResult) -> None:
    """Write the velocities of a result into the table of bodies.

    The bodies of contacts without an answer keep their velocities.

    Args:
        bodies: the table, shape ``(rows, B)``, which is changed: an array of NumPy, or of another library
            with the Array API whose rows can be assigned.
        pairs: of the contacts, as given to :func:`~collision_response.batch.resolve_batch`. They should be
            one of the :func:`independent_sets`: if a movable body is in several pairs, any of them counts.
        result: what ``resolve_batch`` returned for these contacts.

    Raises:
        ValueError: if an array has the wrong shape or type, or if ``bodies`` is lazy or cannot be changed.
    """
    if not isinstance(bodies, np.ndarray):
        convert = None if is_lazy(bodies) else converter_like(bodies)
        if convert is None:
            raise ValueError(f"bodies: must be an array that can be changed, is {type(bodies).__name__}")
        table = as_numpy("bodies", bodies).copy()
        scatter_velocities(table, pairs, result)
        rows = rows_of(table.shape[0])
        for motion in (rows.velocity, rows.angular_velocity):
            changed = convert(table[motion])
            try:
                bodies[motion, :] = changed
            except TypeError as error:
                raise ValueError(f"bodies: must be an array that can be changed: {error}") from error
        return
    if bodies.ndim != 2 or bodies.dtype.kind != "f":
        raise ValueError(f"bodies: must be floats of shape (rows, B), are {bodies.dtype} of {bodies.shape}")
    if not bodies.flags.writeable:
        raise ValueError("bodies: must be an array that can be changed, is read-only")
    if not all(hasattr(result, name) for name in MOTION):
        raise ValueError(f"result: must be a BatchResult, is {type(result).__name__}")
    pairs, rows = as_pairs(pairs).copy(), rows_of(bodies.shape[0])  # another thread may change them
    status, velocity, spin = (as_numpy(f"result.{name}", getattr(result, name)) for name in MOTION)
    if status.shape != pairs.shape[1:]:
        raise ValueError(f"pairs: must be those of the {status.size} contacts, are {pairs.shape[1]}")
    if status.dtype.kind not in "iu":
        raise ValueError(f"result.status: must be status codes, is {status.dtype}")
    if not np.isin(status, list(StatusCode)).all():
        raise ValueError("result.status: must be status codes, has others")
    for name, motion, own in (
        ("velocity", velocity, rows.velocity),
        ("angular_velocity", spin, rows.angular_velocity),
    ):
        shape = own.stop - own.start, 2, status.size
        if motion.shape != shape:
            raise ValueError(f"result.{name}: must be of shape {shape} for these bodies, is {motion.shape}")
    answered = IS_ANSWER[status]
    if not answered.all():
        pairs, velocity, spin = pairs[:, answered], velocity[..., answered], spin[..., answered]
    if ((pairs < 0) | (pairs >= bodies.shape[1])).any():
        raise ValueError(f"pairs: must be columns of the {bodies.shape[1]} bodies")
    bodies[rows.velocity][:, pairs] = velocity
    bodies[rows.angular_velocity][:, pairs] = spin
