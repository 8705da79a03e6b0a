"""The table ``/impacts`` of a recording, with one row per impact: writing, reading and recomputing it.

Its columns, after the timelines:

* words: ``status``; ``message``, for refusals only; ``body_a``, ``body_b`` (names); ``law``, ``geometry``,
  ``precision``, as used; ``regime``; ``adjustments``
* numbers, as in :class:`~collision_response.Impact`: the fields of ``NUMBERS``
* ``restitution``, ``friction``, as used; ``duration``: the time that the computation took [s]
* vectors: ``position``, ``normal``, ``impulse``; ``twist_a_before``, ``twist_a_after``, ``twist_b_before``,
  ``twist_b_after``, each ``vx vy vz wx wy wz``
* the request: ``request_a``, ``request_b``, with the rows of ``BodyStates.msg`` (an immovable body has
  infinite mass); ``request_contact``, ``x y z nx ny nz e mu et`` (et is NaN if the model's value is used);
  ``request_model``, the fields of :class:`~collision_response.ImpactModel`; if a body is articulated, also
  ``inverse_inertia_a`` and ``inverse_inertia_b``, the 21 numbers of the upper triangle (NaN for a rigid body)

The row of a refusal has only a status and a message.
"""

from __future__ import annotations

import math
import shlex
import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from .. import Body, Contact, Geometry, ImpactError, ImpactModel, Law, Precision, resolve
from ..answer import NUMBERS
from ..body_conversions import ROWS, body_from_numbers, body_to_numbers
from ..model import ENUMERATIONS
from ..physics.inverse_inertia import InverseInertia
from ..physics.vector import Vec3
from .record import Record, Refusal
from .rerun_sdk import RerunWarning, RrdReader, pa, rr
from .viewer_layout import PLOTS

TABLE = "/impacts"
ARCHETYPE = "Impact"
TIMELINES = ("ros_time", "answer")

ALWAYS_PRESENT = next(iter(PLOTS))
"""An entity that every recording has, even one without answers: the style of this plot is always written."""

WORD, NUMBER, LIST = 0, 1, -1
"""Kinds of columns. A greater kind is a vector with that many components."""
REFUSAL = {"answer": NUMBER, "status": WORD, "message": WORD}
ANSWER = {
    "answer": NUMBER,
    **dict.fromkeys(("status", "body_a", "body_b", *ENUMERATIONS, "regime"), WORD),
    "adjustments": WORD,
    **dict.fromkeys((*NUMBERS, "restitution", "friction", "duration"), NUMBER),
    **dict.fromkeys(("position", "normal", "impulse"), 3),
    **dict.fromkeys(("twist_a_before", "twist_a_after", "twist_b_before", "twist_b_after"), 6),
    **{"request_a": ROWS, "request_b": ROWS, "request_contact": 9, "request_model": LIST},
}


def answer_of(row: Record) -> dict[str, Any]:
    """Columns of an answer, without the request and the duration."""
    impact = row.impact
    return {
        "status": str(impact.status),
        "body_a": row.name_a,
        "body_b": row.name_b,
        **{name: str(getattr(impact.model, name)) for name in ENUMERATIONS},
        "regime": str(impact.regime),
        "adjustments": str(impact.adjustments),
        **{name: float(getattr(impact, name)) for name in NUMBERS},
        "restitution": float(impact.contact.restitution),
        "friction": float(impact.contact.friction),
        "position": [*impact.contact.position],
        "normal": [*impact.contact.normal],
        "impulse": [*impact.impulse],
        "twist_a_before": [*row.body_a.velocity, *row.body_a.angular_velocity],
        "twist_a_after": [*impact.twist_a.linear, *impact.twist_a.angular],
        "twist_b_before": [*row.body_b.velocity, *row.body_b.angular_velocity],
        "twist_b_after": [*impact.twist_b.linear, *impact.twist_b.angular],
    }


def _request_of(row: Record) -> dict[str, list[float]]:
    return {
        "request_a": body_to_numbers(row.body_a),
        "request_b": body_to_numbers(row.body_b),
        "request_contact": numbers_of_contact(row.contact, row.impact.contact),
        "request_model": [*row.model],
    }


def _inverse_inertias_of(row: Record) -> dict[str, list[float]]:
    rigid = [math.nan] * len(InverseInertia._fields)
    return {
        "inverse_inertia_a": [*(row.body_a.inverse_inertia or rigid)],
        "inverse_inertia_b": [*(row.body_b.inverse_inertia or rigid)],
    }


def numbers_of_contact(requested: Contact, used: Contact) -> list[float]:
    """Numbers of a requested contact, with the values used for coefficients that are functions."""
    e_t = requested.tangential_restitution
    e = used.restitution if callable(requested.restitution) else requested.restitution
    mu = used.friction if callable(requested.friction) else requested.friction
    return [*requested.position, *requested.normal, e, mu, math.nan if e_t is None else e_t]


def impact_columns(rows: Sequence[Record]) -> Any:
    """Columns of the table for some impacts."""
    dicts = [answer_of(row) | _request_of(row) | {"duration": row.duration} for row in rows]
    if any(body.inverse_inertia for row in rows for body in (row.body_a, row.body_b)):
        for values, row in zip(dicts, rows, strict=True):
            values |= _inverse_inertias_of(row)
    return _columns({name: [values[name] for values in dicts] for name in dicts[0]})


def refusal_columns(rows: Sequence[Refusal]) -> Any:
    """Columns of the table for some refusals."""
    parts = [row.reason.partition(": ") for row in rows]
    return _columns({"status": [code for code, _, _ in parts], "message": [text for _, _, text in parts]})


def _columns(table: dict[str, list[Any]]) -> Any:
    return rr.DynamicArchetype.columns(
        archetype=ARCHETYPE, components={name: _array(values) for name, values in table.items()}
    )


def _array(values: list[Any]) -> pa.Array:
    if isinstance(values[0], list):
        flat = np.array(values, np.float64)
        return pa.FixedSizeListArray.from_arrays(pa.array(flat.ravel()), flat.shape[1])
    return pa.array(values)


def read(
    paths: Iterable[Path | str],
    table: str = TABLE,
    lists: Sequence[str] = (),
    columns: Mapping[str, int] = ANSWER,
) -> pa.Table:
    """Read all impacts and refusals of some recordings, in the order of their answers.

    Args:
        paths: paths of the files.
        table: entity of another table to read instead.
        lists: columns of that table with several values in each row.
        columns: kinds of the columns that answers have in that table.

    Raises:
        OSError, RuntimeError: if a file cannot be read.
        ValueError: if a file is not a recording of this node, or is not complete. The message names the file.
    """
    tables = []
    for path in paths:
        recording = open_complete(path)
        chunks = recording.stream().filter(content=table).to_chunks()
        if not chunks and not recording.stream().filter(content=ALWAYS_PRESENT).to_chunks():
            raise _foreign(path, f"it has neither {table} nor {ALWAYS_PRESENT}")
        for chunk in chunks:
            batch = chunk.to_record_batch()
            found = {
                name.removeprefix(f"{ARCHETYPE}:"): batch.column(name)
                for name in batch.schema.names
                if name in TIMELINES or name.startswith(f"{ARCHETYPE}:")
            }
            rows = pa.table(
                {name: c if name in (*TIMELINES, *lists) else c.flatten() for name, c in found.items()}
            )
            is_refusal = {*found} <= {*TIMELINES, *REFUSAL}
            for name, kind in (REFUSAL if is_refusal else columns).items():
                if name not in found or not _is_of(kind, rows.schema.field(name).type):
                    raise _foreign(path, f"{table} has no valid column {name}")
            tables.append(rows)
    if not tables:
        return pa.table({"status": pa.array([], pa.string())})
    return pa.concat_tables(tables, promote_options="default").sort_by("answer")


def open_complete(path: Path | str) -> RrdReader:
    """Open a recording that is complete.

    Raises:
        RuntimeError: if it cannot be read.
        ValueError: if it is not complete.
    """
    with warnings.catch_warnings():  # rerun only warns if a file was cut off between two of its chunks
        warnings.filterwarnings("error", "RRD file has no footer", RerunWarning)
        try:
            return RrdReader(str(path))
        except RerunWarning:
            why = "is not complete, as after a crash or while it is being written"
            recovered = Path(path).with_name(f"recovered_{Path(path).name}")
            repair = ["rerun", "rrd", "merge", "--continue-on-error", str(path), "-o", str(recovered)]
            raise ValueError(f"{path} {why}; recover it with: {shlex.join(repair)}") from None


def _foreign(path: Path | str, why: str) -> ValueError:
    return ValueError(f"{path} is not a recording of this node: {why}")


def _is_of(kind: int, found: pa.DataType) -> bool:
    """Whether a column of this type is of a kind."""
    if kind == WORD:
        return bool(pa.types.is_string(found))
    if kind == NUMBER:
        return bool(pa.types.is_floating(found) or pa.types.is_integer(found))
    if kind == LIST:
        return bool(pa.types.is_list(found) or pa.types.is_fixed_size_list(found))
    return bool(pa.types.is_fixed_size_list(found)) and found.list_size == kind


def rows_of(impacts: pa.Table) -> list[dict[str, Any]]:
    """Rows of a table as dictionaries, without ``ros_time``, for which Python's times are too coarse."""
    return impacts.select([name for name in impacts.column_names if name != "ros_time"]).to_pylist()


def differences(row: dict[str, Any]) -> Iterator[tuple[str, Any, Any]]:
    """Compute the impact of a row again, and yield each column that differs, with its old and new value.

    Raises:
        ValueError: if this version does not know the model.
    """
    contact, model = contact_of(row["request_contact"]), model_of(row["request_model"])
    request = body_of(row, "a"), body_of(row, "b"), contact, model
    try:
        now = answer_of(Record(0, 0, row["body_a"], row["body_b"], *request, resolve(*request)))
    except ImpactError as error:
        now = {"status": str(error.code)}
    yield from changed_columns(row, now)


def body_of(row: dict[str, Any], side: str) -> Body:
    """Body of a request; ``side`` is ``"a"`` or ``"b"``."""
    return body_from_numbers(row[f"request_{side}"], row.get(f"inverse_inertia_{side}"))


def model_of(numbers: Sequence[float]) -> ImpactModel:
    """Model from the numbers of ``request_model``.

    Raises:
        ValueError: if this version has no such model.
    """
    law, geometry, precision, *others = numbers
    try:
        return ImpactModel(Law(int(law)), Geometry(int(geometry)), Precision(int(precision)), *others)
    except (TypeError, ValueError) as error:
        raise ValueError(f"request_model is not known to this version: {error}") from None


def contact_of(numbers: Sequence[float]) -> Contact:
    """Contact from the numbers of ``request_contact``."""
    *position_and_normal, e, mu, e_t = numbers
    position, normal = Vec3(*position_and_normal[:3]), Vec3(*position_and_normal[3:])
    return Contact(position, normal, e, mu, None if math.isnan(e_t) else e_t)


def changed_columns(before: dict[str, Any], now: dict[str, Any]) -> Iterator[tuple[str, Any, Any]]:
    """Yield the columns in which two rows differ, with both values. ``before`` may lack columns."""
    for name, value in now.items():
        old = before.get(name)
        if old is None or old == value:
            continue
        first = value[0] if isinstance(value, list) else value
        if isinstance(first, str) or not np.array_equal(old, value, equal_nan=True):
            yield name, old, value
