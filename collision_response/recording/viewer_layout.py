"""Where things are in a recording, and how the viewer shows them at first."""

from __future__ import annotations

from typing import NamedTuple

import rerun as rr
import rerun.blueprint as rrb

WORLD = "/world"
CONTACT = f"{WORLD}/contact"
CONE = f"{WORLD}/friction_cone"
REGIME = "/impact/regime"
LOG = "/log"

Colour = tuple[int, int, int]

BLUE, ORANGE, GREEN, RED, VIOLET, GREY = (
    (90, 160, 230),
    (240, 150, 50),
    (110, 190, 110),
    (220, 80, 80),
    (160, 120, 210),
    (150, 150, 150),
)
BEFORE, AFTER = BLUE, ORANGE
SPIN_BEFORE, SPIN_AFTER = (60, 110, 170), (180, 100, 20)
REGIMES = {"STICKING": GREEN, "SLIDING": BLUE, "REVERSED": ORANGE, "JAMMED": RED, "SEPARATING": GREY}

HAS_STATES = hasattr(rr, "StateChange")
"""Whether this rerun shows states over time: 0.39, the last for Python 3.10, does not."""


class Plot(NamedTuple):
    """Numbers over time in one view.

    Attributes:
        title: of the view.
        fields: of ``Impact``, one for each curve.
        names: of the curves.
        colours: of the curves.
    """

    title: str
    fields: tuple[str, str]
    names: tuple[str, str]
    colours: tuple[Colour, Colour]


PLOTS = {
    "/impact/kinetic_energy": Plot(
        "Kinetic energy [J]",
        ("kinetic_energy_before", "kinetic_energy_after"),
        ("before", "after"),
        (BEFORE, AFTER),
    ),
    "/impact/energy_lost": Plot(
        "Energy lost [J]",
        ("energy_lost_restitution", "energy_lost_friction"),
        ("restitution", "friction"),
        (RED, VIOLET),
    ),
    "/impact/normal_velocity": Plot(
        "Normal velocity [m/s]",
        ("normal_velocity_before", "normal_velocity_after"),
        ("before", "after"),
        (BEFORE, AFTER),
    ),
    "/impact/impulse": Plot(
        "Impulse [N s]", ("normal_impulse", "tangential_impulse"), ("normal", "tangential"), (GREEN, VIOLET)
    ),
}
"""By entity: all curves of a view are columns of one, for what a recording costs goes with its entities."""

SCENE = (
    "Velocity before (blue), after (orange), spin darker; contact normal (grey), impulse (green) in its cone"
)


def body_path(name: str) -> str:
    """The entity of a body, whatever its name: the frame of its centre of mass."""
    return f"{WORLD}/bodies/{rr.escape_entity_path_part(name)}"


def velocity_path(name: str) -> str:
    """The entity of a body's velocities, in the world's frame."""
    return f"{WORLD}/velocities/{rr.escape_entity_path_part(name)}"


def blueprint(eye: rrb.EyeControls3D | None = None, time_axis: rrb.TimeAxis | None = None) -> rrb.Blueprint:
    """The scene, beside it what changes with time, below it the answers in words.

    Args:
        eye: where to look at the scene from; left out, the viewer looks at all of it.
        time_axis: of the plots; left out, they show all of the time.
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
