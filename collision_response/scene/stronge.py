"""ROUTH_STRONGE for several contacts: Liu, Zhao & Brogliato's law, as an equation in time.

Each contact is a spring that gives back the part e^2 of the work it took, as Stronge's law does:

    v' = M^-1 N f     f_i = k_i max(x_i, 0)^eta
    x_i' = -u_i            while u_i < 0                 loading
         = -u_i / e_i^2    while u_i > 0 and x_i > 0     unloading
         = 0               else

until all x_i are 0 and u >= 0. Only the ratios of the k_i matter; eta is 1 for linear springs, 3/2 for
Hertz's. For one contact it gives u+ = -e u for any of them. Friction opposes the slip, with mu f_i at
most. So a contact loses (1 - e^2) of what compresses it, and friction the work along its path.

Without friction the equation is integrated by a pair of orders 5 and 4. With friction a step solves for
the slip at its end, so that contacts stick; it is of order 2, and extrapolated to 3. Steps adapt to an
error for each; one in which a spring turns, where its rate bends, ends there. The whole path is followed
with ever smaller errors, and how far the last two answers are apart is the estimate of the error.

A contact given twice is twice as stiff. For e towards 0 a contact takes ever more compressions to end.

Sources: Liu, Zhao & Brogliato, "Frictionless Multiple Impacts in Multibody Systems. I. Theoretical
Framework", Proc. R. Soc. A 464 (2008); Ascher, Ruuth & Spiteri, "Implicit-Explicit Runge-Kutta Methods for
Time-Dependent Partial Differential Equations", Appl. Numer. Math. 25 (1997), for the steps with friction.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from ..status import ImpactError, StatusCode
from .reflections import Struck

LEAST_RESTITUTION = 0.05
"""Below it a path takes too many compressions to end."""

WORK = 500_000_000
"""A budget for all paths together, in couplings of two contacts: a second or two."""


class Paths(NamedTuple):
    """With which errors of a step the path is followed, relative to the motion.

    Attributes:
        first, ratio: of the first path, and of one to the next.
        enough: the estimate that suffices without a tolerance.
    """

    first: float
    ratio: float
    enough: float


SMOOTH, RUBBING = Paths(1e-7, 1e-2, 1e-6), Paths(1e-4, 1e-1, 1e-5)
FINEST = 1e-13


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
        ImpactError: PATH_TOO_LONG: the budget was spent before there were two paths to compare.
    """

    paths = RUBBING if has_friction else SMOOTH
    work, estimate, change, last = WORK, math.inf, 0.0, None
    fine = paths.first
    while fine >= FINEST and estimate > (tolerance or paths.enough):
        found = cluster.compress(list(stiffness), exponent, fine, work, has_friction)
        if found is None:
            break
        p, tangential, rubbed, work = found
        struck = Struck(p, tangential, rubbed=rubbed)
        if last is not None:
            # A change may be small by chance: no less than the one before leads to expect.
            change = max(apart(last, struck), change * paths.ratio)
            estimate = 2 * change + fine
        last = struck
        fine *= paths.ratio
    if last is None or estimate == math.inf:
        reason = "the path of the impulses did not end within its budget"
        raise ImpactError(StatusCode.PATH_TOO_LONG, "contacts", reason)
    return last, estimate
