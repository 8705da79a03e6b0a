"""The entities of a recording, and the initial layout of the viewer."""

from __future__ import annotations

from typing import NamedTuple

from .colours import AFTER, BEFORE, GREEN, RED, VIOLET, Colour
from .rerun_sdk import rr, rrb

WORLD = "/world"
VELOCITIES = f"{WORLD}/velocities"
CONTACT = f"{WORLD}/contact"
IMPULSE = f"{WORLD}/impulse"
CONE = f"{WORLD}/friction_cone"
REGIME = "/impact/regime"
LOG = "/log"

HAS_STATES = hasattr(rr, "StateChange")
"""Whether this version of rerun shows states over time. 0.39, the last one for Python 3.10, does not."""


class Plot(NamedTuple):
    """A view with curves over time: fields of ``Impact``, made of a pattern and the name of each curve."""

    title: str
    pattern: str
    colours: dict[str, Colour]

    @property
    def fields(self) -> list[str]:
        """The field that each curve shows."""
        return [self.pattern.format(name) for name in self.colours]


IN_TIME, CAUSES = {"before": BEFORE, "after": AFTER}, {"restitution": RED, "friction": VIOLET}

PLOTS = {
    "/impact/kinetic_energy": Plot("Kinetic energy [J]", "kinetic_energy_{}", IN_TIME),
    "/impact/energy_lost": Plot("Energy lost [J]", "energy_lost_{}", CAUSES),
    "/impact/normal_velocity": Plot("Normal velocity [m/s]", "normal_velocity_{}", IN_TIME),
    "/impact/impulse": Plot("Impulse [N s]", "{}_impulse", {"normal": GREEN, "tangential": VIOLET}),
}
"""The plots by entity. The curves of a plot share an entity, because each entity makes a recording larger."""

SCENE = "Velocity before (blue), after (orange), spin darker; impulse (green) in its cone"


def body_path(name: str) -> str:
    """Entity of a body: the frame of its centre of mass. Any name works."""
    return f"{WORLD}/bodies/{rr.escape_entity_path_part(name)}"


def velocity_path(name: str) -> str:
    """Entity of a body's velocities, in the world frame."""
    return f"{VELOCITIES}/{rr.escape_entity_path_part(name)}"


def blueprint(eye: rrb.EyeControls3D | None = None, time_axis: rrb.TimeAxis | None = None) -> rrb.Blueprint:
    """Make the layout: the scene with the plots next to it, and the answers in words below.

    Args:
        eye: the viewpoint of the scene; ``None``: the viewer shows all of it.
        time_axis: the time axis of the plots; ``None``: they show all times.
    """
    plots = [
        rrb.TimeSeriesView(
            origin=entity, name=plot.title, axis_x=time_axis, plot_legend=rrb.Corner2D.RightTop
        )
        for entity, plot in PLOTS.items()
    ]
    states = [rrb.StateTimelineView(origin=REGIME, name="What friction did")] if HAS_STATES else []
    return rrb.Blueprint(
        rrb.Vertical(
            rrb.Horizontal(
                rrb.Spatial3DView(origin=WORLD, name=SCENE, eye_controls=eye),
                rrb.Vertical(*plots, *states),
                column_shares=[3, 2],
            ),
            rrb.TextLogView(origin=LOG, name="Answers"),
            row_shares=[4, 1],
        ),
        rrb.TimePanel(timeline="ros_time", state="collapsed"),
        collapse_panels=True,
    )
