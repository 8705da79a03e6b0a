"""Coulomb friction along the path of the impulse: Routh's method.

**The path.** The impact is followed from first touch to last in the normal impulse ``p``. While the contact
slips with the speed ``s`` along the unit vector ``t``, friction acts against ``t``:

    dP/dp = n - mu t        du/dp = K (n - mu t)

with the unit normal ``n``. When slip stops, the contact sticks if friction can hold it. Otherwise it slips
on, for good, in the one direction ``z`` in which slip grows straight from rest.

**Its end.** Let ``u_n`` be the normal velocity and ``W = int u_n dp`` the work of the normal impulse.
Compression ends where ``u_n`` reaches 0, at ``p_c`` and ``W_c < 0``. The impact ends where

    Poisson    p = (1 + e) p_c          restitution of impulse
    Stronge    W = (1 - e^2) W_c        restitution of energy

Neither creates energy for e in [0, 1]. In the code ``p`` and ``W`` start again from 0 when restitution
begins, since they are small if e is: restitution ends at ``p = e p_c`` or ``W = -e^2 W_c``. Friction may
press the bodies together at first (``du_n/dp < 0``: jam, Painleve's paradox); slip then always stops, and
``u_n`` rises after all.

**Units.** ``n.K n`` and ``|u_n|`` before the impact are 1, so the unit of impulse is their quotient ``j``.
With two tangential axes, ``A`` is the tangential part of ``K`` and ``b`` the tangential part of ``K n``.
Instead of ``p``, slip counts ``x = (1 + mu) p``. With ``c = 1 / (1 + mu)`` and ``m = mu c``,

    dp = c dx    dP_t = -m t dx    du_t/dx = f(t) = c b - m A t    du_n/dx = r(t) = c - m b.t

are of order 1 for all mu.

**Slip that turns.** Let ``q`` be the tangent perpendicular to ``t``. The slip speed changes at the rate
``g = t.f``, and ``t`` turns at the rate ``w / s`` with ``w = q.f``, infinitely fast where slip stops. With
``dx = s dT`` nothing is singular,

    dt/dT = w q    ds/dT = g s    dx/dT = s    du_n/dT = r s    dW/dT = c u_n s

and no direction is ever computed from a difference (Keller 1986). Planar slip has ``w = 0``.
``routh_path.py`` integrates these equations until, to the tolerance, slip turns no more before it stops or
the impact ends.

From there on slip is straight: ``routh_straight.py``. ``routh_error.py`` bounds the error of the path.

Sources: Routh, *Dynamics of a System of Rigid Bodies*, 1905, sections 180-199; Keller, "Impact With
Friction", J. Appl. Mech. 53 (1986); Stronge, "Rigid body collisions with friction", Proc. R. Soc. A
431 (1990); Wang & Mason, "Two-Dimensional Rigid-Body Collisions With Friction", J. Appl. Mech. 59
(1992).
"""

from __future__ import annotations

from ...numbers.operations import (
    ROUNDOFF,
    Scalar,
    certain,
    choose,
    error_of,
    maximum,
    minimum,
    negation,
    varying_as,
    widened,
)
from ..effective_mass import ContactKinematics
from .contact_frame import ContactFrame, Tangential
from .law import Coefficients, Law, Outcome, Regime
from .routh_error import InputErrors, path_error
from .routh_path import Path, TurningSlip, turn
from .routh_straight import (
    FirstSlip,
    Ray,
    StraightRest,
    first_slip,
    ray_from_rest,
    straight_rest,
    tangential_impulse,
)

DEFAULT_TOLERANCE = 1e-12
"""Relative tolerance of the path if the model has none."""

LEAST_TOLERANCE = 1e-13
"""The finest tolerance of the path: about the rounding of its steps in doubles."""

PATH_SHARE = 1 / 4096
"""The part of the tolerance of the model that the path may use; the bound of its error counts the rest."""

COARSEST = 4e-9
"""The coarsest tolerance of the path: a coarser path is no faster, and its bound grows out of proportion."""

GREATEST_FRICTION = 1e100
"""More friction counts as this: slip stops within 1e-100 of its impulse. The error bound includes the
difference."""

LEAST_RESTITUTION = 1e-140
"""Less restitution returns nothing that counts."""


def routh(contact: ContactKinematics, coefficients: Coefficients) -> Outcome:
    """The impulse by Routh's path: ROUTH_POISSON if ``settings.law`` says so, else ROUTH_STRONGE."""
    e, mu, settings = coefficients
    energetic = negation(settings.law == Law.ROUTH_POISSON)
    e_e, e_mu, friction = error_of(e) + LEAST_RESTITUTION, error_of(mu), certain(mu)
    mu = minimum(friction, GREATEST_FRICTION)
    e = choose(
        certain(e) < LEAST_RESTITUTION,
        lambda: varying_as(0 * certain(e), lambda: certain(e)),
        lambda: certain(e),
    )
    frame = ContactFrame.of(contact)
    u_n, slip = frame.un, Tangential(frame.u1, frame.u2)
    slip = choose(frame.surely_separates(), lambda: slip * 0, lambda: slip)
    speed = choose(certain(u_n) < 0, lambda: -u_n, lambda: 1 + 0 * u_n)
    j = speed / frame.Knn
    data = frame.scaled_K()
    e_A = error_of(data[0]) + 2 * error_of(data[1]) + error_of(data[2])
    e_b, e_slip = error_of(data[3]) + error_of(data[4]), error_of(slip.x / speed) + error_of(slip.y / speed)

    o = 0 * certain(slip.x)
    tolerance = choose(
        settings.tolerance > 0,
        lambda: maximum(minimum(PATH_SHARE * settings.tolerance, COARSEST), LEAST_TOLERANCE),
        lambda: DEFAULT_TOLERANCE,
    )
    c = 1 / (1 + mu)
    e_c = choose(friction > GREATEST_FRICTION, lambda: c, lambda: o)
    A11, A12, A22, b1, b2 = map(certain, data)
    path = Path(A11, A12, A22, b1, b2, c, mu * c, e, energetic, tolerance)
    ray = ray_from_rest(path, mu)
    first = first_slip(path, ray, slip, speed)
    y = turn(path, *first[:4])
    e_A, e_b, e_slip = _with_rounding(path, first.s, y, e_A, e_b, e_slip)
    rest = straight_rest(path, ray, first, y)
    P1, P2, kink = tangential_impulse(path, ray, first, y, rest)
    p = rest.p + kink
    heat = y.heat + path.m * ((rest.s + rest.s_c) * rest.x + (rest.s_c + rest.s_e) * rest.x_r) / 2
    heat = heat + ray.k * ray.G * rest.after_stop * rest.after_stop / 2
    lost = choose(energetic, lambda: (1 - e) * (1 + e) * -rest.W_c, lambda: -(rest.W_c + rest.W))
    lost = maximum(lost, -heat)  # less only by rounding
    regime = _regime_at_end(ray, first, rest)
    least_r = minimum(y.least_r, choose(rest.along > 0, lambda: rest.r, lambda: 1 + o))
    P_n, X = rest.p_c + p, choose(rest.in_restitution, lambda: y.p_c / c + y.x, lambda: y.x) + rest.along
    jams = (certain(least_r) < 0) & (certain(X) > tolerance)  # not while slip is as good as none
    regime = choose(jams, lambda: 1.0 * Regime.JAMMED, lambda: regime)
    ignored_slip = choose(first.slips, lambda: o, lambda: abs(certain(slip.x)) + abs(certain(slip.y)))
    e_slip = e_slip + ignored_slip / certain(speed)
    error = path_error(path, ray, y, rest._replace(p=p), X, mu, InputErrors(e_A, e_b, e_slip, e_e, e_mu, e_c))

    tangential = Tangential(widened(P1, error.P_t) * j, widened(P2, error.P_t) * j)
    p_c, p, u, s_e, G, after_stop = map(certain, (rest.p_c, p, rest.u, rest.s_e, ray.G, rest.after_stop))
    lost = widened(lost, error.steps + error.u_n * (p_c + p) + abs(u) * error.P_n)
    heat = widened(
        heat, error.steps + error.size * error.slip + error.friction * (s_e + G * after_stop) * error.P_n
    )
    return Outcome(
        frame.to_world(tangential, widened(P_n, error.P_n) * j),
        regime,
        lost * (speed * j),
        heat * (speed * j),
        unfinished=y.excess_turn > 0,
    )


def _with_rounding(
    path: Path, s: Scalar, y: TurningSlip, e_A: Scalar, e_b: Scalar, e_slip: Scalar
) -> tuple[Scalar, Scalar, Scalar]:
    """The errors of ``A``, ``b`` and the slip ``s`` if these were rounded to floats where slip turned."""
    unit = choose(certain(y.slip_error) > 0, lambda: ROUNDOFF + 0 * s, lambda: 0 * s)
    b = abs(path.b1) + abs(path.b2)
    return e_A + 2 * unit * (path.A11 + path.A22), e_b + unit * b, e_slip + 2 * unit * s


def _regime_at_end(ray: Ray, first: FirstSlip, rest: StraightRest) -> Scalar:
    """The regime of a path on which friction does not jam."""
    p = rest.after_stop
    final1, final2 = rest.s_e * rest.t1 + ray.G * p * ray.z1, rest.s_e * rest.t2 + ray.G * p * ray.z2
    is_reversed = first.t1 * final1 + first.t2 * final2 < 0
    slides = choose(is_reversed, lambda: 1.0 * Regime.REVERSED, lambda: 1.0 * Regime.SLIDING)
    return choose(ray.sticks & (p > 0), lambda: 1.0 * Regime.STICKING, lambda: slides)
