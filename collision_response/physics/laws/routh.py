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

A grazing impact changes a fast slip by a slow ``u_n``. They are therefore kept apart, and nothing of the
impulse is taken from the slip but its direction. For the same reason restitution counts ``p`` and ``W``
from its own beginning: with a small e they are small.

At a given ``p`` errors of the path do not grow, because friction draws any two slips together (in the norm
of ``K_tt^-1``). But they move the ends of the two phases: a relative error ``x`` of the path, whose ``u_n``
changes at ``L = n.K n + mu |K n|_t`` at most, moves them by

    Rest       x L p_c / (du_n/dp)
    Poisson    e times that
    Stronge    x L (e^2 p_c^2 + p^2) / u_n           p and u_n where restitution ends

which is the ``doubt``; and where ``u_n`` turns back just before the end, the error can be all that follows.

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
from .tangent_plane import across, direction, tangents

DOUBLE_TOLERANCE = 1e-12
"""Relative error of a curved path when the request asks for none, and the least there is."""

SHARE = 1 / 128
"""Of the tolerance asked for, the path's: margins and the condition of most impacts leave as much of it."""


def path_tolerance(parameters: Parameters) -> float:
    """Relative error to which a curved path is followed."""
    return max(parameters.tolerance * SHARE, DOUBLE_TOLERANCE)


class Goal(Protocol):
    """Where a phase of the impact ends: at an ``excess`` of 0."""

    def distance(self, state: State, rate: float) -> float:
        """Normal impulse still to go if ``u_n`` changes at ``rate`` [1/kg]; infinite if never."""

    def excess(self, u_n: float, p: float, W: float) -> float:
        """Negative before the end, 0 at it, positive after."""

    def slope(self, u_n: float, rate: float) -> float:
        """``d excess / dp``."""

    def doubt(self, p: float, steepest: float) -> float:
        """Error of the excess per relative error of the path, if ``u_n`` changes by ``steepest`` at most."""


class State(NamedTuple):
    """A point of the path.

    Attributes:
        P: impulse so far [N s].
        slip: tangential velocity of body_a relative to body_b at the contact [m/s].
        u_n: the normal one [m/s].
        p: normal impulse since the phase began [N s].
        W: its work [J].
        doubt: error of the impulse where the phases end, per relative error of the path [N s].
        course: ``dP/dp`` once the slip has stopped for the first time, until then ``None``.
        sticks: whether that course is without slip.
        jammed: whether ``u_n`` has fallen on the way.
    """

    P: Any
    slip: Any
    u_n: float
    p: float = 0.0
    W: float = 0.0
    doubt: float = 0.0
    course: Any = None
    sticks: bool = False
    jammed: bool = False

    @classmethod
    def of(cls, approach: Approach[Any]) -> State:
        """The first touch."""
        length = approach.n.norm()
        n = approach.n / length
        return cls(n * 0.0, across(n, approach.u), approach.n_u / length)


class Rest(NamedTuple):
    """The end of compression: the normal velocity rises to 0."""

    def distance(self, state: State, rate: float) -> float:
        return -state.u_n / rate if rate > 0 else math.inf

    def excess(self, u_n: float, p: float, W: float) -> float:
        return u_n

    def slope(self, u_n: float, rate: float) -> float:
        return rate

    def doubt(self, p: float, steepest: float) -> float:
        return steepest * p


class Impulse(NamedTuple):
    """Poisson's end of restitution: the normal impulse reaches ``p``, known to within ``error``."""

    p: float
    error: float

    def distance(self, state: State, rate: float) -> float:
        return self.p - state.p

    def excess(self, u_n: float, p: float, W: float) -> float:
        return p - self.p

    def slope(self, u_n: float, rate: float) -> float:
        return 1.0

    def doubt(self, p: float, steepest: float) -> float:
        return self.error


class Work(NamedTuple):
    """Stronge's end of restitution: the normal work reaches ``W``, known to within ``error``."""

    W: float
    error: float

    def distance(self, state: State, rate: float) -> float:
        missing = self.W - state.W
        square = state.u_n**2 + 2 * rate * missing
        return 2 * missing / (state.u_n + math.sqrt(square)) if square >= 0 else math.inf

    def excess(self, u_n: float, p: float, W: float) -> float:
        return W - self.W

    def slope(self, u_n: float, rate: float) -> float:
        return u_n

    def doubt(self, p: float, steepest: float) -> float:
        return self.error + steepest * p * p


def routh_poisson(approach: Approach[V], parameters: Parameters) -> Outcome:
    """Routh's path, ended by restitution of impulse."""

    def end(e: float, rest: State, path: Path) -> Goal:
        return Impulse(e * rest.p, e * rest.doubt)

    return _follow(approach, parameters, end)


def routh_stronge(approach: Approach[V], parameters: Parameters) -> Outcome:
    """Routh's path, ended by restitution of energy."""

    def end(e: float, rest: State, path: Path) -> Goal:
        return Work(-e * e * rest.W, e * e * path.steepest * rest.p * rest.p)

    return _follow(approach, parameters, end)


def _follow(
    approach: Approach[V], parameters: Parameters, end: Callable[[float, State, Path], Goal]
) -> Outcome:
    path = Path.of(approach, parameters)
    rest = path.travel(State.of(approach), Rest())
    last = rest._replace(u_n=0.0, p=0.0, W=0.0)
    goal = end(parameters.restitution, rest, path)
    if goal.excess(last.u_n, last.p, last.W) < 0:
        last = path.travel(last, goal)
    condition = 1 + last.doubt / last.P.norm()
    return Outcome(last.P, path.regime(approach, last), rest.W + last.W, condition=condition)


class Path(NamedTuple):
    """What stays the same on the way.

    Attributes:
        K: inverse effective mass [1/kg].
        n: unit normal.
        mu: friction.
        tolerance: relative error of the curved part.
        steepest: the most that ``du_n/dp`` can be, up or down [1/kg].
        least: the normal impulse without which no compression can end [N s].
    """

    K: Tensor[Any]
    n: Any
    mu: float
    tolerance: float
    steepest: float
    least: float

    @classmethod
    def of(cls, approach: Approach[Any], parameters: Parameters) -> Path:
        K, length, mu = approach.mobility(), approach.n.norm(), parameters.friction
        n = approach.n / length
        Kn = K @ n
        steepest = n.dot(Kn) + mu * across(n, Kn).norm()
        return cls(K, n, mu, path_tolerance(parameters), steepest, -approach.n_u / length / steepest)

    def travel(self, state: State, goal: Goal) -> State:
        """From ``state`` to ``goal``, through the stop of the slip if it comes first."""
        course = state.course
        if course is None:
            state, course = self._slip(state, goal)
        if course is None:
            course, sticks = self._course_from_rest()
            state = state._replace(course=course, sticks=sticks)
        if state.course is not None:
            state = self._straight(state, course, goal.distance(state, self.rate(course)))
        moved = goal.doubt(state.p, self.steepest) / goal.slope(state.u_n, self.rate(course))
        return state._replace(doubt=state.doubt + course.norm() * moved)

    def rate(self, course: Any) -> float:
        """``du_n/dp`` on a course [1/kg]."""
        return float(self.n.dot(self.K @ course))

    def _slip(self, state: State, goal: Goal) -> tuple[State, Any]:
        """Slip until the goal, and the course there; or until the stop, and ``None``."""
        if self._turns(state, goal):
            from .hodograph import slip_along_curve  # SciPy takes half a second to import

            state = slip_along_curve(self, state, goal)
        speed = state.slip.norm()
        if speed == 0:
            return state, None
        t = state.slip / speed
        course = self.n - t * self.mu
        growth = t.dot(self.K @ course)
        to_goal = goal.distance(state, self.rate(course))
        left = speed + growth * to_goal
        if left > 0:
            return self._straight(state, course, to_goal)._replace(slip=t * left), course
        return self._straight(state, course, -speed / growth)._replace(slip=self.n * 0.0), None

    def _turns(self, state: State, goal: Goal) -> bool:
        """Whether the slip changes direction by more than the tolerance before the goal or its stop."""
        speed = state.slip.norm()
        if isinstance(state.slip, Vec2) or speed == 0:
            return False
        t = state.slip / speed
        course = self.n - t * self.mu
        change = across(self.n, self.K @ course)
        growth = t.dot(change)
        to_stop = -speed / growth if growth < 0 else math.inf
        distance = min(to_stop, goal.distance(state, self.rate(course)))
        return bool((change - t * growth).norm() * distance > self.tolerance * speed)

    def regime(self, approach: Approach[Any], last: State) -> Regime:
        """What friction did, seen from the end."""
        if last.jammed:
            return Regime.JAMMED
        return Regime.STICKING if last.sticks else Regime(slipping(approach, last.slip))

    def _course_from_rest(self) -> tuple[Any, bool]:
        """How the path goes on once the contact has stopped slipping; whether it sticks."""
        stick = self.K.solve(self.n)
        stick = stick / self.n.dot(stick)
        if across(self.n, stick).norm() <= self.mu:
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
            slip=state.slip + across(self.n, self.K @ course) * distance,
            u_n=state.u_n + rate * distance,
            p=state.p + distance,
            W=state.W + (state.u_n + rate * distance / 2) * distance,
            jammed=state.jammed or rate < 0,
        )
