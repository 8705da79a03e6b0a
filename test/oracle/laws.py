"""Impulse of one impact between two rigid bodies, by five laws, in mpmath.

A and B touch at a point; n points from B to A; r = point - CoM; u is the velocity of A
relative to B there, so u_n < 0 approaches. An impulse P on A, -P on B, gives

    u+ = u + K P,   K = sum over A, B of  1/m - [r]x I^-1 [r]x      (3x3, positive definite)

Below, K and u are in axes (t1, t2, n) and tangential vectors are complex numbers:
U = s z the slip, z = exp(i theta) its direction; b = K_tn; K_tt z = a z + d conj(z), where
a = (K11+K22)/2 and d = (K11-K22)/2 + i K12; k = K_nn.

ROUTH'S PATH (Routh 1860, 1905; Keller 1986). The normal impulse p grows from 0 and friction
opposes the slip of the moment: du/dp = K (n - mu z). In the polar coordinates of the slip,

    ds/dp = r,   s dtheta/dp = w,   r + i w = b/z - mu a - mu d/z^2,
    du_n/dp = q = k - mu Re(conj(b) z).

r, w, q depend on theta alone, hence d(ln s)/dtheta = r/w (Batlle 1996). The roots z_j of

    2i w z^2 = mu conj(d) z^4 - conj(b) z^3 + b z - mu d

are the directions along which slip goes straight. w has mean zero, so at least two of the
theta_j are real, and theta turns monotonically from one real root towards the next.
w is a constant times prod_j sin((theta-theta_j)/2); r/w has the poles theta_j, and tends to
+i, -i at the two imaginary infinities, so its partial fractions have no constant term:

    R_j = sin((theta-theta_j)/2) / sin((theta_0-theta_j)/2),   A_j = r(theta_j) / w'(theta_j)
    s = s_0 prod_j R_j^A_j,     p = integral of s/w = (s_0/w_0) integral of prod_j R_j^(A_j-1).

The logarithmic place v of theta between the root it leaves and the root it nears is the
variable of the quadrature: the integrand is smooth in it at both ends. u_n and the normal
work W need little more:

    u_n = u_n0 + Re(conj(K_tt^-1 b) (U - U_0)) + (k - K_nt K_tt^-1 K_tn) p
    W = integral of u_n dp = [u K^-1 u]/2 + mu integral of s dp.

Slip that nears a root with r < 0 stops at a finite p. It then sticks if the impulse that
holds it, n - K_tt^-1 K_tn, lies in the cone. If not, it resumes along the one direction with
w = 0 and r = g > 0: z = (g + mu K_tt)^-1 b, and |z| = 1 has one root g, for |z| falls with g
and exceeds 1 at g = 0. Both ways are straight, and u_n grows on both (on the second,
q = f.Kf + mu g with f = n - mu z). An impact without initial slip starts there.

Compression ends at the first p with u_n = 0, p_c, with the work W_c < 0. The end of the
impact: Poisson, p = (1+e) p_c; Stronge (1990), the first p with W = (1-e^2) W_c.

    Jam (Painleve): q < 0 somewhere in compression, so u_n falls first. dE/dp = u_n - mu s < 0
    bounds u, so that compression ends all the same; p_c and W_c keep their definitions, W_c
    being the work of the whole compression. Reported as `jam`.
    Slip that turns can make u_n fall in restitution. The definitions are applied to the
    letter and `falls_again` reports it. Stronge's end still has u_n >= 0; Poisson's need not.

THE ALGEBRAIC LAWS. Chatterjee & Ruina (1998): P = (1+e) P_I + c (P_II - P_I) with
P_I = -n u_n/k, P_II = -K^-1 u, and c = 1+e_t, or what puts P on the cone. Moreau, in one step:
u_n+ = -e u_n and either u_t+ = 0 with P in the cone, or P = p (n - mu z) with p > 0 and z the
direction of u_t+. With p = N/q, N = -(1+e) u_n, these z are the unit roots of a quartic,
Im(U/z) q + N w = 0, with q > 0 and Re((U + p h)/z) >= 0, h = z (r + i w).

Moreau's problem has a solution, but for strong friction not always one. Every one is in
`candidates`. Chosen: sticking if it is there, else the least kinetic energy afterwards.
"""
from dataclasses import dataclass, field
from fractions import Fraction
from typing import NamedTuple

from mpmath import mp

LAWS = ("frictionless", "chatterjee_ruina", "moreau", "routh_poisson", "routh_stronge")

GUARD = 30  # extra working digits: K^-1 and the exponents A_j may each cost a dozen
RANK = 1e-13  # a principal moment this small against the largest is a double's zero


class Body(NamedTuple):
    """mass None: immovable. inertia about the CoM in body axes; a zero moment means that
    the body cannot be turned about that axis (ideal rod, point). quaternion (x, y, z, w), of
    any length, takes body axes to world axes; vectors in world axes."""
    mass: object
    inertia: object
    quaternion: object = (0, 0, 0, 1)
    position: object = (0, 0, 0)
    velocity: object = (0, 0, 0)
    angular_velocity: object = (0, 0, 0)


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


class Outcome(NamedTuple):
    impulse: object
    report: Report
    velocity_a: object
    angular_velocity_a: object
    velocity_b: object
    angular_velocity_b: object


# ---- from bodies to K and u

def _num(x):
    if isinstance(x, Fraction):
        return mp.mpf(x.numerator) / x.denominator
    return mp.mpf(x)


def _vec(x):
    return mp.matrix([_num(c) for c in x])


def _mat(x):
    return x.copy() if isinstance(x, mp.matrix) else mp.matrix([[_num(c) for c in row] for row in x])


def _dot(x, y):
    return mp.fdot(zip(x, y))


def _skew(r):
    return mp.matrix([[0, -r[2], r[1]], [r[2], 0, -r[0]], [-r[1], r[0], 0]])


def _rotation(quaternion):
    q = _vec(quaternion)
    q /= mp.norm(q)
    S = _skew(q[:3])
    return mp.eye(3) + 2 * q[3] * S + 2 * S * S


def _inverse_inertia(body):
    if body.mass is None:
        return mp.zeros(3)
    R = _rotation(body.quaternion)
    world = R * _mat(body.inertia) * R.T
    moments, axes = mp.eigsy(world)
    if min(moments) > RANK * max(moments):
        return mp.inverse(world)
    inverse = [1 / m if m > RANK * max(moments) else 0 for m in moments]
    return axes * mp.diag(inverse) * axes.T


def _mobility(a, b, point):
    K = mp.zeros(3)
    for body in (a, b):
        if body.mass is not None:
            r = _skew(_vec(point) - _vec(body.position))
            K += mp.eye(3) / _num(body.mass) - r * _inverse_inertia(body) * r
    return K


def _point_velocity(body, point):
    r = _vec(point) - _vec(body.position)
    return _vec(body.velocity) + _skew(_vec(body.angular_velocity)) * r


def mobility(a, b, point, digits=50):
    with mp.workdps(digits + GUARD):
        return _mobility(a, b, point)


def relative_velocity(a, b, point, digits=50):
    with mp.workdps(digits + GUARD):
        return _point_velocity(a, point) - _point_velocity(b, point)


# ---- the contact in axes (t1, t2, n)

class _Contact:
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
        return self.b / z - self.mu * (self.a + self.d / z ** 2)

    def q(self, z):
        return self.k - self.mu * mp.re(mp.conj(self.b) * z)

    def push(self, z):
        return mp.matrix([-self.mu * z.real, -self.mu * z.imag, 1])

    def energy(self, P, u):
        return _dot(P, u) + _dot(P, self.K * P) / 2

    def in_cone(self, P):
        return mp.hypot(P[0], P[1]) <= self.mu * P[2] * (1 + self.none)


def _roots(c):
    """Roots of c0 z^4 + ... + c4 with conj(c_j) = -c_(4-j); ends that vanish are dropped."""
    tiny = mp.mpf(10) ** -(mp.dps - GUARD // 3) * max(map(abs, c))
    while c and abs(c[0]) <= tiny:
        c = c[1:-1]
    return mp.polyroots(c, maxsteps=1000, extraprec=2 * mp.prec) if len(c) > 1 else []


def _on_circle(z, digits):
    return abs(abs(z) - 1) < mp.mpf(10) ** (-digits // 3)  # a double root keeps half the digits


# ---- the algebraic laws

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
    for z in _roots(half + middle + [-mp.conj(c) for c in reversed(half)]):
        if _on_circle(z, con.digits):
            z /= abs(z)
            if con.q(z) > 0:
                P = N / con.q(z) * con.push(z)
                if mp.re((U + P[2] * z * con.rw(z)) / z) >= 0:
                    found.append(("slide", P, con.energy(P, u)))
    found.sort(key=lambda f: (f[0] == "slide", f[2]))
    return found


# ---- Routh's path: segments with at(x) = (p, u, W) since their start, x from x0 to x1

class _Straight:
    """Constant push f; x is p."""
    cuts = ()
    far = mp.inf

    def __init__(self, con, u, f, x1=mp.inf):
        self.u, self.c, self.x0, self.x1 = u, con.K * f, mp.mpf(0), x1
        self.step = mp.norm(u) / mp.norm(self.c)
        self.stops = x1 < mp.inf

    def at(self, p):
        return p, self.u + p * self.c, p * (self.u[2] + p * self.c[2] / 2)

    def rates(self, p):
        return mp.mpf(1), self.c[2]


class _Turning:
    """Slip that changes direction; x is v, and the angle is measured from theta_0, turnwise."""
    step = mp.mpf(1)

    def __init__(self, con, u):
        self.con, self.u = con, u
        U = mp.mpc(u[0], u[1])
        self.s0, self.z0 = abs(U), U / abs(U)
        w0 = con.rw(self.z0).imag
        self.turn, self.p_unit = mp.sign(w0), self.s0 / abs(w0)
        mu, b, d = con.mu, con.b, con.d
        quartic = [mu * mp.conj(d), -mp.conj(b), 0, b, -mu * d]
        real, self.factors = [], []
        for z in _roots(quartic):
            slope = (-b / z + 2 * mu * d / z ** 2 - mp.conj(b) * z + 2 * mu * mp.conj(d) * z ** 2) / 2
            if abs(slope) < con.scale * mp.mpf(10) ** (-con.digits // 3):
                raise ArithmeticError("two directions of straight slip coincide")
            r = (con.rw(z) + mp.conj(con.rw(1 / mp.conj(z)))) / 2
            angle = -self.turn * mp.j * mp.log(z / self.z0)
            if _on_circle(z, con.digits):
                real.append((angle.real % (2 * mp.pi), mp.re(r / slope)))
            else:
                self.factors.append((angle, r / slope))
        real.sort()
        (self.target, self.a_target), (self.origin, self.a_origin) = real[0], real[-1]
        self.origin -= 2 * mp.pi
        self.span = self.target - self.origin
        self.factors += real[1:-1]
        self.x0, self.x1 = mp.log(-self.origin / self.target), mp.inf
        self.stops = self.a_target > 0
        self.far = self.x0 + mp.log(10) * con.digits / self.a_target if self.stops else mp.inf
        self.known = {self.x0: mp.mpc(0)}
        self.cuts = []
        if mu * abs(b) > con.k:
            for side in (1, -1):
                z = b / abs(b) * mp.expj(side * mp.acos(con.k / (mu * abs(b))))
                angle = self.turn * mp.arg(z / self.z0) % (2 * mp.pi)
                if angle < self.target:
                    self.cuts.append(mp.log((angle - self.origin) / (self.target - angle)))
            self.cuts.sort()

    def _place(self, v):
        """s/s_0, z, d(p)/dv"""
        before, after = self.span / (1 + mp.exp(-v)), self.span / (1 + mp.exp(v))
        angle = self.target - after
        pairs = [(mp.sin(after / 2) / mp.sin(self.target / 2), self.a_target),
                 (mp.sin(before / 2) / mp.sin(-self.origin / 2), self.a_origin)]
        pairs += [(mp.sin((angle - x) / 2) / mp.sin(-x / 2), A) for x, A in self.factors]
        logs = [(mp.log(R), A) for R, A in pairs]
        s = mp.exp(mp.re(sum(A * L for L, A in logs)))
        w = mp.exp(mp.re(sum(L for L, A in logs)))
        z = self.z0 * mp.expj(self.turn * angle)
        return s, z, self.p_unit * s / w * before * after / self.span

    def _flow(self, v):
        """d(p + i D)/dv, with D the integral of s/s_0 dp"""
        s, _, dp = self._place(v)
        return mp.mpc(dp, dp * s)

    def _sum(self, v):
        if v not in self.known:
            if v == mp.inf:
                start = max(self.x0, mp.mpf(1))
                tail = lambda y: self._flow(start - mp.log(y) / self.a_target) / (y * self.a_target)
                self.known[v] = self._sum(start) + mp.quad(tail, [0, 1])
            else:
                near = min((x for x in self.known if x < mp.inf), key=lambda x: abs(x - v))
                chunks = mp.linspace(near, v, int(mp.ceil(abs(v - near) / 2)) + 1)
                rest = mp.quad(self._flow, chunks, method="gauss-legendre") if v != near else 0
                self.known[v] = self.known[near] + rest
        return self.known[v]

    def at(self, v):
        if v == mp.inf and not self.stops:
            return v, mp.matrix([mp.nan, mp.nan, v]), v
        con, total = self.con, self._sum(v)
        p, D = total.real, total.imag
        U0 = self.s0 * self.z0
        s, z, _ = self._place(v) if v < mp.inf else (mp.mpf(0), self.z0, None)
        U = self.s0 * s * z
        u = mp.matrix([U.real, U.imag, self.u[2] + mp.re(mp.conj(con.hold) * (U - U0)) + con.schur * p])
        W = con.energy(con.Ki * (u - self.u), self.u) + con.mu * self.s0 * D
        return p, u, W

    def rates(self, v):
        _, z, dp = self._place(v)
        return dp, dp * self.con.q(z)


def _slip(con, u):
    U = mp.mpc(u[0], u[1])
    if con.mu == 0:
        return _Straight(con, u, mp.matrix([0, 0, 1]))
    z = U / abs(U)
    rw = con.rw(z)
    if abs(rw.imag) > con.none * con.scale:
        return _Turning(con, u)
    return _Straight(con, u, con.push(z), -abs(U) / rw.real if rw.real < 0 else mp.inf)


def _after_stop(con, u):
    if abs(con.hold) <= con.mu * (1 + con.none):
        return "sticks", _Straight(con, u, mp.matrix([-con.hold.real, -con.hold.imag, 1]))
    Ktt, b = con.K[:2, :2], con.K[:2, 2]
    along = lambda g: mp.lu_solve(g * mp.eye(2) + con.mu * Ktt, b)
    g = mp.findroot(lambda g: mp.norm(along(g)) - 1, (0, abs(con.b)), solver="anderson")
    return "slips on", _Straight(con, u, con.push(mp.mpc(*along(g))))


def _solve(seg, value, slope, lo, hi):
    """The x in [lo, hi] with value = 0; value < 0 at lo, >= 0 at hi, and rises."""
    if hi == mp.inf:
        step, hi = seg.step, lo + seg.step
        while value(hi) < 0:
            if hi > seg.far:
                return seg.x1
            step *= 2
            lo, hi = hi, hi + step
    x = (lo + hi) / 2
    for _ in range(10 * mp.prec):
        y, dy = value(x), slope(x)
        lo, hi = (x, hi) if y < 0 else (lo, x)
        new = x - y / dy if dy else lo
        new = new if lo < new < hi else (lo + hi) / 2
        if abs(new - x) <= mp.mpf(10) ** -(mp.dps - GUARD // 3) * (abs(x) + seg.step):
            return new
        x = new
    raise ArithmeticError("no root found")


def _pieces(seg):
    """(lo, hi, u_n(lo), u_n(hi)): between them u_n is monotone and keeps one sign."""
    lo = seg.x0
    for hi in (*seg.cuts, seg.x1):
        a, b = seg.at(lo)[1][2], seg.at(hi)[1][2]
        if a < 0 < b or b < 0 < a:
            sign = mp.sign(b)
            zero = _solve(seg, lambda x: sign * seg.at(x)[1][2],
                          lambda x: sign * seg.rates(x)[1], lo, hi)
            yield lo, zero, a, mp.mpf(0)
            lo, a = zero, mp.mpf(0)
        yield lo, hi, a, b
        lo = hi


def _routh(con, u, e, stronge, report):
    p0 = W0 = mp.mpf(0)
    p_c = W_c = None
    now = u
    seg = _slip(con, u) if mp.hypot(u[0], u[1]) > con.none * mp.norm(u) else None
    while True:
        if seg is None:
            what, seg = _after_stop(con, now)
            report.events.append((what, p0))

        def done(x):
            p, _, W = seg.at(x)
            return W0 + W - (1 - e * e) * W_c if stronge else p0 + p - (1 + e) * p_c

        def pace(x):
            dp = seg.rates(x)[0]
            return seg.at(x)[1][2] * dp if stronge else dp

        for lo, hi, a, b in _pieces(seg):
            end = None
            if p_c is None:
                report.jam |= bool(b < a)
                if b == 0:
                    p, _, W = seg.at(hi)
                    p_c, W_c = p0 + p, W0 + W
                    report.events.append(("end of compression", p_c))
                    end = hi if e == 0 else None
            else:
                report.falls_again |= bool(b < a)
                if done(hi) >= 0:
                    end = _solve(seg, done, pace, lo, hi)
            if end is not None:
                p, now, _ = seg.at(end)
                report.events.append(("end", p0 + p))
                return con.Ki * (now - u)
        p, now, W = seg.at(seg.x1)
        p0, W0, seg = p0 + p, W0 + W, None
        report.events.append(("slip stops", p0))


# ---- the laws together

def _impulse(law, K, u, n, e, mu, e_t, digits):
    if law not in LAWS:
        raise ValueError(f"law must be one of {LAWS}")
    K, u, n, e, mu, e_t = _mat(K), _vec(u), _vec(n), _num(e), _num(mu), _num(e_t)
    n /= mp.norm(n)
    side = min(range(3), key=lambda i: abs(n[i]))
    t1 = _skew(n) * mp.matrix([int(i == side) for i in range(3)])
    t1 /= mp.norm(t1)
    T = mp.matrix([list(t1), list(_skew(n) * t1), list(n)])
    report = Report("separating", _dot(u, n), _dot(u, n), mp.mpf(0))
    if report.un_before >= 0:
        return mp.zeros(3, 1), report
    con, v = _Contact(T * K * T.T, mu, digits), T * u
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
        P = _routh(con, v, e, law == "routh_stronge", report)
    report.un_after = v[2] + (con.K * P)[2]
    report.energy = con.energy(P, v)
    return T.T * P, report


def impulse(law, K, u, n, e, mu, e_t=0, digits=50):
    """(impulse on A, Report); K, u, n in any common axes, n of any length from B to A."""
    with mp.workdps(digits + GUARD):
        return _impulse(law, K, u, n, e, mu, e_t, digits)


def impact(a, b, point, normal, e, mu, law, e_t=0, digits=50):
    with mp.workdps(digits + GUARD):
        u = _point_velocity(a, point) - _point_velocity(b, point)
        P, report = _impulse(law, _mobility(a, b, point), u, normal, e, mu, e_t, digits)
        after = []
        for body, J in ((a, P), (b, -P)):
            v, omega = _vec(body.velocity), _vec(body.angular_velocity)
            if body.mass is not None:
                r = _vec(point) - _vec(body.position)
                v += J / _num(body.mass)
                omega += _inverse_inertia(body) * (_skew(r) * J)
            after += [v, omega]
        return Outcome(P, report, *after)
