"""Writing entries to a rerun file, in columns."""

from __future__ import annotations

import math
import os
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import chain
from pathlib import Path
from typing import Any
from uuid import uuid4

import numpy as np

from ..body_numbers import orientation_of
from ..physics.body import Body
from ..physics.centre_of_mass import with_com_as_reference
from ..physics.contact import Contact
from ..physics.vector import ZERO, Vec3
from .colours import AFTER, BEFORE, GREEN, GREY, RED, REGIMES, SPIN_AFTER, SPIN_BEFORE, VIOLET
from .equivalent_solid import EquivalentSolid
from .piped_file import PipedFile
from .record import (
    BodyRecord,
    Entry,
    Gap,
    Record,
    Refusal,
    SceneRecord,
    UnwritableEntries,
    drawn_bodies,
    with_floats,
)
from .rerun_sdk import rr
from .scenes import TABLE as SCENES
from .scenes import scene_columns
from .table import TABLE, impact_columns, refusal_columns
from .viewer_layout import (
    CONE,
    CONTACT,
    HAS_STATES,
    IMPULSE,
    LOG,
    PLOTS,
    REGIME,
    WORLD,
    blueprint,
    body_path,
    velocity_path,
)

ARROW_TIME = 0.1
"""Time [s] that scales all arrows: a velocity is drawn as the distance covered in this time, an impulse as
the change of velocity that it causes along itself, a normal as 1 m/s."""

MAX_CONE_SLOPE = 3.0
"""Friction coefficient above which friction cones are not drawn wider."""

SIDES = 32
CIRCLE = np.linspace(0, 2 * np.pi, SIDES, endpoint=False)
CONE_MESH = rr.Mesh3D(
    vertex_positions=[(0.0, 0.0, 0.0), *np.stack([np.cos(CIRCLE), np.sin(CIRCLE), np.ones(SIDES)], axis=1)],
    triangle_indices=[(0, 1 + i, 1 + (i + 1) % SIDES) for i in range(SIDES)],
    albedo_factor=(*VIOLET, 40),
)
"""A cone about the z axis with height and slope 1."""

OPPOSITE = 1e-12
"""A unit vector this close to -z is half a turn from z, about the x axis: its own axis would be rounding."""

FLUSH_TIME = 5.0
"""Longest time [s] to wait for rerun to pass on what it was given."""

LAYOUT_FILE = "layout.rrd"

POINT_RADIUS = rr.Radius.ui_points(6)
ARROW_RADIUS = rr.Radius.ui_points(2)
IMPULSE_RADIUS = rr.Radius.ui_points(4)
"""Thicker than the others, because the friction cone around an impulse hides some of it."""

Times = list[rr.TimeColumn]
Columns = tuple[str, Times, Any]
"""An entity, the times of its rows, and its columns."""
AnyImpact = Record | SceneRecord
Answer = AnyImpact | Refusal | Gap
"""Entries with a sequence number."""
Appearance = tuple[str, bool, bool]
"""Name of a body, whether it appears in a body state (else in an impact), and whether it has no stamp. The
style of a body is written for each of these combinations, since each has other timelines."""
BodyStyle = tuple[list[tuple[str, Any]], Columns]
"""How a body looks, by entity, and its shape, from its first appearance on each timeline."""


class Recording:
    """What all files of one recording share, so that the viewer shows them together.

    Every stream and every blueprint leaves two threads and 1 MB of memory behind (rerun 0.41). So there is
    one stream for all files, and the blueprint is written once, to a file in memory, whose contents,
    ``layout``, are copied to each file. On a full disk rerun would wait for ever, as in :class:`PipedFile`.
    """

    def __init__(self) -> None:
        self.stream = rr.RecordingStream("collision_response", recording_id=uuid4())
        with open(os.memfd_create(LAYOUT_FILE), "rb") as file:
            self.stream.save(f"/dev/fd/{file.fileno()}", default_blueprint=blueprint())
            self.stream.disconnect()
            self.layout = file.read()


class Writer:
    """Writes one file of a recording, which is complete when the context is left.

    There are two timelines: ``answer``, the sequence number, and ``ros_time``. Answers without a stamp, as
    before the first ``/clock`` of a simulation, are on the first only; body states without one are left out.

    The directory of the file is made if it does not exist. No other file of the recording may be open.

    Raises:
        OSError: if the file exists or cannot be created.
    """

    def __init__(self, path: Path, recording: Recording) -> None:
        path.parent.mkdir(parents=True, exist_ok=True)
        self.path = path
        self._styled: set[Appearance] = set()
        self._stream = recording.stream
        self.file = PipedFile(path)
        try:
            self._stream.save(self.file.name)
        except BaseException:
            self.file.join()
            raise
        self._stream.log_file_from_contents(LAYOUT_FILE, recording.layout)
        self._log_styles()
        self._stream.flush(timeout_sec=FLUSH_TIME)  # so that the styles come before the columns

    def __enter__(self) -> Writer:
        return self

    def __exit__(self, *_: object) -> None:
        self._stream.disconnect()
        self.file.join()
        self.file.check()

    def write(self, batch: Sequence[Entry]) -> None:
        """Append entries, which are then written soon.

        Raises:
            OSError: if these or earlier entries cannot be written to the file.
            UnwritableEntries: if some of the entries cannot be converted for rerun.
        """
        try:
            columns, styles = self._prepared(batch)
        except Exception as error:  # names and numbers may be anything
            unwritable = [entry for entry in batch if not self._is_writable(entry)]
            raise UnwritableEntries(unwritable or [*batch]) from error
        for path, times, values in columns:
            self._stream.send_columns(path, indexes=times, columns=values)
        for appearance, (looks, (path, times, shape)) in styles.items():
            self._styled.add(appearance)
            for entity, look in looks:
                self._stream.log(entity, look, static=True)
            self._stream.send_columns(path, indexes=times, columns=shape)
        self._stream.flush(timeout_sec=FLUSH_TIME)
        self.file.check()

    def _prepared(self, batch: Sequence[Entry]) -> tuple[list[Columns], dict[Appearance, BodyStyle]]:
        """Columns of a batch, and styles of the bodies that are new in it."""
        batch = list(map(with_floats, batch))
        with np.errstate(over="ignore", invalid="ignore"):  # rerun draws in float32
            styles: dict[Appearance, BodyStyle] = {}
            for entry in batch:
                for name, body, _ in drawn_bodies(entry):
                    appearance = name, isinstance(entry, BodyRecord), entry.stamp == 0
                    if appearance not in self._styled and appearance not in styles:
                        styles[appearance] = _style_of(entry, name, body)
            return [*_columns(batch)], styles

    def _is_writable(self, entry: Entry) -> bool:
        try:
            self._prepared([entry])
        except Exception:  # the first error is reported
            return False
        return True

    def _log_styles(self) -> None:
        log = self._stream.log
        log(WORLD, rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        log(CONTACT, rr.Points3D.from_fields(radii=POINT_RADIUS, colors=RED), static=True)
        log(CONTACT, rr.Arrows3D.from_fields(radii=ARROW_RADIUS, colors=GREY), static=True)
        log(IMPULSE, rr.Arrows3D.from_fields(radii=IMPULSE_RADIUS, colors=GREEN), static=True)
        log(CONE, CONE_MESH, static=True)
        if HAS_STATES:
            log(REGIME, rr.StateConfiguration(values=[*REGIMES], colors=[*REGIMES.values()]), static=True)
        for entity, plot in PLOTS.items():
            names, colours = [*plot.colours], [*plot.colours.values()]
            points = rr.SeriesPoints(colors=colours, names=names, markers="circle", marker_sizes=3)
            log(entity, points, static=True)


def _style_of(entry: Entry, name: str, body: Body) -> BodyStyle:
    path, colour = body_path(name), None if body.is_movable() else GREY
    style = rr.Points3D.from_fields(radii=POINT_RADIUS, colors=colour, labels=name, show_labels=True)
    arrows = rr.Arrows3D.from_fields(radii=ARROW_RADIUS, colors=[AFTER, SPIN_AFTER, BEFORE, SPIN_BEFORE])
    shape = [*rr.Points3D.columns(positions=[(0.0, 0.0, 0.0)])]
    if (solid := EquivalentSolid.of(body)) is not None:
        shape += solid.columns()
    return [(path, style), (velocity_path(name), arrows)], (path, _times([entry]), shape)


def _columns(batch: Sequence[Entry]) -> Iterator[Columns]:
    """All columns of a batch. The rows of each table have the same timelines."""
    yield from bodies([entry for entry in batch if isinstance(entry, BodyRecord)])
    answers = [entry for entry in batch if not isinstance(entry, BodyRecord)]
    for rows in ([row for row in answers if row.stamp], [row for row in answers if not row.stamp]):
        impacts = [row for row in rows if isinstance(row, AnyImpact)]
        yield from bodies(impacts)
        yield from contacts(impacts)
        yield from series(impacts)
        yield from regimes(impacts)
        yield from table(rows)
        yield from log(rows)


def bodies(rows: Iterable[Entry]) -> Iterator[Columns]:
    """Columns of bodies: their centres of mass, with velocities and spins after and before an impact."""
    by_name: dict[str, list[tuple[Entry, list[Body]]]] = defaultdict(list)
    for row in rows:
        for name, body, after in drawn_bodies(row):
            states = [*map(body.with_twist, after), body]
            by_name[name].append((row, [with_com_as_reference(state) for state in states]))
    for name, appearances in by_name.items():
        times = _times([row for row, _ in appearances])
        moments = [*zip(*(states for _, states in appearances), strict=True)]
        positions = _array(body.position for body in moments[-1])
        motions = chain.from_iterable(map(_motions, moments))
        yield body_path(name), times, _poses(positions, moments[-1])
        yield velocity_path(name), times, _arrows(positions, *motions)


def contacts(impacts: Sequence[AnyImpact]) -> Iterator[Columns]:
    """Columns of contacts: contact points, each with normal, impulse and friction cone."""
    with_contacts = [(row, found) for row in impacts if (found := _contacts_of(row))]
    if not with_contacts:
        return
    times, counts = _times([row for row, _ in with_contacts]), [len(found) for _, found in with_contacts]
    drawn = [contact for _, found in with_contacts for contact in found]
    positions = _array(contact.position for contact, _, _ in drawn)
    normals = _units(_array(contact.normal for contact, _, _ in drawn))
    changes = _array(impulse / mass if mass > 0 else ZERO for _, impulse, mass in drawn)
    labels = [f"{impulse.norm():.3g} N s" for _, impulse, _ in drawn]
    points = rr.Points3D.columns(positions=positions).partition(counts)
    arrows = _arrows(positions, changes, rows=counts)
    yield CONTACT, times, [*points, *_arrows(positions, normals, rows=counts)]
    yield IMPULSE, times, [*arrows, *rr.Arrows3D.columns(labels=labels).partition(counts)]
    heights = np.maximum((normals * changes).sum(axis=1), 0.0) * ARROW_TIME
    slopes = np.minimum(np.array([contact.friction for contact, _, _ in drawn], float), MAX_CONE_SLOPE)
    cones = rr.InstancePoses3D.columns(
        translations=positions,
        quaternions=_from_z_axis(normals),
        scales=np.stack([slopes * heights, slopes * heights, heights], axis=1),
    )
    yield CONE, times, cones.partition(counts)


def _contacts_of(row: AnyImpact) -> list[tuple[Contact, Vec3, float]]:
    """Every contact, its impulse, and the mass [kg] by which the impulse is divided for drawing.

    The mass is 0 if it is smaller than any float, and infinite if both bodies are immovable.
    """
    if not isinstance(row, SceneRecord):
        return [(row.impact.contact, row.impact.impulse, row.impact.effective_mass)]
    inverses = [1 / row.bodies[a].mass + 1 / row.bodies[b].mass for a, b in row.pairs]
    masses = [1 / inverse if inverse else math.inf for inverse in inverses]
    return list(zip(row.impact.contacts, row.impact.impulses, masses, strict=True))


def series(impacts: Sequence[AnyImpact]) -> Iterator[Columns]:
    """Columns of the plots. A scene has only the numbers that do not belong to one contact."""
    for entity, plot in PLOTS.items():
        rows = [row for row in impacts if hasattr(row.impact, plot.fields[0])]
        if rows:
            values = np.array([[getattr(row.impact, field) for field in plot.fields] for row in rows], float)
            lengths = [len(plot.fields)] * len(rows)
            yield entity, _times(rows), rr.Scalars.columns(scalars=values.ravel()).partition(lengths)


def regimes(impacts: Sequence[AnyImpact]) -> Iterator[Columns]:
    """Columns of the regimes over time."""
    rows = [row for row in impacts if isinstance(row, Record)]
    if rows and HAS_STATES:
        yield REGIME, _times(rows), rr.StateChange.columns(state=[str(row.impact.regime) for row in rows])


def table(rows: Sequence[Answer]) -> Iterator[Columns]:
    """Columns of the tables: impacts and scenes with request and answer, and refusals."""
    tables: dict[type[Answer], tuple[str, Callable[[Any], Any]]] = {
        SceneRecord: (SCENES, scene_columns),
        Record: (TABLE, impact_columns),
        Refusal: (TABLE, refusal_columns),
    }
    for kind, (entity, columns_of) in tables.items():
        if chosen := [row for row in rows if isinstance(row, kind)]:
            yield entity, _times(chosen), columns_of(chosen)


def log(rows: Sequence[Answer]) -> Iterator[Columns]:
    """Columns of the log: every answer in words."""
    if not rows:
        return
    levels = [rr.TextLogLevel.INFO if isinstance(row, AnyImpact) else rr.TextLogLevel.WARN for row in rows]
    yield LOG, _times(rows), rr.TextLog.columns(text=[_in_words(row) for row in rows], level=levels)


def _in_words(row: Answer) -> str:
    if isinstance(row, Refusal):
        return row.reason
    if isinstance(row, Gap):
        return f"{row.missing} entries are missing here: {row.why}"
    lost = row.impact.energy_lost_restitution + row.impact.energy_lost_friction
    energy = f"{lost:.6g} J lost ({', '.join(choice.name for choice in row.impact.model[:3])})"
    if isinstance(row, SceneRecord):
        return f"{len(row.pairs)} contacts of {len(row.names)} bodies at once: {energy}"
    answer = row.impact
    return (
        f"{row.name_a} on {row.name_b}: {answer.regime.name}, "
        f"{answer.normal_impulse:.6g} N s along the normal, {answer.tangential_impulse:.6g} N s across, "
        f"{energy}"
    )


def _poses(positions: np.ndarray, bodies: Sequence[Body]) -> Any:
    turned = _units(_array((orientation_of(body) for body in bodies), length=4))
    return rr.Transform3D.columns(translation=positions, quaternion=turned)


def _motions(bodies: Sequence[Body]) -> tuple[np.ndarray, np.ndarray]:
    """Velocities, and spins as the velocities of points at the root-mean-square distance of the mass."""
    arms = np.array([[(body.inertia.trace() / 2 / body.mass) ** 0.5] for body in bodies], float)
    return _array(body.velocity for body in bodies), arms * _array(body.angular_velocity for body in bodies)


def _from_z_axis(normals: np.ndarray) -> np.ndarray:
    """Quaternions ``(x, y, z, w)`` that rotate the z axis to unit vectors."""
    x, y, z = normals.T
    turned = np.stack([-y, x, 0 * x, 1 + z], axis=1)
    turned[z < -1 + OPPOSITE] = 1.0, 0.0, 0.0, 0.0
    return _units(turned)


def _arrows(origins: np.ndarray, *velocities: np.ndarray, rows: Sequence[int] | None = None) -> Any:
    """Columns of arrows, from each origin one arrow for each array of velocities.

    ``rows`` has the number of origins in each row; ``None``: one.
    """
    count, vectors = len(velocities), np.stack(velocities, axis=1) * ARROW_TIME
    columns = rr.Arrows3D.columns(origins=origins.repeat(count, axis=0), vectors=vectors.reshape(-1, 3))
    return columns.partition([count * number for number in rows or [1] * len(origins)])


def _array(tuples: Iterable[tuple[float, ...]], length: int = 3) -> np.ndarray:
    return np.fromiter(chain.from_iterable(tuples), np.float64).reshape(-1, length)


def _units(rows: np.ndarray) -> np.ndarray:
    """Rows scaled to length 1, first by their largest component: so no square overflows or becomes 0."""
    rows = rows / abs(rows).max(axis=1, keepdims=True)
    return rows / np.linalg.norm(rows, axis=1, keepdims=True)


def _times(rows: Sequence[Entry]) -> Times:
    """Time columns of rows, which all have a stamp or all none, and all a sequence number or all none."""
    times = []
    if rows[0].stamp:
        stamps = np.array([row.stamp for row in rows], dtype="datetime64[ns]")
        times.append(rr.TimeColumn("ros_time", timestamp=stamps))
    if answers := [row.sequence for row in rows if not isinstance(row, BodyRecord)]:
        times.append(rr.TimeColumn("answer", sequence=answers))
    return times
