"""Measured impacts from a recording of the node: its table ``/impacts``, and the states that it received.

A law computed the twists after an impact in the table, so they are not measurements. The measurement is the
first state of a body that the node received after the impact. A recording holds the velocity of the centre of
mass in that state, but not the angular velocity.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from ..body_conversions import body_from_numbers, with_com_as_reference
from ..physics.body import Body, Twist
from ..physics.contact import Contact
from ..physics.vector import Vec3
from ..status import ImpactError, StatusCode
from .measurements import Impacts

TABLE = "/impacts"
UNKNOWN = Vec3(math.nan, math.nan, math.nan)

States = tuple[list[int], list[Vec3]]
"""Stamps of states [ns], in ascending order, and the velocities of the centre of mass [m/s]."""


def read_impacts(path: Path, within: float) -> Impacts:
    """Read the impacts of a recording.

    Args:
        path: the recording.
        within: how long after an impact a state may be received and still be its measurement [s]. Gravity
            changes the velocity in the meantime. With 0 the node's answers are used as measurements, which
            gives back the coefficients that the node used.

    Raises:
        ImpactError: INVALID_TABLE if the recording has no impacts, or no state that was received within the
            given time after one of them. Other codes as :meth:`~collision_response.identify.Impacts.of`.
        ImportError: if rerun is not installed.
        OSError: if the file cannot be read.
    """
    rows = list(_rows(path, TABLE))
    answered = [row for row in rows if row.get("Impact:request_a") and row.get("Impact:twist_a_after")]
    if not answered:
        raise ImpactError(StatusCode.INVALID_TABLE, TABLE, f"there are none in {path}")
    bodies = {side: [with_com_as_reference(_body(row, side)) for row in answered] for side in "ab"}
    numbers = (row["Impact:request_contact"][0] for row in answered)
    contacts = [Contact.of(one[:3], one[3:6]) for one in numbers]
    if within:
        names = {row[f"Impact:body_{side}"][0] for row in answered for side in "ab"}
        states = {name: _read_states(path, name) for name in names}
        after = {side: [_measured(row, side, states, within) for row in answered] for side in "ab"}
        movable = (
            t for side in "ab" for b, t in zip(bodies[side], after[side], strict=True) if b.is_movable()
        )
        if all(math.isnan(twist.linear.x) for twist in movable):
            reason = (
                f"no state of a body was received within {within:g} s after any of {len(answered)} impacts"
            )
            raise ImpactError(StatusCode.INVALID_TABLE, "states", reason)
    else:
        after = {side: [_answer(row, side) for row in answered] for side in "ab"}
    return Impacts.of(bodies["a"], bodies["b"], contacts, after["a"], after["b"])


def _rows(path: Path, entity: str) -> Iterator[dict[str, Any]]:
    """Yield the rows of an entity, each with its values by column name."""
    from ..recording.table import open_complete

    try:
        chunks = list(open_complete(path).stream().filter(content=entity).to_chunks())
    except (RuntimeError, ValueError) as error:  # the file is cut short, or not a recording
        raise OSError(str(error)) from None
    for chunk in chunks:
        batch = chunk.to_record_batch()
        if "ros_time" in batch.schema.names:
            column = batch.schema.names.index("ros_time")
            batch = batch.set_column(column, "ros_time", batch.column("ros_time").cast("int64"))
        yield from batch.to_pylist()


def _body(row: dict[str, Any], side: str) -> Body:
    own = row.get(f"Impact:inverse_inertia_{side}")
    return body_from_numbers(row[f"Impact:request_{side}"][0], own[0] if own else None)


def _answer(row: dict[str, Any], side: str) -> Twist:
    """Return the node's answer for a body: its twist after the impact, at the centre of mass."""
    numbers = row[f"Impact:twist_{side}_after"][0]
    body = _body(row, side).with_twist(Twist(Vec3(*numbers[:3]), Vec3(*numbers[3:])))
    return Twist(with_com_as_reference(body).velocity, body.angular_velocity)


def _read_states(path: Path, name: str) -> States:
    """Read the states of a body that the node received.

    They are the rows with a single velocity arrow. The rows of impacts have more.
    """
    from ..recording.viewer_layout import velocity_path
    from ..recording.writer import ARROW_TIME

    arrows = [(row.get("ros_time"), row.get("Arrows3D:vectors")) for row in _rows(path, velocity_path(name))]
    states = sorted((stamp, some[0]) for stamp, some in arrows if stamp and some and len(some) == 1)
    return [stamp for stamp, _ in states], [Vec3(*arrow) * (1 / ARROW_TIME) for _, arrow in states]


def _measured(row: dict[str, Any], side: str, states: dict[str, States], within: float) -> Twist:
    """Return the measurement of a body: its first velocity ``within`` a time [s] after an impact, if any."""
    stamps, velocities = states[row[f"Impact:body_{side}"][0]]
    stamp: int = row.get("ros_time") or 0  # 0: the time is not known
    place = bisect_right(stamps, stamp) if stamp else len(stamps)
    is_there = place < len(stamps) and stamps[place] - stamp <= within * 1e9
    return Twist(velocities[place] if is_there else UNKNOWN, UNKNOWN)
