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
Friction may wedge bodies, as in a corner of two walls with mu > 1: its springs stay compressed, and the path
has no end.

Sources: Liu, Zhao & Brogliato, "Frictionless Multiple Impacts in Multibody Systems. I. Theoretical
Framework", Proc. R. Soc. A 464 (2008); Ascher, Ruuth & Spiteri, "Implicit-Explicit Runge-Kutta Methods for
Time-Dependent Partial Differential Equations", Appl. Numer. Math. 25 (1997), for the steps with friction.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

from ..status import ImpactError, StatusCode
from .reflections import ClusterImpulses

LEAST_RESTITUTION = 0.05
"""Below it a path takes too many compressions to end."""

WORK = 1_500_000_000
"""A budget for all paths together, roughly in nanoseconds: a second or two."""


class Paths(NamedTuple):
    """With which errors of a step the path is followed, relative to the motion.

    Attributes:
        first, ratio: of the first path, and of one to the next.
        enough: the estimate that suffices without a tolerance.
    """

    first: float
    ratio: float
    enough: float


SMOOTH, RUBBING = Paths(1e-5, 1e-2, 1e-6), Paths(1e-2, 1e-1, 1e-5)
LEAST_PATHS = 3
"""So many are followed at least: two may be near each other by chance."""

FINEST = 1e-13
COARSEST_RATIO = 0.5
"""A path that is hardly finer than the one before tells nothing."""

WORST = 0.1
"""An answer with a greater estimate is none."""


def compressed(
    cluster: Any,
    stiffness: Sequence[float],
    exponent: float,
    tolerance: float,
    *,
    has_friction: bool,
    apart: Callable[[ClusterImpulses, ClusterImpulses], float],
) -> tuple[ClusterImpulses, float]:
    """The impulses, and the relative error of the answer.

    Args:
        cluster: see ``collision_response/scene/__init__.py``.
        stiffness: of each contact, in any unit.
        exponent: ``eta``.
        tolerance: relative error wanted; 0: any.
        has_friction: whether a contact has.
        apart: how far two answers are apart, relative to the change.

    Raises:
        ImpactError: PATH_TOO_LONG: the budget was spent before two paths came near each other, or a path
            has no end.
    """

    paths = RUBBING if has_friction else SMOOTH
    fine, ratio, work, change, estimate = paths.first, paths.ratio, WORK, 0.0, math.inf
    found: list[ClusterImpulses] = []
    while fine >= FINEST and (len(found) < LEAST_PATHS or estimate > (tolerance or paths.enough)):
        path = cluster.compress(list(stiffness), exponent, fine, work, has_friction)
        if path is None:
            break
        if path is False:
            reason = "friction wedges the bodies: springs stay compressed, and their impulses have no end"
            raise ImpactError(StatusCode.PATH_TOO_LONG, "contacts", reason)
        p, tangential, rubbed, left = path
        found.append(ClusterImpulses(p, tangential, rubbed=rubbed))
        if len(found) > 1:
            # A change may be small by chance: no less than the one before leads to expect.
            change = max(apart(*found[-2:]), change * ratio)
            estimate = 2 * change + fine
        # The work of a path grows with the root of its fineness, or faster: no finer than the budget allows.
        ratio = max(paths.ratio, (1.25 * (work - left) / max(left, 1)) ** 2)
        if ratio > COARSEST_RATIO:
            break
        fine, work = fine * ratio, left
    if estimate > WORST:
        reason = "the path of the impulses did not settle within its budget"
        raise ImpactError(StatusCode.PATH_TOO_LONG, "contacts", reason)
    return found[-1], estimate
