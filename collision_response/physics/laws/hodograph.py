"""The curved part of Routh's path: slip that turns while it lasts.

With the angle ``a`` of the slip, its speed ``s``, and tangential axes 1 along the first slip and 2
across it, ``du/dp = K (n - mu t)`` reads

    ds/dp = h(a),    s da/dp = g(a),    h + i g = exp(-i a) ((K t~)_1 + i (K t~)_2),   t~ = n - mu t.

It is stiff where the slip stops, because it turns infinitely fast there. In the variable ``tau`` with
``dp = s dtau`` it is not; ``a`` then runs smoothly into a direction that the slip keeps:

    da/dtau = g,   d(ln s)/dtau = h,   dP_t/dtau = -mu s t,   dp/dtau = s,   dW/dtau = u_n s.

The integration ends at the goal of the phase, or as soon as the rest of the path is straight to the
tolerance: when the slip turns by less than that while it changes by a factor e, or is slower by that
factor than the impact. Speeds are in units of the approach's, masses in that of the effective mass.

Of SciPy's integrators the one of order 8 is used. On random boxes and rods at tolerance 1e-8 it took 12 ms
and was wrong by 1e-9; RK45 took 16 ms (4e-8), LSODA 10 ms (2e-6), Radau 370 ms (1e-7): it alone kept every
tolerance asked of it, from 1e-4 to 1e-11.

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
"""Steps of the integrator. The longest path of a million random ones took under a hundred."""


def slip_along_curve(path: Path, state: State, goal: Goal) -> tuple[State, bool]:
    """Follow slip that turns, to the goal or until it turns no more; whether it was the goal.

    Raises:
        ImpactError: PATH_TOO_LONG after ``STEP_BUDGET`` steps.
    """
    slip = path.across(state.u)
    s_0 = slip.norm()
    t_1 = slip / s_0
    t_2 = path.n.cross(t_1)
    K_1, K_2, K_n = path.K @ t_1, path.K @ t_2, path.K @ path.n
    inverse_mass = path.n.dot(K_n)
    unit = state.u.norm()
    k_11, k_12, k_22 = (k / inverse_mass for k in (t_1.dot(K_1), t_1.dot(K_2), t_2.dot(K_2)))
    k_1, k_2, mu = t_1.dot(K_n) / inverse_mass, t_2.dot(K_n) / inverse_mass, path.mu
    impulse, work = unit / inverse_mass, unit * unit / inverse_mass

    def turning(a: float) -> tuple[float, float, float, float]:
        c, d = math.cos(a), math.sin(a)
        along_1 = k_1 - mu * (k_11 * c + k_12 * d)
        along_2 = k_2 - mu * (k_12 * c + k_22 * d)
        return c, d, c * along_1 + d * along_2, c * along_2 - d * along_1

    def normal_velocity(y: Array) -> float:
        return float(state.u_n / unit + k_1 * y[2] + k_2 * y[3] + y[4])

    def rates(_: float, y: Array) -> list[float]:
        c, d, h, g = turning(y[0])
        s = math.exp(y[1])
        return [g, h, -mu * s * c, -mu * s * d, s, normal_velocity(y) * s]

    def excess(y: Array) -> float:
        p, W = state.p + impulse * y[4], state.W + work * y[5]
        return goal.excess(unit * normal_velocity(y), p, W)

    def settled(y: Array) -> bool:
        _, _, h, g = turning(y[0])
        return abs(g) <= path.tolerance * abs(h) or (h < 0 and math.exp(y[1]) <= path.tolerance)

    def state_at(y: Array) -> State:
        a, log_s, P_1, P_2, p, W = y.tolist()
        u_n = unit * normal_velocity(y)
        return state._replace(
            P=state.P + (t_1 * P_1 + t_2 * P_2 + path.n * p) * impulse,
            u=direction(t_1, t_2, a) * (unit * math.exp(log_s)) + path.n * u_n,
            u_n=u_n,
            p=state.p + impulse * p,
            W=state.W + work * W,
            jammed=jammed,
        )

    jammed = state.jammed
    start = np.array([0.0, math.log(s_0 / unit), 0.0, 0.0, 0.0, 0.0])
    if excess(start) >= 0:
        return state, True
    error = max(path.tolerance / 10, 1e-13)
    solver = DOP853(rates, 0.0, start, math.inf, rtol=error, atol=error)
    for _ in range(STEP_BUDGET):
        c, d, *_ = turning(solver.y[0])
        jammed = jammed or k_1 * -mu * c - mu * k_2 * d + 1 < 0
        if settled(solver.y):
            return state_at(solver.y), False
        solver.step()
        if excess(solver.y) >= 0:
            return state_at(_where(excess, solver)), True
    raise ImpactError(StatusCode.PATH_TOO_LONG, "contact", f"the slip still turns after {STEP_BUDGET} steps")


def _where(excess: Callable[[Array], float], solver: DOP853) -> Array:
    """The point of the last step where ``excess`` is 0."""
    between = solver.dense_output()
    tau = brentq(lambda tau: excess(between(tau)), solver.t_old, solver.t, xtol=1e-15, rtol=1e-14)
    return between(tau)
