"""L3, Coulomb friction in one step: Moreau's law, to which iterative engines converge.

The normal velocity is reversed, ``u_n+ = -e u_n``, and Coulomb's law is applied to the velocity
*after* the impact. With the unit normal ``n``:

    stick   u+ = -e u_n n, so P = K^-1 (-e u_n n - u), if that lies in the friction cone;
    slide   P = p (n - mu t),  p = -(1 + e) u_n / (n.K (n - mu t)),  where the slip that remains has
            the direction t of the friction it meets: (u + K P)_t = s t, s >= 0.

In the plane ``t`` is one of two directions. In space its angle solves

    (u_t x t) (n.K (n - mu t)) - (1 + e) u_n (K (n - mu t))_t x t = 0,

a trigonometric polynomial of degree two with up to four roots. If several slide, the one that leaves
the least energy is taken.

The law may *create* energy (Kane's paradox), and at high friction it may have no solution. Both are
detected; the answer is then Chatterjee & Ruina's, and says so.

Source: Moreau, "Unilateral Contact and Dry Friction in Finite Freedom Dynamics", 1988, section 9;
Kane & Levinson, *Dynamics: Theory and Applications*, 1985, section 5.8, for the paradox.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from ...numerics.trigonometric_roots import trigonometric_roots
from ..effective_mass import Approach
from ..vector import V, Vec2
from .chatterjee_ruina import chatterjee_ruina
from .law import Outcome, Parameters, Regime, slipping
from .tangent_plane import direction, tangents

ROUNDING = 2.0**-48
"""Work that is less than this part of the work against the approach is rounding."""


def moreau(approach: Approach[V], parameters: Parameters) -> Outcome:
    """The one-step impulse, or Chatterjee & Ruina's where that one is unsound."""
    outcome = one_step(approach, parameters)
    if outcome is None or creates_energy(approach, outcome):
        return chatterjee_ruina(approach, parameters)._replace(fell_back=True)
    return outcome


def one_step(approach: Approach[V], parameters: Parameters) -> Outcome | None:
    """Moreau's law as it is, energy or not; ``None`` if it has no solution."""
    e, mu = parameters.restitution, parameters.friction
    K, u, n = approach.mobility(), approach.u, approach.n / approach.n.norm()
    u_n = approach.n_u / approach.n.norm()
    P = K.solve(-u - n * (e * u_n))
    P_n = n.dot(P)
    if (P - n * P_n).norm() <= mu * P_n:
        return Outcome(P, Regime.STICKING)
    sliding = list(_sliding_impulses(K, u, u_n, n, e, mu))
    if not sliding:
        return None
    P = min(sliding, key=lambda impulse: impulse.dot(u * 2 + K @ impulse))
    return Outcome(P, slipping(approach, u + K @ P))


def creates_energy(approach: Approach[V], outcome: Outcome) -> bool:
    """Whether the bodies end with more kinetic energy than they had."""
    P: Any = outcome.impulse
    u = approach.u
    work = P.dot(u * 2 + approach.mobility() @ P) / 2
    return bool(work > ROUNDING * abs(P.dot(u)))


def _sliding_impulses(K: Any, u: Any, u_n: float, n: Any, e: float, mu: float) -> Iterator[Any]:
    for t in _candidate_directions(K, u, u_n, n, e, mu):
        along = n - t * mu
        inverse_mass = n.dot(K @ along)
        if inverse_mass > 0:
            P = along * (-(1 + e) * u_n / inverse_mass)
            if t.dot(u + K @ P) >= 0:
                yield P


def _candidate_directions(K: Any, u: Any, u_n: float, n: Any, e: float, mu: float) -> list[Any]:
    """Directions in which the slip that remains may be parallel to the friction it meets."""
    if isinstance(n, Vec2):
        return [*tangents(n), *(-t for t in tangents(n))]
    t_1, t_2 = tangents(n)
    K_1, K_2 = K @ t_1, K @ t_2
    u_1, u_2, k_1, k_2, k_n = t_1.dot(u), t_2.dot(u), n.dot(K_1), n.dot(K_2), n.dot(K @ n)
    k_11, k_12, k_22 = t_1.dot(K_1), t_1.dot(K_2), t_2.dot(K_2)
    j = (1 + e) * u_n
    angles = trigonometric_roots(
        constant=mu * (u_2 * k_1 - u_1 * k_2) / 2,
        cosine=j * k_2 - u_2 * k_n,
        sine=u_1 * k_n - j * k_1,
        cosine_2=mu * ((u_1 * k_2 + u_2 * k_1) / 2 - j * k_12),
        sine_2=mu * ((u_2 * k_2 - u_1 * k_1) + j * (k_11 - k_22)) / 2,
    )
    return [direction(t_1, t_2, angle) for angle in angles]
