"""The API as a typed program uses it: ``make lint`` also checks the types of this file."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable
from fractions import Fraction
from typing import Any, get_type_hints

import numpy as np
import pytest

import collision_response
from collision_response import (
    Body,
    Contact,
    ContactImpact,
    Geometry,
    Impact,
    ImpactError,
    ImpactModel,
    Law,
    SceneImpact,
    StatusCode,
    Twist,
    Vec3,
    resolve,
    resolve_contact,
    resolve_scene,
)
from collision_response.batch import BatchResult, body_rows, contact_rows, resolve_batch
from collision_response.derivatives import differentiate, saltation_matrix, sphere_on_plane
from collision_response.physics import friction, restitution
from collision_response.physics.mass_properties import Particle, of_particles

FLOOR = Body.static()


def as_array(numbers: Iterable[float]) -> np.ndarray[Any, np.dtype[np.float64]]:
    return np.array(list(numbers), float)


@pytest.mark.parametrize("kind", [tuple, list, as_array, iter])
def test_vectors_may_be_of_any_kind(kind: Callable[[Iterable[float]], Iterable[float]]) -> None:
    expected = Body.dynamic(
        2.0, (1, 0, 0, 1, 0, 1), (0, 0, 1), (0, 0, 0, 1), (1, 0, -2), (1, 2, 3), (0, 0, 0.1)
    )
    body = Body.dynamic(
        mass=2.0,
        inertia=kind((1, 0, 0, 1, 0, 1)),
        position=kind((0, 0, 1)),
        orientation=kind((0, 0, 0, 1)),
        velocity=kind((1, 0, -2)),
        angular_velocity=kind((1, 2, 3)),
        com=kind((0, 0, 0.1)),
    )
    assert body == expected
    assert Body.static(kind((1, 2, 3))) == Body.static((1, 2, 3))
    assert Body.kinematic(kind((1, 2, 3)), kind((1, 0, 0))) == Body.kinematic((1, 2, 3), (1, 0, 0))
    assert Body.box(1.0, kind((1, 2, 3))) == Body.box(1.0, (1, 2, 3))
    contact = Contact.of(kind((0, 0, 0)), normal=kind((0, 0, 1)), restitution=0.5, friction=0.25)
    assert contact == Contact.of((0, 0, 0), (0, 0, 1), 0.5, 0.25)
    K = [kind(row) for row in ((1, 0, 0), (0, 1, 0), (0, 0, 1))]
    answer: ContactImpact = resolve_contact(K, u=kind((0, 0, -1)), n=kind((0, 0, 1)))
    assert answer.velocity_after.z == 1.0
    assert of_particles([(1.0, kind((0, 0, 0)))]) == of_particles([Particle(1.0, Vec3(0, 0, 0))])
    by_table = restitution.tabulated(kind((0, 1)), kind((1, 0.5)))
    assert by_table(0.5) == friction.tabulated(kind((0, 1)), kind((1, 0.5)))(0.5) == 0.75
    surfaces, gravity = sphere_on_plane(1.0), (0, 0, -9.81)
    matrix = saltation_matrix(expected, FLOOR, contact, surfaces=surfaces, gravity=kind(gravity))
    assert (matrix == saltation_matrix(expected, FLOOR, contact, surfaces=surfaces, gravity=gravity)).all()


def test_names_that_do_not_exist_are_errors_for_type_checkers_too() -> None:
    with pytest.raises(AttributeError):
        collision_response.Bdoy  # type: ignore[attr-defined]  # noqa: B018
    version: str = collision_response.__version__
    assert version


if sys.version_info >= (3, 11):  # typing.Unpack is newer

    @pytest.mark.parametrize("name", ["dynamic", "of", "sphere", "box", "mesh"])
    def test_signatures_have_types_at_run_time(name: str) -> None:
        assert get_type_hints(getattr(Body, name))["return"] is Body


@pytest.mark.parametrize("kind", [tuple, list, as_array])
def test_the_other_vector_may_be_of_any_kind(kind: Callable[[Iterable[float]], Iterable[float]]) -> None:
    v, other = Vec3(1.0, 2.0, 4.0), kind((1.0, 1.0, 0.5))
    total: Vec3 = v + other
    difference: Vec3 = v - other
    assert (total, difference) == ((2.0, 3.0, 4.5), (0.0, 1.0, 3.5))
    assert (v.dot(other), v.cross(other).z) == (5.0, -1.0)
    reflected: Vec3 = (1.0, 1.0, 0.5) + v  # noqa: RUF005
    assert reflected == total


def test_answers_have_their_types() -> None:
    ball = Body.sphere(2.0, 0.1, position=(0, 0, 0.1), velocity=(1, 0, -3))
    law: restitution.Restitution = restitution.viscoelastic(0.1)
    contact = Contact.of((0, 0, 0), (0, 0, 1), restitution=law, friction=friction.stribeck(0.5, 0.25, 0.1))
    impact: Impact = resolve(ball, FLOOR, contact, ImpactModel(law=Law.COULOMB, geometry=Geometry.AUTO))
    energy: float = impact.kinetic_energy_before - impact.kinetic_energy_after
    twist: Twist = impact.twist_a
    status: StatusCode = impact.status
    assert (energy > 0, twist.linear.z > 0, status) == (True, True, StatusCode.OK)
    assert ball.with_twist(twist)._replace(mass=3.0).velocity == twist.linear
    scene: SceneImpact = resolve_scene([ball, FLOOR], [(0, 1)], [contact])
    assert scene.twists[0] == twist
    exact = resolve(ball, FLOOR, contact._replace(restitution=Fraction(1, 2), friction=0.0))
    assert exact.twist_a.linear.z == Fraction(3, 2)
    rows, columns = body_rows(Geometry.POINT), contact_rows(Geometry.POINT)
    bodies, contacts = np.zeros((rows.height, 2, 1)), np.zeros((columns.height, 1))
    bodies[rows.mass], bodies[rows.velocity][2, 0], contacts[columns.normal][2] = [[1.0], [np.inf]], -1.0, 1.0
    result: BatchResult = resolve_batch(bodies, contacts)
    assert result.status.tolist() == [StatusCode.OK]
    smooth = contact._replace(restitution=0.5, friction=0.25)
    derivatives = differentiate(ball, FLOOR, smooth, with_respect_to=["contact.restitution"])
    assert derivatives.of("twist_a.linear", "contact.restitution").shape == (3, 1)
    try:
        resolve(ball, ball, contact)
    except ImpactError as error:
        assert (error.code, error.field) == (StatusCode.SAME_BODY, "body_b")
