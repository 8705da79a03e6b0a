"""The impulse of one impact by five laws, in the letters of contact.py.

Chatterjee & Ruina (1998): P = (1+e) P_I + c (P_II - P_I) with
P_I = -n u_n/k, P_II = -K^-1 u, and c = 1+e_t, or the c that puts P on the cone. Moreau, in one step:
u_n+ = -e u_n and either u_t+ = 0 with P in the cone, or P = p (n - mu z) with p > 0 and z the
direction of u_t+. With p = N/q, N = -(1+e) u_n, these z are the unit roots of a quartic,
Im(U/z) q + N w = 0, with q > 0 and Re((U + p h)/z) >= 0, h = z (r + i w).

Moreau's problem always has a solution, but it may have three: besides sticking there can be two ways
to slide if K is very anisotropic and mu of order 1. All are in `candidates`. The impulse returned is
that of sticking if it is among them, else the one that leaves the least kinetic energy.
"""

from dataclasses import dataclass, field

from mpmath import mp

from .contact import Contact, on_circle, roots
from .matrices import GUARD, dot, mat, num, skew, vec
from .routh import routh

LAWS = ("frictionless", "chatterjee_ruina", "moreau", "routh_poisson", "routh_stronge")


@dataclass
class Report:
    regime: str  # separating, frictionless, stick, slide, path
    un_before: object
    un_after: object
    energy: object  # change of kinetic energy
    events: list = field(default_factory=list)  # of the path: (what, normal impulse so far)
    jam: bool = False
    falls_again: bool = False
    candidates: list = field(default_factory=list)  # Moreau: (regime, impulse, energy)


def _chatterjee_ruina(con, u, e, e_t):
    P1 = mp.matrix([0, 0, -u[2] / con.k])
    step = -con.Ki * u - P1
    P = (1 + e) * P1 + (1 + e_t) * step
    if con.in_cone(P):
        return P, "stick"
    c = con.mu * (1 + e) * P1[2] / (mp.hypot(step[0], step[1]) - con.mu * step[2])
    return (1 + e) * P1 + c * step, "slide"


def _moreau(con, u, e):
    found = []
    P = con.Ki * (mp.matrix([0, 0, -e * u[2]]) - u)
    if con.in_cone(P):
        found.append(("stick", P, con.energy(P, u)))
    U, N, mu, b, d, k = mp.mpc(u[0], u[1]), -(1 + e) * u[2], con.mu, con.b, con.d, con.k
    half = [mu * (mp.conj(U * b) / 2 + N * mp.conj(d)), -mp.conj(k * U + N * b)]
    middle = [mp.mpc(0, -mu * mp.im(U * mp.conj(b)))]
    for z in roots(half + middle + [-mp.conj(c) for c in reversed(half)]):
        if on_circle(z, con.digits):
            z /= abs(z)
            if con.q(z) > 0:
                P = N / con.q(z) * con.push(z)
                if mp.re((U + P[2] * z * con.rw(z)) / z) >= 0:
                    found.append(("slide", P, con.energy(P, u)))
    found.sort(key=lambda f: (f[0] == "slide", f[2]))
    return found


def _impulse(law, K, u, n, e, mu, e_t, digits):
    if law not in LAWS:
        raise ValueError(f"law must be one of {LAWS}")
    K, u, n, e, mu, e_t = mat(K), vec(u), vec(n), num(e), num(mu), num(e_t)
    n /= mp.norm(n)
    side = min(range(3), key=lambda i: abs(n[i]))
    t1 = skew(n) * mp.matrix([int(i == side) for i in range(3)])
    t1 /= mp.norm(t1)
    T = mp.matrix([list(t1), list(skew(n) * t1), list(n)])
    report = Report("separating", dot(u, n), dot(u, n), mp.mpf(0))
    if report.un_before >= 0:
        return mp.zeros(3, 1), report
    con, v = Contact(T * K * T.T, mu, digits), T * u
    if law == "frictionless":
        P, report.regime = mp.matrix([0, 0, -(1 + e) * v[2] / con.k]), law
    elif law == "chatterjee_ruina":
        P, report.regime = _chatterjee_ruina(con, v, e, e_t)
    elif law == "moreau":
        found = _moreau(con, v, e)
        if not found:
            raise ArithmeticError("no root of Moreau's problem found")
        report.candidates = [(regime, T.T * P, energy) for regime, P, energy in found]
        report.regime, P, _ = found[0]
    else:
        report.regime = "path"
        P, report.events, report.jam, report.falls_again = routh(con, v, e, law == "routh_stronge")
    report.un_after = v[2] + (con.K * P)[2]
    report.energy = con.energy(P, v)
    return T.T * P, report


def impulse(law, K, u, n, e, mu, e_t=0, digits=50):
    """(impulse on A, Report); K, u, n in any common axes, n of any length from B to A."""
    with mp.workdps(digits + GUARD):
        return _impulse(law, K, u, n, e, mu, e_t, digits)
