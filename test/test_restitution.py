"""Velocity-dependent restitution against the equation of motion it stands for, and in use."""

from __future__ import annotations

import math

import pytest
from integrate import until

from collision_response import Adjustment, Body, Contact, ImpactModel, resolve
from collision_response.physics.restitution import plastic, viscoelastic

DROP = Body.dynamic(1.0, velocity=(0.0, 0.0, -2.0))
FLOOR = Body.static()


def contact(restitution):
    return Contact.of((0, 0, 0), normal=(0, 0, 1), restitution=restitution)


@pytest.mark.parametrize("damping", [1e-3, 1e-2, 0.1, 0.5, 1.0, 3.0])
def test_viscoelastic_is_the_rebound_of_the_damped_hertz_contact(damping):
    """In units of the collision its equation is ``x'' = -x^1.5 - damping x^0.5 x'``, with v = 1."""

    def motion(y):
        x = max(y[0], 0.0)
        return [y[1], -(x**1.5) - damping * math.sqrt(x) * y[1]]

    def pulled_apart(y):
        return -1.0 if y[1] > 0 else -(y[0] + damping * y[1])

    _, end, _ = until(motion, [0.0, 1.0], [pulled_apart], tolerance=1e-9)
    # 0.01 is what the approximant promises
    assert viscoelastic(damping)(1.0) == pytest.approx(-end[1], abs=0.01)


def test_plastic_is_elastic_up_to_the_yield_speed_and_then_falls_as_johnson_says():
    law = plastic(0.5)
    assert law(0.5) == 1.0
    assert law(0.5 * (1 + 1e-9)) == pytest.approx(1.0, abs=1e-8)
    # the limit is (6 sqrt(3)/5)^(1/2) (4 * 6/5)^(-1/8) q^(1/4); its first correction is of order q
    limit = math.sqrt(6 * math.sqrt(3) / 5) * (4 * 6 / 5) ** -0.125
    assert law(0.5e8) == pytest.approx(limit * 1e-2, rel=1e-7)


@pytest.mark.parametrize("make", [viscoelastic, plastic])
def test_constants_of_the_material_are_checked(make):
    with pytest.raises(ValueError, match="-1"):
        make(-1.0)


def test_a_function_gives_the_coefficient_and_the_answer_names_it():
    impact = resolve(DROP, FLOOR, contact(lambda speed: 1 / (1 + speed)))
    assert impact.contact.restitution == pytest.approx(1 / 3)
    assert impact.twist_a.linear.z == pytest.approx(2 / 3)


def test_the_threshold_acts_below_and_says_so():
    slow = resolve(DROP, FLOOR, contact(0.5), ImpactModel(restitution_threshold=2.5))
    assert slow.normal_velocity_after == 0.0
    assert slow.contact.restitution == 0.0
    assert slow.adjustments == Adjustment.RESTITUTION_THRESHOLD
    fast = resolve(DROP, FLOOR, contact(0.5), ImpactModel(restitution_threshold=2.0))
    assert fast.normal_velocity_after == 1.0
    assert fast.adjustments == Adjustment.NONE
