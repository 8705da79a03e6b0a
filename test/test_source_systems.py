"""The systems S1 to S8 of the two sources, by resolve()."""

from __future__ import annotations

import math
from fractions import Fraction
from operator import attrgetter

import pytest

from collision_response import resolve
from collision_response.demo.systems import all_systems, s1, s2
from collision_response.physics.mass_properties import Particle, of_particles
from collision_response.physics.vector import Vec3

ROUNDING = 1e-14
"""Relative: the closed forms and the answers each take some twenty rounded steps."""


@pytest.mark.parametrize("system", all_systems(), ids=attrgetter("name"))
def test_system(system):
    impact = resolve(system.body_a, system.body_b, system.contact)
    for quantity, value in system.expected.items():
        assert attrgetter(quantity)(impact) == pytest.approx(value, rel=ROUNDING, abs=0), quantity


def test_s1_conserves_energy():
    """The second formula of the source as printed lacks a sine and would fail here."""
    system = s1()
    impact = resolve(system.body_a, system.body_b, system.contact)
    assert impact.kinetic_energy_after == pytest.approx(impact.kinetic_energy_before, rel=ROUNDING)


@pytest.mark.parametrize("degrees", range(-45, 46, 5))
def test_s2_for_every_corner_angle(degrees):
    system = s2(math.radians(degrees))
    impact = resolve(system.body_a, system.body_b, system.contact)
    for quantity, value in system.expected.items():
        # the components pass through zero, so the scale is the speed of the impact, 4 m/s
        assert attrgetter(quantity)(impact) == pytest.approx(value, rel=ROUNDING, abs=4 * ROUNDING), quantity


def test_s4_mass_properties_of_particles():
    """A dumbbell of 1 kg and 3 kg, 4 m apart along x, worked by hand."""
    particles = [
        Particle(Fraction(1), Vec3(*map(Fraction, (0, 1, 2)))),
        Particle(Fraction(3), Vec3(*map(Fraction, (4, 1, 2)))),
    ]
    mass, com, inertia = of_particles(particles)
    assert mass == 4
    assert com == (3, 1, 2)
    assert inertia == (0, 0, 0, 12, 0, 12)
