"""The units of inputs and results, by which ``units.hpp`` scales them."""

from __future__ import annotations

DIMENSIONS = {
    "mass": (1, 0, 0),
    "inertia": (1, 2, 0),
    "position": (0, 1, 0),
    "com": (0, 1, 0),
    "velocity": (0, 1, -1),
    "angular_velocity": (0, 0, -1),
    "restitution_threshold": (0, 1, -1),
    "impulse": (1, 1, -1),
    "linear": (0, 1, -1),
    "angular": (0, 0, -1),
    "normal_impulse": (1, 1, -1),
    "tangential_impulse": (1, 1, -1),
    "normal_velocity_before": (0, 1, -1),
    "normal_velocity_after": (0, 1, -1),
    "effective_mass": (1, 0, 0),
    "kinetic_energy_before": (1, 2, -2),
    "kinetic_energy_after": (1, 2, -2),
    "energy_lost_restitution": (1, 2, -2),
    "energy_lost_friction": (1, 2, -2),
}
"""Exponents of mass, length and time for each field. A field that is not listed is dimensionless."""


def units(name: str) -> tuple[int, int, int, int, int, int]:
    """Return the unit of a quantity, as exponents.

    The base units are those of mass, length and time, then the lengths of the two quaternions and of the
    normal, on which no answer depends.
    """
    owner, field, *_ = [*name.split("."), ""]
    lengths = {
        ("body_a", "orientation"): (1, 0, 0),
        ("body_b", "orientation"): (0, 1, 0),
        ("contact", "normal"): (0, 0, 1),
    }
    dimensions = DIMENSIONS.get(field, (0, 0, 0))
    if field == "inverse_inertia":  # the angular components are named a, b and c
        dimensions = (-1, -sum(axis in "abc" for axis in name.rpartition(".")[2]), 0)
    return (*dimensions, *lengths.get((owner, field), (0, 0, 0)))
