"""For clients of ``~/resolve_collision_batch``: requests from arrays, and responses to arrays.

    >>> import numpy as np
    >>> from collision_response import Geometry
    >>> from collision_response.batch.rows import body_rows, contact_rows
    >>> body, contact = body_rows(Geometry.POINT), contact_rows(Geometry.POINT)
    >>> bodies, contacts = np.zeros((body.height, 3)), np.zeros((contact.height, 2))
    >>> bodies[body.mass] = [[1.0, 2.0, np.inf]]
    >>> contacts[contact.normal] = [[0.0], [0.0], [1.0]]
    >>> request = pack(bodies, [[0, 1], [2, 2]], contacts)  # the first two bodies each touch the third

The rows are those of :mod:`collision_response.batch.rows`. Send the request with a client of rclpy.
"""

from __future__ import annotations

from collections.abc import Iterable

from numpy.typing import ArrayLike

from ..batch import BatchResult, is_bounded
from ..batch.arrays import Array, as_numpy
from ..batch.result import result_fields
from ..batch.rows import TABLE_LAYOUTS, body_rows
from ..model import DEFAULT, Geometry, ImpactModel
from .convert import error_from, model_message, model_of
from .tables import Request, Response, append, as_indices, as_lines, as_text, result_in, view_of


def pack(
    bodies: ArrayLike,
    pairs: ArrayLike,
    contacts: ArrayLike,
    model: ImpactModel | None = None,
    *,
    names: Iterable[str] = (),
    frame_id: str = "",
    report: bool = False,
) -> Request:
    """Make the request for a batch of N contacts.

    Args:
        bodies: a column for each body, shape ``(rows, B)``; B may be 0. The number of rows determines the
            layout.
        pairs: for each contact the column of body_a, to which the normal points, and the column of body_b,
            shape ``(2, N)``. Columns from B on are the bodies of ``names``.
        contacts: a column for each contact, shape ``(rows, N)``.
        model: what to model. Left out: what the node's parameters say, which also holds for fields of a model
            that are 0, such as the law AUTO.
        names: names of bodies. The node uses their latest received states.
        frame_id: the inertial frame of all bodies and contacts.
        report: whether to ask for regimes, energies and adjustments.

    Raises:
        ImpactError: if the model is invalid.
        TypeError: if ``model`` is not an :class:`ImpactModel`, or ``names`` is no sequence.
        ValueError: if an array has the wrong shape or masked elements, an entry of ``pairs`` is not an index,
            or a name is not one line of text.
    """
    wanted = model_message(model)
    bodies, contacts = as_numpy("bodies", bodies), as_numpy("contacts", contacts)
    pairs = as_numpy("pairs", pairs)
    _check_shapes(bodies, pairs, contacts)
    request = Request(names=as_lines(names), report=report, model=wanted)
    request.header.frame_id = as_text("frame_id", frame_id)
    request.layout = getattr(Request, TABLE_LAYOUTS[bodies.shape[0]].name)
    append(request.bodies, bodies)
    append(request.pairs, as_indices(pairs))
    append(request.contacts, contacts)
    return request


def unpack(response: Response) -> BatchResult:
    """Results of a batch, as views of the response's memory.

    A batch without contacts has no report, even if it was asked for: the response does not tell.

    Raises:
        ImpactError: if the whole request was refused.
        TypeError: if it is not such a response.
    """
    if not isinstance(response, Response):
        raise TypeError(f"response: must be of ResolveCollisionBatch, is {type(response).__name__}")
    if not response.success:
        raise error_from(response.code, response.message)
    rows, n = body_rows(Geometry(response.model.geometry)), len(response.status)
    bounded, report = is_bounded(model_of(response.model, DEFAULT)), bool(response.regimes)
    return result_in(response, result_fields(rows, n, bounded=bounded, report=report), view_of)


def _check_shapes(bodies: Array, pairs: Array, contacts: Array) -> None:
    if bodies.ndim != 2 or bodies.shape[0] not in TABLE_LAYOUTS:
        known = " or ".join(map(str, TABLE_LAYOUTS))
        raise ValueError(f"bodies: must be of shape ({known}, B), is {bodies.shape}")
    if pairs.ndim != 2 or pairs.shape[0] != 2:
        raise ValueError(f"pairs: must be of shape (2, N), is {pairs.shape}")
    n, heights = pairs.shape[1], TABLE_LAYOUTS[bodies.shape[0]].contacts.heights
    if contacts.ndim != 2 or contacts.shape[1] != n or contacts.shape[0] not in heights:
        shape = f"({heights[0]} to {heights[-1]}, {n})"
        raise ValueError(f"contacts: must be of shape {shape}, is {contacts.shape}")
    for name, table in (("bodies", bodies), ("contacts", contacts), ("pairs", pairs)):
        if table.dtype.kind not in "biuf":
            raise ValueError(f"{name}: must be real numbers, is {table.dtype}")
