"""Routh's path with friction that depends on the slip speed, by SciPy's integrator for stiff systems.

The normal is z. Slip has the angle a and the logarithm l of its speed s; the impulse grows by dp = s dT:

    f = b - mu A t      da/dT = q.f      dl/dT = t.f      du_n/dT = s (k - mu b.t)      dP/dT = s (-mu t, 1)

Where slip stops, the contact sticks to the end if mu(0) can hold it. Otherwise slip goes on in the direction
in which it grows straight, a root of q.f.
"""

from itertools import pairwise

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

LEAST = -34.0
"""Logarithm of the slip that counts as 0, relative to the approach speed."""


def _directions(mu, A, b):
    """Angles of the directions in which slip grows straight from rest, with the friction mu."""

    def across(a):
        return (b - mu * A @ (np.cos(a), np.sin(a))) @ (-np.sin(a), np.cos(a))

    grid = np.linspace(0, 2 * np.pi, 721) + 1e-3
    roots = [brentq(across, x, y, xtol=1e-15) for x, y in pairwise(grid) if across(x) * across(y) <= 0]
    grows = [(b - mu * A @ (np.cos(a), np.sin(a))) @ (np.cos(a), np.sin(a)) for a in roots]
    return [a for a, g in zip(roots, grows, strict=True) if g > 0]


def routh_by_speed(K, u, e, mu, energetic, tolerance=1e-11):
    """Impulse, work of friction and velocity after; ``mu`` is a function of the slip speed.

    Without ``energetic``, restitution of impulse ends where it would create energy.
    """
    K, u = np.array(K, float), np.array(u, float)
    A, b, k = K[:2, :2], K[:2, 2], K[2, 2]
    approach = -u[2]
    p = W = heat = 0.0
    P, compression = np.zeros(2), None
    slip = np.hypot(u[0], u[1])
    state = [np.arctan2(u[1], u[0]), np.log(slip)] if slip > 0 else None

    def left(y):
        """What the phase lacks after p, W and u_n: 0 at its end."""
        if compression is None:
            return -y[2]
        p_c, W_c = compression
        return -e * e * W_c - (y[1] - W_c) if energetic else min((1 + e) * p_c - y[0], y[-1] - y[1])

    def rates(_, y):
        a, log_s = y[:2]
        s = np.exp(log_s)
        t, q = np.array([np.cos(a), np.sin(a)]), np.array([-np.sin(a), np.cos(a)])
        m = mu(s)
        f = b - m * A @ t
        return [q @ f, t @ f, s, s * y[4], s * (k - m * b @ t), -s * m * t[0], -s * m * t[1], s * s * m]

    while True:
        if state is None:  # at rest
            held = np.linalg.solve(A, b)
            if np.hypot(*held) <= mu(0.0):
                rate = k - b @ held
                for _ in range(2):
                    if compression is None:
                        way = -u[2] / rate
                    elif energetic:
                        missing = left((p, W, u[2], heat))
                        way = (np.sqrt(u[2] ** 2 + 2 * rate * missing) - u[2]) / rate
                    else:
                        to_all_energy = (np.sqrt(u[2] ** 2 + 2 * rate * (heat - W)) - u[2]) / rate
                        way = min((1 + e) * compression[0] - p, to_all_energy)
                    W += way * (u[2] + rate * way / 2)
                    p, P, u[2] = p + way, P - way * held, u[2] + rate * way
                    if compression is not None:
                        break
                    compression = p, W
                return np.array([*P, p]), heat, np.array([0.0, 0.0, u[2]])
            (angle,) = _directions(mu(0.0), A, b)
            state = [angle, LEAST + np.log(approach)]

        def stops(_, y):
            return y[1] - LEAST - np.log(approach) + 1e-3

        def ends(_, y):
            return left([*y[2:5], y[7]])

        stops.terminal, stops.direction, ends.terminal, ends.direction = True, -1, True, -1
        run = solve_ivp(
            rates, (0, 1e9), [*state, p, W, u[2], *P, heat], method="LSODA",
            rtol=tolerance, atol=[tolerance, tolerance, *[tolerance * 1e-2] * 6], events=[stops, ends],
        )  # fmt: skip
        assert run.status == 1, run.message
        y = run.y[:, -1]
        a, s = y[0], np.exp(y[1])
        p, W, u[2], P, heat = y[2], y[3], y[4], y[5:7], y[7]
        u[:2] = s * np.cos(a), s * np.sin(a)
        if run.t_events[0].size:
            state = None
            continue
        state = [a, y[1]]
        if compression is not None:
            return np.array([*P, p]), heat, u
        compression = p, W
        u[2] = 0.0
        if e == 0:
            return np.array([*P, p]), heat, u
