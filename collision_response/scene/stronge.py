"""ROUTH_STRONGE for several contacts: the law of Liu, Zhao & Brogliato, as a differential equation in time.

Each contact is a spring that gives back the fraction e^2 of the work it took, as in Stronge's law:

    v' = M^-1 N f     f_i = k_i max(x_i, 0)^eta
    x_i' = -u_i            while u_i < 0                 loading
         = -u_i / e_i^2    while u_i > 0 and x_i > 0     unloading
         = 0               else

until all x_i are 0 and u >= 0. Only the ratios of the k_i matter. The exponent eta is 1 for linear springs
and 3/2 for Hertz's. For one contact u+ = -e u, for any k and eta. Friction opposes the slip, with at most mu
f_i. So a contact loses (1 - e^2) of the work that compresses it, and friction takes its work along the path.

Without friction a Runge-Kutta pair of orders 5 and 4 integrates the equation. With friction each step solves
for the slip at its end, so that contacts can stick; its order is 2, extrapolated to 3. Steps adapt to an
error allowed for each; a step in which a spring turns from loading to unloading, where its rate bends, ends
there. The whole path is followed several times, with smaller and smaller errors, and the distance between the
last two answers is the estimate of the error.

A contact given twice is twice as stiff. The smaller e is, the more compressions a contact takes to end.
Friction may wedge bodies, as in a corner of two walls with mu > 1: then springs stay compressed, and the path
has no end.

The integration is ``ContactSprings`` of ``kernels/scene/contact_springs.hpp``.

Sources: Liu, Zhao & Brogliato, "Frictionless Multiple Impacts in Multibody Systems. I. Theoretical
Framework", Proc. R. Soc. A 464 (2008); Ascher, Ruuth & Spiteri, "Implicit-Explicit Runge-Kutta Methods for
Time-Dependent Partial Differential Equations", Appl. Numer. Math. 25 (1997), for the steps with friction.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

from ..kernels import library
from ..status import ImpactError, StatusCode
from .impulses import ClusterImpulses

LEAST_RESTITUTION = 0.05
"""Below this restitution a path takes too many compressions to end."""

WORK = 1_500_000_000
"""Budget for all paths together, roughly in nanoseconds: a second or two."""


class Refinement(NamedTuple):
    """The errors allowed in a step of each successive path, relative to the motion.

    Attributes:
        first: of the first path.
        ratio: of each path to the one before.
        enough: estimate of the answer's error at which to stop, if no tolerance is given.
    """

    first: float
    ratio: float
    enough: float


WITHOUT_FRICTION, WITH_FRICTION = Refinement(1e-5, 1e-2, 1e-6), Refinement(1e-2, 1e-1, 1e-5)

LEAST_PATHS = 3
"""Least number of paths: two may be close to each other by chance."""

FINEST = 1e-13
"""Least error allowed in a step."""

COARSEST_RATIO = 0.5
"""A path whose error is not smaller than this fraction of the one before tells nothing new."""

WORST = 0.1
"""Greatest error estimate that still counts as an answer."""


def follow_springs(
    cluster: library.Cluster,
    stiffness: Sequence[float],
    exponent: float,
    tolerance: float,
    *,
    has_friction: bool,
    distance: Callable[[ClusterImpulses, ClusterImpulses], float],
) -> tuple[ClusterImpulses, float]:
    """Return the impulses, and an estimate of the relative error of the answer.

    Args:
        cluster: see ``scene/__init__.py``.
        stiffness: of each contact, in any unit.
        exponent: ``eta``.
        tolerance: greatest relative error wanted; 0 for the default.
        has_friction: whether a contact has friction.
        distance: of the answers that two sets of impulses give, relative to the change of velocity.

    Raises:
        ImpactError: PATH_TOO_LONG, if the budget is spent before two paths come close to each other, or if a
            path has no end.
    """
    refinement = WITH_FRICTION if has_friction else WITHOUT_FRICTION
    step_error, ratio, work, change, estimate = refinement.first, refinement.ratio, WORK, 0.0, math.inf
    paths: list[ClusterImpulses] = []
    while step_error >= FINEST and (len(paths) < LEAST_PATHS or estimate > (tolerance or refinement.enough)):
        path = cluster.follow_springs(list(stiffness), exponent, step_error, work, has_friction)
        if path is None:  # the budget is spent
            break
        if path is False:
            reason = "friction wedges the bodies: springs stay compressed, and their impulses have no end"
            raise ImpactError(StatusCode.PATH_TOO_LONG, "contacts", reason)
        normal, tangential, friction_loss, work_left = path
        paths.append(ClusterImpulses(normal, tangential, friction_loss=friction_loss))
        if len(paths) > 1:
            # A change may be small by chance, so it counts for no less than the one before predicts.
            change = max(distance(*paths[-2:]), change * ratio)
            estimate = 2 * change + step_error
        # The work of a path grows at least with the square root of the refinement: stay within the budget.
        ratio = max(refinement.ratio, (1.25 * (work - work_left) / max(work_left, 1)) ** 2)
        if ratio > COARSEST_RATIO:
            break
        step_error, work = step_error * ratio, work_left
    if estimate > WORST:
        reason = "the path of the impulses did not settle within its budget"
        raise ImpactError(StatusCode.PATH_TOO_LONG, "contacts", reason)
    return paths[-1], estimate
