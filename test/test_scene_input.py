"""Input of scenes: invalid values are refused by code and field, contradictory walls are recognised."""

from __future__ import annotations

import doctest
import math
import random
import sys
from decimal import Decimal
from fractions import Fraction as F
from itertools import product

import numpy as np
import pytest
from refusals import refused
from scene_cases import Scene, any_scene, box, random_scene, row_of_balls, speeds

from collision_response import (
    Adjustment,
    Body,
    Contact,
    Geometry,
    ImpactError,
    ImpactModel,
    Law,
    Precision,
    StatusCode,
    resolve,
    resolve_scene,
)
from collision_response.kernels import protocol
from collision_response.physics.vector import Vec3
from collision_response.scene import frictionless

UP = Contact.of((0.0, 0.0, 0.0), (0.0, 0.0, 1.0))
BALL = Body.dynamic(1.0, velocity=(0.0, 0.0, -1.0))
FLOOR = Body.static()


@pytest.mark.parametrize(
    ("pairs", "code", "field"),
    [
        pytest.param([(0, 1), (0, 1), (0, 7)], StatusCode.UNKNOWN_BODY, "pairs[2]", id="no such body"),
        pytest.param([(0, 1), (-1, 1), (0, 1)], StatusCode.UNKNOWN_BODY, "pairs[1]", id="negative"),
        pytest.param([(0, 1), (0, 1), (0, 0)], StatusCode.SAME_BODY, "pairs[2]", id="itself"),
        pytest.param([(0, 1), (0, 1), (1, 2)], StatusCode.NO_DYNAMIC_BODY, "pairs[2]", id="two walls"),
    ],
)
def test_invalid_pairs_are_refused_by_name(pairs, code, field):
    with refused(code, field):
        resolve_scene([BALL, FLOOR, FLOOR], pairs, [UP] * 3)


@pytest.mark.parametrize(
    ("change", "code", "field"),
    [
        ({"friction": -0.1}, StatusCode.INVALID_COEFFICIENT, "contacts[2].friction"),
        ({"friction": math.inf}, StatusCode.NOT_FINITE, "contacts[2].friction"),
        ({"restitution": 1.5}, StatusCode.INVALID_COEFFICIENT, "contacts[2].restitution"),
        (
            {"restitution": lambda v: 2.0},
            StatusCode.INVALID_COEFFICIENT,
            "contacts[2].restitution(approach_speed)",
        ),
        ({"normal": (0.0, 0.0, 0.0)}, StatusCode.INVALID_NORMAL, "contacts[2].normal"),
        ({"position": (0.0, math.nan, 0.0)}, StatusCode.NOT_FINITE, "contacts[2].position"),
    ],
)
@pytest.mark.parametrize("pairs", [[(0, 1)] * 3, [(0, 1), (2, 1), (3, 1)]], ids=["cluster", "alone"])
def test_invalid_contacts_are_refused_by_name(change, code, field, pairs):
    contacts = [UP, UP._replace(position=(1.0, 0.0, 0.0)), UP._replace(**change)]
    with refused(code, field):
        resolve_scene([BALL, FLOOR, BALL, BALL], pairs, contacts)


@pytest.mark.parametrize("law", [Law.FRICTIONLESS, Law.COULOMB, Law.MOREAU])
@pytest.mark.parametrize("field", ["restitution", "friction"])
@pytest.mark.parametrize("value", [math.inf, -math.inf, math.nan, -1.0, 2.0])
def test_a_coefficient_is_refused_as_by_resolve(law, field, value):
    """With the value in the message."""
    contact = UP._replace(**{field: value})
    try:
        resolve(BALL, FLOOR, contact, ImpactModel(law))
    except ImpactError as error:
        expected = error
    else:  # friction may be 2
        resolve_scene([BALL, FLOOR], [(0, 1)] * 2, [UP, contact], ImpactModel(law))
        return
    contacts = [UP._replace(position=(1.0, 0, 0)), contact]
    with refused(expected.code, f"contacts[1].{field}") as found:
        resolve_scene([BALL, FLOOR], [(0, 1)] * 2, contacts, ImpactModel(law))
    assert found.value.reason == expected.reason


@pytest.mark.parametrize(
    ("change", "code", "field"),
    [
        ({"mass": -1.0}, StatusCode.INVALID_MASS, "bodies[0].mass"),
        ({"inertia": (1.0, 0.0, 0.0, 1.0, 0.0, 9.0)}, StatusCode.INVALID_INERTIA, "bodies[0].inertia"),
        ({"velocity": (0.0, 0.0, math.inf)}, StatusCode.NOT_FINITE, "bodies[0].velocity"),
    ],
)
@pytest.mark.parametrize("number", [float, F])
def test_invalid_bodies_are_refused_by_name(change, code, field, number):
    bad = BALL._replace(
        **{k: type(getattr(BALL, k))(*v) if isinstance(v, tuple) else v for k, v in change.items()}
    )
    contacts = [UP._replace(friction=number(0)), UP._replace(position=(1.0, 0.0, 0.0))]
    with refused(code, field):
        resolve_scene([bad, FLOOR], [(0, 1)] * 2, contacts)
    # A body without contacts must be sound too.
    with refused(code, field.replace("[0]", "[2]")):
        resolve_scene([BALL, FLOOR, bad], [(0, 1)] * 2, contacts)
    belt = Body.kinematic(velocity=(0.0, math.nan, 0.0))
    with refused(StatusCode.NOT_FINITE, "bodies[2].velocity"):
        resolve_scene([BALL, FLOOR, belt], [(0, 1)] * 2, contacts)


@pytest.mark.parametrize(
    ("request_", "message"),
    [
        pytest.param(([BALL, 3], [(0, 1)], [UP]), r"bodies\[1\]: must be a Body", id="no body"),
        pytest.param(([BALL, FLOOR], [(0, 1)], [3]), r"contacts\[0\]: must be a Contact", id="no contact"),
        pytest.param(([BALL, FLOOR], [(0, "a")], [UP]), r"pairs\[0\]: must be two indices", id="no pair"),
        pytest.param(([BALL, FLOOR], [0], [UP]), r"pairs\[0\]: must be two indices", id="one index"),
        pytest.param(
            ([BALL._replace(mass="1"), FLOOR], [(0, 1)] * 2, [UP, UP._replace(position=(1.0, 0.0, 0.0))]),
            r"bodies\[0\].mass: must be a real number",
            id="no number",
        ),
        pytest.param(
            ([BALL, FLOOR], [(0, 1)] * 2, [UP, UP._replace(normal=(0.0, 1.0))]),
            r"contacts\[1\].normal: must be 3",
            id="two numbers",
        ),
        pytest.param((3, [(0, 1)], [UP]), "bodies: must be a sequence", id="no bodies"),
        pytest.param(([BALL, FLOOR], None, [UP]), "pairs: must be a sequence", id="no pairs"),
        pytest.param(([BALL, FLOOR], [(0, 1)], 1.5), "contacts: must be a sequence", id="no contacts"),
    ],
)
def test_arguments_of_the_wrong_type_are_refused_by_name(request_, message):
    with pytest.raises(TypeError, match=message):
        resolve_scene(*request_)


KNOT: list[object] = []
KNOT.append(KNOT)
NOT_NUMBERS = [None, "x", "", (1, 2), [1], {}, object(), np.array([1.0, 2.0]), Decimal("NaN"), 1j, True, KNOT]


@pytest.mark.parametrize("value", NOT_NUMBERS, ids=lambda value: type(value).__name__)
@pytest.mark.parametrize("options", [{}, {"exponent": 1.0}], ids=["in kernels", "in Python"])
@pytest.mark.parametrize("kind", ["cluster", "fractions", "one contact", "no contact"])
@pytest.mark.parametrize("law", [Law.AUTO, Law.FRICTIONLESS])
def test_what_is_no_number_is_refused_by_name(value, options, kind, law):
    """In place of a number, and of a vector, of a body and of a contact."""
    contacts = [UP, UP._replace(normal=(1.0, 0.0, 0.0))][: {"one contact": 1, "no contact": 0}.get(kind)]
    if kind == "fractions":
        law, contacts[0] = Law.FRICTIONLESS, contacts[0]._replace(restitution=F(1))
    for field in ("mass", "inertia", "position", "orientation", "velocity", "angular_velocity", "com"):
        if field == "orientation" and value is None:
            continue
        bodies = [BALL._replace(**{field: value}), FLOOR]
        with pytest.raises((TypeError, ImpactError), match=rf"^bodies\[0\]\.{field}"):
            resolve_scene(bodies, [(0, 1)] * len(contacts), contacts, ImpactModel(law), **options)
    for field in ("position", "normal", "restitution", "friction") if contacts else ():
        wrong = [*contacts[:-1], contacts[-1]._replace(**{field: value})]
        with pytest.raises((TypeError, ImpactError), match=rf"^contacts\[{len(wrong) - 1}\]\.{field}"):
            resolve_scene([BALL, FLOOR], [(0, 1)] * len(wrong), wrong, ImpactModel(law), **options)


@pytest.mark.parametrize("value", [None, 3, "COULOMB", Law.COULOMB, (1, 2), {}], ids=repr)
@pytest.mark.parametrize("options", [{}, {"exponent": 1.0}], ids=["in kernels", "in Python"])
def test_what_is_no_model_is_refused(value, options):
    with pytest.raises(TypeError, match=r"^model: must be an ImpactModel"):
        resolve_scene(*box(), value, **options)


@pytest.mark.parametrize("option", ["threshold", "exponent", "orders", "stiffness"])
@pytest.mark.parametrize("value", [np.array([1.5, 1.5]), np.array([1.5]), "x", False, {}, 1j], ids=repr)
def test_options_of_the_wrong_type_are_refused_by_name(option, value):
    with pytest.raises((TypeError, ValueError), match=f"^{option}"):
        resolve_scene(*box(), **{option: value})


def test_stiffness_may_be_any_iterable():
    given = 1.0, 2.0, 3.0, 4.0
    answers = [
        resolve_scene(*box(e=0.5), ImpactModel(Law.ROUTH_STRONGE), stiffness=kind(given))
        for kind in (tuple, list, iter, np.array)
    ]
    assert all(answer == answers[0] for answer in answers)


def test_there_must_be_one_pair_for_each_contact():
    with pytest.raises(ValueError, match="pairs: must be one for each contact"):
        resolve_scene([BALL, FLOOR], [(0, 1)], [UP, UP])


@pytest.mark.parametrize(
    ("model", "field"),
    [
        (ImpactModel(Law.ROUTH_POISSON), "model.law"),
        (ImpactModel(Law.COULOMB, tangential_restitution=0.5), "model.tangential_restitution"),
        (ImpactModel(geometry=Geometry.POINT), "model.geometry"),
        (ImpactModel(geometry=Geometry.PLANAR), "model.geometry"),
    ],
)
def test_models_for_one_contact_are_refused_for_several(model, field):
    with refused(StatusCode.INVALID_MODEL, field):
        resolve_scene(*box(), model)


def test_slip_out_of_the_plane_matters_only_with_friction():
    slides = Body.box(1.0, (1, 1, 1), velocity=(0, -1, 0.7))
    model = ImpactModel(Law.COULOMB, Geometry.PLANAR)

    def touches(mu: float) -> list[Contact]:
        return [Contact.of((x, -0.5, 0), (0, 1, 0), 0.5, mu) for x in (-0.5, 0.5)]

    with refused(StatusCode.INVALID_MODEL, "model.geometry"):
        resolve_scene([slides, FLOOR], [(0, 1)] * 2, touches(0.3), model)
    still = slides._replace(velocity=Vec3(0, -1, 0))
    assert resolve_scene([still, FLOOR], [(0, 1)] * 2, touches(0.3), model).status is StatusCode.OK


def test_a_copy_keeps_its_own_tangential_restitution():
    given = [UP._replace(tangential_restitution=e_t) for e_t in (0.0, None)]
    answer = resolve_scene([BALL, FLOOR], [(0, 1)] * 2, given)
    assert [contact.tangential_restitution for contact in answer.contacts] == [0.0, None]


@pytest.mark.parametrize(
    ("option", "field"),
    [
        ({"threshold": -1}, "threshold"),
        ({"threshold": 1}, "threshold"),
        ({"threshold": np.float32(1)}, "threshold"),  # which rounds the number below 1 to 1
        ({"threshold": np.array(np.float16(1))}, "threshold"),
        ({"exponent": 0.5}, "exponent"),
        ({"orders": -1}, "orders"),
        ({"stiffness": [1, 1, 0, 1]}, "stiffness[2]"),
    ],
)
def test_invalid_options_are_refused_by_name(option, field):
    with refused(StatusCode.INVALID_MODEL, field):
        resolve_scene(*box(), **option)


def test_there_must_be_one_stiffness_for_each_contact():
    with pytest.raises(ValueError, match="stiffness: must be one for each contact"):
        resolve_scene(*box(), stiffness=[1.0])


def test_restitution_too_small_for_stronge_is_refused():
    with refused(StatusCode.INVALID_COEFFICIENT, "contacts[0].restitution", match=r"is 0\.01$"):
        resolve_scene(*box(e=0.01), ImpactModel(Law.ROUTH_STRONGE))


@pytest.mark.parametrize("e", [0.5, lambda speed: 0.5])
def test_below_the_threshold_stronge_takes_the_least_restitution_that_it_can(e):
    bodies, pairs, contacts = box()
    contacts[1:] = [contact._replace(restitution=e) for contact in contacts[1:]]
    answer = resolve_scene(
        bodies, pairs, contacts, ImpactModel(Law.ROUTH_STRONGE, restitution_threshold=10.0)
    )
    least = [contact._replace(restitution=protocol.LEAST_SPRING_RESTITUTION) for contact in contacts]
    expected = resolve_scene(bodies, pairs, least, ImpactModel(Law.ROUTH_STRONGE))
    assert answer.adjustments is Adjustment.RESTITUTION_THRESHOLD
    assert (answer.twists, answer.contacts) == (expected.twists, tuple(least))
    already = resolve_scene(bodies, pairs, least, answer.model._replace(restitution_threshold=10.0))
    assert already._replace(model=answer.model) == answer
    contacts[0] = contacts[0]._replace(restitution=0.0)
    with refused(StatusCode.INVALID_COEFFICIENT, "contacts[0].restitution", match=r"is 0\.0$"):
        resolve_scene(bodies, pairs, contacts, answer.model._replace(restitution_threshold=10.0))


def test_a_contradiction_in_one_of_several_clusters_names_its_contacts():
    """``resolve_scenes`` answers the other clusters."""
    balls = [Body.sphere(1.0, 0.1, position=(i, 0, 0.1), velocity=(0, 0, -1)) for i in range(3)]
    bodies = [*balls, Body.static(), Body.kinematic(velocity=(0.2, 0, 0))]
    floor = [Contact.of((i, 0, 0), (0, 0, 1)) for i in range(3)]
    sides = [Contact.of((x, 0, 0.1), (n, 0, 0)) for x, n in ((1.1, -1), (0.9, 1))]
    with refused(StatusCode.CONTRADICTORY_CONTACTS, "contacts[1, 3, 4]"):
        resolve_scene(bodies, [(0, 3), (1, 3), (2, 3), (1, 3), (1, 4)], floor + sides)


def test_fractions_are_for_rational_laws():
    with refused(StatusCode.INVALID_MODEL, "model.law"):
        resolve_scene(*box(mu=F(1, 3), number=F))


def test_an_integer_beyond_the_digits_of_a_float_is_refused():
    contacts = [UP._replace(position=(2**60 + 1, 0, 0)), UP]
    with refused(StatusCode.INVALID_MODEL, "contacts[0]"):
        resolve_scene([BALL, FLOOR], [(0, 1)] * 2, contacts)


def test_numbers_of_other_kinds_are_floats():
    np = pytest.importorskip("numpy")
    scene = box()
    bodies = [scene.bodies[0]._replace(mass=np.float64(1), position=np.array([0, 0, 0.5])), scene.bodies[1]]
    assert resolve_scene(bodies, np.array(scene.pairs), scene.contacts).twists == scene.resolve().twists


def test_an_empty_scene_is_separating():
    answer = resolve_scene([BALL, FLOOR], [], [])
    assert answer.status is StatusCode.SEPARATING
    assert answer.kinetic_energy_after == answer.kinetic_energy_before == 0.5
    assert answer.twists[0].linear == (0, 0, -1)
    assert str(answer).startswith("SEPARATING")
    assert resolve_scene([], [], []).twists == ()


def squeezed(v, left, right, e=1.0, number=float) -> Scene:
    """A ball that touches two walls, which move along x."""
    zero = number(0)
    bodies = [
        Body.dynamic(number(1), velocity=(number(v), zero, zero)),
        Body.kinematic((zero, zero, zero), (number(left), zero, zero)),
        Body.kinematic((zero, zero, zero), (number(right), zero, zero)),
    ]
    contacts = [
        Contact.of((number(-1), zero, zero), (number(1), zero, zero), number(e)),
        Contact.of((number(1), zero, zero), (number(-1), zero, zero), number(e)),
    ]
    return Scene(bodies, [(0, 1), (0, 2)], contacts)


@pytest.mark.parametrize("law", [Law.FRICTIONLESS, Law.COULOMB, Law.MOREAU])
@pytest.mark.parametrize("number", [float, F])
def test_closing_walls_contradict_each_other(law, number):
    if number is F and law is Law.COULOMB:
        return
    with refused(StatusCode.CONTRADICTORY_CONTACTS, "contacts"):
        resolve_scene(*squeezed(0, 1, -1, number=number), ImpactModel(law))


def pressed(corners: int, closing: float, e: float, mu: float, v=(0.3, 0.1, -1.0)) -> Scene:
    """A cube between a floor and a ceiling that moves down, touching each at ``corners`` points."""
    bodies = [
        Body.box(1.0, (1, 1, 1), velocity=v, angular_velocity=(0, 0, 0.5)),
        Body.static(),
        Body.kinematic((0, 0, 2), (0, 0, -closing)),
    ]
    points = [(-0.5, -0.5), (0.5, 0.5), (-0.5, 0.5), (0.5, -0.5), (0.0, 0.0), (0.0, 0.5)][:corners]
    contacts = [Contact.of((x, y, -side / 2), (0, 0, side), e, mu) for side in (1.0, -1.0) for x, y in points]
    return Scene(bodies, [(0, 1)] * corners + [(0, 2)] * corners, contacts)


@pytest.mark.parametrize("law", [Law.FRICTIONLESS, Law.COULOMB, Law.MOREAU, Law.ROUTH_STRONGE])
@pytest.mark.parametrize("corners", [1, 2, 3, 4, 5, 6])
@pytest.mark.parametrize("closing", [1.0, 1e-3, 1e-12])
def test_closing_walls_are_refused_by_every_law(law, corners, closing):
    """However slowly they close, with any coefficients, also in large clusters."""
    for e, mu, v in product((0.0, 0.5, 1.0), (0.0, 0.3, 3.0), ((0.0, 0.0, 0.0), (0.3, 0.1, -1.0))):
        with refused(StatusCode.CONTRADICTORY_CONTACTS, "contacts"):
            resolve_scene(*pressed(corners, closing, e, mu, v), ImpactModel(law))


def between_jaws(gaps, velocity=0, e=0.5, mu=0.0, number=float) -> Scene:
    """A point between pairs of walls, each pair along its own axis; the gaps open at the speeds ``gaps``."""
    axes = [(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 1, 1), (0, 3, 4), (2, 0, -1)]
    bodies = [Body.dynamic(number(1), velocity=(number(0), number(velocity), number(velocity)))]
    pairs, contacts = [], []
    for axis, gap in zip(axes, gaps, strict=False):
        square = sum(x * x for x in axis)
        for side, speed in ((1, 0), (-1, gap)):
            pairs.append((0, len(bodies)))
            bodies.append(Body.kinematic(velocity=tuple(number(speed * x) / square for x in axis)))
            normal = tuple(number(side * x) for x in axis)
            contacts.append(Contact.of((number(0),) * 3, normal, number(e), number(mu)))
    return Scene(bodies, pairs, contacts)


@pytest.mark.parametrize("law", [Law.FRICTIONLESS, Law.COULOMB, Law.MOREAU])
@pytest.mark.parametrize("walls", [2, 4, 6, 10])
def test_between_walls_at_rest_a_body_that_does_not_approach_is_unchanged(law, walls):
    """With any coefficients."""
    normals = [(1, 0, 0), (-1, 0, 0), (1, 1, 0), (-1, -1, 0), (2, 1, 0), (-2, -1, 0)]
    normals += [(3, 1, 0), (-3, -1, 0), (1, 3, 0), (-1, -3, 0)]
    for velocity, e, mu in product(((0, 0, 0), (0, 0, 1.5)), (0.0, 0.5, 1.0), (0.0, 0.5)):
        contacts = [Contact.of((0, 0, 0), normal, e, mu) for normal in normals[:walls]]
        scene = [Body.dynamic(1.0, velocity=velocity), FLOOR], [(0, 1)] * walls, contacts
        answer = resolve_scene(*scene, ImpactModel(law))
        assert (answer.status, answer.error_bound) == (StatusCode.SEPARATING, 0)
        assert answer.twists[0].linear == velocity


@pytest.mark.parametrize("e", [0.0, 0.5, 1.0])
def test_frictionless_moreau_between_walls_agrees_with_fractions(e):
    """A point between two walls lands on a third."""
    for velocity in product((0, 1), (0.0, 1.0), (-2, -1e-9)):
        contacts = [Contact.of((0, 0, 0), n, e) for n in ((1, 0, 0), (-1, 0, 0), (0, 0, 1), (0, 1, 2))]
        scene = Scene([Body.dynamic(1.0, velocity=velocity), FLOOR], [(0, 1)] * 4, contacts)
        answer, exact = scene.resolve(Law.MOREAU), scene.in_fractions().resolve(Law.MOREAU)
        assert answer.model.law is exact.model.law
        change = max(map(abs, exact.changes[0].linear), default=0)
        for x, y in zip(answer.changes[0].linear, exact.changes[0].linear, strict=True):
            assert abs(F(x) - y) <= F(answer.error_bound) * 2 * change
        assert answer.error_bound < 1e-12


GAPS = [gaps for size in (2, 4, 6) for gaps in product((-1, 0, 1), repeat=size) if list(gaps) == sorted(gaps)]


@pytest.mark.parametrize("law", [Law.FRICTIONLESS, Law.COULOMB, Law.MOREAU, Law.ROUTH_STRONGE])
def test_one_closing_pair_of_walls_contradicts_itself_whatever_the_others_do(law):
    for gaps, velocity, mu in product(GAPS, (0, 1), (0.0, 0.3)):
        if min(gaps) < 0:
            with refused(StatusCode.CONTRADICTORY_CONTACTS):
                between_jaws(gaps, velocity, mu=mu).resolve(law)


@pytest.mark.parametrize("law", [Law.FRICTIONLESS, Law.COULOMB, Law.MOREAU])
def test_walls_that_do_not_close_hold_or_release(law):
    for gaps, velocity, mu in product(GAPS, (0, 1), (0.0, 0.3)):
        scene = between_jaws(gaps, velocity, mu=mu)
        if min(gaps) < 0:
            continue
        answer = scene.resolve(law)
        parts = min(answer.normal_velocities_after) > -1e-6
        assert parts or answer.error_bound == math.inf


@pytest.mark.parametrize("law", [Law.FRICTIONLESS, Law.MOREAU])
def test_walls_at_rest_hold_and_opening_walls_release_in_fractions(law):
    for gaps, velocity in product((g for g in GAPS if len(g) < 6), (0, 1)):
        scene = between_jaws(gaps, velocity, number=F)
        if min(gaps) < 0:
            with refused(StatusCode.CONTRADICTORY_CONTACTS):
                scene.resolve(law)
            continue
        answer = scene.resolve(law)
        for gap, *after in zip(
            gaps, answer.normal_velocities_after[::2], answer.normal_velocities_after[1::2], strict=True
        ):
            assert min(after) >= 0 and (gap > 0 or after == [0, 0])


def gripped(points: int, tilt: float, e: float, mu: float, seed: int) -> Scene:
    """A box at rest between two fingers that move to the right; its contact points and normals are off."""
    fingers = [Body.kinematic((side * 0.1, 0, 0), velocity=(0.5, 0, 0)) for side in (-1, 1)]
    pairs, contacts = [], []
    draw = random.Random(seed).gauss
    for finger, side in ((1, -1), (2, 1)):
        for y, z in [(-0.03, -0.03), (0.03, 0.03), (-0.03, 0.03), (0.03, -0.03), (0, 0), (0, 0.03)][:points]:
            point = [x + tilt * draw(0, 1) for x in (side * 0.05, y, z)]
            normal = [x + tilt * draw(0, 1) for x in (-side, 0, 0)]
            pairs.append((0, finger))
            contacts.append(Contact.of(point, normal, e, mu))
    return Scene([Body.box(1.0, (0.1, 0.1, 0.1)), *fingers], pairs, contacts)


@pytest.mark.parametrize(
    ("law", "mu"), [(Law.FRICTIONLESS, 0.0), (Law.COULOMB, 0.5), (Law.MOREAU, 0.0), (Law.MOREAU, 0.5)]
)
@pytest.mark.parametrize("points", [1, 2, 4, 6])
@pytest.mark.parametrize("tilt", [0.0, 1e-16, 1e-14, 1e-12, 1e-9, 1e-6, 1e-3])
def test_a_gripper_moves_what_it_holds(law, mu, points, tilt, monkeypatch):
    """However exactly its fingers are parallel. A box that would rattle between them does not rebound.

    Symmetric fingers do not turn the box, so it moves as they do. Friction is computed to about 1e-8;
    energies here are 0.1 J, right to the last bits. An eighth of the usual budget: a box that rattles uses
    all of it.
    """
    monkeypatch.setattr(frictionless, "DIGITS", frictionless.DIGITS // 8)
    for e in (0.0, 0.5, 1.0):
        answer = gripped(points, tilt, e, mu, seed=points).resolve(law)
        after = answer.normal_velocities_after
        assert min(after) > -1e-9 or answer.error_bound == math.inf
        assert answer.energy_lost_restitution + answer.energy_lost_friction >= -1e-12
        if Adjustment.NO_REBOUND in answer.adjustments:
            assert e > 0 and {contact.restitution for contact in answer.contacts} == {0.0}
            plastic = gripped(points, tilt, 0.0, mu, seed=points).resolve(answer.model.law)
            assert math.dist(answer.twists[0].linear, plastic.twists[0].linear) < 1e-6
        if tilt == 0 and points == 4 and law is not Law.MOREAU:
            assert math.dist(answer.twists[0].linear, (0.5, 0, 0)) < 1e-7


def test_a_rotating_wall_may_contradict_itself():
    """A point next to its axis that touches it from both sides is squeezed or released."""
    for law, radii in product(
        (Law.FRICTIONLESS, Law.COULOMB, Law.MOREAU, Law.ROUTH_STRONGE), product((-2, -1, 0, 0.5, 2), repeat=3)
    ):
        wall = Body.kinematic(angular_velocity=(0.0, 0.0, 1.0))
        contacts = [
            Contact.of((0, y, 0), (n, 0, 0), 1.0) for y, n in zip(radii, (-1.0, 1.0, -1.0), strict=True)
        ]
        scene = [Body.dynamic(1.0), wall], [(0, 1)] * 3, contacts
        if max(radii[0], radii[2]) > radii[1]:
            with refused(StatusCode.CONTRADICTORY_CONTACTS):
                resolve_scene(*scene, ImpactModel(law))
        elif law is not Law.ROUTH_STRONGE:  # whose springs may bounce without end
            assert min(resolve_scene(*scene, ImpactModel(law)).normal_velocities_after) > -1e-6


@pytest.mark.parametrize("law", [Law.FRICTIONLESS, Law.COULOMB, Law.MOREAU, Law.ROUTH_STRONGE])
@pytest.mark.parametrize("corners", [1, 3, 4, 6])
@pytest.mark.parametrize("closing", [0.0, -0.125, -1.0])
def test_walls_that_do_not_close_are_no_contradiction(law, corners, closing, monkeypatch):
    """With a tenth of the usual budget: more would not end a cube that bounces between walls at rest."""
    monkeypatch.setattr(protocol, "SPRING_WORK", protocol.SPRING_WORK // 10)
    for e, mu in product((0.5, 1.0), (0.0, 0.3)):
        try:
            answer = pressed(corners, closing, e, mu).resolve(law)
        except ImpactError as error:
            assert law is Law.ROUTH_STRONGE and error.code is StatusCode.PATH_TOO_LONG
        else:
            assert min(answer.normal_velocities_after) > -1e-6


@pytest.mark.parametrize("corners", [1, 2, 3, 4, 6])
@pytest.mark.parametrize("mu", [0.3, 3.0])
def test_between_two_walls_moreau_falls_back_to_coulomb(corners, mu):
    """The rebound from the floor that Newton requires would be an approach to the ceiling."""
    scene = pressed(corners, 0.0, 0.5, mu)
    answer, held = scene.resolve(Law.MOREAU), scene.resolve(Law.COULOMB)
    assert answer.adjustments & Adjustment.LAW_FALLBACK
    assert (answer.twists, answer.error_bound) == (held.twists, held.error_bound)


@pytest.mark.parametrize("count", [7, 8, 12])
@pytest.mark.parametrize("e", [0.0, 0.3, 0.5, 1.0])
@pytest.mark.parametrize("law", [Law.COULOMB, Law.MOREAU])
def test_a_row_of_balls_between_two_walls_stops(count, e, law):
    """There is no room for a rebound, however many contacts there are."""
    balls = [Body.sphere(1.0, 0.5, position=(i, 0, 0), velocity=(0**i, 0, 0)) for i in range(count)]
    pairs = [(i, i + 1) for i in range(count - 1)] + [(0, count), (count - 1, count)]
    contacts = [Contact.of((i + 0.5, 0, 0), (-1, 0, 0), e, 0.3) for i in range(count - 1)]
    walls = [Contact.of((x, 0, 0), (n, 0, 0), e, 0.3) for x, n in ((-0.5, 1), (count - 0.5, -1))]
    answer = resolve_scene([*balls, Body.static()], pairs, contacts + walls, ImpactModel(law))
    assert max(twist.linear.norm() for twist in answer.twists) < 1e-7


@pytest.mark.parametrize("number", [float, F])
@pytest.mark.parametrize("law", [Law.FRICTIONLESS, Law.COULOMB])
@pytest.mark.parametrize("e", [0, 1])
def test_a_ball_between_two_walls_is_held(number, e, law):
    if number is F and law is Law.COULOMB:
        return
    answer = squeezed(1, 0, 0, e, number).resolve(law)
    assert speeds(answer)[0] == 0
    assert [P.x for P in answer.impulses] == [0, -1]


def test_a_held_body_moves_with_the_walls_and_its_free_contacts_bounce():
    scene = squeezed(1, F(1, 2), F(1, 2), number=F)
    striker = Body.dynamic(F(1), velocity=(F(0), F(-1), F(0)))
    contact = Contact.of((F(0), F(1), F(0)), (F(0), F(1), F(0)))
    answer = Scene([*scene.bodies, striker], [*scene.pairs, (3, 0)], [*scene.contacts, contact]).resolve(
        Law.FRICTIONLESS
    )
    assert answer.twists[0].linear == (F(1, 2), -1, 0)
    assert answer.twists[3].linear == (0, 0, 0)


def test_between_opening_walls_a_ball_bounces_until_it_is_slower():
    answer = squeezed(1, F(-1, 8), F(1, 8), number=F).resolve(Law.FRICTIONLESS)
    assert min(answer.normal_velocities_after) >= 0
    in_floats = squeezed(1, -0.125, 0.125).resolve(Law.FRICTIONLESS)
    assert speeds(in_floats)[0] == float(speeds(answer)[0])


def test_a_cradle_between_walls_is_held():
    scene = row_of_balls((1, 0, 0))
    wall = Body.static()
    contacts = [
        Contact.of((F(-1, 2), F(0), F(0)), (F(1), F(0), F(0))),
        Contact.of((F(5, 2), F(0), F(0)), (F(-1), F(0), F(0))),
    ]
    answer = Scene(
        [*scene.bodies, wall], [*scene.pairs, (0, 3), (2, 3)], [*scene.contacts, *contacts]
    ).resolve()
    assert speeds(answer)[:3] == [0, 0, 0]


def test_a_tolerance_that_is_not_met_is_reported():
    assert box((1, 0, -1), mu=0.3).resolve(tolerance=1e-4).status is StatusCode.OK
    assert box((1, 0, -1), mu=0.3).resolve(tolerance=1e-15).status is StatusCode.TOLERANCE_NOT_MET
    assert box().resolve(tolerance=1e-13).status is StatusCode.OK


def test_restitution_may_depend_on_speed_and_vanishes_below_the_threshold():
    scene = box(e=1.0)
    fading = scene.with_contacts(restitution=lambda v: 0.5 if v > 0.5 else 0.1)
    assert {c.restitution for c in fading.resolve().contacts} == {0.5}
    answer = scene.resolve(restitution_threshold=2.0)
    assert {c.restitution for c in answer.contacts} == {0.0}
    assert answer.adjustments.name == "RESTITUTION_THRESHOLD"
    assert answer.twists[0].linear == pytest.approx((0, 0, 0), abs=1e-15)


def test_the_answer_reports_what_was_modelled():
    answer = box(mu=0.3).resolve()
    assert (answer.model.law, answer.model.geometry, answer.model.precision) == (
        Law.COULOMB,
        Geometry.SPATIAL,
        Precision.DOUBLE,
    )
    assert box().resolve().model[:3] == (Law.FRICTIONLESS, Geometry.SPATIAL, Precision.EXTENDED)
    smooth = box(mu=0.3).resolve(Law.FRICTIONLESS)
    assert {c.friction for c in smooth.contacts} == {0}


def test_order_sensitivity_is_positive_for_a_box_and_zero_for_a_ball():
    assert box().resolve(options={"orders": 4}).order_sensitivity > 0.3
    assert box().resolve(options={"orders": 2}).order_sensitivity > 0.3
    assert resolve_scene([BALL, FLOOR], [(0, 1)], [UP], orders=4).order_sensitivity == 0
    assert box().resolve().order_sensitivity is None
    assert row_of_balls((1, 0, 0), number=float).resolve(options={"orders": 4}).order_sensitivity == 0


def test_order_sensitivity_takes_the_restitution_of_each_contact():
    """FRICTIONLESS takes one for the cluster. The outer balls of masses 1, 2, 1 come at 1 m/s."""
    one, two = Body.sphere(1.0, 0.5), Body.sphere(2.0, 0.5, position=(1.0, 0.0, 0.0))
    bodies = [
        one._replace(velocity=Vec3(1.0, 0.0, 0.0)),
        two,
        one._replace(position=Vec3(2.0, 0.0, 0.0), velocity=Vec3(-1.0, 0.0, 0.0)),
    ]
    contacts = [Contact.of((i + 0.5, 0.0, 0.0), (-1.0, 0.0, 0.0), e) for i, e in enumerate((0.25, 0.5))]
    before, masses = np.array([F(1), F(0), F(-1)]), (1, 2, 1)
    changes = [_one_by_one(before, masses, (F(1, 4), F(1, 2)), order) - before for order in ((0, 1), (1, 0))]
    sizes = [change * change @ masses for change in changes]
    distance = (changes[0] - changes[1]) ** 2 @ masses
    expected = math.sqrt(distance / min(sizes))
    for numbers in ((0.25, 0.5), (lambda speed: 0.25, lambda speed: 0.5)):
        given = [contact._replace(restitution=e) for contact, e in zip(contacts, numbers, strict=True)]
        answer = resolve_scene(bodies, [(0, 1), (1, 2)], given, orders=2)
        assert answer.order_sensitivity == pytest.approx(expected, rel=1e-8)  # an approach of 1e-9 is rest


def _one_by_one(velocities, masses, restitutions, order):
    """Velocities along a row after impacts one by one, in fractions, until approaches are below 1e-12."""
    v = velocities.copy()
    while any(v[i] - v[i + 1] > F(1, 10**12) for i in order):
        for i in order:
            approach, mass = v[i] - v[i + 1], F(masses[i] * masses[i + 1], masses[i] + masses[i + 1])
            if approach > 0:
                impulse = (1 + restitutions[i]) * mass * approach
                v[i], v[i + 1] = v[i] - impulse / masses[i], v[i + 1] + impulse / masses[i + 1]
    return v


def test_order_sensitivity_is_infinite_where_impacts_one_by_one_never_end():
    ball = Body.sphere(1.0, 0.5, velocity=(1.0, 0.0, 0.0))
    walls = [Contact.of((x, 0.0, 0.0), (-2 * x, 0.0, 0.0), 1.0) for x in (-0.5, 0.5)]
    answer = resolve_scene([ball, FLOOR], [(0, 1)] * 2, walls, orders=2)
    assert answer.order_sensitivity == math.inf
    assert str(answer).splitlines()[-1] == "order sensitivity inf"


def test_order_sensitivity_of_a_cluster_knows_nothing_of_others():
    """A box that lands 1e10 times as slowly as a ball elsewhere."""
    alone = box((0, 0, -1e-10))
    ball = BALL._replace(position=Vec3(50.0, 0.0, 0.5))
    contact = Contact.of((50.0, 0.0, 0.0), (0.0, 0.0, 1.0))
    bodies, pairs = [*alone.bodies, ball], [*alone.pairs, (len(alone.bodies), 1)]
    answer = resolve_scene(bodies, pairs, [*alone.contacts, contact], orders=2)
    assert len(answer.clusters) == 2
    assert answer.order_sensitivity == alone.resolve(options={"orders": 2}).order_sensitivity > 0.3


def test_order_sensitivity_of_fractions_is_that_of_floats():
    """A light ball between two others takes so many impacts that fractions would grow for minutes."""
    masses = (1, F(1, 10**6), 1, 10**6)
    exact, rounded = (
        row_of_balls((1, 0, 0, 0), 0, masses, number).resolve(options={"orders": 4}) for number in (F, float)
    )
    assert isinstance(exact.twists[0].linear.x, F)
    assert exact.order_sensitivity == rounded.order_sensitivity > 0


def test_one_object_may_be_several_bodies_in_every_order():
    """Two equal boxes that touch, on one floor."""
    scene = box(e=0.5)
    bodies, pairs = [scene.bodies[0], scene.bodies[0], FLOOR], [(0, 2)] * 4 + [(1, 2)] * 4 + [(0, 1)]
    contacts = [*scene.contacts * 2, UP]
    answer = resolve_scene(bodies, pairs, contacts, orders=3)
    copies = resolve_scene([Body(*body) for body in bodies], pairs, contacts, orders=3)
    assert answer == copies and answer.order_sensitivity > 0


def test_the_table_shows_every_contact_and_body():
    text = str(box((1, 0, -1), mu=0.3).resolve(options={"orders": 2}))
    assert text.splitlines()[0].startswith("OK by COULOMB, relative error at most ")
    assert len(text.splitlines()) == 1 + 5 + 3 + 1 + 1


def test_a_repeated_contact_shares_its_impulse():
    one = resolve(BALL, FLOOR, UP)
    answer = resolve_scene([BALL, FLOOR], [(0, 1), (1, 0)], [UP, UP._replace(normal=-UP.normal)])
    assert answer.impulses[0] == one.impulse * 0.5
    assert answer.impulses[1] == -one.impulse * 0.5
    assert answer.twists[0] == one.twist_a


@pytest.mark.parametrize("law", [Law.COULOMB, Law.AUTO])
@pytest.mark.parametrize("first", [None, 0.0])
def test_copies_may_name_the_tangential_restitution_of_the_model_or_not(law, first):
    contacts = [UP._replace(friction=0.5, tangential_restitution=e_t) for e_t in (first, 0.25)]
    model, pairs = ImpactModel(law, tangential_restitution=0.25), [(0, 1), (1, 0)]
    spinning = BALL._replace(angular_velocity=Vec3(1.0, 2.0, 3.0))
    contacts[1] = contacts[1]._replace(normal=-UP.normal)
    if first is None:
        answer = resolve_scene([spinning, FLOOR], pairs, contacts, model)
        assert answer.twists[0] == resolve(spinning, FLOOR, contacts[0], model).twist_a
        assert [c.tangential_restitution for c in answer.contacts] == [None, 0.25]
    else:
        with refused(StatusCode.INVALID_MODEL, "contacts[1].tangential_restitution"):
            resolve_scene([spinning, FLOOR], pairs, contacts, model)


def test_auto_reads_a_tangential_restitution_only_where_there_is_friction():
    smooth, rough = box(e=0.5).with_contacts(tangential_restitution=0.25), box(e=0.5, mu=0.3)
    bodies = [*smooth.bodies, *rough.bodies]
    pairs = [*smooth.pairs, *((a + 2, b + 2) for a, b in rough.pairs)]
    answer = resolve_scene(bodies, pairs, [*smooth.contacts, *rough.contacts])
    assert answer.model.law is Law.COULOMB
    assert answer.twists[0] == resolve_scene(*smooth).twists[0]
    with refused(StatusCode.INVALID_MODEL, "contacts[0].tangential_restitution"):
        resolve_scene(bodies, pairs, [*smooth.contacts, *rough.contacts], ImpactModel(Law.COULOMB))


@pytest.mark.parametrize("law", [Law.FRICTIONLESS, Law.COULOMB, Law.MOREAU, Law.ROUTH_STRONGE])
def test_a_tangential_restitution_is_checked_even_where_it_has_no_effect(law):
    scene = box(e=0.5, mu=0.3)
    with pytest.raises(TypeError, match=r"contacts\[0\].tangential_restitution: must be a"):
        scene.with_contacts(tangential_restitution="x").resolve(law)
    with refused(StatusCode.INVALID_COEFFICIENT, "contacts[0].tangential_restitution"):
        scene.with_contacts(tangential_restitution=2.0).resolve(law)


def test_a_contact_does_not_change_the_model_of_the_scene():
    bodies = [BALL, BALL._replace(position=Vec3(9.0, 0.0, 0.0)), FLOOR]
    contacts = [
        UP._replace(friction=0.5, tangential_restitution=0.5),
        UP._replace(position=Vec3(9.0, 0.0, 0.0)),
    ]
    for order in ([0, 1], [1, 0]):
        answer = resolve_scene(bodies, [(i, 2) for i in order], [contacts[i] for i in order])
        assert answer.model.tangential_restitution == 0.0


TURNING = box((1.0, 0.5, -1.0), (3.0, 2.0, 1.0), e=0.9, mu=0.4)
AND_A_BALL = TURNING._replace(bodies=[*TURNING.bodies, BALL])
SMOOTH = AND_A_BALL.with_contacts(friction=0.0)
DISC = Body.dynamic(1.0, (0.4, 0.0, 0.0, 0.4, 0.0, 0.6), velocity=(0.3, -2.0, 0.0))
SIDE = Contact.of((0.1, -1.0, 0.0), (0.0, 1.0, 0.0), 0.5, 0.3)
IN_PLANE = Scene([DISC, FLOOR], [(0, 1)] * 2, [SIDE, SIDE._replace(position=(-0.1, -1.0, 0.0))])
IN_A_CORNER = Scene(
    [BALL._replace(velocity=(-1.0, -2.0, -1.0)), FLOOR],
    [(0, 1)] * 2,
    [UP._replace(restitution=0.5), UP._replace(normal=Vec3(1.0, 0.0, 0.0))],
)
TWICE = [*IN_A_CORNER.contacts, UP._replace(normal=Vec3(0.0, 0.0, -1.0), restitution=0.5)]
PATHS_OF_SCENES = {
    "kernels": (AND_A_BALL, {}),
    "in Python": (AND_A_BALL, {"exponent": 2.0}),
    "restitution threshold": (AND_A_BALL, {"exponent": 2.0, "model": ImpactModel(restitution_threshold=0.1)}),
    "springs": (AND_A_BALL, {"model": ImpactModel(Law.ROUTH_STRONGE)}),
    "in several orders": (AND_A_BALL, {"orders": 3}),
    "one contact": (AND_A_BALL._replace(pairs=[(0, 1)], contacts=TURNING.contacts[:1]), {"exponent": 2.0}),
    "in the plane": (IN_PLANE, {"model": ImpactModel(geometry=Geometry.PLANAR)}),
    "fractions": (SMOOTH._replace(bodies=[SMOOTH.bodies[0]._replace(mass=F(1, 3)), *SMOOTH.bodies[1:]]), {}),
    "restitution by speed": (AND_A_BALL.with_contacts(restitution=lambda _: 0.5), {}),
    "friction by speed": (AND_A_BALL.with_contacts(friction=lambda _: 0.5), {}),
    "several walls at one point": (IN_A_CORNER, {}),
    "a contact given twice": (Scene(IN_A_CORNER[0], [*IN_A_CORNER[1], (1, 0)], TWICE), {}),
}


@pytest.mark.parametrize("kind", [tuple, list, np.array], ids=lambda kind: kind.__name__)
@pytest.mark.parametrize("name", PATHS_OF_SCENES)
def test_vectors_may_be_any_sequence(name, kind):
    (bodies, pairs, contacts), options = PATHS_OF_SCENES[name]

    def in_kind(given):
        return type(given)(*(kind(field) if isinstance(field, tuple) else field for field in given))

    expected = resolve_scene(bodies, pairs, contacts, **options)
    scene = resolve_scene([*map(in_kind, bodies)], pairs, [*map(in_kind, contacts)], **options)
    assert scene._replace(contacts=()) == expected._replace(contacts=())


def test_the_docstring_examples_run():
    assert doctest.testmod(sys.modules["collision_response.scene.resolve_scene"]).failed == 0


@pytest.mark.parametrize("law", [Law.AUTO, Law.FRICTIONLESS, Law.MOREAU])
def test_copies_with_equal_functions_count_once(law):
    """The functions are different objects: what counts are their values."""
    box_and_floor = [
        Body.box(
            1.0, (1, 1, 1), position=(0, 0, 0.5), velocity=(1, 0.25, -1), angular_velocity=(0.25, 0.5, 0)
        ),
        Body.static(),
    ]
    corner = Contact.of((0.5, 0.5, 0), (0, 0, 1), 0.25, 0.5)
    functions = [corner._replace(restitution=lambda v: 0.25, friction=lambda v: 0.5) for _ in range(2)]
    expected = resolve_scene(box_and_floor, [(0, 1)] * 2, [corner] * 2, ImpactModel(law))
    for contacts in (functions, [functions[0], corner]):
        answer = resolve_scene(box_and_floor, [(0, 1)] * 2, contacts, ImpactModel(law))
        assert answer == expected


def with_copies(scene: Scene, seed: int) -> tuple[Scene, Scene]:
    """The scene with some contacts given again, by either order of the bodies: without friction, and with
    some that differs between copies."""
    rng, (bodies, pairs, contacts) = random.Random(seed), scene
    for i in rng.choices(range(len(contacts)), k=3):
        (a, b), contact = pairs[i], contacts[i]
        if rng.random() < 0.5:
            (a, b), contact = (b, a), contact._replace(normal=-contact.normal)
        pairs, contacts = [*pairs, (a, b)], [*contacts, contact]
    rough = [contact._replace(friction=rng.choice([0.0, 0.3, 0.9])) for contact in contacts]
    return Scene(bodies, pairs, contacts).with_contacts(friction=0.0), Scene(bodies, pairs, rough)


@pytest.mark.parametrize("exact", [False, True])
@pytest.mark.parametrize("seed", range(60))
def test_friction_has_no_effect_on_frictionless(seed, exact):
    scene = random_scene(seed, contacts=4) if exact else any_scene(seed)
    smooth, rough = with_copies(scene.in_fractions() if exact else scene, seed)
    functions = rough._replace(
        contacts=[c._replace(restitution=lambda v, e=c.restitution: e) for c in rough.contacts]
    )
    expected = smooth.resolve(Law.FRICTIONLESS)
    for other in (rough, functions):
        answer = other.resolve(Law.FRICTIONLESS)
        assert answer._replace(contacts=()) == expected._replace(contacts=())
    tangential = [
        c._replace(tangential_restitution=0.0) if i % 2 else c for i, c in enumerate(rough.contacts)
    ]
    answer = rough._replace(contacts=tangential).resolve(Law.FRICTIONLESS)
    assert answer.twists == expected.twists


@pytest.mark.parametrize("count", [1, 2])
@pytest.mark.parametrize("field", ["restitution", "friction"])
def test_an_error_of_a_function_of_the_caller_is_not_changed(field, count):
    class OwnError(TypeError):
        pass

    def fails(speed):
        raise OwnError("of the caller")

    ball, floor = Body.dynamic(1.0, velocity=(0.25, 0, -1)), Body.static()
    contacts = [Contact.of((x, 0, 0), (0, 0, 1), 0.5, 0.25) for x in range(count)]
    contacts[0] = contacts[0]._replace(**{field: fails})
    with pytest.raises(OwnError, match=r"^of the caller$"):
        resolve_scene([ball, floor], [(0, 1)] * count, contacts)
