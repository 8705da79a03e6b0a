"""What every law takes and gives.

A law is a function ``law(approach, parameters) -> Outcome``. It sees two bodies only through
:class:`~collision_response.physics.effective_mass.Approach`, so it works in every geometry, and it
is asked only about bodies that approach each other: ``n.u < 0``.
"""

from __future__ import annotations

from enum import IntEnum
from typing import Any, NamedTuple

from ..effective_mass import Approach
from ..number import Scalar, choose
from ..vector import V, Vector


class Parameters(NamedTuple):
    """What a law needs to know besides the bodies.

    Attributes:
        restitution: ``e`` in [0, 1].
        friction: ``mu`` >= 0.
        tangential_restitution: ``e_t`` in [-1, 1].
        tolerance: relative error at which a law that integrates may stop.
    """

    restitution: Scalar
    friction: Scalar = 0.0
    tangential_restitution: Scalar = 0.0
    tolerance: float = 0.0


class Regime(IntEnum):
    """What friction did: the constants of ``msg/CollisionResult.msg``."""

    SEPARATING = 1
    STICKING = 2
    SLIDING = 3
    REVERSED = 4
    JAMMED = 5


class Outcome(NamedTuple):
    """The answer of a law.

    Attributes:
        impulse: on body_a [N s].
        regime: what friction did, a :class:`Regime`.
        normal_work: done on the bodies by the normal impulse [J], where the law knows better than
            the mean of the normal velocities before and after; else ``None``.
        fell_back: whether the law had no sound answer, and this is Chatterjee & Ruina's.
        split: the impulses between which Chatterjee & Ruina's law chose, if it was that law: the error
            bound needs them again.
        condition: how many times greater the relative error of the impulse can be than those made on the
            way to it, where the law follows a path.
    """

    impulse: Vector
    regime: Scalar
    normal_work: Scalar | None = None
    fell_back: bool = False
    split: Any = None
    condition: Scalar = 1.0


def slipping(approach: Approach[V], velocity_after: V) -> Scalar:
    """The regime of a contact that ends with slip: SLIDING, or REVERSED against its first direction."""
    n, u = approach.n, approach.u
    slip_before = u - n * (n.dot(u) / n.dot(n))
    return choose(slip_before.dot(velocity_after) < 0, lambda: Regime.REVERSED, lambda: Regime.SLIDING)
