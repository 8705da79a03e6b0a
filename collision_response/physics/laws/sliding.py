"""The slide of Moreau's law: all roots in [0, 1] of

    F(sigma) = sigma^2 + h sigma + h^2 D + mu beta.x - |x|,     x = sigma v + h w

``F`` is a parabola less a convex function. Since ``w = adj(S) v`` with ``S`` positive definite, the second
derivative of ``|x|`` falls as sigma grows: ``F`` is first concave, then convex. It is negative at 0, where
the contact cannot stick, and not at 1. So there are one root or three.

    the least     from below. ``|x|`` lies above its tangents, so the parabola less a tangent crosses zero
                  before ``F`` does. The order is two; one step is exact where ``x`` keeps its direction,
                  as in the plane, and for ``S`` alike in all directions
    the greatest  from above by Newton's method, if ``F`` is concave at the least. Where it stops being
                  convex or rising there is no other root
    the third     between these two, by bisection

These are values. What a root is off follows from ``F`` there: with ``|F| <= E`` and ``|F'| >= m`` a true
root is no farther than ``r = 2 E / m``, if ``|F''| r <= m / 2`` on the way.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from ...numbers.operations import (
    Condition,
    Scalar,
    certain,
    choose,
    error_of,
    fixed,
    greater,
    iterate,
    negation,
    square_root,
    widened,
)
from .contact_frame import Tangential

NEAR = 2.0**-20
"""Values as near to each other as this leave open how many roots there are, or which loses most."""

FINEST = 2.0**-120
"""A bracket is no finer than this part of its end: a sum of two doubles may be halved a thousand times."""

BUDGET = 400


class Root(NamedTuple):
    """The root that the law takes.

    Attributes:
        sigma: its value; 0 if the contact sticks.
        open: not 0 if it may as well be another.
        unfinished: not 0 if a loop ended by its budget.
    """

    sigma: Scalar
    open: Scalar
    unfinished: Scalar


class Search(NamedTuple):
    """Where a search is and was, and whether it is open that there is a root."""

    sigma: Scalar
    before: Scalar
    open: Scalar


class Bracket(NamedTuple):
    """An interval with a root, and its width before."""

    low: Scalar
    high: Scalar
    before: Scalar


class Three(NamedTuple):
    """Three roots; when no longer waiting, the least stands for the one that loses most."""

    low: Scalar
    middle: Scalar
    high: Scalar
    open: Scalar
    waiting: Scalar


class Sliding(NamedTuple):
    """The letters of the equation."""

    v: Tangential
    hw: Tangential
    h: Scalar
    hhD: Scalar
    mu_beta: Tangential

    def x(self, sigma: Scalar) -> Tangential:
        """The direction of the slip that remains, of some length."""
        return self.v * sigma + self.hw

    def d(self, sigma: Scalar) -> Scalar:
        """The determinant of ``rho + S``, to some scale."""
        return sigma * (sigma + self.h) + self.hhD

    def at(self, sigma: Scalar) -> tuple[Scalar, Scalar, Scalar, Scalar]:
        """``F``, ``F'``, ``|x|`` and the second derivative of ``|x|``."""
        x = self.x(sigma)
        length = x.length()
        F = self.d(sigma) + self.mu_beta.dot(x) - length
        t = x / divisor(length)
        turn = t.cross(self.v)
        slope = 2 * sigma + self.h + self.mu_beta.dot(self.v) - t.dot(self.v)
        return F, slope, length, turn * turn / divisor(length)

    def variation(self, sigma: Scalar) -> Scalar:
        """What varies as the root near ``sigma``: a step of Newton's method from there."""
        F, slope, _, _ = self.at(fixed(sigma))
        return -F / slope

    def doubt(self, sigma: Scalar) -> Scalar:
        """How far from ``sigma`` the root may be; more than 1, so anywhere, where that is not known."""
        F, slope, _, curl = self.at(sigma)
        residual, least = certain(abs(F) + error_of(F)), certain(abs(certain(slope)) - error_of(slope))
        radius = certain(2 * residual / divisor(least))
        # Within `room` |x| shrinks by a quarter at most, and its second derivative grows less than threefold.
        room = certain(sigma + self.hhD / divisor(self.h)) / 4
        bend = certain(2 + 3 * (curl + error_of(curl)))
        known = (least > 0) & (radius <= room) & (radius < 1) & (radius * bend <= 0.45 * least)
        return choose(known, lambda: radius, lambda: 2.0 + 0 * room)

    def solution(
        self, F: Scalar, slope: Scalar, slides: Condition, mu: Scalar, u: Tangential, kept: Scalar
    ) -> Root:
        """Of all roots, the one that loses most energy.

        Args:
            F, slope: ``F`` and ``F'`` at 0.
            slides: whether there are roots.
            mu, u, kept: friction, slip and ``(1 - e) |u_n|`` before the impact, in the units of ``v``.
        """
        zero = 0 * self.h
        least = self._least(F, slope, slides)
        low = least.sigma
        concave = slides & (self.at(low)[3] * (1 + NEAR) > 2)
        greatest = self._greatest(low, concave)
        high = greatest.sigma
        several = concave & (high > low)
        start = Bracket(low, high, choose(several, lambda: high - low + 1, lambda: zero))
        third = iterate(start, _narrows, self._half, BUDGET)

        def loss(sigma: Scalar) -> Scalar:
            g = self.x(sigma) / self.d(sigma)
            return kept * (1 + self.mu_beta.dot(g)) + mu * g.dot(u + g * sigma)

        def decides(at: Three) -> Three:
            first, second, last = loss(at.low), loss(at.middle), loss(at.high)
            other = greater(second, last)
            sigma = choose(second > last, lambda: at.middle, lambda: at.high)
            sigma = choose(first >= other, lambda: at.low, lambda: sigma)
            tie = NEAR * (abs(first) + abs(second) + abs(last))
            near = (abs(first - other) < tie) | (abs(second - last) < tie)
            return Three(sigma, sigma, sigma, choose(near, lambda: at.open + 1, lambda: at.open), 0 * sigma)

        waiting = choose(several, lambda: 1 + zero, lambda: zero)
        three = Three(low, (third.low + third.high) / 2, high, greatest.open, waiting)
        chosen = iterate(three, lambda at: at.waiting > 0, decides, 1)
        # A search that only creeps has ended: the residual says how near it is.
        creeps = (low - least.before <= NEAR * low) & (greatest.before - high <= NEAR * high)
        unfinished = negation(creeps) | _narrows(third)
        return Root(chosen.low, chosen.open, choose(unfinished, lambda: 1 + zero, lambda: zero))

    def _least(self, F: Scalar, slope: Scalar, slides: Condition) -> Search:
        """The least root, from below."""

        def nearer(at: Search) -> Search:
            F, slope, _, _ = self.at(at.sigma)
            step = choose(F < 0, lambda: _crossing(F, slope), lambda: 0 * F)
            return Search(at.sigma + step, at.sigma, at.open)

        zero = 0 * F
        first = choose(slides, lambda: _crossing(F, slope), lambda: zero)
        before = choose(slides, lambda: zero - 1, lambda: zero)
        return iterate(Search(first, before, zero), lambda at: at.sigma > at.before, nearer, BUDGET)

    def _greatest(self, least: Scalar, concave: Condition) -> Search:
        """The greatest root, from above; the least if that is the only one."""

        def nearer(at: Search) -> Search:
            F, slope, length, curl = self.at(at.sigma)
            to = at.sigma - F / divisor(slope)
            only = (F > 0) & ((to <= least) | negation((slope > 0) & (curl < 2)))
            sigma = choose(F > 0, lambda: to, lambda: at.sigma)
            near = choose(NEAR * length > F, lambda: 1 + 0 * F, lambda: 0 * F)
            return choose(only, lambda: Search(least, least, near), lambda: Search(sigma, at.sigma, 0 * F))

        zero = 0 * least
        start = choose(concave, lambda: Search(1 + zero, 2 + zero, zero), lambda: Search(least, least, zero))
        return iterate(start, lambda at: at.sigma < at.before, nearer, BUDGET)

    def _half(self, at: Bracket) -> Bracket:
        middle, width = (at.low + at.high) / 2, at.high - at.low
        rises = self.at(middle)[0] > 0
        return choose(rises, lambda: Bracket(middle, at.high, width), lambda: Bracket(at.low, middle, width))


def _narrows(at: Bracket) -> Condition:
    width = at.high - at.low
    return (width < at.before) & (width > FINEST * at.high)


def _crossing(F: Scalar, slope: Scalar) -> Scalar:
    """The positive zero of ``F + slope x + x^2``, with ``F < 0``."""
    both = abs(slope) + square_root(greater(slope * slope - 4 * F, 0 * F))
    return choose(slope > 0, lambda: -2 * F / divisor(both), lambda: both / 2)


def divisor(x: Scalar) -> Scalar:
    """``x`` if its value is positive, else a 1 of which nothing is known: for quotients that do not count."""
    return choose(certain(x) > 0, lambda: x, lambda: widened(1.0 + 0 * certain(x), math.inf))
