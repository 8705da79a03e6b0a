"""The shape that is drawn for a body, from its mass and inertia: its real shape is unknown."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ..physics.body import Body
from ..physics.tensor import Symmetric3
from .rerun_sdk import rr

EQUAL = 1e-6
"""Principal moments that differ by less than this fraction of the largest are those of a ball."""

MIN_THICKNESS = 0.02
"""Smallest half-size that is drawn, as a fraction of the largest."""


class EquivalentSolid(NamedTuple):
    """The homogeneous ball or box that has a body's mass and inertia.

    Attributes:
        is_ball: whether it is a ball; otherwise it is a box. A cube is drawn as the ball with its inertia.
        half_sizes: half of its size along each of its axes [m].
        axes: quaternion ``(x, y, z, w)`` from its axes to the body axes.
    """

    is_ball: bool
    half_sizes: np.ndarray
    axes: np.ndarray

    @classmethod
    def of(cls, body: Body) -> EquivalentSolid | None:
        """Equivalent solid of a body; ``None`` for a point mass and for an immovable body."""
        moments, columns = np.linalg.eigh(np.array(Symmetric3(*body.inertia).rows()))
        if not moments[2] > 0:
            return None
        is_ball = bool(moments[2] - moments[0] <= EQUAL * moments[2])
        mean_squares = np.maximum(moments.sum() / 2 - moments, 0.0) / body.mass
        columns[:, 2] = np.cross(columns[:, 0], columns[:, 1])  # right-handed
        return cls(is_ball, np.sqrt(mean_squares * (5 if is_ball else 3)), _quaternion(columns))

    def columns(self) -> Any:
        """Columns for rerun, with one row. Thin solids get a thickness: the viewer would not show them."""
        half_sizes = np.maximum(self.half_sizes, MIN_THICKNESS * self.half_sizes.max())
        kind = rr.Ellipsoids3D if self.is_ball else rr.Boxes3D
        return kind.columns(
            half_sizes=[half_sizes], quaternions=[self.axes], fill_mode=[rr.components.FillMode.Solid]
        )


def _quaternion(m: np.ndarray) -> np.ndarray:
    """Quaternion of a rotation matrix: the eigenvector of the largest eigenvalue (Bar-Itzhack 2000)."""
    trace, axis = np.trace(m), np.array([m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]])
    k = np.block([[m + m.T - trace * np.eye(3), axis[:, None]], [axis, trace]])
    return np.linalg.eigh(k)[1][:, 3]
