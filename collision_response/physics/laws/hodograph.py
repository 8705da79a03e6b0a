"""The curved part of Routh's path: slip that turns while it lasts.

With the angle ``a`` of the slip, its speed ``s``, and tangential axes 1 along the first slip and 2
across it, ``du/dp = K (n - mu t)`` reads

    ds/dp = h(a),    s da/dp = g(a),    h + i g = exp(-i a) ((K t~)_1 + i (K t~)_2),   t~ = n - mu t.

It is stiff where the slip stops, because it turns infinitely fast there. In the variable ``tau`` with
``dp = s dtau`` it is not; ``a`` then runs smoothly into a direction that the slip keeps:

    da/dtau = g,   d(ln s)/dtau = h,   dP_t/dtau = -mu s t,   dp/dtau = s,   dW/dtau = u_n s.

What counts is the impulse, however fast the slip. So impulses are in units of the least without which
compression cannot end, and speeds in those of what that changes. ``u_n`` is integrated for itself: taken
from the slip or from ``P`` it could cancel. Of the slip, ``a`` and ``ln s`` count from the start, and hardly
change where the impact grazes. ``tau`` is slowed so that ``dp/dtau`` starts below 1.

The integration ends as soon as the rest of the path is straight to the tolerance: when the goal of the
phase is near; when the slip will stop within that much impulse, or turns by less while it slows by a factor
e; or when ``a`` is that near a direction it is drawn to, where ``dg/da = -pull < 0``. It is then put there
exactly, since what little ``g`` would leave across the slip is not little where that stops.

Of SciPy's integrators the one of order 8 is used. On random boxes and rods at tolerance 1e-8 it took 12 ms
and was wrong by 1e-9; RK45 took 16 ms (4e-8), LSODA 10 ms (2e-6), Radau 370 ms (1e-7): it alone kept every
tolerance asked of it, from 1e-4 to 1e-11. Its interpolant keeps none where the step is as long as stability
allows: it only tells where to step to.

Sources: Keller, "Impact With Friction", J. Appl. Mech. 53 (1986); Bhatt & Koechling, "Three-
Dimensional Frictional Rigid-Body Impact", J. Appl. Mech. 62 (1995); the integrator is Dormand &
Prince's of order 8 as in SciPy (Hairer, Norsett & Wanner, *Solving ODEs I*, 1993).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.integrate import DOP853
from scipy.optimize import brentq

from ...status import ImpactError, StatusCode
from .tangent_plane import direction

Array = np.ndarray[Any, np.dtype[np.float64]]

if TYPE_CHECKING:
    from .routh import Goal, Path, State

STEP_BUDGET = 2000
"""Steps of the integrator. The longest of some thousand random paths, many grazing or jammed, took 152."""

NEWTON_STEPS = 3
"""To a direction that slip keeps: each squares what is left, at first at most the tolerance."""


def slip_along_curve(path: Path, state: State, goal: Goal) -> State:
    """Follow slip that turns until the rest of the way to the goal is straight.

    Raises:
        ImpactError: PATH_TOO_LONG after ``STEP_BUDGET`` steps.
    """
    n, mu, tolerance = path.n, path.mu, path.tolerance
    slip_speed = state.slip.norm()
    t_1 = state.slip / slip_speed
    t_2 = n.cross(t_1)
    K_1, K_2, K_n = path.K @ t_1, path.K @ t_2, path.K @ n
    inverse_mass = n.dot(K_n)
    k_1, k_2 = t_1.dot(K_n) / inverse_mass, t_2.dot(K_n) / inverse_mass
    f_11, f_12, f_22 = (mu / inverse_mass * K for K in (t_1.dot(K_1), t_1.dot(K_2), t_2.dot(K_2)))
    f_1, f_2 = mu * k_1, mu * k_2
    swiftest = inverse_mass * (math.hypot(k_1, k_2) + f_11 + f_22)
    impulse = max(path.least, tolerance * slip_speed / swiftest)  # a turn by the tolerance takes the latter
    speed, work = impulse * inverse_mass, impulse * impulse * inverse_mass
    s_0 = slip_speed / speed
    pace = 1 / (1 + s_0)

    def turning(a: float) -> tuple[float, float, float, float, float]:
        v, d = 2 * math.sin(a / 2) ** 2, math.sin(a)
        c = 1 - v  # the versine v keeps what follows smooth where it hardly changes from the start
        along_1 = (k_1 - f_11) + (f_11 * v - f_12 * d)
        along_2 = (k_2 - f_12) + (f_12 * v - f_22 * d)
        rise = (1 - f_1) + (f_1 * v - f_2 * d)
        return c, d, c * along_1 + d * along_2, c * along_2 - d * along_1, rise

    def rates(_: float, y: Array) -> list[float]:
        a, growth, _P_1, _P_2, _p, u_n, _W = y.tolist()
        c, d, h, g, rise = turning(a)
        dp = pace * s_0 * math.exp(growth)
        return [pace * g, pace * h, -mu * c * dp, -mu * d * dp, dp, rise * dp, u_n * dp]

    def pull(a: float) -> float:
        c, d, h, *_ = turning(a)
        return h + f_11 * d * d - 2 * f_12 * c * d + f_22 * c * c

    def excess(y: Array) -> float:
        return goal.excess(speed * y[5], state.p + impulse * y[4], state.W + work * y[6])

    def slope(y: Array) -> float:
        *_, rise = turning(y[0])
        return goal.slope(speed * y[5], inverse_mass * rise)

    def settled(y: Array) -> bool:
        _, _, h, g, _ = turning(y[0])
        return abs(g) <= tolerance * max(-h, pull(y[0])) or s_0 * math.exp(y[1]) <= -h * tolerance

    def zero(of: Callable[[Array], float], end: float) -> float:
        """About where a function is 0 in the last step, before ``end``."""
        between = solver.dense_output()
        tau: float = brentq(lambda tau: of(between(tau) if tau < solver.t else solver.y), solver.t_old, end)
        return tau

    def integrator(tau: float, y: Array, end: float, step: float | None = None) -> DOP853:
        return DOP853(rates, tau, y, end, rtol=tolerance / 10, atol=tolerance / 10, first_step=step)

    def state_at(y: Array) -> State:
        a, growth, P_1, P_2, p, u_n, W = y.tolist()
        for _ in range(NEWTON_STEPS):
            *_, g, _ = turning(a)
            if abs(g) <= tolerance * pull(a):
                a += g / pull(a)
        return state._replace(
            P=state.P + (t_1 * P_1 + t_2 * P_2 + n * p) * impulse,
            slip=direction(t_1, t_2, a) * (slip_speed * math.exp(growth)),
            u_n=speed * u_n,
            p=state.p + impulse * p,
            W=state.W + work * W,
            doubt=doubt,
            jammed=jammed,
        )

    doubt, jammed = state.doubt, state.jammed
    solver = integrator(0.0, np.array([0.0, 0.0, 0.0, 0.0, 0.0, state.u_n / speed, 0.0]), math.inf)
    for _ in range(STEP_BUDGET):
        *_, rise = turning(solver.y[0])
        jammed = jammed or rise < 0
        if settled(solver.y):
            return state_at(solver.y)
        rising = slope(solver.y) > 0
        solver.step()
        y, end = solver.y, solver.t
        if rising and slope(y) < 0:  # a crest: the goal may lie before it, or just not be reached
            end = zero(slope, end)
            y = solver.dense_output()(end)
            p = state.p + impulse * y[4]
            doubt = max(doubt, p * goal.doubt(p, path.steepest) / abs(excess(y)))
        if excess(y) >= 0:
            end = zero(excess, end)
            solver = integrator(solver.t_old, solver.y_old, end, (end - solver.t_old) or None)
            while solver.status == "running":
                solver.step()
            return state_at(solver.y)
    raise ImpactError(StatusCode.PATH_TOO_LONG, "contact", f"the slip still turns after {STEP_BUDGET} steps")
