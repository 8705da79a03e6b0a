"""An impact in space between springs (Stronge, Impact Mechanics, ch. 5), by SciPy, from event to event.

The state is P, F_n, and the tangential force while the contact sticks, or the angle theta of the spring's
deflection while it slips:

    u = u_0 + K P,  P' = F,  F_n' = -k u_n,  stick F_t' = -kappa u_t,  slip theta' = kappa q.u_t / (mu F_n)

theta changes fast at first, so slip is integrated from the time EARLY on, after the first term of theta.
"""

import math

import numpy as np
from scipy.integrate import solve_ivp

EARLY = 1e-4
LAST = 1e-9  # of the greatest normal force: the rest has 1e-18 of the impulse


def springs_in_space(K, u, e, mu, kappa, *, stiff=False):
    """The impulse P, for a normal along z, mu > 0 and e > 0.

    It is right to 1e-13, or to 1e-10 by a method for stiff equations, as those of little friction are.
    """
    K, u_0 = np.array(K, float), np.array(u, float)
    k, most, loading = 1.0, 0.0, True
    slip, speed = math.hypot(*u_0[:2]), -u_0[2]
    sticks = kappa * slip <= mu * speed
    y = np.zeros(6)
    if not sticks:
        angle = math.atan2(u_0[1], u_0[0])
        a, q = _axes(angle)
        turn = kappa * speed * q @ (K[:2, 2] - mu * K[:2, :2] @ a) / (4 * mu * speed + 2 * kappa * slip)
        P_n = speed * EARLY**2 / 2
        y = np.array([*(-mu * P_n * a), P_n, speed * EARLY, angle + turn * EARLY**2])

    def velocity(y):
        return u_0 + K @ y[:3]

    def stick(_, y):
        v = velocity(y)
        return [y[4], y[5], y[3], -k * v[2], -kappa * v[0], -kappa * v[1]]

    def slide(_, y):
        v, (a, q) = velocity(y), _axes(y[4])
        return [*(-mu * y[3] * a), y[3], -k * v[2], kappa * (q @ v[:2]) / (mu * y[3])]

    def slips_on(_, y):
        v = velocity(y)
        return _axes(y[4])[0] @ v[:2] + mu * k * v[2] / kappa

    def above_rest(_, y):
        return y[3] - LAST * most

    def below_most(_, y):
        return most - y[3]

    for _ in range(200):
        events = [(lambda _, y: mu * y[3] - math.hypot(y[4], y[5])) if sticks else slips_on]
        events += [lambda _, y: -velocity(y)[2]] if loading else [above_rest, below_most]
        for event in events:
            event.terminal, event.direction = True, -1
        way = solve_ivp(
            stick if sticks else slide,
            (0, 1e3),
            y,
            "Radau" if stiff else "DOP853",
            events=events,
            max_step=0.05,
            rtol=1e-11 if stiff else 3e-14,
            atol=1e-14 if stiff else 1e-17,
        )
        y = way.y[:, -1]
        which = next(i for i, times in enumerate(way.t_events) if len(times))
        if which == 0:
            sticks = not sticks
            tangential = -mu * y[3] * _axes(y[4])[0] if sticks else [math.atan2(-y[5], -y[4])]
            y = np.array([*y[:4], *tangential])
        elif loading:
            loading, most, k = False, y[3], 1 / e**2
        elif which == 1:
            return y[:3]
        else:
            loading, k = True, 1.0
    raise ArithmeticError("no end")


def _axes(angle):
    """The unit vector at an angle, and the one perpendicular to it."""
    c, s = math.cos(angle), math.sin(angle)
    return np.array([c, s]), np.array([-s, c])
