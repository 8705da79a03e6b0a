"""A planar impact between springs (Stronge, Impact Mechanics, ch. 5) in arbitrary precision, phase by phase.

Within a phase the equations are linear: z' = M z for z = (u_t, u_n, F_t, F_n, P_t, P_n). z(t) is the series
of the matrix exponential, in steps that are short compared with the period of the fastest spring. A phase
ends when a linear form of z falls below 0. On a step that form is a polynomial, whose first root is found,
also if it only dips below 0 between two samples.

    u' = K F,  P' = F,  F_n' = -k u_n,  k = 1 in loading, 1/e^2 in unloading and up again to F_max
    stick   F_t' = -kappa u_t         until |F_t| > mu F_n
    slip    F_t' = -s mu F_n'         until s u_t + mu k u_n / kappa < 0, s the sign of the deflection

It uses neither the integrator nor the units nor the axes of the law that it checks.
"""

from mpmath import mp

U_T, U_N, F_T, F_N, P_T, P_N = range(6)
TERMS = 30
SAMPLES = 8


def springs(K, u, e, mu, kappa):
    """The impulse (P_t, P_n) for K = (K_tt, K_tn, K_nn) and u = (u_t, u_n), with u_n < 0."""
    Ktt, Ktn, Knn = map(mp.mpf, K)
    u_t, u_n = map(mp.mpf, u)
    e, mu, kappa = mp.mpf(e), mp.mpf(mu), mp.mpf(kappa)
    tiny = mp.mpf(10) ** (-mp.dps + 8) * (abs(u_t) + abs(u_n))
    sticks = mu > 0 and kappa * abs(u_t) <= mu * abs(u_n)
    s = mp.mpf(1 if u_t >= 0 else -1)
    k, most, loading = mp.mpf(1), mp.mpf(0), True
    z = [u_t, u_n] + [mp.mpf(0)] * 4
    fastest = mp.sqrt((Ktt + abs(Ktn)) * kappa + (Knn + abs(Ktn) * (1 + mu)) / (e or 1) ** 2)
    step = 1 / (4 * fastest)

    def rate(z):
        f_n = -k * z[U_N]
        f_t = -kappa * z[U_T] if sticks else -s * mu * f_n
        return [Ktt * z[F_T] + Ktn * z[F_N], Ktn * z[F_T] + Knn * z[F_N], f_t, f_n, z[F_T], z[F_N]]

    for _ in range(200000):
        series = [z]
        for j in range(1, TERMS):
            series.append([x / j for x in rate(series[-1])])
        normal = [({U_N: -1}, 0)] if loading else [({F_N: 1}, 0), ({F_N: -1}, most)]
        if sticks:
            friction = [({F_N: mu, F_T: -1}, 0), ({F_N: mu, F_T: 1}, 0)]
        else:
            friction = [({U_T: s, U_N: mu * k / kappa}, 0)] if mu else []
        ends = []
        for which, (weights, constant) in enumerate(normal + friction):
            values = [sum(w * c[i] for i, w in weights.items()) for c in series]
            values[0] += constant
            end = _first_below(values, step, tiny)
            if end is not None:
                ends.append((end, which))
        t, which = min(ends, default=(step, None))
        z = [_value([c[i] for c in series], t) for i in range(6)]
        if not sticks:
            z[F_T] = -s * mu * z[F_N]
        if which is None:
            continue
        if which >= len(normal):
            if sticks:
                s = mp.mpf(-1 if z[F_T] > 0 else 1)
            sticks = not sticks
        elif loading:
            if e == 0:
                return z[P_T], z[P_N]
            loading, most, k = False, z[F_N], 1 / e**2
        elif which == 0:
            return z[P_T], z[P_N]
        else:  # up again, past F_max
            loading, k = True, mp.mpf(1)
    raise ArithmeticError("no end")


def _value(polynomial, t):
    total = mp.mpf(0)
    for c in reversed(polynomial):
        total = total * t + c
    return total


def _first_below(p, end, tiny):
    """The first t in (0, end] at which the polynomial p falls below 0; None if it does not."""
    slope = [j * c for j, c in enumerate(p)][1:]
    low = mp.mpf(0)
    for i in range(1, SAMPLES + 1):
        high = end * i / SAMPLES
        if _value(p, high) >= -tiny:
            if not (_value(slope, low) < 0 < _value(slope, high)):
                low = high
                continue
            bottom = _root(lambda t: -_value(slope, t), low, high)
            if _value(p, bottom) >= -tiny:
                low = high
                continue
            high = bottom
        return _root(lambda t: _value(p, t), low, high)
    return None


def _root(f, low, high):
    """Where f falls through 0."""
    for _ in range(int(3.4 * mp.dps) + 8):
        middle = (low + high) / 2
        if f(middle) >= 0:
            low = middle
        else:
            high = middle
    return high
