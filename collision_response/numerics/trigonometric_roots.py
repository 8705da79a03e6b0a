"""Real roots of trigonometric polynomials of degree two."""

from __future__ import annotations

import math

import numpy as np

ON_CIRCLE = 1e-5
"""How far from the unit circle a computed root may lie. Rounding moves a simple root by about 1e-15
and a double one by its square root; a false root that slips in is one that a caller must reject."""


def trigonometric_roots(
    constant: float, cosine: float, sine: float, cosine_2: float, sine_2: float
) -> list[float]:
    """The angles in (-pi, pi] where a trigonometric polynomial vanishes, at most four.

    ``f(a) = constant + cosine cos a + sine sin a + cosine_2 cos 2a + sine_2 sin 2a``. With
    ``z = exp(i a)`` it is a quartic in ``z``, whose roots on the unit circle are wanted. They are
    found as eigenvalues of its companion matrix and polished by Newton's method on ``f``.
    """
    quartic = np.array(
        [
            (cosine_2 - 1j * sine_2) / 2,
            (cosine - 1j * sine) / 2,
            constant,
            (cosine + 1j * sine) / 2,
            (cosine_2 + 1j * sine_2) / 2,
        ]
    )
    size = np.abs(quartic).max()
    if size == 0:
        return []
    roots = np.roots(np.where(np.abs(quartic) < 1e-300 * size, 0, quartic) / size)
    angles = np.angle(roots[np.abs(np.abs(roots) - 1) < ON_CIRCLE]).tolist()

    def polish(a: float) -> float:
        for _ in range(3):
            f = constant + cosine * math.cos(a) + sine * math.sin(a)
            f += cosine_2 * math.cos(2 * a) + sine_2 * math.sin(2 * a)
            slope = sine * math.cos(a) - cosine * math.sin(a)
            slope += 2 * (sine_2 * math.cos(2 * a) - cosine_2 * math.sin(2 * a))
            step = f / slope if slope else 0.0
            if abs(step) > ON_CIRCLE:
                break
            a -= step
        return a

    return [polish(a) for a in angles]
