"""The exact answer to a request, computed from the equations in rational arithmetic.

FRICTIONLESS is rational in its inputs; COULOMB needs one square root, taken to 1000 bits. Both are right to
hundreds of digits at any magnitude. MOREAU and ROUTH take their impulse from the mpmath oracle of the tests,
given exact K, u and n. This module shares no code with the package.

    u = v_A + w_A x r_A - v_B - w_B x r_B        K = sum of 1/m - [r]x I^-1 [r]x        u+ = u + K P
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

try:
    from gmpy2 import mpq as Fraction  # up to ten times as fast
except ImportError:
    from fractions import Fraction

ROOT_BITS = 1000
PIVOT_LIMIT = Fraction(1, 2**50)
"""A moment of inertia counts as 0 at or below this part of the terms that add up to it."""

ORACLE_DIGITS = 35
"""Routh's path loses up to half of them where the work decides its end."""

ORACLE_ERROR = 1e-15
"""Relative error of the impulse by the oracle with these digits."""

LARGEST_FLOAT = Fraction(math.nextafter(math.inf, 0.0))
SMALLEST_FLOAT = Fraction(1, 2**1074)

Vec = tuple[Fraction, Fraction, Fraction]
Mat = tuple[Vec, Vec, Vec]
ZERO: Vec = (Fraction(0),) * 3
ZERO_MATRIX: Mat = (ZERO,) * 3


class PlainBody(NamedTuple):
    """A body in plain numbers. ``mass`` is None if it is immovable; ``position`` and ``velocity`` are those
    of the reference point.
    """

    mass: float | None = None
    inertia: Sequence[float] = (0.0,) * 6
    position: Sequence[float] = (0.0,) * 3
    orientation: Sequence[float] | None = None
    velocity: Sequence[float] = (0.0,) * 3
    spin: Sequence[float] = (0.0,) * 3
    com: Sequence[float] = (0.0,) * 3


class PlainContact(NamedTuple):
    """A contact in plain numbers."""

    position: Sequence[float]
    normal: Sequence[float]
    restitution: Any = 1.0
    friction: float = 0.0


class PlainCollision(NamedTuple):
    """Two bodies and their contact."""

    a: PlainBody
    b: PlainBody
    contact: PlainContact


# vectors and tensors of fractions


def vec(v: Sequence[float]) -> Vec:
    return tuple(Fraction(x) for x in v)  # type: ignore[return-value]


def dot(a: Vec, b: Vec) -> Fraction:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def cross(a: Vec, b: Vec) -> Vec:
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


def plus(a: Vec, b: Vec) -> Vec:
    return a[0] + b[0], a[1] + b[1], a[2] + b[2]


def minus(a: Vec, b: Vec) -> Vec:
    return a[0] - b[0], a[1] - b[1], a[2] - b[2]


def times(a: Vec, s: Fraction) -> Vec:
    return a[0] * s, a[1] * s, a[2] * s


def apply(m: Mat, v: Vec) -> Vec:
    return dot(m[0], v), dot(m[1], v), dot(m[2], v)


def transposed(m: Mat) -> Mat:
    return tuple(zip(*m, strict=True))  # type: ignore[return-value]


def inverse(m: Mat) -> Mat:
    """The inverse by cofactors: exact, so conditioning does not matter."""
    x, y, z = m
    adjugate = cross(y, z), cross(z, x), cross(x, y)
    determinant = dot(x, adjugate[0])
    return transposed(tuple(times(row, 1 / determinant) for row in adjugate))  # type: ignore[arg-type]


def square_root(x: Fraction) -> Fraction:
    """The square root of ``x >= 0``, relatively right to ``ROOT_BITS``; exact if it is rational."""
    if x == 0:
        return x
    p, q = math.isqrt(x.numerator), math.isqrt(x.denominator)
    if p * p == x.numerator and q * q == x.denominator:
        return Fraction(p, q)
    shift = 2 * ROOT_BITS + x.denominator.bit_length() - x.numerator.bit_length()
    shift += shift % 2
    scaled = x * Fraction(2) ** shift
    return Fraction(math.isqrt(scaled.numerator // scaled.denominator)) / Fraction(2) ** (shift // 2)


def length(v: Vec) -> Fraction:
    return square_root(dot(v, v))


def nearest_float(x: Fraction) -> float:
    """The nearest float64; infinite beyond its range."""
    try:
        return float(x)
    except OverflowError:
        return math.copysign(math.inf, x)


# bodies


@dataclass(frozen=True)
class Side:
    """One body as seen from the contact, in world axes; parts are computed on demand."""

    body: PlainBody
    point: Vec

    @cached_property
    def mass(self) -> Fraction | None:
        return None if self.body.mass is None else Fraction(self.body.mass)

    @cached_property
    def rotation(self) -> Mat:
        return rotation_matrix(self.body.orientation)

    @cached_property
    def com(self) -> Vec:
        return apply(self.rotation, vec(self.body.com)) if any(self.body.com) else ZERO

    @cached_property
    def r(self) -> Vec:
        return minus(minus(self.point, vec(self.body.position)), self.com)

    @cached_property
    def velocity(self) -> Vec:
        return vec(self.body.velocity)

    @cached_property
    def spin(self) -> Vec:
        return vec(self.body.spin)

    @cached_property
    def speed_scale(self) -> Fraction:
        """Size of the terms of the contact velocity, for the rounding that they cause."""
        arms = length(self.point) + length(vec(self.body.position)) + length(self.com)
        return length(self.velocity) + length(self.spin) * arms

    @cached_property
    def trace(self) -> Fraction:
        return _trace(self._tensor)

    @cached_property
    def inertia(self) -> Mat:
        return _turned(self.rotation, self._tensor)

    @cached_property
    def inverse_inertia(self) -> Mat:
        half_trace = self.trace / 2
        if _is_definite(self._tensor):
            undone = inverse(self._tensor)
        elif half_trace == 0:
            return ZERO_MATRIX
        else:  # a rod: I/c projects across its axis
            squared = tuple(apply(self._tensor, row) for row in self._tensor)  # I I, for I is symmetric
            undone = tuple(times(row, 1 / half_trace**3) for row in squared)  # type: ignore[assignment]
        return _turned(self.rotation, undone)

    @cached_property
    def massless_spin(self) -> Vec:
        """The part of the angular velocity about an axis without inertia."""
        if self.mass is None or _is_definite(self._tensor):
            return ZERO
        if self.trace == 0:
            return self.spin
        in_body = apply(transposed(self.rotation), self.spin)
        across = times(apply(self._tensor, in_body), 2 / self.trace)
        return apply(self.rotation, minus(in_body, across))

    @cached_property
    def _tensor(self) -> Mat:
        """The inertia in body axes; zero for an immovable body."""
        if self.mass is None:
            return ZERO_MATRIX
        xx, xy, xz, yy, yz, zz = (Fraction(c) for c in self.body.inertia)
        return (xx, xy, xz), (xy, yy, yz), (xz, yz, zz)

    def contact_velocity(self) -> Vec:
        """The velocity of the contact point; spin about an axis without inertia does not move it."""
        centre = plus(self.velocity, cross(self.spin, self.com))
        return plus(centre, cross(minus(self.spin, self.massless_spin), self.r))

    def response(self, impulse: Vec) -> tuple[Vec, Vec]:
        """The change of the twist of the reference point."""
        if self.mass is None:
            return ZERO, ZERO
        angular = apply(self.inverse_inertia, cross(self.r, impulse))
        return minus(times(impulse, 1 / self.mass), cross(angular, self.com)), angular

    def energy(self, velocity: Vec, spin: Vec) -> Fraction:
        if self.mass is None:
            return Fraction(0)
        centre = plus(velocity, cross(spin, self.com))
        return (self.mass * dot(centre, centre) + dot(spin, apply(self.inertia, spin))) / 2


def rotation_matrix(quaternion: Sequence[float] | None) -> Mat:
    """Rational in the components, whatever the length of the quaternion."""
    if quaternion is None:
        quaternion = (0, 0, 0, 1)
    x, y, z, w = (Fraction(c) for c in quaternion)
    s = 2 / (x * x + y * y + z * z + w * w)
    return (
        (1 - s * (y * y + z * z), s * (x * y - w * z), s * (x * z + w * y)),
        (s * (x * y + w * z), 1 - s * (x * x + z * z), s * (y * z - w * x)),
        (s * (x * z - w * y), s * (y * z + w * x), 1 - s * (x * x + y * y)),
    )


def _trace(m: Mat) -> Fraction:
    return m[0][0] + m[1][1] + m[2][2]


def _is_definite(tensor: Mat) -> bool:
    """Whether the moments about three conjugate axes are more than the rounding of the components."""
    x, y, _ = tensor
    axes = ((Fraction(1), Fraction(0), Fraction(0)), (-x[1], x[0], Fraction(0)), cross(x, y))
    # the moments that went into the components of each axis: those of all axes that products couple to it
    sizes = [sum(tensor[j][j] for j in range(3) if j == k or tensor[k][j] != 0) for k in range(3)]
    for axis in axes:
        moment = dot(axis, apply(tensor, axis))
        rounding = PIVOT_LIMIT * sum(size * x**2 for size, x in zip(sizes, axis, strict=True))
        if not moment > rounding:
            return False
    return True


def _turned(rotation: Mat, tensor: Mat) -> Mat:
    """``R T R^T``."""
    half = tuple(apply(tensor, row) for row in rotation)  # rows of R T, T being symmetric
    return tuple(tuple(dot(h, row) for row in rotation) for h in half)  # type: ignore[return-value]


# both bodies


@dataclass(frozen=True)
class Pair:
    """Both bodies as seen from the contact; parts are computed on demand."""

    a: Side
    b: Side
    n: Vec

    @cached_property
    def u(self) -> Vec:
        return minus(self.a.contact_velocity(), self.b.contact_velocity())

    @cached_property
    def normal_length(self) -> Fraction:
        """The length of the normal."""
        return length(self.n)

    @cached_property
    def K(self) -> Mat:
        columns = []
        for i in range(3):
            unit: Vec = tuple(Fraction(int(i == k)) for k in range(3))  # type: ignore[assignment]
            column = ZERO
            for side in (self.a, self.b):
                if side.mass is not None:
                    turning = cross(apply(side.inverse_inertia, cross(side.r, unit)), side.r)
                    column = plus(column, plus(times(unit, 1 / side.mass), turning))
            columns.append(column)
        return tuple(columns)  # type: ignore[return-value]

    @property
    def n_u(self) -> Fraction:
        return dot(self.n, self.u)

    @property
    def n_Kn(self) -> Fraction:
        return dot(self.n, apply(self.K, self.n))

    @property
    def approach_speed(self) -> Fraction:
        return -self.n_u / self.normal_length

    def energy_change(self, impulse: Vec) -> Fraction:
        return dot(impulse, plus(times(self.u, Fraction(2)), apply(self.K, impulse))) / 2


def pair_of(collision: PlainCollision) -> Pair:
    point = vec(collision.contact.position)
    return Pair(Side(collision.a, point), Side(collision.b, point), vec(collision.contact.normal))


# laws


class Answer(NamedTuple):
    """The exact answer.

    Attributes:
        pair: the bodies.
        separating: whether the bodies separate, so that nothing happens.
        impulses: the impulses that the law allows: one, except for MOREAU.
        sticks: whether COULOMB brings the slip to its target.
        margin: relative distance of that impulse from the friction cone.
        restitution: as used.
        below_threshold: whether the threshold set the restitution to 0.
        report: the report of the oracle, for MOREAU and ROUTH.
    """

    pair: Pair
    separating: bool
    impulses: list[Vec]
    sticks: bool
    margin: float
    restitution: Fraction
    below_threshold: bool
    report: Any = None


def answer(
    collision: PlainCollision, law: str, e_t: float = 0.0, threshold: float = 0.0, pair: Pair | None = None
) -> Answer:
    """The exact answer by a law that is not AUTO, with a restitution that is a number."""
    pair = pair or pair_of(collision)
    e, mu = Fraction(collision.contact.restitution), Fraction(collision.contact.friction)
    n_u, nn = pair.n_u, dot(pair.n, pair.n)
    if n_u >= 0:
        return Answer(pair, True, [ZERO], False, math.inf, e, False)
    below = e != 0 and n_u * n_u < Fraction(threshold) ** 2 * nn
    e = Fraction(0) if below else e
    if law == "FRICTIONLESS":
        return Answer(pair, False, [times(pair.n, -(1 + e) * n_u / pair.n_Kn)], False, math.inf, e, below)
    if law == "COULOMB":
        impulse, sticks, margin = _coulomb(pair, e, mu, Fraction(e_t))
        return Answer(pair, False, [impulse], sticks, margin, e, below)
    impulses, report = _by_oracle(pair, law, e, mu)
    return Answer(pair, False, impulses, False, math.inf, e, below, report)


def _coulomb(pair: Pair, e: Fraction, mu: Fraction, e_t: Fraction) -> tuple[Vec, bool, float]:
    """``P = (1+e) P_I + kappa (P_II - P_I)``, with the largest kappa up to ``1 + e_t`` in the cone."""
    n, nn = pair.n, dot(pair.n, pair.n)
    plastic = times(n, -pair.n_u / pair.n_Kn)
    rest = times(apply(inverse(pair.K), pair.u), Fraction(-1))
    D = minus(rest, plastic)
    base = times(plastic, 1 + e)

    def parts(v: Vec) -> tuple[Fraction, Vec]:
        along = dot(n, v)
        return along, minus(v, times(n, along / nn))

    wanted = plus(base, times(D, 1 + e_t))
    P_n, P_t = parts(wanted)  # P_n times |n|
    tangential, limit = dot(P_t, P_t) * nn, mu * P_n
    sticks = P_n >= 0 and tangential <= limit * limit
    if sticks:
        margin = (
            1 - nearest_float(tangential / (limit * limit))
            if limit
            else (math.inf if not tangential else 0.0)
        )
        return wanted, True, margin
    D_n, D_t = parts(D)
    kappa = mu * dot(n, base) / (square_root(dot(D_t, D_t) * nn) - mu * D_n)
    margin = nearest_float(1 - kappa / (1 + e_t))
    return plus(base, times(D, kappa)), False, margin


ORACLE_NAMES = {"MOREAU": "moreau", "ROUTH_POISSON": "routh_poisson", "ROUTH_STRONGE": "routh_stronge"}


def _by_oracle(pair: Pair, law: str, e: Fraction, mu: Fraction) -> tuple[list[Vec], Any]:
    """The impulses of the oracle. The problem is scaled to order 1, so that magnitudes do not matter."""
    import oracle

    mass, speed = _power_of_two(1 / pair.n_Kn * dot(pair.n, pair.n)), _power_of_two(length(pair.u))
    size = mass * speed
    K = tuple(times(row, mass) for row in pair.K)
    u = times(pair.u, 1 / speed)
    n = times(pair.n, 1 / pair.normal_length)
    mu = min(mu, Fraction(10**20))  # more would not change the answer, and the oracle would lose digits
    given = oracle.impulse(ORACLE_NAMES[law], K, u, n, e, mu, digits=ORACLE_DIGITS)
    impulses = [given[0]]
    if given[1].candidates:
        impulses = [P for _, P, _ in given[1].candidates]
    return [times(_fractions(P), size) for P in impulses], given[1]


def _power_of_two(x: Fraction) -> Fraction:
    return Fraction(2) ** (x.numerator.bit_length() - x.denominator.bit_length())


def _fractions(P: Any) -> Vec:
    out = []
    for x in P:
        sign, man, exp, _ = x._mpf_
        value = Fraction(int(man)) * Fraction(2) ** int(exp)
        out.append(-value if sign else value)
    return tuple(out)  # type: ignore[return-value]


# errors of an answer


def _componentwise_error(given: Sequence[float], exact: Vec) -> Vec:
    """The error of each component, where a number that is right to the nearest subnormal has none."""
    apart = minus(vec(given), exact)
    return tuple(Fraction(0) if 2 * abs(d) <= SMALLEST_FLOAT else d for d in apart)  # type: ignore[return-value]


def _relative_error(error2: Fraction, size2: Fraction) -> float:
    if error2 == 0:
        return 0.0
    return nearest_float(square_root(error2 / size2)) if size2 > 0 else math.inf


def impulse_error(given: Sequence[float], exact: Vec) -> float:
    """The relative error in the Euclidean norm."""
    apart = _componentwise_error(given, exact)
    return _relative_error(dot(apart, apart), dot(exact, exact))


def twist_error(side: Side, linear: Sequence[float], angular: Sequence[float], impulse: Vec) -> float:
    """The relative error of a change of twist in the norm ``(m dv.dv + tr(I)/3 dw.dw)^(1/2)``."""
    dv, dw = side.response(impulse)
    if side.mass is None:
        return 0.0 if not any((*linear, *angular)) else math.inf
    m, moment = side.mass, side.trace / 3
    error_v, error_w = _componentwise_error(linear, dv), _componentwise_error(angular, dw)
    return _relative_error(
        m * dot(error_v, error_v) + moment * dot(error_w, error_w), m * dot(dv, dv) + moment * dot(dw, dw)
    )


def is_representable(exact: Answer) -> bool:
    """Whether every number of the answer is in the range of float64."""
    pair = exact.pair
    for P in exact.impulses[:1]:
        sizes = [abs(x) for x in P]
        after = plus(pair.u, apply(pair.K, P))
        sizes += [abs(pair.n_u) / pair.normal_length, abs(dot(pair.n, after)) / pair.normal_length]
        sizes += [abs(dot(P, pair.u)), abs(dot(P, after)), dot(pair.n, pair.n) / pair.n_Kn]
        before = then = Fraction(0)
        for side, impulse in ((pair.a, P), (pair.b, times(P, Fraction(-1)))):
            dv, dw = side.response(impulse)
            v, w = plus(side.velocity, dv), plus(side.spin, dw)
            sizes += [abs(x) for x in (*dv, *dw, *v, *w)]
            before, then = before + side.energy(side.velocity, side.spin), then + side.energy(v, w)
        if max(*sizes, before, then) > LARGEST_FLOAT:
            return False
    return True
