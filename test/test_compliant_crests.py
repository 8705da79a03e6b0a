"""Compression by COMPLIANT that hardly ends, or hardly does not end: ``u_n`` reaches 0 and falls back.

While the contact sticks, its springs swing: ``u'' = -K C u`` with the stiffnesses ``C = diag(kappa, 1)``.
That has a closed form. Friction that presses the bodies together makes ``u_n`` fall again before it stays
above 0. Without restitution the impact is over if ``u_n`` reaches 0 at its first crest; if not, it goes on
for long.
"""

from __future__ import annotations

import math
from functools import cache
from itertools import product

import pytest

from collision_response import ContactImpact, ImpactModel, Law, resolve_contact

TOLERANCES = [0.0, 1e-3, 1e-6, 1e-9]
CRESTS = [sign * 10.0**-k for k in range(2, 11) for sign in (1, -1)]

# A, b and kappa, and two slips that have the crest on either side of 0.
CONTACTS = {
    "metal": (4.0, 1.75, 1.0, (-0.75, -0.65)),
    "stiff along the surface": (5.8, -2.2, 5.0, (1.1, 1.4)),
    "soft along the surface": (1.75, -1.27, 2 / 3, (-0.1, 0.2)),
}


def crest(A: float, b: float, kappa: float, slip: float) -> float:
    """The first greatest ``u_n`` after a touch with this slip and an approach at speed 1."""
    trace, det = A * kappa + 1, (A - b * b) * kappa
    root = math.sqrt(trace * trace / 4 - det)
    squares = trace / 2 + root, det / (trace / 2 + root)
    (t1, n1), (t2, n2) = ((b, square - A * kappa) for square in squares)  # u_t and u_n of each mode
    size1, size2 = (slip * n2 + t2) / (t1 * n2 - t2 * n1), (-t1 - slip * n1) / (t1 * n2 - t2 * n1)
    w1, w2 = map(math.sqrt, squares)
    a1, a2 = size1 * n1, size2 * n2

    def slope(t: float) -> float:
        return -a1 * w1 * math.sin(w1 * t) - a2 * w2 * math.sin(w2 * t)

    low = next(t for t in (i / 1000 for i in range(1, 10_000)) if slope(t) > 0 >= slope(t + 1e-3))
    high = low + 1e-3
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if slope(middle) > 0 else (low, middle)
    return a1 * math.cos(w1 * low) + a2 * math.cos(w2 * low)


@cache
def slip_with(wanted: float, A: float, b: float, kappa: float, slips: tuple[float, float]) -> float:
    """The slip with which the first crest is at this ``u_n``."""
    low, high = slips
    is_high_at_low = crest(A, b, kappa, low) > crest(A, b, kappa, high)
    for _ in range(60):
        middle = (low + high) / 2
        is_low = crest(A, b, kappa, middle) < wanted
        low, high = (low, middle) if is_low == is_high_at_low else (middle, high)
    return low


@pytest.mark.parametrize(("A", "b", "kappa", "slips"), CONTACTS.values(), ids=CONTACTS)
def test_compression_ends_if_u_n_just_reaches_0(A, b, kappa, slips):
    K = [[A, 0.0, b], [0.0, A, 0.0], [b, 0.0, 1.0]]

    def resolved(wanted: float, tolerance: float) -> ContactImpact:
        u = slip_with(wanted, A, b, kappa, slips), 0.0, -1.0
        model = ImpactModel(Law.COMPLIANT, tolerance=tolerance, stiffness_ratio=kappa)
        return resolve_contact(K, u, (0.0, 0.0, 1.0), 0.0, 30.0, model)

    early = resolved(0.01, 0.0).normal_impulse
    wrong, known = [], 0
    for wanted, tolerance in product(CRESTS, TOLERANCES):
        result = resolved(wanted, tolerance)
        known += result.error_bound < 1
        if result.error_bound < 1 and (result.normal_impulse < 1.3 * early) != (wanted > 0):
            wrong.append((wanted, tolerance, result.normal_impulse, result.error_bound))
    assert not wrong
    # Next to 0, and with coarse steps, no bound is known.
    assert known >= 0.8 * len(CRESTS) * len(TOLERANCES)
