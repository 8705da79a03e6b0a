"""Requests in other types of numbers: every function answers with the floats that it gives for floats."""

from __future__ import annotations

import math
from collections.abc import Iterator
from decimal import Decimal
from fractions import Fraction
from typing import Any

import numpy as np
import pytest

pytest.importorskip("flint")  # EXTENDED must be exact here

import attacks
from answer_faults import UNIT, faults_of_answer, numbers_of, pair_of, resolved, right_answer
from attacks import Case
from exact import nearest_float

from collision_response import (
    Body,
    Contact,
    Geometry,
    Impact,
    ImpactError,
    ImpactModel,
    Law,
    Precision,
    SceneContact,
    SceneImpact,
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
    sphere_on_plane,
)
from collision_response.identify import Impacts
from collision_response.physics.vector import ZERO
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
    import pyarrow as pa

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
            assert found.schema.equals(expected.schema)
            for pair in zip(found.columns, expected.columns, strict=True):
                if pa.types.is_timestamp(pair[0].type):  # nanoseconds, for which pyarrow needs pandas
                    pair = [column.cast(pa.int64()) for column in pair]
                np.testing.assert_equal(*(column.to_pylist() for column in pair))


GOOD = dict.fromkeys(attacks.FIELDS, 0.5)


NAMES = {"spin": "angular_velocity", "e_t": "tangential_restitution", "threshold": "restitution_threshold"}


def _answer_with(field: str, value: Any) -> Impact:
    """The answer to a request with one value of another type."""
    g = {**GOOD, field: value}
    body = Body.dynamic(
        g["mass"],
        (g["inertia"], 0.0, 0.0, 0.6, 0.0, 0.7),
        (0.25, g["position"], 0.5),
        None,
        (0.25, g["velocity"], -3.0),
        (g["spin"], 0.25, 0.125),
    )
    contact = Contact.of((0.0, 0.0, 0.0), (0.25, g["normal"], 1.0), g["restitution"], g["friction"])
    model = ImpactModel(
        tolerance=g["tolerance"], tangential_restitution=g["e_t"], restitution_threshold=g["threshold"]
    )
    return resolve(body, Body.static((0.1, 0.2, -1.0)), contact, model)


@pytest.mark.parametrize("given", list(attacks.kinds_of_number()), ids=lambda given: given.name)
def test_number_types(given):
    """A value is used as the float that it equals, to the bit, or refused by name."""
    try:
        impact = _answer_with(given.field, given.value)
    except (TypeError, ImpactError) as refusal:
        name = NAMES.get(given.field, given.field)
        assert name in str(refusal), f"the refusal does not name {name}: {refusal}"
        return
    assert given.is_number, f"{given.value!r} was taken for a number"
    assert numbers_of(impact) == numbers_of(_answer_with(given.field, float(given.value)))
    wrong = {name: type(x).__name__ for name, x in numbers_of(impact).items() if type(x) is not float}
    assert not wrong
    assert type(impact.error_bound) is float


TURNED = Body.dynamic(
    1.0, (1.0, 0.0, 0.0, 2.0, 0.0, 2.5), (0.25, 1.0, 0.125), (0.0, 0.0, 0.6, 0.8), (0.5, -1.0, 0.25),
    (1.0, 0.5, 0.25), (0.125, 0.0625, 0.125),
)  # fmt: skip


REQUEST = {
    "body_a": TURNED,
    "body_b": Body.kinematic((0.0, 0.0, 0.0), (0.125, 0.0, 0.0), (0.0, 0.0, 0.5)),
    "contact": Contact.of((0.0, 0.0, 0.0), (0.0, 1.0, 0.0), 0.5, 0.25),
}


CALLS = {
    "point": lambda a, b, c: resolve(a, b, c, ImpactModel(geometry=Geometry.POINT)),
    "planar": lambda a, b, c: resolve(a, b, c, ImpactModel(geometry=Geometry.PLANAR)),
    "more digits": lambda a, b, c: resolve(a, b, c, ImpactModel(tolerance=1e-30)),
    "functions": lambda a, b, c: resolve(a, b, c._replace(restitution=lambda v: v / 8, friction=lambda v: v)),
    "a path": lambda a, b, c: resolve(
        a, b, c._replace(friction=lambda v: 0.1), ImpactModel(Law.ROUTH_STRONGE)
    ),
    "requirements": lambda a, b, c: scene_requirements({"a": a, "b": b}, [SceneContact("a", "b", c)], 0.5),
    "scene": lambda a, b, c: resolve_scene(
        [a, b], [(0, 1)] * 2, [c, c._replace(position=(0.25, 0.0, 0.125))]
    ),
    "covariance": lambda a, b, c: propagate_covariance(
        a, b, c, ImpactModel(), np.eye(12) / 64, sphere_on_plane(0.125), normal_sd=0.125
    ),
    "measurements": lambda a, b, c: (
        Impacts.of([a], [b], [c], [Twist(ZERO, ZERO)], [Twist(ZERO, ZERO)]).bodies
    ),
}


@pytest.mark.parametrize("call", CALLS.values(), ids=CALLS)
@pytest.mark.parametrize("kind", [tuple, list, np.array])
def test_vectors_may_be_any_sequence(kind, call):
    expected = call(*REQUEST.values())
    for owner, part in REQUEST.items():
        for field, value in part._asdict().items():
            if isinstance(value, tuple):
                given = REQUEST | {owner: part._replace(**{field: kind(value)})}
                np.testing.assert_equal(_without_contacts(call(*given.values())), _without_contacts(expected))


def _without_contacts(answer: Any) -> Any:
    """The answer without the contacts of the request, which it returns as they were given."""
    if isinstance(answer, SceneImpact):
        return answer._replace(contacts=())
    return answer._replace(contact=None) if isinstance(answer, Impact) else answer


@pytest.mark.parametrize(
    "precision", [Precision.AUTO, Precision.SINGLE, Precision.DOUBLE, Precision.EXTENDED]
)
@pytest.mark.parametrize("law", [Law.COULOMB, Law.FRICTIONLESS, Law.ROUTH_STRONGE])
@pytest.mark.parametrize(
    "restitution", list(attacks.restitutions()), ids=lambda restitution: restitution.name
)
def test_restitution_functions(restitution, law, precision):
    if law is Law.ROUTH_STRONGE and precision is Precision.EXTENDED:
        return
    plane = attacks.rod_in_plane(0.6, 0.8, 1.0, -2.0, 0.5, 0.3)
    for collision in (plane,) if law is Law.ROUTH_STRONGE else (plane, attacks.ON_FLOOR):
        given = attacks.with_contact(collision, restitution=restitution.function)
        model = ImpactModel(law, precision=precision)
        if restitution.code:
            with pytest.raises(ImpactError) as refusal:
                resolved(given, model)
            assert refusal.value.code.name == restitution.code
            assert "restitution" in refusal.value.field
            continue
        impact = resolved(given, model)
        used = impact.contact.restitution
        assert isinstance(used, (float, int))
        speed = nearest_float(pair_of(collision).approach_speed)
        if impact.error_bound < math.inf:
            # the function gets the speed rounded to the precision used
            near = speed * 4 * float(UNIT[impact.model.precision])
            possible = [float(restitution.function(v)) for v in (speed - near, speed, speed + near)]
            assert min(possible) <= used <= max(possible)
        fixed = attacks.with_contact(collision, restitution=float(used))
        as_number = Case("", fixed, {"law": law.name, "precision": precision.name})
        right = right_answer(fixed, law.name, 0.0, 0.0)
        found = faults_of_answer(impact, as_number, model, law, right)
        assert not found, "\n".join(found)


@pytest.mark.parametrize(
    "precision", [Precision.AUTO, Precision.SINGLE, Precision.DOUBLE, Precision.EXTENDED]
)
@pytest.mark.parametrize("error", attacks.USER_ERRORS, ids=lambda error: type(error).__name__)
def test_an_error_in_the_users_function_is_raised_unchanged(error, precision):
    def restitution(v: float) -> float:
        raise error

    collision = attacks.with_contact(attacks.ON_FLOOR, restitution=restitution)
    with pytest.raises(type(error)) as raised:
        resolved(collision, ImpactModel(precision=precision))
    assert raised.value is error
