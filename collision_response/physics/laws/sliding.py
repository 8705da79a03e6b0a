"""The slip equation of Moreau's law: all its roots in [0, 1], and the one that loses most energy.

In the letters of ``moreau.py`` the equation is

    F(sigma) = d + mu beta.x - |x| = 0        x = sigma v + h w        d = sigma^2 + h sigma + h^2 D

**Shape.** ``F`` is a parabola minus the convex function ``|x|``, with the slopes

    F'    = 2 sigma + h + mu beta.v - t.v        t = x / |x|
    |x|'' = (t x v)^2 / |x| = (h w x v)^2 / |x|^3

``w = adj(S) v / tr(S)`` with ``S`` positive definite, so ``|x|`` grows with ``sigma`` and ``|x|''`` falls:
``F`` is first concave, then convex. If the contact slips, ``F`` is negative at 0; it is not negative at 1. So
there is one root in between, or there are three.

    least root       from 0 upwards. ``|x|`` lies above its tangents, so the parabola minus a tangent
                     reaches 0 before ``F`` does. The order of convergence is two. One step is exact if ``x``
                     keeps its direction, as in the plane, or if ``S`` is a multiple of 1.
    greatest root    from 1 downwards by Newton's method, if ``F`` is concave at the least root. Where ``F``
                     stops being convex or rising, there is no other root.
    middle root      between these two, by bisection.

**Error.** The loops give values without an error. The error of a root follows from ``F`` there: if
``|F| <= E`` and ``|F'| >= m``, a true root is within ``r = 2 E / m``, provided that ``|F''| r <= m / 2`` on
the way.
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
    iterate,
    maximum,
    negation,
    positive_part,
    square_root,
    widened,
)
from .contact_frame import Tangential

MARGIN = 2.0**-20
"""Relative difference up to which it is undecided how many roots there are, or which one loses most."""

FINEST = 2.0**-120
"""Relative width at which bisection ends: a sum of two doubles could be halved a thousand times."""

BUDGET = 400
"""Steps of a loop."""


class Root(NamedTuple):
    """The root that the law takes.

    Attributes:
        sigma: its value; 0 if the contact sticks.
        ambiguous: not 0 if rounding could have led to another root.
        unfinished: not 0 if a loop used up its budget.
    """

    sigma: Scalar
    ambiguous: Scalar
    unfinished: Scalar


class Search(NamedTuple):
    """The state of a search: the present and the previous ``sigma``; and whether a root may not exist."""

    sigma: Scalar
    previous: Scalar
    ambiguous: Scalar


class Bracket(NamedTuple):
    """An interval that contains a root, and its width one step before."""

    low: Scalar
    high: Scalar
    previous_width: Scalar


class ThreeRoots(NamedTuple):
    """Three roots. Once ``undecided`` is 0, ``low`` is the one that loses most energy."""

    low: Scalar
    middle: Scalar
    high: Scalar
    ambiguous: Scalar
    undecided: Scalar


class Sliding(NamedTuple):
    """The coefficients of the slip equation: ``v``, ``h w``, ``h``, ``h^2 D`` and ``mu beta``.

    ``F`` is ``d (1 + beta.f / j) - |x|``, in which only ``|x| = d |f| / (mu j)`` depends on ``mu``.
    """

    v: Tangential
    hw: Tangential
    h: Scalar
    hhD: Scalar
    mu_beta: Tangential

    def x(self, sigma: Scalar) -> Tangential:
        """``x``, which has the direction of the slip that remains."""
        return self.v * sigma + self.hw

    def d(self, sigma: Scalar) -> Scalar:
        """``d``: the determinant of ``rho + S``, scaled."""
        return sigma * (sigma + self.h) + self.hhD

    def evaluate(self, sigma: Scalar) -> tuple[Scalar, Scalar, Scalar, Scalar]:
        """``F``, ``F'``, ``|x|`` and ``|x|''``."""
        x = self.x(sigma)
        length = x.length()
        F = self.d(sigma) + self.mu_beta.dot(x) - length
        t = x / safe_divisor(length)
        t_cross_v = t.cross(self.v)
        slope = 2 * sigma + self.h + self.mu_beta.dot(self.v) - t.dot(self.v)
        return F, slope, length, t_cross_v * t_cross_v / safe_divisor(length)

    def newton_correction(self, sigma: Scalar) -> Scalar:
        """``-F / F'``: as a function of the coefficients, it varies as the root near ``sigma`` does."""
        F, slope, _, _ = self.evaluate(fixed(sigma))
        return -F / slope

    def error_radius(self, sigma: Scalar, capped: Scalar) -> Scalar:
        """Greatest distance of a root from ``sigma``; 2, so anywhere, if it cannot be bounded.

        Args:
            sigma: the root that was found.
            capped: 1 if friction is greater than the one in the coefficients, else 0.
        """
        F, slope, length, curvature = self.evaluate(sigma)
        E = certain(abs(F) + error_of(F) + capped * certain(length))
        m = certain(abs(certain(slope)) - error_of(slope) - capped * certain(self.v.norm_1()))
        radius = certain(2 * E / safe_divisor(m))
        # |x| >= (sigma + h D) |v|. So within this distance |x| shrinks by a quarter at most, and |x|'', which
        # goes with its inverse cube, grows less than threefold.
        hD = choose(certain(self.h) > 0, lambda: self.hhD / self.h, lambda: self.hhD)  # 0 without friction
        distance = certain(sigma + hD) / 4
        second_derivative = certain(2 + 3 * (curvature + error_of(curvature)))
        known = (m > 0) & (radius <= distance) & (radius < 1) & (radius * second_derivative <= 0.45 * m)
        return choose(known, lambda: radius, lambda: 2.0 + 0 * distance)

    def root(
        self, F: Scalar, slope: Scalar, slides: Condition, mu: Scalar, c_u_t: Tangential, c_lost_speed: Scalar
    ) -> Root:
        """Of all roots, the one that loses most energy.

        Args:
            F, slope: ``F`` and ``F'`` at 0.
            slides: whether there are roots.
            mu: friction.
            c_u_t: ``c u_t``.
            c_lost_speed: ``c (1 - e) |u_n|``.
        """
        zero = 0 * self.h
        least = self._least(F, slope, slides)
        low = least.sigma
        is_concave = slides & (self.evaluate(low)[3] * (1 + MARGIN) > 2)
        greatest = self._greatest(low, is_concave)
        high = greatest.sigma
        has_three = is_concave & (high > low)
        start = Bracket(low, high, choose(has_three, lambda: high - low + 1, lambda: zero))
        middle = iterate(start, _narrows, self._half, BUDGET)

        def energy_lost(sigma: Scalar) -> Scalar:
            # P_n = j (1 + mu beta.g) and f = mu j g give the losses of moreau.py, times 2 c / j.
            g = self.x(sigma) / self.d(sigma)
            return c_lost_speed * (1 + self.mu_beta.dot(g)) + mu * g.dot(c_u_t + g * sigma)

        def decide(roots: ThreeRoots) -> ThreeRoots:
            first, second, last = energy_lost(roots.low), energy_lost(roots.middle), energy_lost(roots.high)
            other = maximum(second, last)
            sigma = choose(second > last, lambda: roots.middle, lambda: roots.high)
            sigma = choose(first >= other, lambda: roots.low, lambda: sigma)
            tie = MARGIN * (abs(first) + abs(second) + abs(last))
            is_tie = (abs(first - other) < tie) | (abs(second - last) < tie)
            ambiguous = choose(is_tie, lambda: roots.ambiguous + 1, lambda: roots.ambiguous)
            return ThreeRoots(sigma, sigma, sigma, ambiguous, 0 * sigma)

        undecided = choose(has_three, lambda: 1 + zero, lambda: zero)
        three = ThreeRoots(low, (middle.low + middle.high) / 2, high, greatest.ambiguous, undecided)
        chosen = iterate(three, lambda roots: roots.undecided > 0, decide, 1)
        # A search that moves by less than MARGIN has ended: the residual gives its error.
        moves = (low - least.previous > MARGIN * low) | (greatest.previous - high > MARGIN * high)
        unfinished = moves | _narrows(middle)
        return Root(chosen.low, chosen.ambiguous, choose(unfinished, lambda: 1 + zero, lambda: zero))

    def _least(self, F: Scalar, slope: Scalar, slides: Condition) -> Search:
        """The least root, from below; 0 if the contact sticks."""

        def step(at: Search) -> Search:
            F, slope, _, _ = self.evaluate(at.sigma)
            step = choose(F < 0, lambda: _crossing(F, slope), lambda: 0 * F)
            return Search(at.sigma + step, at.sigma, at.ambiguous)

        zero = 0 * F
        first = choose(slides, lambda: _crossing(F, slope), lambda: zero)
        previous = choose(slides, lambda: zero - 1, lambda: zero)
        return iterate(Search(first, previous, zero), lambda at: at.sigma > at.previous, step, BUDGET)

    def _greatest(self, least: Scalar, is_concave: Condition) -> Search:
        """The greatest root, from above; ``least`` if there is no other."""

        def step(at: Search) -> Search:
            F, slope, length, curvature = self.evaluate(at.sigma)
            newton = at.sigma - F / safe_divisor(slope)
            no_other = (F > 0) & ((newton <= least) | negation((slope > 0) & (curvature < 2)))
            sigma = choose(F > 0, lambda: newton, lambda: at.sigma)
            ambiguous = choose(MARGIN * length > F, lambda: 1 + 0 * F, lambda: 0 * F)
            return choose(
                no_other, lambda: Search(least, least, ambiguous), lambda: Search(sigma, at.sigma, 0 * F)
            )

        zero = 0 * least
        start = choose(
            is_concave, lambda: Search(1 + zero, 2 + zero, zero), lambda: Search(least, least, zero)
        )
        return iterate(start, lambda at: at.sigma < at.previous, step, BUDGET)

    def _half(self, at: Bracket) -> Bracket:
        """One step of the bisection: ``F`` is positive below the middle root and negative above."""
        middle, width = (at.low + at.high) / 2, at.high - at.low
        is_below = self.evaluate(middle)[0] > 0
        return choose(
            is_below, lambda: Bracket(middle, at.high, width), lambda: Bracket(at.low, middle, width)
        )


def _narrows(at: Bracket) -> Condition:
    """Whether bisection still makes progress, and has not reached ``FINEST``."""
    width = at.high - at.low
    return (width < at.previous_width) & (width > FINEST * at.high)


def _crossing(F: Scalar, slope: Scalar) -> Scalar:
    """The positive zero of ``F + slope s + s^2``, with ``F < 0``."""
    both = abs(slope) + square_root(positive_part(slope * slope - 4 * F))
    return choose(slope > 0, lambda: -2 * F / safe_divisor(both), lambda: both / 2)


def safe_divisor(x: Scalar) -> Scalar:
    """``x`` if its value is positive, else 1 with an infinite error: for a quotient that is then not used."""
    return choose(certain(x) > 0, lambda: x, lambda: widened(1.0 + 0 * certain(x), math.inf))
