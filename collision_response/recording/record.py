"""What is recorded, in plain Python."""

from __future__ import annotations

from typing import NamedTuple

from .. import Impact
from ..physics.body import Body


class Record(NamedTuple):
    """One impact.

    Attributes:
        stamp: when [ns].
        sequence: number of the answer.
        name_a, name_b: of the bodies.
        body_a, body_b: before the impact.
        impact: the answer.
    """

    stamp: int
    sequence: int
    name_a: str
    name_b: str
    body_a: Body
    body_b: Body
    impact: Impact


class Sighting(NamedTuple):
    """Where a body was, at a time when nothing need have struck it.

    Attributes:
        stamp: when [ns].
        name: of the body.
        body: as it was.
    """

    stamp: int
    name: str
    body: Body


class Refusal(NamedTuple):
    """One request that could not be answered.

    Attributes:
        stamp: when [ns].
        sequence: number of the answer.
        reason: in words.
    """

    stamp: int
    sequence: int
    reason: str


Entry = Record | Sighting | Refusal
