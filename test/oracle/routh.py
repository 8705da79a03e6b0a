"""Routh's path of an impact (Routh 1860, 1905; Keller 1986), in the letters of contact.py.

The normal impulse p grows from 0 and friction opposes the slip of the moment. r, w, q depend
on theta alone, hence d(ln s)/dtheta = r/w (Batlle 1996). The roots z_j of

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
    Slip that turns can make u_n fall in restitution too. The definitions are applied to the
    letter and `falls_again` reports it. Stronge's end has u_n >= 0 even so, since dW/dp = u_n
    there; nothing keeps Poisson's so.
"""

from mpmath import mp

from .contact import on_circle, roots
from .matrices import GUARD


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

    def stride(self, p):
        return mp.inf


class _Turning:
    """Slip that changes direction; x is v from its start v0, the angle theta from theta_0, turnwise.

    The exponents are huge where slip hardly turns (a sphere, nearly): R_j is taken with as many
    more digits.
    """

    def __init__(self, con, u):
        self.con, self.u = con, u
        U = mp.mpc(u[0], u[1])
        self.s0, self.z0 = abs(U), U / abs(U)
        w0 = con.rw(self.z0).imag
        self.turn, self.w0 = mp.sign(w0), abs(w0)
        mu, b, d = con.mu, con.b, con.d
        quartic = [mu * mp.conj(d), -mp.conj(b), 0, b, -mu * d]
        real, self.factors = [], []
        for z in roots(quartic):
            dw = mu * (d / z**2 + mp.conj(d) * z**2) - (b / z + mp.conj(b) * z) / 2
            if abs(dw) < (abs(b) + mu * abs(d)) * mp.mpf(10) ** (-con.digits // 3):
                raise ArithmeticError("two directions of straight slip coincide")
            r = (con.rw(z) + mp.conj(con.rw(1 / mp.conj(z)))) / 2
            angle = -self.turn * mp.j * mp.log(z / self.z0)
            if on_circle(z, con.digits):
                real.append((angle.real % (2 * mp.pi), mp.re(r / dw)))
            else:
                self.factors.append((angle, r / dw))
        real.sort()
        (self.target, self.a_target), (self.origin, self.a_origin) = real[0], real[-1]
        self.origin -= 2 * mp.pi
        self.span = self.target - self.origin
        self.factors += real[1:-1]
        largest = max(abs(A) for A in (self.a_target, self.a_origin, *(A for _, A in self.factors)))
        self.dps = mp.dps + int(mp.log10(1 + largest))
        self.v0 = mp.log(-self.origin / self.target)
        self.x0, self.x1, self.stops = mp.mpf(0), mp.inf, self.a_target > 0
        self.late = max(self.x0, 5 - self.v0)  # s goes as exp(-a_target v) from here, to a percent
        self.far = self.late + mp.log(10) * con.digits / self.a_target if self.stops else mp.inf
        copies = [x + 2 * mp.pi * turns for x, _ in self.factors for turns in (-1, 0, 1)]
        self.poles = [self._x(angle) for angle in copies] + [mp.mpc(-self.v0, mp.pi)]
        self.least = self.s0 / abs(con.rw(self.z0)) * mp.mpf(10) ** -mp.dps
        self.step = 1 / (1 + abs(self._place(self.x0)[3]))
        self.known = {self.x0: mp.mpc(0)}
        self.cuts = []
        if mu * abs(b) > con.k:
            for side in (1, -1):
                z = b / abs(b) * mp.expj(side * mp.acos(con.k / (mu * abs(b))))
                angle = self.turn * mp.arg(z / self.z0) % (2 * mp.pi)
                if angle < self.target:
                    self.cuts.append(self._x(angle))
            self.cuts.sort()

    def _x(self, angle):
        return mp.log((angle - self.origin) / (self.target - angle)) - self.v0

    def _place(self, x):
        """s/s_0, z, dp/dx, d(ln s)/dx"""
        with mp.workdps(self.dps):
            v = self.v0 + x
            before, after = self.span / (1 + mp.exp(-v)), self.span / (1 + mp.exp(v))
            angle = self.target - after
            pairs = [
                (mp.sin(after / 2) / mp.sin(self.target / 2), self.a_target),
                (mp.sin(before / 2) / mp.sin(-self.origin / 2), self.a_origin),
            ]
            pairs += [(mp.sin((angle - t) / 2) / mp.sin(-t / 2), A) for t, A in self.factors]
            logs = [(mp.log(R), A) for R, A in pairs]
            s = mp.exp(mp.re(sum(A * L for L, A in logs)))
            w = self.w0 * mp.exp(mp.re(sum(L for L, A in logs)))
            z = self.z0 * mp.expj(self.turn * angle)
            pace = before * after / self.span / w
        return s, z, self.s0 * s * pace, self.con.rw(z).real * pace

    def _flow(self, x):
        """d(p + i D)/dx, with D the integral of s/s_0 dp"""
        s, _, dp, _ = self._place(x)
        return mp.mpc(dp, dp * s)

    def _tail(self, y):
        """_flow per y = exp(-a_target (x - late)), which is bounded at y = 0, where slip stops"""
        return self._flow(self.late - mp.log(y) / self.a_target) / (y * self.a_target)

    def _chunks(self, x, end):
        """Steps no longer than the distance to the nearest singularity of the integrand, nor than
        s takes to change by e^4, unless nothing is left of the integrand there."""
        chunks, way = [x], mp.sign(end - x)
        while x != end:
            _, _, dp, rate = self._place(x)
            step = min(abs(x - pole) for pole in self.poles)
            while step * abs(rate) > 4 and step * max(dp, self._place(x + way * step)[2]) > self.least:
                step = 3 / abs(rate) if step * dp > self.least else step / 2
            x = x + way * step if step < abs(end - x) else end
            chunks.append(x)
        return chunks

    def _sum(self, x):
        if x not in self.known:
            goal = min(x, self.late) if x == mp.inf else x
            near = min((y for y in self.known if y < mp.inf), key=lambda y: abs(y - goal))
            with mp.workdps(mp.dps - GUARD // 2):
                if x == mp.inf:
                    rest = self._between(near, self.late) + mp.quad(self._tail, [0, 1])
                else:
                    rest = self._between(near, x)
            self.known[x] = self.known[near] + rest
        return self.known[x]

    def _between(self, x, end):
        return mp.quad(self._flow, self._chunks(x, end), method="gauss-legendre") if x != end else 0

    def at(self, x):
        if x == mp.inf and not self.stops:
            return x, mp.matrix([mp.nan, mp.nan, x]), x
        con, total = self.con, self._sum(x)
        p, D = total.real, total.imag
        U0 = self.s0 * self.z0
        s, z, *_ = self._place(x) if x < mp.inf else (mp.mpf(0), self.z0)
        U = self.s0 * s * z
        un = self.u[2] + mp.re(mp.conj(con.hold) * (U - U0)) + con.schur * p
        u = mp.matrix([U.real, U.imag, un])
        W = con.energy(con.Ki * (u - self.u), self.u) + con.mu * self.s0 * D
        return p, u, W

    def rates(self, x):
        _, z, dp, _ = self._place(x)
        return dp, dp * self.con.q(z)

    def stride(self, x):
        """s changes by e^4 in it"""
        return 4 / abs(self._place(x)[3])


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

    def along(g):
        return mp.lu_solve(g * mp.eye(2) + con.mu * Ktt, b)

    g = mp.findroot(lambda g: mp.norm(along(g)) - 1, (0, abs(con.b)), solver="anderson")
    return "slips on", _Straight(con, u, con.push(mp.mpc(*along(g))))


def _solve(seg, value, slope, lo, hi):
    """The x in [lo, hi] with value = 0; value < 0 at lo, >= 0 at hi, and rises."""
    if hi == mp.inf:
        step, hi = seg.step, lo + seg.step
        while value(hi) < 0:
            if hi > seg.far:
                return seg.x1
            step = min(2 * step, seg.stride(hi))
            lo, hi = hi, hi + step
    x = (lo + hi) / 2
    for _ in range(10 * mp.prec):
        y, dy = value(x), slope(x)
        lo, hi = (x, hi) if y < 0 else (lo, x)
        new = x - y / dy if dy else lo
        small = abs(new - x) <= mp.mpf(10) ** -(mp.dps - 2 * GUARD // 3) * seg.step
        x = new if small or lo < new < hi else (lo + hi) / 2
        if small:
            return x
    raise ArithmeticError("no root found")


def _zero_of_un(seg, lo, hi, sign):
    return _solve(seg, lambda x: sign * seg.at(x)[1][2], lambda x: sign * seg.rates(x)[1], lo, hi)


def _reach(seg, lo, hi, p=None, W=None):
    """Where the normal impulse of the segment reaches p, or its work W."""
    if W is None:
        return _solve(seg, lambda x: seg.at(x)[0] - p, lambda x: seg.rates(x)[0], lo, hi)
    return _solve(seg, lambda x: seg.at(x)[2] - W, lambda x: seg.at(x)[1][2] * seg.rates(x)[0], lo, hi)


def _pieces(seg):
    """(lo, hi, u_n(lo), u_n(hi)): between them u_n is monotone and keeps one sign."""
    lo = seg.x0
    for hi in (*seg.cuts, seg.x1):
        a, b = seg.at(lo)[1][2], seg.at(hi)[1][2]
        if a < 0 < b or b < 0 < a:
            zero = _zero_of_un(seg, lo, hi, mp.sign(b))
            yield lo, zero, a, mp.mpf(0)
            lo, a = zero, mp.mpf(0)
        yield lo, hi, a, b
        lo = hi


def routh(con, u, e, stronge):
    """impulse, events, jam, falls_again"""
    events, jam, falls_again = [], False, False
    p0 = W0 = mp.mpf(0)
    p_c = W_c = None
    slips = con.mu == 0 or mp.hypot(u[0], u[1]) > con.none * mp.norm(u)
    now, seg = u, _slip(con, u) if slips else None
    while True:
        if seg is None:
            what, seg = _after_stop(con, now)
            events.append((what, p0))
        for lo, hi, a, b in _pieces(seg):
            end = None
            if p_c is None:
                jam |= bool(b < a)
                if b == 0:
                    p, _, W = seg.at(hi)
                    p_c, W_c = p0 + p, W0 + W
                    events.append(("end of compression", p_c))
                    end = hi if e == 0 else None
            else:
                falls_again |= bool(b < a)
                p, _, W = seg.at(hi)
                if stronge and (1 - e * e) * W_c <= W0 + W:
                    end = _reach(seg, lo, hi, W=(1 - e * e) * W_c - W0)
                elif not stronge and p0 + p >= (1 + e) * p_c:
                    end = _reach(seg, lo, hi, p=(1 + e) * p_c - p0)
            if end is not None:
                p, now, _ = seg.at(end)
                return con.Ki * (now - u), [*events, ("end", p0 + p)], jam, falls_again
        p, now, W = seg.at(seg.x1)
        p0, W0, seg = p0 + p, W0 + W, None
        events.append(("slip stops", p0))
