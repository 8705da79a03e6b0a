"""Measured impacts from a recording of the node: its table ``/impacts``, and the states that it received.

A law computed the twists after an impact in the table, so they are not measurements. The measurement is the
velocity of the centre of mass in the first state of a body that the node received after the impact, unless
the body had another impact before that.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections import defaultdict
from operator import itemgetter
from pathlib import Path
from typing import Any

from ..arguments import check_number
from ..physics.body import Twist
from ..physics.centre_of_mass import with_com_as_reference
from ..physics.vector import Vec3
from ..recording import table
from ..recording.viewer_layout import VELOCITIES, velocity_path
from ..recording.writer import ARROW_TIME
from ..status import ImpactError, StatusCode
from .measurements import Impacts

UNKNOWN = Vec3(math.nan, math.nan, math.nan)

History = list[tuple[int, int, Vec3 | None]]
"""States and impacts of a body in the order of time: the stamp [ns]; the number of the answer, for a state
``BEFORE_ANSWERS``; and for a state the velocity of the centre of mass [m/s]."""

BEFORE_ANSWERS = 0
"""A state with the stamp of an impact counts as the state before it."""


def read_impacts(path: Path, within: float) -> tuple[Impacts, int]:
    """Return the impacts of rigid bodies in a recording, and the number of those of mechanisms.

    ``within`` is how long after an impact a state may be received and still be its measurement [s]. Gravity
    changes the velocity in the meantime. With 0 the node's answers are used as measurements, which gives back
    the coefficients that the node used.

    Raises:
        ImpactError: INVALID_TABLE if the recording has no impacts, no state received in time after one of
            them, or the states of several runs. INVALID_MODEL if ``within`` is negative. INVALID_INERTIA if
            all impacts are of mechanisms. Other codes as ``Impacts.of``.
        OSError: if the file cannot be read, or is not a recording of the node.
    """
    check_number("within", within, 0, math.inf, StatusCode.INVALID_MODEL)
    try:
        impacts = table.read([path])
    except (RuntimeError, ValueError) as error:
        raise OSError(str(error)) from None
    if "ros_time" in impacts.column_names:
        impacts = impacts.append_column("stamp", impacts["ros_time"].cast("int64"))
    every = [*table.rows_of(table.divide(impacts)[0])]
    if not every:
        raise ImpactError(StatusCode.INVALID_TABLE, table.TABLE, f"there are none in {path}")
    of_mechanisms = [any(table.body_of(row, side).is_articulated() for side in "ab") for row in every]
    answered = [row for row, left_out in zip(every, of_mechanisms, strict=True) if not left_out] or every
    bodies = {side: [with_com_as_reference(table.body_of(row, side)) for row in answered] for side in "ab"}
    contacts = [table.contact_of(row["request_contact"]) for row in answered]
    if within:
        histories = _read_histories(path)
        after = {side: [_measured(row, side, histories, within) for row in answered] for side in "ab"}
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
    of_bodies = Impacts.of(bodies["a"], bodies["b"], contacts, after["a"], after["b"])
    return of_bodies, len(every) - len(answered)


def _answer(row: dict[str, Any], side: str) -> Twist:
    """Return the node's answer for a body: its twist after the impact, at the centre of mass."""
    numbers = row[f"twist_{side}_after"]
    body = table.body_of(row, side).with_twist(Twist(Vec3(*numbers[:3]), Vec3(*numbers[3:])))
    return Twist(with_com_as_reference(body).velocity, body.angular_velocity)


def _read_histories(path: Path) -> dict[str, History]:
    """Read the states and the impacts of all bodies, by the entity of the body's velocities.

    States are the rows that are not on the timeline of answers. The first arrow of a row is the velocity.
    """
    histories: dict[str, History] = defaultdict(list)
    file = table.open_complete(path)
    if (runs := len(file.recordings())) > 1:
        reason = f"must be those of one run of the node: {path} holds {runs} runs"
        raise ImpactError(StatusCode.INVALID_TABLE, "states", reason)
    for chunk in table.chunks_of(file, f"{VELOCITIES}/**"):
        batch = chunk.to_record_batch()
        if not {"ros_time", "Arrows3D:vectors"} <= {*batch.schema.names}:
            continue
        history, stamps = histories[chunk.entity_path], batch.column("ros_time").cast("int64").to_pylist()
        if "answer" in batch.schema.names:
            answers = batch.column("answer").to_pylist()
            history += ((stamp, answer, None) for stamp, answer in zip(stamps, answers, strict=True))
        else:
            arrows = batch.column("Arrows3D:vectors").to_pylist()
            velocities = [Vec3(*velocity) / ARROW_TIME for velocity, *_ in arrows]
            history += ((s, BEFORE_ANSWERS, v) for s, v in zip(stamps, velocities, strict=True))
    for history in histories.values():
        history.sort(key=itemgetter(0, 1))
    return histories


def _measured(row: dict[str, Any], side: str, histories: dict[str, History], within: float) -> Twist:
    """Return the measurement of a body: its first velocity ``within`` a time [s] after an impact, if any."""
    history, stamp = histories[velocity_path(row[f"body_{side}"])], row.get("stamp") or 0
    place = bisect_right(history, (stamp, row["answer"]), key=itemgetter(0, 1))
    if stamp and place < len(history):
        next_stamp, _, velocity = history[place]
        if velocity is not None and next_stamp - stamp <= within * 1e9:
            return Twist(velocity, UNKNOWN)
    return Twist(UNKNOWN, UNKNOWN)
