"""A robot arm with seven joints, computed with NumPy only: its tip, Jacobian and mass matrix in one pose."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

PI = math.pi
LINKS = (
    # placement xyz, rpy; mass, centre of mass, moments about it
    ((0, 0, 0.15), (0, 0, 0), 4.0, (0, -0.03, 0.12), (0.1, 0.09, 0.02)),
    ((0, 0, 0.19), (PI / 2, 0, PI), 4.0, (0.0003, 0.059, 0.042), (0.05, 0.018, 0.044)),
    ((0, 0.21, 0), (PI / 2, 0, PI), 3.0, (0, 0.03, 0.13), (0.08, 0.075, 0.01)),
    ((0, 0, 0.19), (PI / 2, 0, 0), 2.7, (0, 0.067, 0.034), (0.03, 0.01, 0.029)),
    ((0, 0.21, 0), (-PI / 2, PI, 0), 1.7, (0.0001, 0.021, 0.076), (0.02, 0.018, 0.005)),
    ((0, 0.06, 0.19), (PI / 2, 0, 0), 1.8, (0, 0.0006, 0.0004), (0.005, 0.0036, 0.0047)),
    ((0, 0.081, 0.06), (-PI / 2, PI, 0), 0.3, (0, 0, 0.02), (0.001, 0.001, 0.001)),
)
TIP = np.array([0, 0, 0.1])
Q = (0.3, -0.5, 0.2, -1.2, 0.4, 0.8, -0.1)
V = np.array([0.5, -0.8, 0.3, 1.1, -0.4, 0.9, 2.0])


def rotation_about_axis(axis: int, angle: float) -> np.ndarray:
    """The rotation matrix about a coordinate axis."""
    c, s = math.cos(angle), math.sin(angle)
    R = np.eye(3)
    i, j = (axis + 1) % 3, (axis + 2) % 3
    R[[i, j], [i, j]] = c
    R[i, j], R[j, i] = -s, s
    return R


class Arm(NamedTuple):
    """The arm in its pose; rows of ``J`` are linear, then angular, in world axes."""

    tip: np.ndarray
    J: np.ndarray
    M: np.ndarray
    last: np.ndarray

    def inverse_inertia(self) -> np.ndarray:
        return self.J @ np.linalg.solve(self.M, self.J.T)


def robot_arm() -> Arm:
    """The arm, with ``M = sum J_i^T diag(m, I) J_i`` over its links."""
    R, x, axes, links = np.eye(3), np.zeros(3), [], []
    for (xyz, rpy, mass, com, moments), q in zip(LINKS, Q, strict=True):
        x = x + R @ np.array(xyz)
        R = (
            R
            @ rotation_about_axis(2, rpy[2])
            @ rotation_about_axis(1, rpy[1])
            @ rotation_about_axis(0, rpy[0])
            @ rotation_about_axis(2, q)
        )
        axes.append((R[:, 2], x))
        links.append((mass, x + R @ np.array(com), R @ np.diag(moments) @ R.T))

    def jacobian(point: np.ndarray, joints: int) -> np.ndarray:
        J = np.zeros((6, len(LINKS)))
        for i, (axis, origin) in enumerate(axes[:joints]):
            J[:3, i], J[3:, i] = np.cross(axis, point - origin), axis
        return J

    M = np.zeros((7, 7))
    for i, (mass, centre, inertia) in enumerate(links):
        J = jacobian(centre, i + 1)
        M += mass * J[:3].T @ J[:3] + J[3:].T @ inertia @ J[3:]
    tip = x + R @ TIP
    return Arm(tip, jacobian(tip, 7), M, R)
