"""L4, Coulomb friction along the path of the impulse: Routh's method.

The impact is followed in the normal impulse ``p``, with the unit normal ``n`` and the unit slip
direction ``t``. From the first touch

    dP/dp = n - mu t,    du/dp = K (n - mu t)        while the contact slips.

The path is straight, and has a closed form, except while ``t`` turns, which it does only in space
and only before the slip first stops (``hodograph.py``). When it stops, the contact sticks along

    dP/dp = K^-1 n / (n.K^-1 n)

if that direction lies in the friction cone; else it slips on, for good, along the one ray
``t`` on which the slip grows straight, ``(K (n - mu t))_t = s t`` with ``s > 0``.

Compression lasts until ``u_n`` first rises to 0, at ``p_c``; the work ``W = int u_n dp`` is then
``W_c < 0``. Friction may press the bodies together at first (``du_n/dp < 0``: jam, Painleve's
paradox); then ``mu`` is so large that the slip always stops, the contact sticks, and ``u_n`` rises.
The impact ends with

    Poisson    p = (1 + e) p_c              restitution of impulse
    Stronge    W = (1 - e^2) W_c            restitution of energy

Neither creates energy for e in [0, 1]: friction opposes the slip all along the path, and Stronge's
normal work is ``(1 - e^2) W_c <= 0``; for Poisson's see Wang & Mason 1992. But Poisson's loses some at
e = 1 where the slip stops on the way, though nothing is lost but by friction; Stronge's does not.

Sources: Routh, *Dynamics of a System of Rigid Bodies*, 1905, sections 180-199; Keller, "Impact With
Friction", J. Appl. Mech. 53 (1986); Stronge, "Rigid body collisions with friction", Proc. R. Soc. A
431 (1990); Wang & Mason, "Two-Dimensional Rigid-Body Collisions With Friction", J. Appl. Mech. 59
(1992); Batlle, "Rough balanced collisions", J. Appl. Mech. 63 (1996), for the diverging ray.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple, Protocol

from ...numerics.trigonometric_roots import trigonometric_roots
from ..effective_mass import Approach
from ..tensor import Tensor
from ..vector import V, Vec2
from .law import Outcome, Parameters, Regime, slipping
from .tangent_plane import direction, tangents

DOUBLE_TOLERANCE = 1e-12
"""Relative error of a curved path when the request asks for none."""


class Goal(Protocol):
    """Where a phase of the impact ends."""

    def distance(self, state: State, rate: float) -> float:
        """Normal impulse still to go if ``u_n`` changes at ``rate`` [1/kg]; infinite if never."""

    def excess(self, u_n: float, p: float, W: float) -> float:
        """Negative before the end, 0 at it, positive after."""


class State(NamedTuple):
    """A point of the path.

    Attributes:
        P: impulse so far [N s].
        u: velocity of body_a relative to body_b at the contact [m/s].
        u_n: its normal part.
        p: normal part of ``P``.
        W: work of the normal impulse so far [J].
        course: ``dP/dp`` once the slip has stopped for the first time, until then ``None``.
        sticks: whether that course is without slip.
        jammed: whether ``u_n`` has fallen on the way.
    """

    P: Any
    u: Any
    u_n: float
    p: float
    W: float
    course: Any = None
    sticks: bool = False
    jammed: bool = False


class Rest(NamedTuple):
    """The end of compression: the normal velocity rises to 0."""

    def distance(self, state: State, rate: float) -> float:
        return -state.u_n / rate if rate > 0 else math.inf

    def excess(self, u_n: float, p: float, W: float) -> float:
        return u_n


class Impulse(NamedTuple):
    """Poisson's end of restitution: the normal impulse reaches ``p``."""

    p: float

    def distance(self, state: State, rate: float) -> float:
        return self.p - state.p

    def excess(self, u_n: float, p: float, W: float) -> float:
        return p - self.p


class Work(NamedTuple):
    """Stronge's end of restitution: the normal work reaches ``W``."""

    W: float

    def distance(self, state: State, rate: float) -> float:
        missing = self.W - state.W
        if missing <= 0:
            return 0.0
        square = state.u_n**2 + 2 * rate * missing
        return 2 * missing / (state.u_n + math.sqrt(square)) if square >= 0 else math.inf

    def excess(self, u_n: float, p: float, W: float) -> float:
        return W - self.W


def routh_poisson(approach: Approach[V], parameters: Parameters) -> Outcome:
    """Routh's path, ended by restitution of impulse."""
    return _follow(approach, parameters, lambda e, rest: Impulse((1 + e) * rest.p))


def routh_stronge(approach: Approach[V], parameters: Parameters) -> Outcome:
    """Routh's path, ended by restitution of energy."""
    return _follow(approach, parameters, lambda e, rest: Work((1 - e * e) * rest.W))


def _follow(approach: Approach[V], parameters: Parameters, end: Callable[[float, State], Goal]) -> Outcome:
    n = approach.n / approach.n.norm()
    u_n = approach.n_u / approach.n.norm()
    tolerance = parameters.tolerance or DOUBLE_TOLERANCE
    path = Path(approach.mobility(), n, parameters.friction, tolerance)
    rest = path.travel(State(n * 0.0, approach.u, u_n, 0.0, 0.0), Rest())
    last = path.travel(rest, end(parameters.restitution, rest))
    return Outcome(last.P, path.regime(approach, last), last.W)


class Path(NamedTuple):
    """What stays the same on the way: the inverse effective mass, the unit normal, the friction."""

    K: Tensor[Any]
    n: Any
    mu: float
    tolerance: float

    def travel(self, state: State, goal: Goal) -> State:
        """From ``state`` to ``goal``, through the stop of the slip if it comes first."""
        if state.course is None:
            state, arrived = self._slip(state, goal)
            if arrived:
                return state
            course, sticks = self._course_from_rest()
            state = state._replace(course=course, sticks=sticks)
        return self._straight(state, state.course, goal.distance(state, self.rate(state.course)))

    def across(self, v: Any) -> Any:
        """The tangential part of a vector."""
        return v - self.n * self.n.dot(v)

    def rate(self, course: Any) -> float:
        """``du_n/dp`` on a course [1/kg]."""
        return float(self.n.dot(self.K @ course))

    def _slip(self, state: State, goal: Goal) -> tuple[State, bool]:
        """Slip until the goal or the stop; whether it was the goal."""
        if self._turns(state):
            from .hodograph import slip_along_curve  # SciPy takes half a second to import

            state, arrived = slip_along_curve(self, state, goal)
            if arrived:
                return state, True
        slip = self.across(state.u)
        speed = slip.norm()
        if speed == 0:
            return state, False
        course = self.n - slip * (self.mu / speed)
        closing = -slip.dot(self.K @ course) / speed
        to_stop = speed / closing if closing > 0 else math.inf
        to_goal = goal.distance(state, self.rate(course))
        state = self._straight(state, course, min(to_goal, to_stop))
        if to_goal <= to_stop:
            return state, True
        return state._replace(u=self.n * state.u_n), False

    def _turns(self, state: State) -> bool:
        """Whether the slip changes direction by more than the tolerance."""
        slip = self.across(state.u)
        speed = slip.norm()
        if isinstance(slip, Vec2) or speed == 0:
            return False
        t = slip / speed
        growth = self.across(self.K @ (self.n - t * self.mu))
        turning = growth - t * t.dot(growth)
        return bool(turning.norm() > self.tolerance * growth.norm())

    def regime(self, approach: Approach[Any], last: State) -> Regime:
        """What friction did, seen from the end."""
        if last.jammed:
            return Regime.JAMMED
        return Regime.STICKING if last.sticks else Regime(slipping(approach, last.u))

    def _course_from_rest(self) -> tuple[Any, bool]:
        """How the path goes on once the contact has stopped slipping; whether it sticks."""
        stick = self.K.solve(self.n)
        stick = stick / self.n.dot(stick)
        if self.across(stick).norm() <= self.mu:
            return stick, True
        return self.n - self._diverging_direction() * self.mu, False

    def _diverging_direction(self) -> Any:
        """The direction in which slip grows straight from rest, when the contact cannot stick."""
        return max(self._invariant_directions(), key=lambda t: t.dot(self.K @ (self.n - t * self.mu)))

    def _invariant_directions(self) -> list[Any]:
        """Directions that slip keeps: ``K (n - mu t)`` has no part across both ``t`` and ``n``."""
        if isinstance(self.n, Vec2):
            (t,) = tangents(self.n)
            return [t, -t]
        t_1, t_2 = tangents(self.n)
        K_1, K_2 = self.K @ t_1, self.K @ t_2
        angles = trigonometric_roots(
            constant=0.0,
            cosine=self.n.dot(K_2),
            sine=-self.n.dot(K_1),
            cosine_2=-self.mu * t_1.dot(K_2),
            sine_2=self.mu * (t_1.dot(K_1) - t_2.dot(K_2)) / 2,
        )
        return [direction(t_1, t_2, angle) for angle in angles]

    def _straight(self, state: State, course: Any, distance: float) -> State:
        rate = self.rate(course)
        return state._replace(
            P=state.P + course * distance,
            u=state.u + (self.K @ course) * distance,
            u_n=state.u_n + rate * distance,
            p=state.p + distance,
            W=state.W + (state.u_n + rate * distance / 2) * distance,
            jammed=state.jammed or rate < 0,
        )
