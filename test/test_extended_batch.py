"""Batches in double-double arithmetic: within one unit in the last place, by every backend alike."""

from __future__ import annotations

import math
from itertools import product

import numpy as np
import pytest
from batches import FIRST_FAULTY, N, scene_of, some
from flint import ctx
from random_impacts import RandomImpacts
from reference import BITS, exact_answer
from scenes import Scene

from collision_response import Geometry, ImpactModel, Law, StatusCode
from collision_response.batch.backends import Backend, one_by_one, prepare, programs_for
from collision_response.batch.doubled import ULP
from collision_response.batch.problem import Arithmetic, Problem, Tangential, contact_count
from collision_response.batch.rows import body_rows, contact_rows
from collision_response.model import EXACT_LAWS
from collision_response.tiers import GEOMETRIES

FLOAT64 = np.dtype(np.float64)
PROBLEMS = [Problem(*both, arithmetic=Arithmetic.DOUBLED) for both in product(GEOMETRIES, EXACT_LAWS)]
ORIENTED = Problem(Geometry.SPATIAL, Law.COULOMB, oriented=True, arithmetic=Arithmetic.DOUBLED)
MODELLED = Problem(
    Geometry.SPATIAL, Law.COULOMB, tangential=Tangential.MODEL, threshold=True, arithmetic=Arithmetic.DOUBLED
)


def ids(problem: Problem) -> str:
    return "-".join(str(getattr(part, "name", part)) for part in problem[:3])


def arrays_for(problem: Problem, bodies, contacts, model=(0.5, 1.0)) -> dict[str, np.ndarray]:
    """The arrays of a problem, the results not yet written."""
    program = programs_for(problem, FLOAT64)[1]
    given = {"bodies": bodies, "contacts": contacts[: contact_count(problem)], "model": np.array([model]).T}
    n = bodies.shape[-1]
    return {
        name: given.get(name, np.zeros(program.shape(name, n), np.uint8 if name == "status" else float))
        for name in program.arrays()
    }


def resolved(problem: Problem, bodies, contacts, backend=Backend.NUMPY) -> dict[str, np.ndarray]:
    arrays = arrays_for(problem, bodies, contacts)
    prepare(backend, problem, FLOAT64).run(arrays)
    return arrays


def assert_same(one, other) -> None:
    for name in one:
        np.testing.assert_array_equal(one[name], other[name], err_msg=name)


def check_contact(problem: Problem, results, i: int, scene: Scene, e_t: float, threshold=0.0) -> None:
    """A contact against the exact answer."""
    model = ImpactModel(
        problem.law, problem.geometry, tangential_restitution=e_t, restitution_threshold=threshold
    )
    with ctx.workprec(BITS):
        exact = exact_answer(*scene, model).impact
        assert results["status"][0, i] == exact.status
        P, given = exact.impulse, results["impulse"][:, i].tolist()
        assert sum((x - y) ** 2 for x, y in zip(given, P, strict=False)) <= ULP**2 * P.dot(P)
        for lane, (twist, change) in enumerate(
            ((exact.twist_a, exact.change_a), (exact.twist_b, exact.change_b))
        ):
            check_vector(results["velocity"][:, lane, i], twist.linear, change.linear)
            if problem.geometry is not Geometry.POINT:
                spin = results["angular_velocity"][:, lane, i]
                check_vector(spin, twist.angular[-len(spin) :], change.angular)


def check_vector(given, exact, change) -> None:
    """Half a unit in the last place, and the error of the change, of which the rest may be the opposite."""
    least = change.dot(change).sqrt() * 2.0**-80
    for x, y in zip(given.tolist(), exact, strict=False):
        assert abs(x - y) <= abs(y) * 2.0**-53 + least


@pytest.mark.parametrize("problem", [*PROBLEMS, ORIENTED, MODELLED], ids=ids)
def test_shared_contacts_are_exact_to_an_ulp(problem):
    bodies, contacts = some(problem.geometry, oriented=problem.oriented)
    results = resolved(problem, bodies, contacts)
    if problem.law is Law.FRICTIONLESS:
        contacts = contacts.copy()
        contacts[contact_rows(problem.geometry).friction] = 0.0
    e_t = 0.5 if problem.tangential is Tangential.MODEL else 0.0
    assert (results["error_bound"][0, :FIRST_FAULTY] <= ULP).all()
    for i in range(FIRST_FAULTY):
        scene = scene_of(problem.geometry, bodies, contacts, i)
        check_contact(problem, results, i, scene, e_t, 1.0 if problem.threshold else 0.0)


@pytest.mark.parametrize("problem", PROBLEMS, ids=ids)
def test_the_status_is_that_of_plain_arithmetic(problem):
    bodies, contacts = some(problem.geometry)
    plain = problem._replace(arithmetic=Arithmetic.PLAIN)
    expected = resolved(plain, bodies, contacts)["status"][0]
    results = resolved(problem, bodies, contacts)
    status, bound = results["status"][0], results["error_bound"][0]
    assert ((status == expected) | (status == StatusCode.OUT_OF_RANGE)).all()
    answered = np.isin(status, (StatusCode.OK, StatusCode.SEPARATING))
    np.testing.assert_array_equal(np.isnan(bound), ~answered)


@pytest.mark.parametrize("wildness", [0, 1, 3, 8])
@pytest.mark.parametrize("law", EXACT_LAWS)
def test_ill_conditioned_contacts(law, wildness):
    """Grazing, thin, lopsided, far from their bodies: right to an ulp, or known not to be."""
    impacts, sure = RandomImpacts(seed=wildness, wildness=wildness), 0
    problem = Problem(Geometry.SPATIAL, law, True, Tangential.CONTACTS, arithmetic=Arithmetic.DOUBLED)
    if law is Law.FRICTIONLESS:
        problem = problem._replace(tangential=Tangential.ZERO)
    drawn = [impacts.request(law) for _ in range(60)]
    bodies, contacts = table_of([scene for scene, _ in drawn], [model for _, model in drawn])
    results = resolved(problem, bodies, contacts)
    for i, (scene, model) in enumerate(drawn):
        if results["error_bound"][0, i] <= ULP:
            sure += 1
            if law is Law.FRICTIONLESS:
                scene = scene._replace(contact=scene.contact._replace(friction=0.0))
            check_contact(problem, results, i, scene, model.tangential_restitution)
    assert sure >= 45


def table_of(scenes: list[Scene], models: list[ImpactModel]) -> tuple[np.ndarray, np.ndarray]:
    """Scenes as the columns of a batch."""
    of, at = body_rows(Geometry.SPATIAL, oriented=True), contact_rows(Geometry.SPATIAL)
    bodies, contacts = np.zeros((of.height, 2, len(scenes))), np.zeros((at.height + 1, len(scenes)))
    for i, (scene, model) in enumerate(zip(scenes, models, strict=True)):
        for lane, body in enumerate(scene[:2]):
            bodies[of.mass, lane, i] = body.mass or math.inf
            bodies[of.inertia, lane, i] = body.inertia
            bodies[of.position, lane, i] = body.position
            bodies[of.orientation, lane, i] = body.orientation or (0, 0, 0, 1)
            bodies[of.velocity, lane, i] = body.velocity
            bodies[of.angular_velocity, lane, i] = body.angular_velocity
        contact = scene.contact
        contacts[:, i] = (
            *contact.position,
            *contact.normal,
            contact.restitution,
            contact.friction,
            model.tangential_restitution,
        )
    return bodies, contacts


def test_what_double_doubles_cannot_tell_is_known():
    """An approach so slow that rounding decides, and numbers at the end of the range."""
    bodies, contacts = (array[..., 10:20].copy() for array in some(Geometry.SPATIAL))
    of, at = body_rows(Geometry.SPATIAL), contact_rows(Geometry.SPATIAL)
    bodies[of.angular_velocity, :, 0] = 0.0
    bodies[of.velocity, 0, 0], bodies[of.velocity, 1, 0] = [1.0, 0.0, 0.0], 0.0
    contacts[at.normal, 0] = [2.0**-110, 1.0, 0.0]
    contacts[at.normal, 1] = [1e-160, 1e-160, 0.0]
    bodies[of.inertia, 0, 2] *= 1e-280
    problem = Problem(Geometry.SPATIAL, Law.FRICTIONLESS, arithmetic=Arithmetic.DOUBLED)
    bound = resolved(problem, bodies, contacts)["error_bound"][0]
    assert not (bound[:3] <= ULP).any() and (bound[3:] <= ULP).all()


@pytest.mark.parametrize("problem", [PROBLEMS[0], PROBLEMS[3], PROBLEMS[4], ORIENTED], ids=ids)
def test_one_by_one_is_as_in_blocks(problem):
    bodies, contacts = some(problem.geometry, oriented=problem.oriented)
    arrays = arrays_for(problem, bodies, contacts)
    one_by_one(problem)(arrays)
    assert_same(arrays, resolved(problem, bodies, contacts))


@pytest.mark.parametrize("problem", [PROBLEMS[1], PROBLEMS[4], MODELLED], ids=ids)
def test_compiled_is_as_numpy(machine_code, problem):
    """Though it has fused multiply-adds; and in vectors, with some contacts left over."""
    bodies, contacts = some(problem.geometry)
    assert N % 16
    assert_same(resolved(problem, bodies, contacts, Backend.COMPILED), resolved(problem, bodies, contacts))
    few = bodies[..., :3], contacts[..., :3]
    assert_same(resolved(problem, *few, Backend.COMPILED), resolved(problem, *few))
