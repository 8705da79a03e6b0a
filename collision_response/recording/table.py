"""The table ``/impacts`` of a recording, with one row per impact: writing, reading and recomputing it.

docs/recordings.md says what its columns hold. The row of a refusal has only a status and a message.
"""

from __future__ import annotations

import math
import shlex
import warnings
from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from .. import Body, Contact, Geometry, ImpactError, ImpactModel, Law, Precision, resolve
from ..answer import NUMBERS, format_name
from ..arguments import as_list
from ..body_numbers import ROWS, body_from_numbers, body_to_numbers
from ..in_python.coefficients_at_speed import approach_speed, restitutions_at_speeds
from ..model import ENUMERATIONS
from ..physics.inverse_inertia import InverseInertia
from ..physics.vector import Vec3
from .record import Record, Refusal
from .rerun_sdk import Chunk, RerunWarning, RrdReader, compute, pa, rr
from .viewer_layout import PLOTS

TABLE = "/impacts"
ARCHETYPE = "Impact"
TIMELINES = ("ros_time", "answer")

ALWAYS_PRESENT = next(iter(PLOTS))
"""An entity that every recording has, even one without answers: the style of this plot is always written."""

WORD, NUMBER, WORD_LIST, NUMBER_LIST, VECTOR = "word", "number", "words", "numbers", 0
"""Kinds of columns: one word or number in each row, or several. A kind that is a number is a vector with
that many components; 0: with the same number of them in each row."""
Columns = dict[str, str | int]

CONTACT_SIZE = 9
"""Numbers of each contact: position, normal, restitution, friction and tangential restitution."""

REFUSAL: Columns = {"answer": NUMBER, "status": WORD, "message": WORD}
ANSWER: Columns = {
    "answer": NUMBER,
    **dict.fromkeys(("status", "body_a", "body_b", *ENUMERATIONS, "regime"), WORD),
    "adjustments": WORD,
    **dict.fromkeys((*NUMBERS, "restitution", "friction", "duration"), NUMBER),
    **dict.fromkeys(("position", "normal", "impulse"), 3),
    **dict.fromkeys(("twist_a_before", "twist_a_after", "twist_b_before", "twist_b_after"), 6),
    **{"request_a": ROWS, "request_b": ROWS, "request_contact": CONTACT_SIZE, "request_model": VECTOR},
}
OF_ARTICULATED = dict.fromkeys(("inverse_inertia_a", "inverse_inertia_b"), len(InverseInertia._fields))
OPTIONAL: Columns = {"message": WORD, **OF_ARTICULATED}


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
    (contact,) = numbers_of_contacts([(row.body_a, row.body_b, row.contact)], [row.impact.contact])
    return {
        "request_a": body_to_numbers(row.body_a),
        "request_b": body_to_numbers(row.body_b),
        "request_contact": contact,
        "request_model": [*row.model],
    }


def _inverse_inertias_of(row: Record) -> dict[str, list[float]]:
    both = row.body_a.inverse_inertia, row.body_b.inverse_inertia
    rigid = [math.nan] * len(InverseInertia._fields)
    return {name: [*(one or rigid)] for name, one in zip(OF_ARTICULATED, both, strict=True)}


def numbers_of_contacts(
    requests: Sequence[tuple[Body, Body, Contact]], used: Sequence[Contact]
) -> list[list[float]]:
    """Numbers of the contacts of a cluster, with values at first touch for coefficients that are functions.

    The restitution that was used may be another one: that of the cluster, or 0 below the restitution
    threshold.

    Args:
        requests: for each contact, its body_a, its body_b, and the contact as requested.
        used: the contacts with the coefficients that were used.
    """
    contacts = [contact for _, _, contact in requests]
    restitutions = [contact.restitution for contact in contacts]
    if len(contacts) == 1 and callable(restitutions[0]) and used[0].restitution > 0:
        restitutions = [used[0].restitution]  # no cluster, no threshold: it is the value
    if any(map(callable, restitutions)):
        speeds = [approach_speed(*request) for request in requests]
        restitutions = restitutions_at_speeds(speeds, contacts, ["contact"] * len(contacts))
    frictions = [
        u.friction if callable(c.friction) else c.friction for c, u in zip(contacts, used, strict=True)
    ]
    own = [c.tangential_restitution for c in contacts]
    return [
        [*contact.position, *contact.normal, e, mu, math.nan if e_t is None else e_t]
        for contact, e, mu, e_t in zip(contacts, restitutions, frictions, own, strict=True)
    ]


def impact_columns(rows: Sequence[Record]) -> Any:
    """Columns of the table for some impacts."""
    dicts = [answer_of(row) | _request_of(row) | {"duration": row.duration} for row in rows]
    if any(body.inverse_inertia for row in rows for body in (row.body_a, row.body_b)):
        dicts = [one | _inverse_inertias_of(row) for one, row in zip(dicts, rows, strict=True)]
    return columns_of(dicts, ANSWER | OPTIONAL)


def refusal_columns(rows: Sequence[Refusal]) -> Any:
    """Columns of the table for some refusals."""
    parts = [row.reason.partition(": ") for row in rows]
    return columns_of([{"status": code, "message": text} for code, _, text in parts], REFUSAL)


def columns_of(rows: Sequence[dict[str, Any]], kinds: Columns) -> Any:
    """Columns for rerun of rows that have the same fields."""
    arrays = {name: _array([row[name] for row in rows], kinds[name]) for name in rows[0]}
    return rr.DynamicArchetype.columns(archetype=ARCHETYPE, components=arrays)


def _array(values: list[Any], kind: str | int) -> pa.Array:
    if not isinstance(kind, int):
        return pa.array(values)
    flat = np.array(values, np.float64)
    return pa.FixedSizeListArray.from_arrays(pa.array(flat.ravel()), flat.shape[1])


def read(
    paths: Path | str | Iterable[Path | str],
    table: str = TABLE,
    columns: Columns = ANSWER,
    optional: Columns = OPTIONAL,
) -> pa.Table:
    """Read all impacts and refusals of some recordings, in the order of their answers.

    Args:
        paths: the file, or several.
        table: entity of another table to read instead.
        columns: the columns that every answer has in that table, and their kinds.
        optional: the columns that rows may have. Rows with a ``message`` are refusals.

    Raises:
        OSError, RuntimeError: if a file cannot be read.
        TypeError: if ``paths`` are no paths.
        ValueError: if a file is not a recording of this node, is not complete, or holds answers that another
            one holds, too: it is given twice, or is a copy or a part of that one. The message names the file.
    """
    tables, opened = [], set()
    answers_of_runs: dict[str, list[Any]] = defaultdict(list)
    for path in [paths] if isinstance(paths, (str, Path)) else as_list("paths", paths):
        recording = open_complete(path)
        if (file := Path(path).resolve()) in opened:
            raise ValueError(f"{path} is given twice")
        opened.add(file)
        chunks = _chunks_by_run(recording, table)
        if not chunks and not chunks_of(recording, ALWAYS_PRESENT):
            raise _foreign(path, f"it has neither {table} nor {ALWAYS_PRESENT}")
        found: dict[str, list[Any]] = defaultdict(list)
        for run, chunk in chunks:
            rows = _rows_in(chunk.to_record_batch(), columns | optional)
            if "answer" not in rows.column_names:
                raise _foreign(path, f"{table} has no timeline answer")
            if wrong := _invalid_column(rows, columns, optional):
                raise _foreign(path, f"{table} has no valid column {wrong}")
            found[run].append(rows["answer"].to_numpy())
            tables.append(rows)
        for run, answers in found.items():
            numbers, before = np.concatenate(answers), answers_of_runs[run]
            if before and (again := numbers[np.isin(numbers, np.concatenate(before))]).size:
                raise ValueError(f"{path} holds answer {again[0]} of a run, as does another of the files")
            before.append(numbers)
    if not tables:
        return pa.table({"status": pa.array([], pa.string())})
    whole = pa.concat_tables(tables, promote_options="default")
    answers = whole["answer"]
    in_order = compute.all(compute.greater_equal(answers[1:], answers[:-1]), min_count=0).as_py()
    return whole if in_order else whole.sort_by("answer")  # which takes twice the memory again


def open_complete(path: Path | str) -> RrdReader:
    """Open a recording that is complete.

    Raises:
        RuntimeError: if it cannot be read.
        ValueError: if it is not complete, or its name is not UTF-8.
    """
    with warnings.catch_warnings():  # rerun only warns if a file was cut off between two of its chunks
        warnings.filterwarnings("error", "RRD file has no footer", RerunWarning)
        try:
            return RrdReader(str(path))
        except UnicodeEncodeError:
            name = format_name(str(path))
            raise ValueError(f"{name}: rerun reads no file whose name is not UTF-8") from None
        except RerunWarning:
            why = "is not complete, as after a crash or while it is being written"
            recovered = Path(path).with_name(f"recovered_{Path(path).name}")
            repair = ["rerun", "rrd", "merge", "--continue-on-error", str(path), "-o", str(recovered)]
            raise ValueError(f"{path} {why}; recover it with: {shlex.join(repair)}") from None


def chunks_of(file: RrdReader, content: str) -> list[Chunk]:
    """Return what a file holds of some entities, in all its recordings: those of several runs, if merged."""
    return [chunk for _, chunk in _chunks_by_run(file, content)]


def _chunks_by_run(file: RrdReader, content: str) -> list[tuple[str, Chunk]]:
    """Return what :func:`chunks_of` does, each with the name that rerun gave to the run of the node."""
    return [
        (store.recording_id, chunk)
        for store in file.recordings()
        for chunk in file.stream(store=store).filter(content=content).to_chunks()
    ]


def _foreign(path: Path | str, why: str) -> ValueError:
    return ValueError(f"{path} is not a recording of this node: {why}")


def _rows_in(batch: pa.RecordBatch, columns: Columns) -> pa.Table:
    """Return the timelines and the columns with known names. rerun's lists of one value are undone."""
    found = {name: batch.column(name) for name in TIMELINES if name in batch.schema.names}
    for name, kind in columns.items():
        if (own := f"{ARCHETYPE}:{name}") in batch.schema.names:
            lists = batch.column(own)
            lengths = {*compute.list_value_length(lists).to_pylist()}
            if kind in (WORD_LIST, NUMBER_LIST) or not lengths <= {1, None}:
                found[name] = lists
            else:  # without nulls this shares the memory
                found[name] = compute.list_element(lists, 0) if None in lengths else lists.flatten()
    return pa.table(found)


def _invalid_column(rows: pa.Table, columns: Columns, optional: Columns) -> str | None:
    """Return the name of a column that a row lacks, or that is of another kind, if there is one."""
    for part, required in zip(divide(rows), (columns, REFUSAL), strict=True):
        for name, kind in (optional | required).items() if len(part) else ():
            values = part[name] if name in part.column_names else None
            is_missing = values is None or values.null_count > 0
            if (is_missing and name in required) or not (values is None or _are_of(kind, values.drop_null())):
                return name
    return None


def _are_of(kind: str | int, values: pa.ChunkedArray) -> bool:
    """Whether all values are of a kind."""
    if kind not in (WORD, NUMBER):
        is_vector = pa.types.is_fixed_size_list(values.type)
        if not (is_vector or pa.types.is_list(values.type)):
            return False
        if isinstance(kind, int) and not (is_vector and kind in (VECTOR, values.type.list_size)):
            return False
        values = compute.list_flatten(values)
    if not len(values) or values.null_count:
        return not len(values)
    if kind in (WORD, WORD_LIST):
        return bool(pa.types.is_string(values.type))
    return bool(pa.types.is_floating(values.type) or pa.types.is_integer(values.type))


def divide(table: pa.Table) -> tuple[pa.Table, pa.Table]:
    """Divide a table into its answers and its refusals."""
    if "message" not in table.column_names:
        return table, table.slice(0, 0)
    is_refusal = table["message"].is_valid()
    return table.filter(compute.invert(is_refusal)), table.filter(is_refusal)


def rows_of(table: pa.Table) -> Iterator[dict[str, Any]]:
    """Yield the rows of a table as dictionaries, without ``ros_time``: times of Python are too coarse for it.

    Few at once: as numbers of Python, they take ten times as much memory as in the table.
    """
    names = [name for name in table.column_names if name != "ros_time"]
    for batch in table.select(names).to_batches(max_chunksize=1000):
        yield from batch.to_pylist()


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


def model_of(numbers: Sequence[Any]) -> ImpactModel:
    """Model from the numbers of ``request_model``.

    Raises:
        ValueError: if this version has no such model.
    """
    try:
        law, geometry, precision, *others = numbers
        return ImpactModel(Law(law), Geometry(geometry), Precision(precision), *others)
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
        first = next(iter(value), "") if isinstance(value, list) else value
        if isinstance(first, str) or not np.array_equal(old, value, equal_nan=True):
            yield name, old, value
