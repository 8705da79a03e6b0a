"""Scenes as rows of a table, ``/scenes`` in a recording: written here, read here, asked again from here.

The columns, after the timelines. Those of bodies and contacts hold all of a scene, one after the other:

* words: ``status``, ``law``, ``geometry``, ``precision``, ``adjustments``; lists of them: ``bodies``,
  ``regimes``
* numbers, as in :class:`~collision_response.SceneImpact`: those of ``NUMBERS``
* of bodies: ``twists``, ``vx vy vz wx wy wz`` after the impact
* of contacts: ``impulses``, ``x y z``; ``normal_velocities_before``, ``normal_velocities_after``;
  ``restitution``, ``friction``, as used
* the request, complete: ``request_bodies``, ``request_contacts`` and ``request_model`` as ``/impacts`` has
  them; ``request_pairs``: ``a b``
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import chain
from pathlib import Path
from typing import Any

import pyarrow as pa
import rerun as rr

from .. import ImpactError, SceneImpact, resolve_scene
from ..body_conversions import ROWS, body_from_numbers, body_to_numbers
from ..scene.answer import NUMBERS
from . import table
from .record import SceneRecord
from .table import ARCHETYPE, changed, contact_of, model_of, numbers_of_contact

TABLE = "/scenes"

LISTS = (
    "bodies",
    "regimes",
    "twists",
    "impulses",
    "normal_velocities_before",
    "normal_velocities_after",
    "restitution",
    "friction",
    "request_bodies",
    "request_pairs",
    "request_contacts",
    "request_model",
)
COLUMNS = {
    "answer": table.NUMBER,
    **dict.fromkeys(("status", "law", "geometry", "precision", "adjustments"), table.WORD),
    **dict.fromkeys(NUMBERS, table.NUMBER),
    **dict.fromkeys(LISTS, table.LIST),
}
CONTACT = 9
"""Numbers of a contact in a request."""


def scene_columns(rows: Sequence[SceneRecord]) -> Any:
    """What is written of scenes."""
    dicts = [_answer_of(row.impact) | _request_of(row) for row in rows]
    return rr.DynamicArchetype.columns(
        archetype=ARCHETYPE, components={name: pa.array([one[name] for one in dicts]) for name in dicts[0]}
    )


def read(paths: Iterable[Path | str]) -> pa.Table:
    """All scenes of some recordings, in the order of their answers.

    Raises:
        OSError, RuntimeError: a file cannot be read.
        ValueError: it is no recording of this node.
    """
    return table.read(paths, TABLE, LISTS, COLUMNS)


def _answer_of(impact: SceneImpact) -> dict[str, Any]:
    return {
        "status": str(impact.status),
        **{name: str(getattr(impact.model, name)) for name in ("law", "geometry", "precision")},
        "adjustments": str(impact.adjustments),
        **{name: float(getattr(impact, name)) for name in NUMBERS},
        "twists": [float(x) for twist in impact.twists for x in (*twist.linear, *twist.angular)],
        "impulses": [*chain.from_iterable(impact.impulses)],
        "normal_velocities_before": [*impact.normal_velocities_before],
        "normal_velocities_after": [*impact.normal_velocities_after],
        "restitution": [float(contact.restitution) for contact in impact.contacts],
        "friction": [float(contact.friction) for contact in impact.contacts],
        "regimes": [str(regime) for regime in impact.regimes],
    }


def _request_of(row: SceneRecord) -> dict[str, Any]:
    contacts = zip(row.contacts, row.impact.contacts, strict=True)
    return {
        "bodies": [*row.names],
        "request_bodies": [float(x) for body in row.bodies for x in body_to_numbers(body)],
        "request_pairs": [float(i) for pair in row.pairs for i in pair],
        "request_contacts": [float(x) for asked, used in contacts for x in numbers_of_contact(asked, used)],
        "request_model": [float(x) for x in row.model],
    }


def differences(row: dict[str, Any]) -> Iterator[tuple[str, Any, Any]]:
    """Ask again what a row of ``/scenes`` asked: each column whose value is now another one; was, is."""
    bodies = [body_from_numbers(numbers) for numbers in _split(row["request_bodies"], ROWS)]
    contacts = [contact_of(numbers) for numbers in _split(row["request_contacts"], CONTACT)]
    pairs = [(int(a), int(b)) for a, b in _split(row["request_pairs"], 2)]
    try:
        impact = resolve_scene(bodies, pairs, contacts, model_of(row["request_model"]))
    except ImpactError as error:
        yield "status", row["status"], str(error.code)
        return
    yield from changed(row, _answer_of(impact))


def _split(numbers: Sequence[float], size: int) -> list[Sequence[float]]:
    return [numbers[i : i + size] for i in range(0, len(numbers), size)]
