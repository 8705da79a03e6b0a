"""A scene as the arrays of ``resolve_batch``."""

from __future__ import annotations

from math import inf
from typing import Any

import numpy as np

from collision_response import Geometry
from collision_response.batch.rows import body_rows, contact_rows


def tables(
    scene: Any, geometry: Geometry, n: int = 1, *, friction: bool = False
) -> tuple[np.ndarray, np.ndarray]:
    """The arrays of ``resolve_batch`` for ``n`` copies of a scene; with orientations if a body has one."""
    pair, contact = (scene.body_a, scene.body_b), scene.contact
    oriented = geometry is Geometry.SPATIAL and any(body.orientation is not None for body in pair)
    of, at = body_rows(geometry, oriented=oriented), contact_rows(geometry)
    bodies = np.zeros((of.height, 2, n))
    contacts = np.zeros((at.height if friction else at.friction.start, n))

    def fill(array: np.ndarray, rows: slice, values: Any, *, last: bool = False) -> None:
        width = rows.stop - rows.start
        if width:
            kept = list(values)[-width:] if last else list(values)[:width]
            array[rows] = np.array(kept, dtype=float)[:, np.newaxis]

    for lane, body in enumerate(pair):
        column = bodies[:, lane]
        fill(column, of.mass, [body.mass or inf])
        fill(column, of.inertia, body.inertia, last=geometry is Geometry.PLANAR)
        fill(column, of.position, body.position)
        fill(column, of.velocity, body.velocity)
        fill(column, of.angular_velocity, body.angular_velocity, last=True)
        fill(column, of.orientation, body.orientation or (0.0, 0.0, 0.0, 1.0))
    fill(contacts, at.position, contact.position)
    fill(contacts, at.normal, contact.normal)
    fill(contacts, at.restitution, [contact.restitution])
    if friction:
        fill(contacts, at.friction, [contact.friction])
    return bodies, contacts
