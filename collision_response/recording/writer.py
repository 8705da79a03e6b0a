"""Records to a rerun file, in columns."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator, Sequence
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
import rerun as rr

from ..centre import at_centre
from ..physics.body import Body, Twist
from .layout import AFTER, BEFORE, GREEN, GREY, LOG, RED, SERIES, WORLD, blueprint, body_path
from .piped_file import PipedFile
from .record import Entry, Record, Refusal, Sighting
from .solid import Solid

ARROW_TIME = 0.1
"""A velocity is drawn as the way made in this time [s]; an impulse, as the change of velocity that it
causes along itself; a normal, as 1 m/s. So all arrows of a scene are of one scale."""

POINT_RADIUS = rr.Radius.ui_points(6)
ARROW_RADIUS = rr.Radius.ui_points(2)

Times = list[rr.TimeColumn]
Columns = tuple[str, Times, Any]
"""An entity, when each of its rows was, and the columns."""


class Writer:
    """One file, complete when the context is left.

    Timelines: ``ros_time``, and ``answer``, which counts.
    """

    def __init__(self, path: Path) -> None:
        """Create the file, and its directory if need be.

        Raises:
            OSError: it exists, or cannot be created.
        """
        path.parent.mkdir(parents=True, exist_ok=True)
        self._known: set[str] = set()
        self._stream = rr.RecordingStream("collision_response")
        self._file = PipedFile(path)
        try:
            self._stream.save(self._file.name, default_blueprint=blueprint())
        finally:
            self._file.opened()
        self._log_styles()

    def __enter__(self) -> Writer:
        return self

    def __exit__(self, *_: object) -> None:
        self._stream.disconnect()
        self._file.join()
        self._file.check()

    def write(self, batch: Sequence[Entry]) -> None:
        """Append entries, and have them written before long.

        Raises:
            OSError: these or earlier ones cannot be.
        """
        impacts = [entry for entry in batch if isinstance(entry, Record)]
        sightings = [entry for entry in batch if isinstance(entry, Sighting)]
        answers = [entry for entry in batch if not isinstance(entry, Sighting)]
        for path, times, columns in (
            *seen(sightings),
            *bodies(impacts),
            *contacts(impacts),
            *series(impacts),
            *log(answers),
        ):
            self._stream.send_columns(path, indexes=times, columns=columns)
        for sighting in sightings:
            self._log_body_style(sighting.name, sighting.body)
        for impact in impacts:
            self._log_body_style(impact.name_a, impact.body_a)
            self._log_body_style(impact.name_b, impact.body_b)
        self._stream.flush(timeout_sec=5.0)
        self._file.check()

    def _log_styles(self) -> None:
        log = self._stream.log
        log(WORLD, rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        log(f"{WORLD}/contact/point", rr.Points3D.from_fields(radii=POINT_RADIUS, colors=RED), static=True)
        for arrow, colour in (("normal", GREY), ("impulse", GREEN)):
            style = rr.Arrows3D.from_fields(radii=ARROW_RADIUS, colors=colour)
            log(f"{WORLD}/contact/{arrow}", style, static=True)
        for path, (_, colour) in SERIES.items():
            name = path.rpartition("/")[2]
            points = rr.SeriesPoints(colors=colour, names=name, markers="circle", marker_sizes=3)
            log(path, points, static=True)

    def _log_body_style(self, name: str, body: Body) -> None:
        if name in self._known:
            return
        self._known.add(name)
        path, colour = body_path(name), None if body.is_movable() else GREY
        style = rr.Points3D.from_fields(radii=POINT_RADIUS, colors=colour, labels=name, show_labels=True)
        self._stream.log(path, style, static=True)
        for moment, colour in (("before", BEFORE), ("after", AFTER)):
            arrow = rr.Arrows3D.from_fields(radii=ARROW_RADIUS, colors=colour)
            self._stream.log(f"{path}/velocity_{moment}", arrow, static=True)
        if (solid := Solid.of(body)) is not None:
            self._stream.log(f"{path}/solid", solid.shape(), static=True)


def seen(sightings: Iterable[Sighting]) -> Iterator[Columns]:
    """Where bodies were, and how they moved, between impacts."""
    by_name: dict[str, list[Sighting]] = defaultdict(list)
    for sighting in sightings:
        by_name[sighting.name].append(sighting._replace(body=at_centre(sighting.body)))
    for name, rows in by_name.items():
        path, times, positions = body_path(name), _times(rows), _array(row.body.position for row in rows)
        yield from _poses(path, times, positions, [row.body for row in rows])
        nothing = _arrows(positions[:0], positions[:0]).partition([0] * len(rows))
        yield f"{path}/velocity_before", times, nothing
        yield f"{path}/velocity_after", times, _arrows(positions, _array(row.body.velocity for row in rows))


def bodies(impacts: Iterable[Record]) -> Iterator[Columns]:
    """Centres of mass, and their velocities before and after."""
    by_name: dict[str, list[tuple[Record, Body, Body]]] = defaultdict(list)
    for row in impacts:
        for name, body, twist in (
            (row.name_a, row.body_a, row.impact.twist_a),
            (row.name_b, row.body_b, row.impact.twist_b),
        ):
            by_name[name].append((row, at_centre(body), at_centre(_moving(body, twist))))
    for name, appearances in by_name.items():
        path, times = body_path(name), _times([row for row, _, _ in appearances])
        positions = _array(body.position for _, body, _ in appearances)
        yield from _poses(path, times, positions, [body for _, body, _ in appearances])
        before = _array(body.velocity for _, body, _ in appearances)
        after = _array(body.velocity for _, _, body in appearances)
        yield f"{path}/velocity_before", times, _arrows(positions, before)
        yield f"{path}/velocity_after", times, _arrows(positions, after)


def contacts(impacts: Sequence[Record]) -> Iterator[Columns]:
    """Contact points, normals and impulses."""
    if not impacts:
        return
    times, answers = _times(impacts), [row.impact for row in impacts]
    positions = _array(answer.contact.position for answer in answers)
    normals = _units(_array(answer.contact.normal for answer in answers))
    changes = _array(answer.impulse / answer.effective_mass for answer in answers)
    labels = [f"{answer.impulse.norm():.3g} N s" for answer in answers]
    yield f"{WORLD}/contact/point", times, rr.Points3D.columns(positions=positions)
    yield f"{WORLD}/contact/normal", times, _arrows(positions, normals)
    yield f"{WORLD}/contact/impulse", times, _arrows(positions, changes, labels=labels)


def series(impacts: Sequence[Record]) -> Iterator[Columns]:
    """Numbers over time."""
    if not impacts:
        return
    times = _times(impacts)
    for path, (field, _) in SERIES.items():
        scalars = np.array([getattr(row.impact, field) for row in impacts], dtype=np.float64)
        yield path, times, rr.Scalars.columns(scalars=scalars)


def log(batch: Sequence[Record | Refusal]) -> Iterator[Columns]:
    """Every answer in words."""
    if not batch:
        return
    levels = [rr.TextLogLevel.WARN if isinstance(entry, Refusal) else rr.TextLogLevel.INFO for entry in batch]
    words = rr.TextLog.columns(text=[_in_words(entry) for entry in batch], level=levels)
    yield LOG, _times(batch), words


def _in_words(entry: Record | Refusal) -> str:
    if isinstance(entry, Refusal):
        return entry.reason
    answer = entry.impact
    lost = answer.energy_lost_restitution + answer.energy_lost_friction
    return (
        f"{entry.name_a} on {entry.name_b}: {answer.regime.name}, "
        f"{answer.normal_impulse:.6g} N s along the normal, {answer.tangential_impulse:.6g} N s across, "
        f"{lost:.6g} J lost ({', '.join(choice.name for choice in answer.model[:3])})"
    )


def _poses(path: str, times: Times, positions: np.ndarray, bodies: Sequence[Body]) -> Iterator[Columns]:
    yield path, times, rr.Points3D.columns(positions=positions)
    if any(body.is_movable() for body in bodies):
        turned = _units(_array((body.orientation or (0.0, 0.0, 0.0, 1.0) for body in bodies), length=4))
        yield f"{path}/solid", times, rr.Transform3D.columns(translation=positions, quaternion=turned)


def _moving(body: Body, twist: Twist) -> Body:
    return body._replace(velocity=twist.linear, angular_velocity=twist.angular)


def _arrows(origins: np.ndarray, velocities: np.ndarray, **components: Any) -> Any:
    return rr.Arrows3D.columns(origins=origins, vectors=velocities * ARROW_TIME, **components)


def _array(tuples: Iterable[tuple[float, ...]], length: int = 3) -> np.ndarray:
    return np.fromiter(chain.from_iterable(tuples), np.float64).reshape(-1, length)


def _units(rows: np.ndarray) -> np.ndarray:
    """Each row of length 1: first its longest component, so that no square overflows, or is 0."""
    rows = rows / abs(rows).max(axis=1, keepdims=True)
    return rows / np.linalg.norm(rows, axis=1, keepdims=True)


def _times(rows: Sequence[Entry]) -> Times:
    stamps = np.array([row.stamp for row in rows], dtype="datetime64[ns]")
    times = [rr.TimeColumn("ros_time", timestamp=stamps)]
    answers = [row.sequence for row in rows if not isinstance(row, Sighting)]
    return [*times, rr.TimeColumn("answer", sequence=answers)] if answers else times
