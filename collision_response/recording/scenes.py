"""The table ``/scenes`` of a recording, with one row per scene: writing, reading and recomputing it.

docs/recordings.md says what its columns hold.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import chain
from pathlib import Path
from typing import Any

from .. import ImpactError, SceneImpact, resolve_scene
from ..body_numbers import ROWS, body_from_numbers, body_to_numbers
from ..model import ENUMERATIONS
from ..scene.answer import NUMBERS
from . import table
from .record import SceneRecord
from .rerun_sdk import pa
from .table import CONTACT_SIZE, changed_columns, columns_of, contact_of, model_of, numbers_of_contacts

TABLE = "/scenes"

COLUMNS: table.Columns = {
    "answer": table.NUMBER,
    **dict.fromkeys(("status", *ENUMERATIONS, "adjustments"), table.WORD),
    **dict.fromkeys(NUMBERS, table.NUMBER),
    **dict.fromkeys(("bodies", "regimes"), table.WORD_LIST),
    **dict.fromkeys(("twists", "impulses", "restitution", "friction"), table.NUMBER_LIST),
    **dict.fromkeys(("normal_velocities_before", "normal_velocities_after"), table.NUMBER_LIST),
    **dict.fromkeys(
        (f"request_{part}" for part in ("bodies", "pairs", "contacts", "model")), table.NUMBER_LIST
    ),
}


def scene_columns(rows: Sequence[SceneRecord]) -> Any:
    """Columns of the table for some scenes."""
    return columns_of([_answer_of(row.impact) | _request_of(row) for row in rows], COLUMNS)


def read(paths: Path | str | Iterable[Path | str]) -> pa.Table:
    """Read all scenes of a recording, or of several, in the order of their answers.

    Raises:
        TypeError: if ``paths`` are no paths.
        OSError, RuntimeError: if a file cannot be read.
        ValueError: if a file is not a recording of this node, or is not complete.
    """
    return table.read(paths, TABLE, COLUMNS, {})


def _answer_of(impact: SceneImpact) -> dict[str, Any]:
    return {
        "status": str(impact.status),
        **{name: str(getattr(impact.model, name)) for name in ENUMERATIONS},
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
    contacts: list[Any] = [None] * len(row.contacts)
    for cluster in row.impact.clusters:
        pairs = [(i, *row.pairs[i]) for i in cluster]
        requests = [(row.bodies[a], row.bodies[b], row.contacts[i]) for i, a, b in pairs]
        numbers = numbers_of_contacts(requests, [row.impact.contacts[i] for i in cluster])
        for i, of_contact in zip(cluster, numbers, strict=True):
            contacts[i] = of_contact
    return {
        "bodies": [*row.names],
        "request_bodies": [float(x) for body in row.bodies for x in body_to_numbers(body)],
        "request_pairs": [float(i) for pair in row.pairs for i in pair],
        "request_contacts": [float(x) for numbers in contacts for x in numbers],
        "request_model": [float(x) for x in row.model],
    }


def differences(row: dict[str, Any]) -> Iterator[tuple[str, Any, Any]]:
    """Compute the scene of a row again, and yield each column that differs, with its old and new value.

    Raises:
        ValueError: if this version does not know the model, or a body, a contact or a pair is incomplete.
    """
    bodies = [body_from_numbers(numbers) for numbers in _split(row, "request_bodies", ROWS)]
    if len(row["bodies"]) != len(bodies):
        raise ValueError(f"bodies must have {len(bodies)} names, has {len(row['bodies'])}")
    contacts = [contact_of(numbers) for numbers in _split(row, "request_contacts", CONTACT_SIZE)]
    pairs = [(_index(a), _index(b)) for a, b in _split(row, "request_pairs", 2)]
    model = model_of(row["request_model"])
    try:
        now = _answer_of(resolve_scene(bodies, pairs, contacts, model))
    except ImpactError as error:
        now = {"status": str(error.code)}
    yield from changed_columns(row, now)


def _split(row: dict[str, Any], name: str, size: int) -> list[Sequence[float]]:
    numbers = row[name]
    if len(numbers) % size:
        raise ValueError(f"{name} must have a multiple of {size} numbers, has {len(numbers)}")
    return [numbers[i : i + size] for i in range(0, len(numbers), size)]


def _index(number: float) -> int:
    if number % 1 != 0:  # also of NaN and infinity
        raise ValueError(f"request_pairs must have whole numbers, has {number}")
    return int(number)
