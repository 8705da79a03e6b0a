"""The entries of a recording, without rerun.

Their numbers may be of any type and are recorded as floats. So exact answers, in fractions, are rounded.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from fractions import Fraction
from typing import Any, NamedTuple

import numpy as np

from .. import Body, Contact, Impact, ImpactModel, SceneImpact
from ..body_numbers import body_from_numbers, body_to_numbers
from ..numbers.operations import map_numbers
from ..physics.body import Twist


class Record(NamedTuple):
    """One impact.

    Attributes:
        stamp: time of the impact [ns]; 0 if unknown.
        sequence: number of the answer.
        name_a, name_b: names of the bodies.
        body_a, body_b, contact, model: the request.
        impact: the answer.
        duration: time that the computation took [s]; NaN if unknown.
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
        stamp: time of the impact [ns]; 0 if unknown.
        sequence: number of the answer.
        names: names of the bodies.
        bodies: the bodies before the impact.
        pairs: for each contact, the indices of its body_a and its body_b.
        contacts, model: the rest of the request.
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

    def touching(self) -> list[int]:
        """Indices of the bodies that have a contact. The others do not change, and are not drawn."""
        return sorted({i for pair in self.pairs for i in pair})


class BodyRecord(NamedTuple):
    """State of a body that was received, whether or not the body collides.

    Attributes:
        stamp: time of the state [ns].
        name: name of the body.
        body: the state.
    """

    stamp: int
    name: str
    body: Body


class Refusal(NamedTuple):
    """One request that was refused.

    Attributes:
        stamp: time of the request [ns]; 0 if unknown.
        sequence: number of the answer.
        reason: the status code, a colon, and why the request was refused.
    """

    stamp: int
    sequence: int
    reason: str


class Gap(NamedTuple):
    """A place where entries are missing.

    Attributes:
        stamp: stamp of the last entry before the gap, or of the missing entry [ns]; 0 if unknown.
        sequence: sequence number of the same.
        missing: number of missing entries.
        why: why they are missing.
    """

    stamp: int
    sequence: int
    missing: int
    why: str = "they came faster than they could be written"


Entry = Record | SceneRecord | BodyRecord | Refusal | Gap


def drawn_bodies(entry: Entry) -> list[tuple[str, Body, list[Twist]]]:
    """Bodies that an entry draws: name, body (before an impact), and its twist after the impact, if any."""
    match entry:
        case BodyRecord():
            return [(entry.name, entry.body, [])]
        case Record(impact=impact):
            return [
                (entry.name_a, entry.body_a, [impact.twist_a]),
                (entry.name_b, entry.body_b, [impact.twist_b]),
            ]
        case SceneRecord():
            twists = entry.impact.twists
            return [(entry.names[i], entry.bodies[i], [twists[i]]) for i in entry.touching()]
    return []


INT64 = np.iinfo(np.int64)


def has_place(entry: Any) -> bool:
    """Whether this is an entry with a place on the timelines: its stamp and number are integers of 64 bits.

    The least of these is no time to rerun.
    """
    if not isinstance(entry, Entry):
        return False
    places = [entry.stamp] if isinstance(entry, BodyRecord) else [entry.stamp, entry.sequence]
    return all(isinstance(place, (int, np.integer)) and INT64.min < place <= INT64.max for place in places)


def with_floats(entry: Entry) -> Entry:
    """Return an entry whose bodies and answer hold floats, whatever numbers they were given as."""
    match entry:
        case BodyRecord(body=body):
            return entry._replace(body=_body_with_floats(body))
        case Record(body_a=body_a, body_b=body_b, impact=impact, duration=duration):
            return entry._replace(
                body_a=_body_with_floats(body_a),
                body_b=_body_with_floats(body_b),
                impact=_answer_with_floats(impact),
                duration=float(duration),
            )
        case SceneRecord(bodies=bodies, impact=impact):
            return entry._replace(
                bodies=list(map(_body_with_floats, bodies)), impact=_answer_with_floats(impact)
            )
    return entry


def _body_with_floats(body: Body) -> Body:
    inverse_inertia = body.inverse_inertia and [*map(float, body.inverse_inertia)]
    return body_from_numbers([*map(float, body_to_numbers(body))], inverse_inertia)


def _answer_with_floats(impact: Any) -> Any:
    """Return an answer with floats; its numbers are all fractions, or all floats."""
    if not isinstance(impact.kinetic_energy_before, Fraction):
        return impact
    return map_numbers(lambda value: float(value) if isinstance(value, Fraction) else value, impact)


class UnwritableEntries(Exception):
    """Some ``entries`` of a batch cannot be written, so nothing of the batch was written."""

    def __init__(self, entries: list[Entry]) -> None:
        super().__init__(f"{len(entries)} entries cannot be written")
        self.entries = entries
