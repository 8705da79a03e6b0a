"""The enumerations of the Python package are the constants of the messages."""

from __future__ import annotations

from enum import IntEnum

import pytest

pytest.importorskip("rclpy")

from collision_response import (
    Adjustment,
    Geometry,
    Impact,
    ImpactModel,
    Law,
    Precision,
    Regime,
    StatusCode,
    msg,
)
from collision_response.ros.convert import NOTES, NUMBERS


def constants(message):
    numbers = {name: value for name, value in vars(message).items() if isinstance(value, int)}
    return {name: number for name, number in numbers.items() if name.isupper()}


def members(*kinds: type[IntEnum]):
    return {member.name: member.value for kind in kinds for member in kind}


def test_status_codes():
    assert constants(msg.Status) == members(StatusCode)


def test_models():
    assert constants(msg.ImpactModel) == {
        name: value for name, value in members(Law, Geometry, Precision).items() if value
    } | {"AUTO": Geometry.AUTO}
    assert Geometry.AUTO == Precision.AUTO
    assert tuple(msg.ImpactModel.get_fields_and_field_types()) == ImpactModel._fields


def test_regimes_and_adjustments():
    adjustments = {flag.name: flag.value for flag in Adjustment if flag}
    assert constants(msg.CollisionResult) == members(Regime) | adjustments
    assert set(NOTES) == {flag for flag in Adjustment if flag}


def test_every_number_of_an_impact_is_in_the_result():
    fields = msg.CollisionResult.get_fields_and_field_types()
    assert {field for field, kind in fields.items() if kind == "double"} == set(NUMBERS)
    assert set(NUMBERS) <= set(Impact._fields)


def test_nothing_constructed_is_a_success():
    result = msg.CollisionResult()
    assert not StatusCode(result.status.code).is_answer
    assert msg.BodyState().inertia.m == 0.0
    assert msg.BodyState().restitution < 0 and msg.BodyState().friction < 0
    assert msg.Contact().restitution < 0 and msg.Contact().friction < 0
