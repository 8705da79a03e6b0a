"""Requests in other types of numbers: every function answers with the floats that it gives for floats."""

from __future__ import annotations

from collections.abc import Iterator
from decimal import Decimal
from fractions import Fraction
from typing import Any

import numpy as np
import pytest

from collision_response import (
    Body,
    Contact,
    Geometry,
    ImpactModel,
    Law,
    Precision,
    SceneContact,
    Twist,
    Vec3,
    resolve,
    resolve_scene,
    scene_requirements,
)
from collision_response.derivatives import (
    corner_on_plane,
    differentiate,
    propagate_covariance,
    saltation_matrix,
)
from collision_response.identify import Impacts
from collision_response.recording import Record, SceneRecord

TYPES = {
    "float32": np.float32,
    "float64": np.float64,
    "longdouble": np.longdouble,
    "int": int,
    "int8": np.int8,
    "0-d array": lambda x: np.array(float(x)),
    "Decimal": Decimal,
    "Fraction": Fraction,
}

FUNCTIONS: dict[str, Any] = {
    **{f"resolve, {law.name}": lambda a, b, c, law=law: resolve(a, b, c, ImpactModel(law)) for law in Law},
    **{
        f"resolve, {precision.name}": lambda a, b, c, precision=precision: resolve(
            a, b, c, ImpactModel(precision=precision)
        )
        for precision in Precision
    },
    **{
        f"resolve, {geometry.name}": lambda a, b, c, geometry=geometry: resolve(
            a, b, c, ImpactModel(geometry=geometry)
        )
        for geometry in (Geometry.POINT, Geometry.PLANAR)
    },
    "resolve, function": lambda a, b, c: resolve(a, b, c._replace(restitution=lambda v: 0.5)),
    "resolve, own coefficient": lambda a, b, c: resolve(
        a, b, c._replace(tangential_restitution=c.friction), ImpactModel(tolerance=c.friction)
    )._replace(model=None),  # it has the given numbers
    "one contact": lambda a, b, c: resolve_scene([a, b], [(0, 1)], [c], ImpactModel(Law.FRICTIONLESS)),
    **{
        f"scene, {law.name}": lambda a, b, c, law=law: resolve_scene(
            [a, b], [(0, 1)] * 2, [c, _moved(c)], ImpactModel(law)
        )
        for law in (Law.FRICTIONLESS, Law.COULOMB, Law.MOREAU, Law.ROUTH_STRONGE)
    },
    "no contact": lambda a, b, c: resolve_scene([a, b], [], []),
    "scene_requirements": lambda a, b, c: scene_requirements(
        {"a": a, "b": b}, [SceneContact("a", "b", c)], 1e-6
    ),
    "differentiate": lambda a, b, c: differentiate(a, b, c),
    "saltation_matrix": lambda a, b, c: saltation_matrix(a, b, c, surfaces=corner_on_plane),
    "Impacts.of": lambda a, b, c: _measured(a, b, c).residuals(Law.COULOMB, {"restitution": 0.5}, "kinetic"),
    "propagate_covariance": lambda a, b, c: propagate_covariance(
        a, b, c, covariance=np.eye(12), surfaces=corner_on_plane, friction_sd=0.1
    ),
}


def _measured(body_a: Body, body_b: Body, contact: Contact) -> Impacts:
    """An impact after which the bodies have the twists that they had before."""
    twists = [Twist(Vec3(*body.velocity), Vec3(*body.angular_velocity)) for body in (body_a, body_b)]
    return Impacts.of([body_a], [body_b], [contact], *([twist] for twist in twists))


def _moved(contact: Contact) -> Contact:
    x, y, z = contact.position
    return contact._replace(position=(x, y + contact.normal[0] + contact.normal[1], z))


KINDS = ("usual", "moving", "off-centre", "turned")


def request(number: Any, kind: str) -> tuple[Body, Body, Contact]:
    """Two bodies and a contact, of numbers that every type holds exactly."""

    def vector(*numbers: int) -> tuple[Any, ...]:
        return tuple(map(number, numbers))

    inertia, twist = (
        vector(2, 0, 0, 3, 0, 1),
        {"velocity": vector(3, -2, -1), "angular_velocity": vector(1, 2, -1)},
    )
    contact = Contact.of(vector(1, -1, 0), vector(0, 2, 0), number(1), number(1))
    other = Body.static()
    if kind == "moving":
        other = Body.kinematic(vector(1, -3, 0), vector(0, 1, 1), vector(1, 0, 0))
    com = vector(0, 0, 1) if kind == "off-centre" else vector(0, 0, 0)
    orientation = vector(0, 0, 2, 0) if kind == "turned" else None
    body = Body.dynamic(number(4), inertia, vector(0, 0, 0), orientation, **twist)._replace(com=com)
    return body, other, contact


EXACT = ("resolve, FRICTIONLESS", "no contact", "one contact", "scene,")
"""Functions that compute with fractions, or refuse them: see test_rationals.py."""

CASES = [
    (function, type_)
    for function in FUNCTIONS
    for type_ in TYPES
    if not (type_ == "Fraction" and function.startswith(EXACT))
]


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize(("function", "type_"), CASES)
def test_answers_are_those_of_floats(function, type_, kind):
    expected = FUNCTIONS[function](*request(float, kind))
    found = FUNCTIONS[function](*request(TYPES[type_], kind))
    found, expected = list(_numbers(found)), list(_numbers(expected))
    np.testing.assert_equal(found, expected)
    assert list(map(type, found)) == list(map(type, expected))


def _numbers(answer: Any) -> Iterator[Any]:
    """All numbers of an answer, except those of contacts, which are the given ones."""
    if not isinstance(answer, tuple):
        yield answer
    elif not isinstance(answer, Contact):
        for part in answer:
            yield from _numbers(part)


@pytest.mark.parametrize("type_", TYPES)
def test_recordings_hold_floats(type_, tmp_path):
    """What is recorded of a request does not depend on the type of its numbers."""
    pytest.importorskip("rerun")
    from collision_response.recording import Recorder, scenes, table

    def recorded(name: str, number: Any) -> list[Any]:
        problems: list[str] = []
        recorder = Recorder(tmp_path, problems.append, name=f"{name}.rrd")
        for i, kind in enumerate(KINDS):
            a, b, contact = request(number, kind)
            of_two = [a, b], [(0, 1)] * 2, [contact, _moved(contact)]
            model = ImpactModel(Law.FRICTIONLESS)
            impact, scene = resolve(a, b, contact, model), resolve_scene(*of_two, model)
            recorder.add(Record(i + 1, 2 * i, "a", "b", a, b, contact, model, impact))
            recorder.add(SceneRecord(i + 1, 2 * i + 1, ["a", "b"], *of_two, model, scene))
        recorder.close()
        assert problems == []
        (path,) = tmp_path.glob(f"{name}*")
        return [table.read([path]), scenes.read([path])]

    for found, expected in zip(recorded("given", TYPES[type_]), recorded("floats", float), strict=True):
        assert found.num_rows == len(KINDS)
        if type_ != "Fraction":  # whose answers are rounded once
            np.testing.assert_equal(found.to_pylist(), expected.to_pylist())
