"""What is recorded, in plain Python."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from .. import Body, Contact, Impact, ImpactModel, SceneImpact


class Record(NamedTuple):
    """One impact.

    Attributes:
        stamp: when [ns]; 0 if nobody knows.
        sequence: number of the answer.
        name_a, name_b: of the bodies.
        body_a, body_b, contact, model: the request.
        impact: the answer.
        duration: of the computation [s]; NaN if nobody measured it.
    """

    stamp: int
    sequence: int
    name_a: str
    name_b: str
    body_a: Body
    body_b: Body
    contact: Contact
    model: ImpactModel
    impact: Impact
    duration: float = math.nan


class SceneRecord(NamedTuple):
    """Several contacts at once.

    Attributes:
        stamp: when [ns]; 0 if nobody knows.
        sequence: number of the answer.
        names: of the bodies.
        bodies: before the impact.
        pairs: for each contact, the indices of its body_a and its body_b.
        contacts, model: as asked.
        impact: the answer.
    """

    stamp: int
    sequence: int
    names: Sequence[str]
    bodies: Sequence[Body]
    pairs: Sequence[tuple[int, int]]
    contacts: Sequence[Contact]
    model: ImpactModel
    impact: SceneImpact


class BodyRecord(NamedTuple):
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
        stamp: when [ns]; 0 if nobody knows.
        sequence: number of the answer.
        reason: in words.
    """

    stamp: int
    sequence: int
    reason: str


class Gap(NamedTuple):
    """Entries that are missing.

    Attributes:
        stamp: of the last entry before them, or of the one that is missing [ns]; 0 if nobody knows.
        sequence: number of that answer.
        missing: how many.
        why: they are.
    """

    stamp: int
    sequence: int
    missing: int
    why: str = "they came faster than they could be written"


Entry = Record | SceneRecord | BodyRecord | Refusal | Gap


class UnwritableEntries(Exception):
    """Entries of which there is nothing to be written, whatever is done; nothing of their batch is.

    Attributes:
        entries: those.
    """

    def __init__(self, entries: list[Entry]) -> None:
        super().__init__(f"{len(entries)} entries cannot be written")
        self.entries = entries
