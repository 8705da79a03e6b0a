"""An integrator of ordinary differential equations up to an event: Dormand & Prince's method of order 5."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

STAGES = (
    (1 / 5,),
    (3 / 40, 9 / 40),
    (44 / 45, -56 / 15, 32 / 9),
    (19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729),
    (9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656),
    (35 / 384, 0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84),
)
ERROR = np.array([71 / 57600, 0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40])


def integrate_until(
    rhs: Callable[[np.ndarray], Sequence[float]],
    y: Sequence[float],
    events: Sequence[Callable[[np.ndarray], float]],
    tolerance: float = 1e-13,
) -> tuple[float, np.ndarray, int]:
    """Integrate ``y' = rhs(y)`` until the value of an event rises through 0.

    Args:
        rhs: the slope.
        y: the initial value.
        events: functions of ``y``, each negative before it happens.
        tolerance: error of a step, relative to 1 and to ``y``.

    Returns:
        The length of the integration, the final ``y`` and the index of the event.
    """
    y = np.array(y, float)
    at, h = 0.0, 1e-6
    for _ in range(200_000):
        after, error = _step(rhs, y, h)
        share = np.max(np.abs(error) / (tolerance * (1 + np.abs(y))))
        if share <= 1:
            passed = [i for i, event in enumerate(events) if event(y) < 0 <= event(after)]
            if passed:
                way, which = min((_bisect(rhs, y, h, events[i]), i) for i in passed)
                return at + way, _step(rhs, y, way)[0], which
            at, y = at + h, after
        h *= min(5.0, max(0.2, 0.9 * share**-0.2)) if share > 0 else 5.0
    raise ArithmeticError("no event happens")


def _step(rhs: Callable, y: np.ndarray, h: float) -> tuple[np.ndarray, np.ndarray]:
    slopes = [np.array(rhs(y))]
    for row in STAGES:
        reached = y + h * sum(weight * slope for weight, slope in zip(row, slopes, strict=True))
        slopes.append(np.array(rhs(reached)))
    return reached, h * (ERROR @ np.array(slopes))


def _bisect(rhs: Callable, y: np.ndarray, h: float, event: Callable[[np.ndarray], float]) -> float:
    """Where in a step the event happens."""
    low, high = 0.0, h
    while low < (middle := (low + high) / 2) < high:
        low, high = (low, middle) if event(_step(rhs, y, middle)[0]) >= 0 else (middle, high)
    return high
