"""A bound on the error of Routh's path, in the letters and units of ``routh.py``.

Friction draws any two slips together, in the norm of ``A^-1``. So at a given ``p`` the error of the slip is,
in that norm, at most ``E / l``, where ``l^2`` is the least eigenvalue of ``A``, and

    E = |du_t| + p |db| + |P_t| |dA| + ...

is the sum of all errors in the data and in ``du_t = f dx``. Hence ``P_t = A^-1 (u_t - u_t0 - b p)`` has an
error of at most ``2 E / l^2``. While slip is fast, only its direction is in error, and ``P_t`` by
``m x E L / (l s)``, with the greatest eigenvalue ``L^2``; this is less if the impact grazes. ``u_n`` then has
an error of ``D = |b| |dP_t| + |P_t| |db|``, which moves the ends of the phases by

    compression    D / (du_n/dp)
    Poisson        e times that
    Stronge        D (e^2 p_c + p) / u_n, or the root of 2 D (e^2 p_c + p) / (du_n/dp) if that is less

Rounding in the straight pieces is bounded by the numbers themselves.

Friction above ``GREATEST_FRICTION`` is taken as that. At a given ``x``, ``c`` and ``m`` are then in error by
``c`` at most, so that the normal impulse of the slip, ``c x``, may be anything down to 0. No bound is known
if that matters: if only ``c`` raises ``u_n`` while the contact slips, or if it slips on after a stop.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from ...numbers.operations import Scalar, certain, choose, maximum, minimum, negation, square_root
from .contact_frame import Tangential
from .routh_path import Path, TurningSlip
from .routh_straight import Ray, StraightRest

SAFETY = 2.01


class InputErrors(NamedTuple):
    """The errors of the data.

    Attributes:
        A, b, slip, e, mu: of ``A``, of ``b``, of the first slip, of restitution and of friction.
        c: of ``c`` and of ``m`` at a given ``x``; 0 unless friction is above ``GREATEST_FRICTION``.
    """

    A: Scalar
    b: Scalar
    slip: Scalar
    e: Scalar
    mu: Scalar
    c: Scalar


class PathError(NamedTuple):
    """The error of a path, in values.

    Attributes:
        P_t, P_n: of the tangential and the normal impulse.
        u_n, slip: of the normal velocity and the slip at a given normal impulse.
        steps: of the slip and the impulses while slip turns, from the steps.
        friction: tangential impulse per normal impulse where the end of the path is uncertain.
        size: the tangential impulse itself.
    """

    P_t: Scalar
    P_n: Scalar
    u_n: Scalar
    slip: Scalar
    steps: Scalar
    friction: Scalar
    size: Scalar


def path_error(
    path: Path, ray: Ray, y: TurningSlip, rest: StraightRest, X: Scalar, mu: Scalar, errors: InputErrors
) -> PathError:
    """The error of the path: see the head of this file. ``X`` is the impulse ``x`` of all slip."""
    slips_on, slips_to_end = rest.slips_on, rest.slips_to_end
    known = (
        X, rest.along, rest.after_stop, rest.p_c, rest.p, rest.s_c, rest.s_e, rest.u_c, rest.u, rest.W_c,
        rest.g, rest.w, rest.r, *ray[4:8],
    )  # fmt: skip
    X, along, after_stop, p_c, p, s_c, s_e, u_c, u, W_c, g, w, r, k, _, rate, misfit = map(certain, known)
    A11, _, A22, b1, b2, c, m, e, energetic, _ = path
    infinite, L2, P_t, b = math.inf + 0 * A11, A11 + A22, m * X + k * after_stop, Tangential(b1, b2).length()
    E = errors.slip + errors.b * (p_c + p) + errors.A * P_t + errors.mu * L2 * c * X
    E = certain(E + abs(w) * abs(along) + y.slip_error + misfit * k * L2 * after_stop)
    excess = certain(errors.c * X)
    early = certain(excess * (1 + b * P_t))  # normal work that may be done earlier
    E = certain(E + excess * (b + L2))
    l2, slip_error = (
        certain(path.least_eigenvalue() - errors.A),
        certain(E * square_root(L2 / path.least_eigenvalue())),
    )
    least_s = certain(
        minimum(y.least_s, choose(slips_to_end, lambda: minimum(s_c, s_e), lambda: 0 * A11)) - slip_error
    )
    by_slip = certain(choose(l2 > 0, lambda: SAFETY * E / l2, lambda: infinite))
    by_direction = certain(choose(least_s > 0, lambda: P_t * slip_error / least_s, lambda: infinite))
    by_cone = certain(SAFETY / 2 * (P_t + mu * (p_c + p)))  # no two impulses in the cone are further apart
    e_P = certain(minimum(minimum(by_slip, by_direction), by_cone) + y.impulse_error + errors.mu * c * X)
    shift = choose(slips_on & (excess > 0), lambda: 3 * excess + after_stop, lambda: 3 * excess)
    e_P = certain(e_P + excess + k * shift)
    D = certain(P_t * errors.b + b * e_P + y.impulse_error + excess)
    # The error of p_c: by the least du_n/dp that u_n may have had where it reached 0.
    R = certain(r / c)
    either = choose(r > 0, lambda: minimum(R, rate), lambda: rate)
    sliding_rate = choose(certain(s_c * r + g * D * c) < 0, lambda: either, lambda: R)
    sliding_rate = choose(rest.in_restitution, lambda: certain(y.slope) / c, lambda: sliding_rate)
    stopped_rate = choose(certain(u_c + D) > 0, lambda: either, lambda: rate)
    e_c = certain(SAFETY * D / choose(slips_on, lambda: sliding_rate, lambda: stopped_rate))
    most_e = certain(e + errors.e)  # e may be wholly uncertain: at the threshold, between 0 and itself

    e_W = certain(D * (most_e * most_e * p_c + p + e_c) - (most_e + e) * errors.e * W_c)
    e_W = certain(e_W + choose(slips_on, lambda: 0 * A11, lambda: most_e * most_e * early))

    def error_by_work() -> Scalar:
        surely_slips = slips_to_end & (least_s > 0)
        least_rate = choose(
            surely_slips, lambda: R, lambda: choose(slips_on, lambda: minimum(R, rate), lambda: rate)
        )
        either = choose(slips_on, lambda: maximum(abs(R), rate), lambda: rate)
        greatest_rate = choose(surely_slips, lambda: abs(R), lambda: either)
        root = choose(least_rate > 0, lambda: square_root(2 * e_W / least_rate), lambda: infinite)
        is_linear = certain(4 * greatest_rate * e_W) < certain(u * u)
        return choose(is_linear, lambda: SAFETY * e_W / u, lambda: root)

    e_r = choose(energetic, error_by_work, lambda: most_e * e_c + errors.e * p_c)
    e_p, steps = certain(e_c + e_r), y.slip_error + y.impulse_error + early + excess * L2 * P_t
    reaches_ends = (certain(y.crest - 2 * D) > 0) & (certain(c * y.crest_of_work - 2 * e_W) > 0)
    is_sound = (e_c >= 0) & reaches_ends & (y.excess_turn <= 0)
    is_known = ray.sticks & negation(slips_on & (r <= 1e3 * errors.c))
    is_sound = is_sound & ((errors.c <= 0) | is_known)
    friction = choose(slips_to_end | (after_stop < e_p), lambda: mu, lambda: k)
    e_P = choose(is_sound, lambda: e_P + friction * e_p, lambda: infinite)
    e_p = choose(is_sound, lambda: e_p, lambda: infinite)
    return PathError(e_P, e_p + shift, D, slip_error, steps, friction, P_t)
