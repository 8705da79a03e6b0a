"""Hermite's cubic: what a number does within a step, from its values and slopes at both ends."""

from __future__ import annotations

from typing import NamedTuple

from ...numbers.operations import Condition, Scalar, choose, minimum, or_one, positive_part, square_root

NEWTON_STEPS = 3
"""Steps of Newton's method to a crossing, from that of the chord."""


class Cubic(NamedTuple):
    """The cubic ``value + h x (slope + b x / 2 + a x^2 / 3)`` for a step of length ``h``.

    ``x`` goes from 0 to 1 over the step. The slope is ``slope + b x + a x^2``.
    """

    value: Scalar
    slope: Scalar
    b: Scalar
    a: Scalar
    h: Scalar

    @classmethod
    def between(
        cls, value: Scalar, slope: Scalar, last_value: Scalar, last_slope: Scalar, h: Scalar
    ) -> Cubic:
        """The cubic with these values and slopes at the ends of a step."""
        mean = (last_value - value) / or_one(h)
        return cls(
            value, slope, 6 * mean - 4 * slope - 2 * last_slope, 3 * (slope + last_slope - 2 * mean), h
        )

    def at(self, x: Scalar) -> Scalar:
        """The value at ``x``."""
        return self.value + self.h * x * (self.slope + x * (self.b / 2 + x * self.a / 3))

    def crest(self) -> Scalar:
        """Where it is greatest, if it rises at ``x = 0`` and falls at ``x = 1``."""
        square = self.b * self.b - 4 * self.a * self.slope
        both = square_root(positive_part(square)) - self.b
        return choose(both > 0, lambda: 2 * self.slope / both, lambda: 0 * both)

    def flattest(self) -> tuple[Condition, Scalar]:
        """Whether it rises much less within the step than at both ends, and where it rises least."""
        x, last = -self.b / or_one(2 * self.a), self.slope + self.b + self.a
        is_inside = (self.b < 0) & (2 * self.a + self.b > 0)
        return is_inside & (2 * self.slope + self.b * x < minimum(self.slope, last)), x

    def crossing(self) -> Scalar:
        """About where it passes 0, if it is below at ``x = 0`` and above at ``x = 1``."""
        x = -self.value / or_one(self.at(1 + 0 * self.value) - self.value)
        for _ in range(NEWTON_STEPS):
            x = self._nearer_to_crossing(x)
        return x

    def _nearer_to_crossing(self, x: Scalar) -> Scalar:
        """A step of Newton's method, unless it leads out of the step."""
        slope = self.h * (self.slope + x * (self.b + x * self.a))
        nearer = x - self.at(x) / or_one(slope)
        return choose((nearer > 0) & (nearer < 1), lambda: nearer, lambda: x)
