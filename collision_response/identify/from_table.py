"""Measured impacts from a table: a CSV file with one line per impact.

The columns have the names of the rows of ``BodyStates``, in SI units. ``m``, ``ixx ixy ixz iyy iyz izz``,
``comx comy comz``, ``x y z``, ``qx qy qz qw``, ``vx vy vz`` and ``wx wy wz`` describe body_a before the
impact. The same names with ``b_`` in front describe body_b, which is immovable if there is no ``b_m``.
Columns such as ``vx_after`` and ``b_wz_after`` hold what was measured after the impact. If something was not
measured, leave its cell empty or leave out its column. The contact is at ``cx cy cz``, or at ``rx ry rz``
relative to the position ``x y z`` of body_a. Its normal, ``nx ny nz``, points from body_b to body_a. A table
needs ``m``, a normal and a measurement. Other missing columns count as 0, and ``qw`` as 1.

A table with a column ``incidence`` holds readings of a sphere that strikes a flat target. Its other columns
are ``ratio``, ``angle`` and ``spin``, which ``SphereReadings`` of ``collision_response.identify`` describes.
"""

from __future__ import annotations

import csv
import math
from collections.abc import Mapping, Sequence
from pathlib import Path

from ..arguments import number_in
from ..body_numbers import body_from_numbers
from ..physics.body import Body, Twist
from ..physics.contact import Contact
from ..physics.vector import Vec3
from ..status import ImpactError, StatusCode
from .measurements import Impacts
from .sphere_readings import SphereReadings

INERTIA, COM = ["ixx", "ixy", "ixz", "iyy", "iyz", "izz"], ["comx", "comy", "comz"]
POSITION, ORIENTATION = ["x", "y", "z"], ["qx", "qy", "qz", "qw"]
LINEAR, ANGULAR = ["vx", "vy", "vz"], ["wx", "wy", "wz"]
BODY = ["m", *INERTIA, *COM, *POSITION, *ORIENTATION, *LINEAR, *ANGULAR]
AFTER = [f"{name}_after" for name in (*LINEAR, *ANGULAR)]
POINT, ARM, NORMAL = ["cx", "cy", "cz"], ["rx", "ry", "rz"], ["nx", "ny", "nz"]
DEFAULTS = {"m": math.inf, "qw": 1.0}
KNOWN = {*BODY, *AFTER, *(f"b_{name}" for name in (*BODY, *AFTER)), *POINT, *ARM, *NORMAL}
KNOWN |= {"incidence", *SphereReadings.QUANTITIES}

Row = Mapping[str, float]


def read_rows(path: Path, more: Mapping[str, str]) -> tuple[list[dict[str, float]], list[str]]:
    """Read the numbers of a CSV file: one dictionary per row, by column name. Empty cells are NaN.

    Columns with unknown names are left out; their names are the second part of the result. ``more`` has
    columns to set in every row: by name, a number, or the name of a column of the file that has the values.

    Raises:
        ImpactError: INVALID_TABLE if the file is not text, cells are not separated by commas, a cell is not a
            number or is too long, a needed column appears twice, a row has more or fewer cells than there are
            columns, there are no rows, or ``more`` has an unknown column, or one that the file has.
    """
    for name in more:
        if name not in KNOWN:
            raise ImpactError(StatusCode.INVALID_TABLE, "columns", f"{name} is unknown")
    rows = []
    table, unused = _cells(path, KNOWN.union(more.values()))
    for name in more:
        if table and name in table[0]:
            raise ImpactError(StatusCode.INVALID_TABLE, "columns", f"{name} is in the file: it cannot be set")
    for i, cells in enumerate(table):
        cells |= {name: cells.get(value, value) for name, value in more.items()}
        rows.append({name: _number(f"rows[{i}].{name}", cells[name]) for name in cells if name in KNOWN})
    if not rows:
        raise ImpactError(StatusCode.INVALID_TABLE, "rows", f"there are none in {path}")
    return rows, unused


def _cells(path: Path, needed: set[str]) -> tuple[list[dict[str, str]], list[str]]:
    """Read the text of the cells: one dictionary per row, by column name; and the names not needed."""
    with path.open(newline="", encoding="utf-8-sig") as file:
        reader = csv.DictReader(file)
        try:
            names = reader.fieldnames = [name.strip() for name in reader.fieldnames or ()]
            rows = list(reader)
        except UnicodeDecodeError as error:
            raise ImpactError(StatusCode.INVALID_TABLE, "file", f"must be text in UTF-8: {error}") from None
        except csv.Error as error:
            raise ImpactError(StatusCode.INVALID_TABLE, f"line {reader.line_num}", str(error)) from None
    if not any(names):
        reason = "must have the names of the columns in its first line"
        raise ImpactError(StatusCode.INVALID_TABLE, "file", reason)
    for separator in (";", "\t"):
        if len(names) == 1 and separator in names[0]:
            reason = f"must have commas between cells, has {separator!r}"
            raise ImpactError(StatusCode.INVALID_TABLE, "file", reason)
    for i, row in enumerate(rows):
        beyond = row.pop(None, [])
        count = sum(cell is not None for cell in row.values())
        count += len(beyond) if any(map(str.strip, beyond)) else 0
        if count != len(row):
            reason = f"must have {len(row)} cells, as there are columns; has {count}"
            raise ImpactError(StatusCode.INVALID_TABLE, f"rows[{i}]", reason)
    for name in names:
        if name in needed and names.count(name) > 1:
            raise ImpactError(
                StatusCode.INVALID_TABLE, "columns", f"{name} is there {names.count(name)} times"
            )
    return rows, [name for name in names if name and name not in needed]


def _number(field: str, cell: str | None) -> float:
    try:
        return number_in(cell) if cell and not cell.isspace() else math.nan
    except ValueError:
        raise ImpactError(StatusCode.INVALID_TABLE, field, f"must be a number, is {cell!r}") from None


def impacts_from_rows(rows: list[dict[str, float]]) -> Impacts:
    """Return the impacts in the rows of a table.

    Raises:
        ImpactError: INVALID_TABLE if a column is missing; else as ``Impacts.of``.
    """
    _require_columns(rows[0], ["m"], NORMAL, AFTER + [f"b_{name}" for name in AFTER])
    bodies_a, bodies_b = ([_body(row, owner) for row in rows] for owner in ("", "b_"))
    after_a, after_b = ([_twist(row, owner) for row in rows] for owner in ("", "b_"))
    return Impacts.of(bodies_a, bodies_b, [_contact(row) for row in rows], after_a, after_b)


def readings_from_rows(
    rows: list[dict[str, float]], speed: float, radius: float, errors: Mapping[str, float]
) -> SphereReadings:
    """Return the readings in the rows of a table, with arguments and errors as for ``SphereReadings``.

    Raises:
        ImpactError: INVALID_TABLE if a column is missing.
    """
    _require_columns(rows[0], ["incidence"], SphereReadings.QUANTITIES)
    tables = {
        name: [(row["incidence"], row[name]) for row in rows if not math.isnan(row[name])]
        for name in SphereReadings.QUANTITIES
        if name in rows[0]
    }
    return SphereReadings(speed, radius, tables, errors)


def unused_columns(row: Row) -> list[str]:
    """Return the known columns of a table that are not used because of others."""
    if "incidence" in row:
        return [name for name in row if name not in ("incidence", *SphereReadings.QUANTITIES)]
    unused = list(SphereReadings.QUANTITIES)
    if any(name in row for name in POINT):
        unused += ARM
    if "b_m" not in row:  # body_b is immovable
        unused += [f"b_{name}" for name in AFTER]
    return [name for name in row if name in unused]


def _require_columns(row: Row, *groups: Sequence[str]) -> None:
    """Check that a row has at least one column of each group."""
    missing = [" or ".join(group) for group in groups if not any(name in row for name in group)]
    if missing:
        reason = f"must have {'; '.join(missing)}; are {', '.join(row)}. --set NAME=VALUE adds one"
        raise ImpactError(StatusCode.INVALID_TABLE, "columns", reason)


def _numbers(row: Row, names: list[str], default: float = 0.0) -> list[float]:
    return [row.get(name, default) for name in names]


def _body(row: Row, owner: str) -> Body:
    return body_from_numbers([row.get(owner + name, DEFAULTS.get(name, 0.0)) for name in BODY])


def _twist(row: Row, owner: str) -> Twist:
    numbers = _numbers(row, [owner + name for name in AFTER], math.nan)
    return Twist(Vec3(*numbers[:3]), Vec3(*numbers[3:]))


def _contact(row: Row) -> Contact:
    point = [x + r for x, r in zip(_numbers(row, POSITION), _numbers(row, ARM), strict=True)]
    has_point = any(name in row for name in POINT)
    return Contact.of(_numbers(row, POINT) if has_point else point, _numbers(row, NORMAL))
