"""ROUTH_STRONGE for several contacts: Liu, Zhao & Brogliato's law, as an equation in time.

Each contact is a spring that gives back the part e^2 of the work it took, as Stronge's law does:

    v' = M^-1 N f     f_i = k_i max(x_i, 0)^eta
    x_i' = -u_i            while u_i < 0                 loading
         = -u_i / e_i^2    while u_i > 0 and x_i > 0     unloading
         = 0               else

until all x_i are 0 and u >= 0. Only the ratios of the k_i matter; eta is 1 for linear springs, 3/2 for
Hertz's. For one contact it gives u+ = -e u for any of them. Friction opposes the slip, with mu f_i at
most.

Without friction the equation is integrated by a pair of orders 5 and 4, and the answer for a coarser
tolerance tells its error. With friction a step solves for the slip at its end, so that contacts stick,
and is of first order: steps are refined until the answer settles. Both errors are estimates.

A contact given twice is twice as stiff. For e towards 0 a contact takes ever more compressions to end.

Source: Liu, Zhao & Brogliato, "Frictionless Multiple Impacts in Multibody Systems. I. Theoretical
Framework", Proc. R. Soc. A 464 (2008).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any

from ..status import ImpactError, StatusCode
from .reflections import Struck

LEAST_RESTITUTION = 0.05
"""Below it a path takes too many compressions to end."""

STEPS = 2_000_000
FINEST = 1e-13
DEFAULT = 1e-9
COARSER = 100
FIRST_STEP = 1 / 64
REFINEMENTS = 14
FINER = 0.618
"""No simple ratio: slip ends somewhere within a step, and the error is how far from its end."""

LOOK_BACK = 3
"""So many changes must be small: one may be by chance."""

SETTLED = 1e-4
"""Relative change at which steps with friction are refined no more, without a tolerance."""


def compressed(
    cluster: Any,
    stiffness: Sequence[float],
    exponent: float,
    tolerance: float,
    *,
    has_friction: bool,
    apart: Callable[[Struck, Struck], float],
) -> tuple[Struck, float]:
    """The impulses, and the relative error of the answer.

    Args:
        cluster: see ``collision_response/scene/__init__.py``.
        stiffness: of each contact, in any unit.
        exponent: ``eta``.
        tolerance: relative error wanted; 0: any.
        has_friction: whether a contact has.
        apart: how far two answers are apart, relative to the change.

    Raises:
        ImpactError: PATH_TOO_LONG.
    """

    def path(fineness: float) -> Struck:
        found = cluster.compress(list(stiffness), exponent, fineness, STEPS, has_friction)
        if found is None:
            reason = f"the path of the impulses did not end within {STEPS} steps"
            raise ImpactError(StatusCode.PATH_TOO_LONG, "contacts", reason)
        p, tangential, _ = found
        return Struck(p, tangential if has_friction else None)

    if not has_friction:
        fine = max(tolerance / COARSER, FINEST) if tolerance else DEFAULT
        struck = path(fine)
        return struck, apart(path(fine * COARSER), struck) + fine
    step, changes = FIRST_STEP, [math.inf] * LOOK_BACK
    struck = path(step)
    for _ in range(REFINEMENTS):
        step *= FINER
        finer = path(step)
        changes = [*changes[1:], apart(struck, finer)]
        struck = finer
        if max(changes) <= (tolerance or SETTLED):
            break
    return struck, 2 * max(changes)
