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
         the body. Turning the result into world axes does bring in the condition, as ``spread``

The approach speed loses ``(|v_A - v_B| + |w||r|) / |u_n|`` by cancellation. A frictionless impulse
adds the roundings of ``n.Kn``. Chatterjee & Ruina's ``D = -K^-1 (u + Kn j)`` adds the condition of
``K``, whose least eigenvalue is at least ``1/m_A + 1/m_B``; an error of ``j`` moves ``D`` by as much
against the normal, and so enters ``P`` only by ``1 + e - kappa``; and ``kappa`` moves with ``D`` only
where the answer is on the cone, or so near it that rounding decides.

Source of the constants: Higham, *Accuracy and Stability of Numerical Algorithms*, 2002, chs. 3, 10.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any, NamedTuple

from ..physics.body import PIVOT_LIMIT, Body, Twist
from ..physics.effective_mass import Planar, Spatial
from ..physics.laws.chatterjee_ruina import Split
from ..physics.laws.law import Parameters
from ..physics.tensor import Symmetric3
from ..physics.vector import Vec3

UNIT_ROUNDOFF = 2.0**-53
LEAST, RANGE = 1e-30, 1e30
"""Sizes between these let no product of a law overflow or underflow."""

CROSS, TURN, SOLVE, SPEED, SPIN_SPEED = 4.0, 24.0, 12.0, 6.0, 9.0
"""Roundings, worst case: of a vector product of a difference, of a quaternion's turn, of a 3x3 solve
by ``L D L^T``, and of the two parts of the approach speed."""


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
        solve: roundings of ``I^-1 L`` in body axes.
        turn: roundings of a turn into body axes, or out of them.
        spread: ``c (tr(I)/2)^(1/2)``, the root of the condition number of the inertia from above.
        contact_speed: of the contact point about the centre of mass [m/s].
        inverse_mass: [1/kg].
    """

    s: float
    solve: float
    turn: float
    spread: float
    contact_speed: float
    inverse_mass: float

    @property
    def a(self) -> float:
        """Roundings of an angular impulse ``r x P``."""
        return CROSS + self.turn

    @property
    def q(self) -> float:
        """Roundings of ``I^-1 L`` in world axes, in the norm of the energy."""
        return self.solve + self.turn * self.spread

    @property
    def twist(self) -> float:
        """Roundings of the change of twist beyond those of the impulse."""
        if not self.inverse_mass:
            return 0.0
        return self.turn + self.spread * (self.solve + self.a * self.s / math.sqrt(self.inverse_mass))


class Sizes(NamedTuple):
    """What decides the error: the two bodies, and the speeds and masses they meet with.

    Attributes:
        bodies: amplification by body_a and by body_b.
        length: of the normal.
        u_n: normal velocity [m/s], and its absolute error in units of roundoff.
        u_n_error: see ``u_n``.
        u_error: absolute error of the relative velocity, in units of roundoff [m/s].
        inverse_mass: ``1/m_A + 1/m_B`` [1/kg].
        inverse_mass_n: inverse effective mass along the unit normal [1/kg].
        dropped: what the geometry leaves out.
    """

    bodies: tuple[Amplification, Amplification]
    length: float
    u_n: float
    u_n_error: float
    u_error: float
    inverse_mass: float
    inverse_mass_n: float
    dropped: Dropped


def survey(approach: Any, dropped: Dropped = NOTHING) -> Sizes:
    """The sizes that decide the error of an approach, in any geometry."""
    a, b = approach.body_a, approach.body_b
    if isinstance(approach, Spatial):
        bodies = _spatial(a, approach.r_a), _spatial(b, approach.r_b)
    elif isinstance(approach, Planar):
        bodies = _planar(a, math.hypot(*approach.r_a)), _planar(b, math.hypot(*approach.r_b))
    else:
        bodies = _point(a), _point(b)
    length = math.hypot(*approach.n)
    v = math.hypot(*(a.velocity - b.velocity))
    w = bodies[0].contact_speed + bodies[1].contact_speed
    return Sizes(
        bodies,
        length,
        approach.n_u / length,
        SPEED * v + SPIN_SPEED * w + dropped.speed / UNIT_ROUNDOFF,
        3 * v + 5 * w + dropped.speed / UNIT_ROUNDOFF,
        a.inverse_mass + b.inverse_mass,
        approach.n_Kn / (length * length),
        dropped,
    )


def frictionless_error(sizes: Sizes) -> float:
    """Relative error of a frictionless impulse, in units of roundoff."""
    a, b = sizes.bodies
    torque = 2 * (a.a * a.s + b.a * b.s) / math.sqrt(sizes.inverse_mass_n)
    mobility = max(6.0, a.q, b.q) + torque + sizes.dropped.mobility / UNIT_ROUNDOFF
    return sizes.u_n_error / abs(sizes.u_n) + mobility + 8


def coulomb_error(sizes: Sizes, split: Split, parameters: Parameters, n: Any, P: Any) -> float:
    """Relative error of Chatterjee & Ruina's impulse, in units of roundoff."""
    e, mu, e_t, _ = parameters
    length, m = sizes.length, sizes.inverse_mass
    P_I, D = split.j * length, math.hypot(*split.D)
    a, b = sizes.bodies
    stiff = (a.s**2 + b.s**2) / m
    K_error = ((a.q + 2 * a.turn + 5) * a.s**2 + (b.q + 2 * b.turn + 5) * b.s**2) / m + 3
    K_error += sizes.dropped.mobility / UNIT_ROUNDOFF
    j_error = frictionless_error(sizes)
    D_error = sizes.u_error / m + (3 * (1 + stiff) + K_error) * P_I + (K_error + SOLVE * (1 + stiff)) * D

    D_n = n.dot(split.D) / length
    D_t = math.hypot(*(split.D - n * (D_n / length)))
    stick, reach, S = 1 + e_t, mu * (1 + e) * P_I, D_t - mu * D_n
    S_error = ((1 + mu) * (D_error + 4 * D) + mu * j_error * P_I) * UNIT_ROUNDOFF
    kappa = _on_cone(reach, S, stick)
    least, most = _on_cone(reach, S + S_error, stick), _on_cone(reach, S - S_error, stick)
    kappa_error = max(most - kappa, kappa - least) / UNIT_ROUNDOFF
    if least < stick:
        kappa_error += kappa * (j_error + 4)
    along_n = (abs(1 + e - kappa) * j_error + 4) * P_I
    return (along_n + kappa * D_error + kappa_error * D) / math.hypot(*P) + 4


def twist_error(sizes: Sizes) -> float:
    """What the twist changes add to the relative error of the impulse, in units of roundoff."""
    a, b = sizes.bodies
    return 3 + max(a.twist, b.twist) + sizes.dropped.spin / UNIT_ROUNDOFF


def total(roundings: float, sizes: Sizes) -> float:
    """The relative error that so many roundings make, or infinity if that is beyond first order."""
    error = roundings * UNIT_ROUNDOFF
    a, b = sizes.bodies
    deciding = (
        sizes.length, sizes.u_n, sizes.u_error, sizes.inverse_mass,
        a.s, b.s, a.contact_speed, b.contact_speed, a.inverse_mass, b.inverse_mass,
    )  # fmt: skip
    return error / (1 - 4 * error) if error < 0.1 and are_in_range(deciding) else math.inf


def are_in_range(sizes: Iterable[float]) -> bool:
    """Whether no product of the sizes in a law overflows or underflows."""
    for size in sizes:  # noqa: SIM110, twice as fast as all(...)
        if size and not LEAST < abs(size) < RANGE:
            return False
    return True


def gain(sizes: Sizes, bodies: tuple[Body, Body], changes: tuple[Twist, Twist], P: Any) -> float:
    """How much greater the relative error of a twist change can be than that of the impulse, at least 1.

    A wrong direction of the impulse turns a body about an axis about which the right one, through its
    centre of mass, might not.
    """
    greatest = 1.0
    for size, body, change in zip(sizes.bodies, bodies, changes, strict=True):
        if size.s:
            turning = size.spread * size.s  # of tr(I)/2, where the norm has tr(I)/3
            most = math.hypot(*P) * math.sqrt(size.inverse_mass + turning * turning * 2 / 3)
            greatest = max(greatest, most / twist_norm(body, change))
    return greatest


def twist_norm(body: Body, change: Twist) -> float:
    """``(m dv.dv + tr(I)/3 dw.dw)^(1/2)``."""
    dv, dw = change
    return math.sqrt(body.mass * dv.dot(dv) + body.inertia.trace() / 3 * dw.dot(dw))


def amplification_by_arm(body: Body) -> Amplification:
    """What a body does to rounding, by a lever arm of 1 m: its ``s`` is ``c``."""
    return _spatial(body, Vec3(1.0, 0.0, 0.0))


def _on_cone(reach: float, S: float, stick: float) -> float:
    """``kappa``: what reaches the friction cone, or sticking if that comes first."""
    return reach / S if reach < stick * S else stick


def _point(body: Body) -> Amplification:
    return Amplification(0.0, 0.0, 0.0, 0.0, 0.0, body.inverse_mass)


def _planar(body: Body, arm: float) -> Amplification:
    zz, contact_speed = body.inertia.zz, arm * abs(body.angular_velocity.z)
    if not zz:
        return Amplification(0.0, 0.0, 0.0, 0.0, contact_speed, body.inverse_mass)
    spread = math.sqrt(body.inertia.trace() / zz)
    return Amplification(arm / math.sqrt(zz), 2.0, 0.0, spread, contact_speed, body.inverse_mass)


def _spatial(body: Body, r: Vec3) -> Amplification:
    arm, inertia = math.hypot(*r), body.inertia
    contact_speed = arm * math.hypot(*body.angular_velocity)
    diagonal = [moment for moment in (inertia.xx, inertia.yy, inertia.zz) if moment]
    if not diagonal:
        return Amplification(0.0, 0.0, 0.0, 0.0, contact_speed, body.inverse_mass)
    g, solve = 1.0, 2.0
    if inertia.xy or inertia.xz or inertia.yz:
        g = _scaled_condition(inertia)
        solve = SOLVE * g
    c = math.sqrt(g / min(diagonal))
    spread = c * math.sqrt(inertia.trace() / 2)
    turn = 0.0 if body.orientation is None else TURN
    return Amplification(arm * c, solve, turn, spread, contact_speed, body.inverse_mass)


def _scaled_condition(inertia: Symmetric3) -> float:
    """Inverse of the least eigenvalue of the tensor scaled to a unit diagonal, from above.

    The three eigenvalues add up to 3, so the product of the two greater is at most ``(3/2)^2``, and
    the least at least ``(4/9) det``, the product of the pivots over the diagonal. Infinite where
    rounding decides whether there is inertia about some axis at all.
    """
    xx, xy, _, yy, _, zz = inertia
    if not (xx and yy and zz and yy - xy / xx * xy > 16 * PIVOT_LIMIT * yy):
        return math.inf
    factor = inertia.factor()
    if not factor.d_z > 16 * PIVOT_LIMIT * zz:
        return math.inf
    return 9 / (4 * (factor.d_y / yy) * (factor.d_z / zz))
