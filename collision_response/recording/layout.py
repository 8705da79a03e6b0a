"""Where things are in a recording, and how the viewer shows them at first."""

from __future__ import annotations

import rerun as rr
import rerun.blueprint as rrb

WORLD = "/world"
LOG = "/log"

BLUE, ORANGE, GREEN, RED, VIOLET, GREY = (
    (90, 160, 230),
    (240, 150, 50),
    (110, 190, 110),
    (220, 80, 80),
    (160, 120, 210),
    (150, 150, 150),
)
BEFORE, AFTER = BLUE, ORANGE

SERIES = {
    "/impact/kinetic_energy/before": ("kinetic_energy_before", BEFORE),
    "/impact/kinetic_energy/after": ("kinetic_energy_after", AFTER),
    "/impact/energy_lost/restitution": ("energy_lost_restitution", RED),
    "/impact/energy_lost/friction": ("energy_lost_friction", VIOLET),
    "/impact/normal_velocity/before": ("normal_velocity_before", BEFORE),
    "/impact/normal_velocity/after": ("normal_velocity_after", AFTER),
    "/impact/impulse/normal": ("normal_impulse", GREEN),
    "/impact/impulse/tangential": ("tangential_impulse", VIOLET),
}
"""The entity of each time series: the field of ``Impact`` that it shows, and its colour."""

SCENE = "Velocity before (blue), after (orange); contact normal (grey), impulse (green)"

VIEWS = {
    "/impact/kinetic_energy": "Kinetic energy [J]",
    "/impact/energy_lost": "Energy lost [J]",
    "/impact/normal_velocity": "Normal velocity [m/s]",
    "/impact/impulse": "Impulse [N s]",
}


def body_path(name: str) -> str:
    """The entity of a body, whatever its name."""
    return f"{WORLD}/bodies/{rr.escape_entity_path_part(name)}"


def blueprint(eye: rrb.EyeControls3D | None = None, time_axis: rrb.TimeAxis | None = None) -> rrb.Blueprint:
    """The scene, beside it what changes with time, below it the answers in words.

    Args:
        eye: where to look at the scene from; left out, the viewer looks at all of it.
        time_axis: of the plots; left out, they show all of the time.
    """
    plots = [
        rrb.TimeSeriesView(origin=origin, name=name, axis_x=time_axis, plot_legend=rrb.Corner2D.RightTop)
        for origin, name in VIEWS.items()
    ]
    return rrb.Blueprint(
        rrb.Vertical(
            rrb.Horizontal(
                rrb.Spatial3DView(origin=WORLD, name=SCENE, eye_controls=eye),
                rrb.Vertical(*plots),
                column_shares=[3, 2],
            ),
            rrb.TextLogView(origin=LOG, name="Answers"),
            row_shares=[4, 1],
        ),
        rrb.TimePanel(timeline="ros_time", state="collapsed"),
        collapse_panels=True,
    )
