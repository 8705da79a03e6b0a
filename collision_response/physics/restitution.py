"""Restitution that depends on the approach speed, for :attr:`Contact.restitution`.

Each function takes constants of the material and returns ``e(v)``: the coefficient in [0, 1] for an
approach speed ``v`` [m/s].
"""

from __future__ import annotations

import math
from collections.abc import Callable

Restitution = Callable[[float], float]


def viscoelastic(beta: float) -> Restitution:
    """Spheres that dissipate by viscosity: the faster, the less they rebound.

    Hertz's contact with viscous dissipation, ``x'' = -k x^(3/2) - (3/2) A k x^(1/2) x'``, depends on
    the speed only by ``s = beta^(1/2) v^(1/10)`` with ``beta = (3/2) A k^(2/5)`` [(s/m)^(1/5)], where
    ``A`` [s] is the dissipative constant and ``k`` Hertz's stiffness over the effective mass.

    Source: the [1/4] Pade approximant of Mueller & Poeschel, "Collision of viscoelastic spheres:
    Compact expressions for the coefficient of normal restitution", Phys. Rev. E 84 (2011) 021302;
    within 0.01 of the collision's equation of motion.

    Raises:
        ValueError: ``beta`` is negative or not finite.
    """
    if not 0 <= beta < math.inf:
        raise ValueError(f"beta must be finite and not negative, is {beta}")

    def restitution(v: float) -> float:
        s = math.sqrt(beta) * v**0.1
        denominator = 1 + s * (0.501086 + s * (1.15345 + s * (0.577977 + s * 0.532178)))
        return (1 + 0.501086 * s) / denominator

    return restitution


def plastic(yield_speed: float) -> Restitution:
    """Spheres that yield: elastic up to ``yield_speed`` [m/s], then falling as ``v^(-1/4)``.

    Source: Thornton, "Coefficient of Restitution for Collinear Collisions of Elastic-Perfectly
    Plastic Spheres", J. Appl. Mech. 64 (1997) 383-386, eq. 22; its limit for high speed is that of
    Johnson, *Contact Mechanics*, 1985, section 11.5.

    Raises:
        ValueError: ``yield_speed`` is not positive and finite.
    """
    if not 0 < yield_speed < math.inf:
        raise ValueError(f"yield_speed must be positive and finite, is {yield_speed}")

    def restitution(v: float) -> float:
        if v <= yield_speed:
            return 1.0
        q = yield_speed / v
        root = math.sqrt(6 / 5 - q * q / 5)
        return math.sqrt(6 * math.sqrt(3) / 5 * (1 - q * q / 6)) * (q / (q + 2 * root)) ** 0.25

    return restitution
