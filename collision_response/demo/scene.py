"""What a moving scene asks for and is told: it finds the contacts, and knows nothing of ROS."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import NamedTuple

from ..physics.body import Body, Twist
from ..physics.contact import Contact
from ..physics.laws import Regime
from ..physics.vector import Vec3

FRAMES = 20
"""How often a scene shows where its bodies are, per second of its time."""


class Encounter(NamedTuple):
    """Two bodies that touch.

    Attributes:
        time: of the scene [s].
        name_a, name_b: of the bodies.
        body_a: the moving one, as it is now.
        body_b: the other one; ``None`` if it stands still, and is known by its name.
        contact: where and how.
    """

    time: float
    name_a: str
    name_b: str
    body_a: Body
    body_b: Body | None
    contact: Contact


class Answer(NamedTuple):
    """What a scene needs to know of an impact: twists, impulse on body_a, losses."""

    twist_a: Twist
    twist_b: Twist
    impulse: Vec3
    lost_restitution: float
    lost_friction: float
    regime: Regime


Resolve = Callable[[Encounter], Answer]
Show = Callable[[float, Mapping[str, Body]], None]
"""Is told the time of the scene [s] and where everything is."""
