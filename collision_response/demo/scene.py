"""The interface of a moving scene, which finds its contacts itself and does not depend on ROS."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

from ..physics.body import Body, Twist
from ..physics.contact import Contact
from ..physics.laws import Regime

FRAMES = 20
"""Number of times that a scene shows its bodies, per second of its own time."""


class Collision(NamedTuple):
    """Two bodies in contact.

    Attributes:
        time: time of the scene [s].
        name_a, name_b: names of the bodies.
        body_a: the moving body, just before the impact.
        body_b: the other body; ``None`` if it is static and known to the node by its name.
        contact: the contact.
    """

    time: float
    name_a: str
    name_b: str
    body_a: Body
    body_b: Body | None
    contact: Contact


class Answer(NamedTuple):
    """The part of an answer that a scene uses: twists after the impact, energy losses, regime."""

    twist_a: Twist
    twist_b: Twist
    lost_restitution: float
    lost_friction: float
    regime: Regime


Resolve = Callable[[Collision], Answer]
Show = Callable[[float, Mapping[str, Body]], None]
"""Called with the time of the scene [s] and the bodies by name."""
