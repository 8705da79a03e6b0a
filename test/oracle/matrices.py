"""Vectors and matrices of mpmath.

Bodies A and B touch at a point; n points from B to A; r = point - CoM; u is the velocity of A
relative to B at the point, negative along n if they approach. An impulse P on A and -P on B gives

    u+ = u + K P,   K = sum over A, B of  1/m - [r]x I^-1 [r]x      (3x3, positive definite)
"""

from fractions import Fraction

from mpmath import mp

GUARD = 30  # extra working digits: K^-1 and the exponents A_j may each cost a dozen


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
