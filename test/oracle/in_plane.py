"""The impulse of a planar impact in closed form: piecewise linear for Routh, a choice of three for Moreau.

``K`` is ``(K_tt, K_tn, K_nn)`` and ``u`` is ``(u_t, u_n)`` with ``u_n < 0``. All numbers are mpmath's, with
as many digits as the caller's context has. Each function returns ``(P_t, P_n)``.
"""

from mpmath import mp


def routh_in_plane(K, u, e, mu, stronge):
    """Routh's path. Friction keeps its direction until slip stops; ``u`` is linear in the normal impulse."""
    tt, tn, nn = K
    v, w = u
    p, P, W = mp.mpf(0), mp.mpf(0), mp.mpf(0)
    end_of_compression = None
    while True:
        holds = abs(tn) <= mu * tt
        rest = -tn / tt if holds else -mp.sign(tn) * mu
        f = -mp.sign(v) * mu if v != 0 else rest
        dv, dw = tt * f + tn, tn * f + nn
        stop = -v / dv if v * dv < 0 else mp.inf
        if end_of_compression is None:
            end = -w / dw if dw > 0 else mp.inf
        elif not stronge:
            end = (1 + e) * end_of_compression[0] - p
        else:  # w x + dw x^2 / 2 = missing
            missing = (1 - e * e) * end_of_compression[1] - W
            square = w * w + 2 * dw * missing
            both = w + mp.sqrt(square) if square >= 0 else mp.mpf(-1)
            end = mp.mpf(0) if missing <= 0 else 2 * missing / both if both > 0 else mp.inf
        x = min(stop, end)
        p, P, W = p + x, P + f * x, W + (w + dw * x / 2) * x
        v, w = (mp.mpf(0) if stop < end else v + dv * x), w + dw * x
        if end <= stop:
            if end_of_compression is not None:
                return P, p
            end_of_compression, w = (p, W), mp.mpf(0)


def coulomb_in_plane(K, u, e, mu):
    """Chatterjee and Ruina's law."""
    tt, tn, nn = K
    v, w = u
    det = tt * nn - tn * tn
    P_I = -w / nn
    D_t, D_n = -(nn * v - tn * w) / det, -(tt * w - tn * v) / det - P_I
    P_t, P_n = D_t, (1 + e) * P_I + D_n
    if abs(P_t) <= mu * P_n:
        return P_t, P_n
    kappa = mu * (1 + e) * P_I / (abs(D_t) - mu * D_n)
    return kappa * D_t, (1 + e) * P_I + kappa * D_n


def moreau_in_plane(K, u, e, mu):
    """Moreau's law before any fallback, and the energy it creates relative to its work."""
    tt, tn, nn = K
    v, w = u
    det, lost, rise = tt * nn - tn * tn, -v, -(1 + e) * w
    stuck = (nn * lost - tn * rise) / det, (tt * rise - tn * lost) / det
    found = [stuck] if abs(stuck[0]) <= mu * stuck[1] else []
    for sign in (1, -1) if not found else ():
        rate = nn - mu * sign * tn
        if rate > 0:
            P_n = rise / rate
            P_t = -mu * sign * P_n
            if (v + tt * P_t + tn * P_n) * sign >= 0:
                found.append((P_t, P_n))

    def energy(P):
        return P[0] * v + P[1] * w + (tt * P[0] ** 2 + 2 * tn * P[0] * P[1] + nn * P[1] ** 2) / 2

    P = min(found, key=energy)
    return P, energy(P) / (abs(P[0] * v) + abs(P[1] * w))
