"""Two rigid bodies that touch at a point, as what an impulse between them sees of them.

A and B touch at a point; n points from B to A; r = point - CoM; u is the velocity of A
relative to B there, so u_n < 0 approaches. An impulse P on A, -P on B, gives

    u+ = u + K P,   K = sum over A, B of  1/m - [r]x I^-1 [r]x      (3x3, positive definite)
"""

from fractions import Fraction
from typing import NamedTuple

from mpmath import mp

GUARD = 30  # extra working digits: K^-1 and the exponents A_j may each cost a dozen
RANK = 1e-13  # a principal moment this small against the largest is a double's zero


class Body(NamedTuple):
    """mass None: immovable. inertia about the CoM in body axes; a zero moment means that
    the body cannot be turned about that axis (ideal rod, point). quaternion (x, y, z, w), of
    any length, takes body axes to world axes; vectors in world axes."""

    mass: object
    inertia: object
    quaternion: object = (0, 0, 0, 1)
    position: object = (0, 0, 0)
    velocity: object = (0, 0, 0)
    angular_velocity: object = (0, 0, 0)


def num(x):
    if isinstance(x, Fraction):
        return mp.mpf(x.numerator) / x.denominator
    return mp.mpf(x)


def vec(x):
    return mp.matrix([num(c) for c in x])


def mat(x):
    return x.copy() if isinstance(x, mp.matrix) else mp.matrix([[num(c) for c in row] for row in x])


def dot(x, y):
    return mp.fdot(zip(x, y, strict=True))


def skew(r):
    return mp.matrix([[0, -r[2], r[1]], [r[2], 0, -r[0]], [-r[1], r[0], 0]])


def _rotation(quaternion):
    q = vec(quaternion)
    q /= mp.norm(q)
    S = skew(q[:3])
    return mp.eye(3) + 2 * q[3] * S + 2 * S * S


def inverse_inertia(body):
    if body.mass is None:
        return mp.zeros(3)
    R = _rotation(body.quaternion)
    world = R * mat(body.inertia) * R.T
    moments, axes = mp.eigsy(world)
    if min(moments) > RANK * max(moments):
        return mp.inverse(world)
    inverse = [1 / m if m > RANK * max(moments) else 0 for m in moments]
    return axes * mp.diag(inverse) * axes.T


def mobility(a, b, point, digits=50):
    with mp.workdps(digits + GUARD):
        K = mp.zeros(3)
        for body in (a, b):
            if body.mass is not None:
                r = skew(vec(point) - vec(body.position))
                K += mp.eye(3) / num(body.mass) - r * inverse_inertia(body) * r
        return K


def relative_velocity(a, b, point, digits=50):
    with mp.workdps(digits + GUARD):
        r_a, r_b = (vec(point) - vec(body.position) for body in (a, b))
        return (
            vec(a.velocity)
            + skew(vec(a.angular_velocity)) * r_a
            - vec(b.velocity)
            - skew(vec(b.angular_velocity)) * r_b
        )
