"""Contacts for Routh's laws, in families: oblique, planar, grazing, hardly slipping, head-on and jammed."""

from __future__ import annotations

import math
import random

import pytest

pytest.importorskip("mpmath")
from collision_response.physics.tensor import Symmetric3
from collision_response.physics.vector import Vec3

Problem = tuple[tuple[float, ...], tuple[float, ...], tuple[float, ...]]
"""``K``, ``u`` and ``n``."""


def rod(angle: float) -> tuple[float, ...]:
    """``K`` of a uniform rod of mass and length 1 that strikes with its end; the normal is along y."""
    c, s = math.cos(angle), math.sin(angle)
    return (1 + 3 * s * s, -3 * s * c, 0.0, 1 + 3 * c * c, 0.0, 1.0)


def box(draw: random.Random) -> list[list[float]]:
    """``K`` of a slender, flat or compact box, struck at a corner or inside."""
    edges = draw.choice(
        [
            [draw.uniform(0.2, 2) for _ in "xyz"],
            [0.02, 0.02, draw.uniform(1, 3)],
            [0.02, draw.uniform(0.5, 2), draw.uniform(0.5, 2)],
            [1.0, 1.0, 1.0],
        ]
    )
    mass, squares = draw.uniform(0.2, 5), [edge * edge for edge in edges]
    moments = [mass / 12 * (sum(squares) - square) for square in squares]
    q = [draw.gauss(0, 1) for _ in range(4)]
    x, y, z, w = (c / math.hypot(*q) for c in q)
    R = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    is_corner = draw.random() < 0.5
    at = [(draw.choice([-0.5, 0.5]) if is_corner else draw.uniform(-0.5, 0.5)) * edge for edge in edges]
    r = Vec3(*(sum(R[i][j] * at[j] for j in range(3)) for i in range(3)))
    arms = [(r.cross(Vec3(*(R[i][k] for i in range(3)))), moments[k]) for k in range(3)]
    return [
        [(i == j) / mass + sum(arm[i] * arm[j] / moment for arm, moment in arms) for j in range(3)]
        for i in range(3)
    ]


def oblique(draw: random.Random, grazing: float = 0.0) -> Problem:
    """Any contact in space; the approach may be down to ``10**grazing`` of the slip."""
    bodies = [box(draw)] + ([box(draw)] if draw.random() < 0.5 else [])
    K = [[sum(body[i][j] for body in bodies) for j in range(3)] for i in range(3)]
    n, u = (Vec3(*(draw.gauss(0, 1) for _ in "xyz")) for _ in "nu")
    down = 10 ** draw.uniform(grazing, 0) if grazing else abs(u.dot(n)) / n.norm()
    u = u - n * (u.dot(n) / n.dot(n)) - n * (down / n.norm())
    return (K[0][0], K[0][1], K[0][2], K[1][1], K[1][2], K[2][2]), tuple(u), tuple(n)


def planar(draw: random.Random) -> Problem:
    turn, scale = draw.uniform(0, 7), draw.uniform(0.3, 3)
    xx, xy, _, yy, _, zz = (scale * k for k in rod(draw.uniform(0, math.pi)))
    c, s, ux, uy = math.cos(turn), math.sin(turn), draw.uniform(-2, 2), -draw.uniform(0.1, 2)
    K = (c * c * xx - 2 * c * s * xy + s * s * yy, c * s * (xx - yy) + (c * c - s * s) * xy, 0.0,
         s * s * xx + 2 * c * s * xy + c * c * yy, 0.0, zz)  # fmt: skip
    return K, (c * ux - s * uy, s * ux + c * uy, 0.0), (-s, c, 0.0)


def slow(draw: random.Random) -> Problem:
    """A contact with hardly any slip."""
    K, u, n = oblique(draw)
    u, n = Vec3(*u), Vec3(*n)
    along = n * (u.dot(n) / n.dot(n))
    return K, tuple((u - along) * 10 ** draw.uniform(-16, -3) + along), tuple(n)


def head_on(draw: random.Random) -> Problem:
    K, _, n = oblique(draw)
    return K, tuple(-1.5 * x for x in n), n


FRICTION = (0.1, 0.3, 1.0, 5.0)


JAMMING = 3.0


def jammed(draw: random.Random) -> Problem:
    """Friction of ``JAMMING`` presses the bodies together, to an impulse far above that of the approach."""
    while True:
        K, u, n = problem = oblique(draw, -9)
        up = Vec3(*n) / Vec3(*n).norm()
        slip = Vec3(*u) - up * up.dot(Vec3(*u))
        push = up - slip * (JAMMING / slip.norm())
        if up.dot(Symmetric3(*K) @ push) < 0:
            return problem


FAMILIES = {
    "planar": (planar, (0.0, *FRICTION)),
    "space": (oblique, FRICTION),
    "grazing": (lambda draw: oblique(draw, -12), FRICTION),
    "slow": (slow, FRICTION),
    "head_on": (head_on, FRICTION),
    "rough": (oblique, (1e4, 1e60, 1e300)),
    "smooth": (oblique, (0.0, 1e-300, 1e-8)),
    "jammed": (jammed, (JAMMING, 2 * JAMMING)),
}
