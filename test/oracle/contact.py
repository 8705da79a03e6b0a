"""A contact in the axes (t1, t2, n), with tangential vectors as complex numbers.

U = s z is the slip, z = exp(i theta) its direction; b = K_tn; K_tt z = a z + d conj(z), where
a = (K11+K22)/2 and d = (K11-K22)/2 + i K12; k = K_nn. While friction opposes the slip,
du/dp = K (n - mu z), or in the polar coordinates of the slip

    ds/dp = r,   s dtheta/dp = w,   r + i w = b/z - mu a - mu d/z^2,
    du_n/dp = q = k - mu Re(conj(b) z).
"""

from mpmath import mp

from .matrices import GUARD, dot


class Contact:
    def __init__(self, K, mu, digits):
        self.K, self.mu, self.digits = K, mu, digits
        self.Ki = mp.inverse(K)
        self.b = mp.mpc(K[0, 2], K[1, 2])
        self.a, self.k = (K[0, 0] + K[1, 1]) / 2, K[2, 2]
        self.d = mp.mpc((K[0, 0] - K[1, 1]) / 2, K[0, 1])
        self.scale = abs(self.b) + mu * self.a
        self.hold = mp.mpc(*mp.lu_solve(K[:2, :2], K[:2, 2]))  # K_tt^-1 b
        self.schur = 1 / self.Ki[2, 2]
        self.none = mp.mpf(10) ** -(digits + GUARD // 3)  # relative size that counts as zero

    def rw(self, z):
        """r + i w"""
        return self.b / z - self.mu * (self.a + self.d / z**2)

    def q(self, z):
        return self.k - self.mu * mp.re(mp.conj(self.b) * z)

    def push(self, z):
        return mp.matrix([-self.mu * z.real, -self.mu * z.imag, 1])

    def energy(self, P, u):
        return dot(P, u) + dot(P, self.K * P) / 2

    def in_cone(self, P):
        return mp.hypot(P[0], P[1]) <= self.mu * P[2] * (1 + self.none)


def roots(c):
    """Roots of c0 z^4 + ... + c4, where |c_j| = |c_(4-j)|, except those at 0 and infinity."""
    tiny = mp.mpf(10) ** -(mp.dps - GUARD // 3) * max(map(abs, c))
    while c and abs(c[0]) <= tiny:
        c = c[1:-1]
    if len(c) < 2:
        return []
    companion = mp.zeros(len(c) - 1)
    companion[1:, :-1] = mp.eye(len(c) - 2)
    companion[0, :] = mp.matrix([[-x / c[0] for x in c[1:]]])
    return mp.eig(companion, left=False, right=False)


def on_circle(z, digits):
    return abs(abs(z) - 1) < mp.mpf(10) ** (-digits // 3)  # a double root keeps half the digits
