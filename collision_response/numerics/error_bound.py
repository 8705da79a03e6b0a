"""How far an answer computed in rounded arithmetic can be from the exact one.

A running analysis: to first order in the unit roundoff, with the condition of what was computed. It
bounds the relative error of the impulse in the Euclidean norm, and that of each body's change of
twist ``(dv, dw)`` in the norm ``(m dv.dv + tr(I)/3 dw.dw)^(1/2)``: turning counts as much as it would
matter to the kinetic energy if the body were round.

Everything is in units of the roundoff. What the letters stand for, per body:

    c    1 / least moment of inertia, to the power 1/2, from above: the most spin, in the norm of its
         energy, that an angular impulse makes; and s = c |r|
    a    rounding of the angular impulse r x P, relative to |r| |P|
    q    rounding of I^-1 L, relative in the norm of the energy. L D L^T is stable in every scaling of
         the axes (Higham 2002, ch. 10), so what counts is the least eigenvalue 1/g of the tensor
         scaled to a unit diagonal, not its condition number: g = 1 for principal axes, however thin
         the body. Turning the result into world axes does bring in the condition number

The approach speed loses ``(|v_A - v_B| + |w||r|) / |u_n|`` by cancellation. A frictionless impulse
adds the roundings of ``n.Kn``. Chatterjee & Ruina's ``D = -K^-1 (u + Kn j)`` adds the condition of
``K``, whose least eigenvalue is at least ``1/m_A + 1/m_B``; an error of ``j`` moves ``D`` by as much
against the normal, and so enters ``P`` only by ``1 + e - kappa``; and ``kappa`` moves with ``D`` only
where the answer is on the cone, or so near it that rounding decides.

Source of the constants: Higham, *Accuracy and Stability of Numerical Algorithms*, 2002, chs. 3, 10.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Iterable
from functools import reduce
from typing import Any, NamedTuple

from ..physics.body import PIVOT_LIMIT, Body, Twist, factor_inertia
from ..physics.effective_mass import Planar, Spatial
from ..physics.laws.chatterjee_ruina import Split
from ..physics.laws.law import Parameters
from ..physics.number import Scalar, are_zero, choose, square_root
from ..physics.tensor import Symmetric3
from ..physics.vector import V, Vec2, Vec3

UNIT_ROUNDOFF = 2.0**-53
LEAST, RANGE = 1e-30, 1e30
"""Sizes between these let no product of a law overflow or underflow."""

LEAST_SQUARE = 1e-290
"""Above it, a square length has lost nothing to underflow."""

FIRST_ORDER = 0.1
"""A relative error beyond this is beyond an analysis to first order."""

CROSS, TURN, SOLVE, SPEED, SPIN_SPEED = 3.2, 24.0, 12.0, 6.0, 8.2
"""Roundings, worst case: of a vector product with a difference, of a quaternion's turn, of a 3x3 solve
by ``L D L^T``, and of the two parts of the approach speed.

CROSS is 1 for the difference, ``2 / 3^(1/2)`` for the products (``|a_y b_z| + |a_z b_y|`` and so on, in
norm, relative to ``|a||b|``), 1 for their difference. SPEED is 1 for the difference of the velocities,
3 for the scalar product, 2 for the sums; SPIN_SPEED is CROSS, 3 and 2.
"""


class Dropped(NamedTuple):
    """Bounds on what a cheaper geometry leaves out.

    Attributes:
        speed: of the contact's relative velocity [m/s].
        mobility: of the inverse effective mass, relative to ``1/m_A + 1/m_B``.
        spin: of a body's change of twist, relative to it, in the energy norm.
    """

    speed: float
    mobility: float
    spin: float

    def effect(self, approach_speed: float) -> float:
        """About how much the answer changes, relatively."""
        if not approach_speed:
            return math.inf
        return self.speed / approach_speed + self.mobility + self.spin


NOTHING = Dropped(0.0, 0.0, 0.0)


class Amplification(NamedTuple):
    """What one body does to rounding: ``s`` and ``q`` as at the head of this module.

    Attributes:
        ss: ``s^2``.
        solve: roundings of ``I^-1 L`` in body axes.
        turn: roundings of a turn into body axes, or out of them.
        condition: ``c^2 tr(I)/2``, the condition number of the inertia from above.
        speed_squared: of the contact point about the centre of mass [m^2/s^2].
        mass: [kg]; 0 if the body is immovable.
    """

    ss: Scalar
    solve: Scalar
    turn: float
    condition: Scalar
    speed_squared: Scalar
    mass: Scalar


class Sizes(NamedTuple):
    """What decides the error: the two bodies, and the speeds and masses they meet with.

    Attributes:
        bodies: amplification by body_a and by body_b.
        length: of the normal.
        u_n: normal velocity [m/s], and its absolute error in units of roundoff.
        u_n_error: see ``u_n``.
        u_error: absolute error of the relative velocity, in units of roundoff [m/s].
        turn: the greater of the two bodies'.
        solve: the greater of the two bodies'.
        spread: at least the greater root of the two bodies' condition.
        inverse_mass: ``1/m_A + 1/m_B`` [1/kg].
        turning: ``s^2`` of both bodies over that: how much of ``K`` may be due to rotation.
        dropped: what the geometry leaves out.
    """

    bodies: tuple[Amplification, Amplification]
    length: Scalar
    u_n: Scalar
    u_n_error: Scalar
    u_error: Scalar
    turn: Scalar
    solve: Scalar
    spread: Scalar
    inverse_mass: Scalar
    turning: Scalar
    dropped: Dropped

    @property
    def q(self) -> Scalar:
        """Roundings of ``I^-1 L`` in world axes, in the norm of the energy."""
        return self.solve + self.turn * self.spread


def survey(approach: Any, dropped: Dropped = NOTHING) -> Sizes:
    """The sizes that decide the error of an approach, in any geometry."""
    a, b = approach.body_a, approach.body_b
    if isinstance(approach, Spatial):
        bodies = _spatial(a, approach.r_a), _spatial(b, approach.r_b)
    elif isinstance(approach, Planar):
        bodies = _planar(a, approach.r_a), _planar(b, approach.r_b)
    else:
        bodies = _point(a), _point(b)
    length = square_root(_square(approach.n))
    v = square_root(_square(a.velocity - b.velocity))
    w = square_root(2 * (bodies[0].speed_squared + bodies[1].speed_squared))
    inverse_mass = a.inverse_mass + b.inverse_mass
    return Sizes(
        bodies,
        length,
        approach.n_u / length,
        SPEED * v + SPIN_SPEED * w + dropped.speed / UNIT_ROUNDOFF,
        2 * v + 5 * w + dropped.speed / UNIT_ROUNDOFF,
        _greatest(bodies[0].turn, bodies[1].turn),
        _greatest(bodies[0].solve, bodies[1].solve),
        square_root(bodies[0].condition + bodies[1].condition),
        inverse_mass,
        (bodies[0].ss + bodies[1].ss) / inverse_mass,
        dropped,
    )


def frictionless_error(sizes: Sizes) -> Scalar:
    """Relative error of a frictionless impulse, in units of roundoff."""
    torque = 2 * (CROSS + sizes.turn) * square_root(2 * sizes.turning)
    mobility = 6 + sizes.q + torque + sizes.dropped.mobility / UNIT_ROUNDOFF
    return sizes.u_n_error / abs(sizes.u_n) + mobility + 6


def coulomb_error(
    sizes: Sizes, split: Split, parameters: Parameters, n: Any, P: Any, roundoff: float = UNIT_ROUNDOFF
) -> Scalar:
    """Relative error of Chatterjee & Ruina's impulse, in units of roundoff."""
    e, mu, e_t, _ = parameters
    j, nn = split.j, n.dot(n)  # impulses are in units of |n|
    D_n = n.dot(split.D) / nn
    tangential = split.D - n * D_n
    D_t = square_root(tangential.dot(tangential) / nn)
    D = D_t + abs(D_n)

    stiff = 1 + sizes.turning
    K_error = 3 + (sizes.q + 2 * sizes.turn + 5) * sizes.turning + sizes.dropped.mobility / UNIT_ROUNDOFF
    j_error = frictionless_error(sizes)
    D_error = sizes.u_error / (sizes.inverse_mass * sizes.length)
    D_error = D_error + (3 * stiff + K_error) * j + (SOLVE * stiff + K_error) * D
    stick, reach, S = 1 + e_t, mu * (1 + e) * j, D_t - mu * D_n
    S_error = ((1 + mu) * (D_error + 4 * D) + mu * j_error * j) * roundoff
    kappa = choose(reach < stick * S, lambda: reach / S, lambda: stick)
    is_clear = S_error < S

    def near_cone() -> Scalar:
        return choose(is_clear, lambda: kappa * (S_error / (S - S_error)), lambda: stick) / roundoff

    may_slip = reach < stick * (S + S_error)
    kappa_error = choose(may_slip, lambda: near_cone() + kappa * (j_error + 4), lambda: 0.0)
    along_n = (abs(1 + e - kappa) * j_error + 4) * j
    return (along_n + kappa * D_error + kappa_error * D) / square_root(P.dot(P) / nn) + 4


def twist_error(sizes: Sizes) -> Scalar:
    """What the twist changes add to the relative error of the impulse, in units of roundoff."""
    a, b = sizes.bodies
    torque = square_root(a.condition * a.ss * a.mass + b.condition * b.ss * b.mass)
    turning = sizes.solve * sizes.spread + (CROSS + sizes.turn) * torque
    return 3 + sizes.turn + turning + sizes.dropped.spin / UNIT_ROUNDOFF


def closed_form_bound(
    approach: Any,
    sizes: Sizes,
    split: Split | None,
    parameters: Parameters,
    P: Any,
    changes: tuple[Twist, Twist],
    roundoff: float = UNIT_ROUNDOFF,
) -> Scalar:
    """The bound of a law in closed form, on its impulse and both changes of twist.

    Args:
        split: of the impulse by Chatterjee & Ruina; ``None`` if it is frictionless.
    """
    if split is None:
        return total(frictionless_error(sizes) + twist_error(sizes), sizes, roundoff)
    roundings = coulomb_error(sizes, split, parameters, approach.n, P, roundoff)
    roundings = roundings * gain(sizes, (approach.body_a, approach.body_b), changes, P)
    return total(roundings + twist_error(sizes), sizes, roundoff)


def total(roundings: Scalar, sizes: Sizes, roundoff: float = UNIT_ROUNDOFF) -> Scalar:
    """The relative error that so many roundings make, or infinity if that is beyond first order."""
    error = roundings * roundoff
    a, b = sizes.bodies
    deciding = [sizes.length, abs(sizes.u_n), a.mass, b.mass]
    are_small = sum(deciding) + sizes.u_error + a.ss + b.ss < RANGE
    is_first_order = (error < FIRST_ORDER) & are_small & _are_not_tiny(deciding)
    return choose(is_first_order, lambda: error / (1 - 4 * error), lambda: math.inf)


def are_in_range(sizes: Iterable[Scalar]) -> Any:
    """Whether no product of the sizes, none of them negative, in a law overflows or underflows."""
    sizes = list(sizes)
    return _are_not_tiny(sizes) & (sum(sizes) < RANGE)


def gain(sizes: Sizes, bodies: tuple[Body, Body], changes: tuple[Twist, Twist], P: Any) -> Scalar:
    """How much greater the relative error of a twist change can be than that of the impulse, at least 1.

    A wrong direction of the impulse turns a body about an axis about which the right one, through its
    centre of mass, might not.
    """
    PP = P.dot(P)

    def squared(size: Amplification, body: Body, change: Twist) -> Scalar:
        linear, dw = 3 * PP * body.inverse_mass, change.angular
        most = 2 * PP * size.condition * size.ss  # of tr(I)/2, where the norm has tr(I)/3
        turning = body.inertia.trace() * dw.dot(dw)
        return choose(size.ss > 0, lambda: (linear + most) / (linear + turning), lambda: 1.0)

    return square_root(_greatest(*map(squared, sizes.bodies, bodies, changes)))


def amplification_by_arm(body: Body) -> Amplification:
    """What a body does to rounding, by a lever arm of 1 m: its ``ss`` is ``c^2``."""
    return _spatial(body, Vec3(1.0, 0.0, 0.0))


def _square(v: V) -> Scalar:
    """``v.v``, or infinity where it over- or underflows."""
    square = v.dot(v)
    return choose(
        square > LEAST_SQUARE,
        lambda: square,
        lambda: choose(are_zero(v), lambda: 0.0, lambda: math.inf),
    )


def _are_not_tiny(sizes: Iterable[Scalar]) -> Any:
    return reduce(operator.and_, ((size > LEAST) | (size == 0) for size in sizes))


def _greatest(x: Scalar, y: Scalar) -> Scalar:
    """The greater of two, or ``y`` if that is NaN."""
    return choose(y <= x, lambda: x, lambda: y)


def _least(x: Scalar, y: Scalar) -> Scalar:
    return choose(x < y, lambda: x, lambda: y)


def _point(body: Body) -> Amplification:
    return Amplification(0.0, 0.0, 0.0, 0.0, 0.0, body.mass)


def _planar(body: Body, r: Vec2) -> Amplification:
    rr, zz = _square(r), body.inertia.zz
    speed_squared = rr * _square(Vec2(body.angular_velocity.z, 0.0))

    def turns() -> Amplification:
        return Amplification(rr / zz, 2.0, 0.0, body.inertia.trace() / zz, speed_squared, body.mass)

    return choose(zz > 0, turns, lambda: _point(body)._replace(speed_squared=speed_squared))


def _spatial(body: Body, r: Vec3) -> Amplification:
    rr, inertia = _square(r), body.inertia
    speed_squared = rr * _square(body.angular_velocity)

    def turns() -> Amplification:
        uncoupled = are_zero([inertia.xy, inertia.xz, inertia.yz])
        g = choose(uncoupled, lambda: 1.0, lambda: _scaled_condition(inertia))
        cc = g / _least_moment(inertia)
        solve = choose(uncoupled, lambda: 2.0, lambda: SOLVE * g)
        turn = 0.0 if body.orientation is None else TURN
        return Amplification(rr * cc, solve, turn, cc * (inertia.trace() / 2), speed_squared, body.mass)

    return choose(inertia.trace() > 0, turns, lambda: _point(body)._replace(speed_squared=speed_squared))


def _least_moment(inertia: Symmetric3) -> Scalar:
    """The least moment about a coordinate axis; of a rod along one of them, that about the others."""
    least = _least(inertia.xx, _least(inertia.yy, inertia.zz))
    return choose(least > 0, lambda: least, lambda: inertia.trace() / 2)


def _scaled_condition(inertia: Symmetric3) -> Scalar:
    """Inverse of the least eigenvalue of the tensor scaled to a unit diagonal, from above.

    The three eigenvalues add up to 3, so the product of the two greater is at most ``(3/2)^2``, and
    the least at least ``(4/9) det``, the product of the pivots over the diagonal. Infinite where
    rounding decides whether there is inertia about some axis at all.
    """
    is_definite, (_, _, _, _, d_y, d_z) = factor_inertia(inertia)
    _, _, _, yy, _, zz = inertia
    is_clear = (d_y > 16 * PIVOT_LIMIT * yy) & (d_z > 16 * PIVOT_LIMIT * zz)
    return choose(is_definite & is_clear, lambda: 9 / (4 * (d_y / yy) * (d_z / zz)), lambda: math.inf)
