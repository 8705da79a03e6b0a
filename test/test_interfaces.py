"""The enumerations of the Python package equal the constants of the messages."""

from __future__ import annotations

import re
from enum import IntEnum
from pathlib import Path

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
    srv,
)
from collision_response.batch.rows import body_rows, contact_rows
from collision_response.ros.convert import ADJUSTMENT_NOTES, NUMBERS
from collision_response.ros.tables import LAYOUTS

ROOT = Path(__file__).parent.parent


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
    others = {name: n for name, n in constants(msg.CollisionResult).items() if not name.startswith("FROM_")}
    assert others == members(Regime) | adjustments
    assert set(ADJUSTMENT_NOTES) == {flag for flag in Adjustment if flag}


def test_every_number_of_an_impact_is_in_the_result():
    fields = msg.CollisionResult.get_fields_and_field_types()
    of_states = {"state_age_a", "state_age_b"}
    assert {field for field, kind in fields.items() if kind == "double"} == {*NUMBERS, *of_states}
    assert set(NUMBERS) <= set(Impact._fields)


def test_layouts_of_a_batch():
    named = {layout.name: number for number, layout in LAYOUTS.items()}
    assert constants(srv.ResolveCollisionBatch.Request) == named
    for number in (srv.ResolveCollisionBatch.Request.POINT, srv.ResolveCollisionBatch.Request.PLANAR):
        assert LAYOUTS[number].geometry == number


def test_the_rows_of_a_batch_are_listed():
    text = (ROOT / "srv" / "ResolveCollisionBatch.srv").read_text()
    listed = re.findall(r"^#   (POINT|PLANAR|SPATIAL) +(.*)$", text, re.MULTILINE)
    heights = [(name, len(rows.replace(",", "").split())) for name, rows in listed]
    assert heights == [
        *((geometry.name, body_rows(geometry).height) for geometry in Geometry if geometry > Geometry.AUTO),
        *(
            (geometry.name, contact_rows(geometry).height + 1)
            for geometry in Geometry
            if geometry > Geometry.AUTO
        ),
    ]


@pytest.mark.parametrize(
    "file", [*ROOT.glob("msg/*.msg"), *ROOT.glob("srv/*.srv")], ids=lambda file: file.name
)
def test_comments_stand_above_what_they_explain(file):
    """``ros2 interface show`` mangles comments that follow nested fields."""
    assert re.findall(r"^[^#\n].*#.*$", file.read_text(), re.MULTILINE) == []


def test_a_default_constructed_message_is_not_a_success():
    result = msg.CollisionResult()
    assert not StatusCode(result.status.code).is_answer
    assert msg.BodyState().inertia.m == 0.0
    assert msg.BodyState().restitution < 0 and msg.BodyState().friction < 0
    assert msg.Contact().restitution < 0 and msg.Contact().friction < 0


SAFE = re.compile(r"sequence<(double|float|u?int(16|32|64))(, \d+)?>")


def sequences(message, path=""):
    for name, kind in message.get_fields_and_field_types().items():
        if kind.startswith("sequence"):
            yield f"{path}{name}", kind
        elif "/" in kind and "[" not in kind:
            yield from sequences(type(getattr(message(), name)), f"{path}{name}.")


@pytest.mark.parametrize("name", [name for name in dir(srv) if name[0].isupper() and "_" not in name])
def test_requests_hold_no_sequences_of_bytes_strings_or_messages(name):
    request = getattr(srv, name).Request
    assert [(field, kind) for field, kind in sequences(request) if not SAFE.fullmatch(kind)] == []
