"""The demo's own reckoning: when bodies touch, and whether its books would show a fault."""

from __future__ import annotations

import math

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from collision_response.demo.books import EnergyBook, momentum, spin_momentum
from collision_response.demo.time_of_impact import TOUCHING, until_spheres_touch, until_touch
from collision_response.physics.body import Body
from collision_response.physics.vector import Vec3

vectors = st.builds(Vec3, *[st.floats(-3, 3)] * 3)


@given(vectors, vectors, st.floats(0.1, 1.0))
def test_spheres_touch_when_their_distance_is_the_sum_of_their_radii(offset, velocity, reach):
    assume(offset.norm() > 1.1 * reach and velocity.norm() > 0.1)
    time = until_spheres_touch(offset, velocity, reach)
    nearest = max(0.0, -offset.dot(velocity) / velocity.dot(velocity))
    closest = (offset + velocity * nearest).norm()
    if math.isinf(time):
        assert closest >= reach * (1 - 1e-12)
    else:
        assert 0 < time <= nearest
        # rounding of lengths up to 6 m, more where the path only just touches
        assert (offset + velocity * time).norm() == pytest.approx(reach, abs=1e-12)


@given(st.floats(0.01, 5.0), st.floats(-3.0, 3.0))
def test_a_falling_point_reaches_the_floor_when_gravity_says(height, speed):
    g = 9.81

    def gap(t: float) -> tuple[float, float]:
        return height + speed * t - g * t * t / 2, speed - g * t

    expected = (speed + math.sqrt(speed * speed + 2 * g * height)) / g
    # within the gap that counts as none, at the speed of arrival
    assert until_touch(gap, g, 10.0) == pytest.approx(expected, abs=2 * TOUCHING / 0.4 + 1e-12)


def test_a_gap_that_does_not_close_is_not_found():
    assert until_touch(lambda t: (1.0 + t * t, 2 * t), 2.0, 5.0) == math.inf


def test_an_energy_book_shows_what_is_missing_and_what_rises():
    book = EnergyBook(10.0)
    book.enter(8.0, 1.5, 0.5)
    assert (book.error(), book.relative_rise()) == (0.0, 0.0)
    book.enter(9.0, 0.0, 0.0)
    assert (book.error(), book.relative_rise()) == (pytest.approx(0.1), pytest.approx(0.1))


def test_the_momenta_are_those_of_all_bodies():
    inertia = (1.0, 0.0, 0.0, 1.0, 0.0, 2.0)
    a = Body.dynamic(2.0, inertia, (1.0, 0.0, 0.0), None, (0.0, 3.0, 0.0), (0.0, 0.0, 0.5))
    b = Body.dynamic(1.0, velocity=(0.0, -6.0, 0.0), position=(-1.0, 0.0, 0.0))
    assert momentum([a, b]) == (0.0, 0.0, 0.0)
    assert spin_momentum([a, b]) == 6.0 + 1.0 + 6.0
