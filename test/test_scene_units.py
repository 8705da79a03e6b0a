"""Scenes in any units, up to both ends of float64: no bit changes, or the answer is refused."""

from __future__ import annotations

import itertools
import math

import pytest
from refusals import refused
from scene_cases import Scene, any_scene, assert_within_bound, box, row_of_balls

from collision_response import Body, Contact, ImpactError, ImpactModel, Law, StatusCode, resolve_scene
from collision_response.physics.orientation import Quaternion
from collision_response.physics.vector import Vec3


@pytest.mark.parametrize("masses", list(itertools.permutations((1e-12, 1.0, 1e12))))
@pytest.mark.parametrize("e", [0.0, 0.3, 1.0])
def test_masses_of_opposite_range(masses, e):
    scene = row_of_balls((1, 0, -0.5), e, masses, float)
    answer = scene.resolve(Law.FRICTIONLESS)
    assert_within_bound(scene, answer, scene.in_fractions().resolve(Law.FRICTIONLESS))
    assert answer.error_bound < 4e-9  # the root of what double-double leaves where 1e12 cancels


@pytest.mark.parametrize("e", [0.0, 0.5, 1.0])
@pytest.mark.parametrize(
    ("law", "mass", "speed"),
    [
        (Law.FRICTIONLESS, 1e300, 1.2e4),  # that of MOREAU is infinite
        *(
            (law, *scene)
            for law in (Law.FRICTIONLESS, Law.MOREAU)
            for scene in ((1e300, 1e-140), (1e-300, 1e-18), (1e-300, 1e-12))
        ),
    ],
)
def test_energies_and_impulses_at_the_end_of_float64(law, mass, speed, e):
    """The square of a change overflows or underflows, or an impulse has few digits left."""
    scene = box((0.3 * speed, 0, -speed), (0.1 * speed, 0.2 * speed, 0), e=e, mass=mass)
    answer = scene.resolve(law)
    assert_within_bound(scene, answer, scene.in_fractions().resolve(law))


@pytest.mark.parametrize("ratio", [1e-12, 1e-6, 1e6, 1e12])
def test_friction_in_a_chain_of_extreme_masses(ratio):
    """Balls that rub along each other: energy is lost, and no contact approaches afterwards."""
    bodies = [
        Body.dynamic(
            ratio**k, (0.4 * ratio**k, 0, 0, 0.4 * ratio**k, 0, 0.4 * ratio**k), (2.0 * k, 0, 0), None,
            (1.0 - k, 0.3 * k, 0.0),
        )
        for k in range(3)
    ]  # fmt: skip
    contacts = [Contact.of((2.0 * k + 1, 0, 0), (-1, 0, 0), 0.5, 0.3) for k in range(2)]
    answer = Scene(bodies, [(0, 1), (1, 2)], contacts).resolve(Law.COULOMB)
    assert answer.energy_lost_friction >= -1e-12 * answer.kinetic_energy_before
    assert answer.kinetic_energy_after <= answer.kinetic_energy_before * (1 + 1e-12)
    assert min(answer.normal_velocities_after) >= -1e-9


def in_units(scene: Scene, mass: int, length: int, time: int) -> Scene:
    """The same scene in units that are powers of two of the old ones."""
    m, d, t = 2.0**mass, 2.0**length, 2.0**time
    bodies = [
        body._replace(
            mass=body.mass * m,
            inertia=type(body.inertia)(*(x * m * d * d for x in body.inertia)),
            position=body.position * d,
            velocity=Vec3(*body.velocity) * (d / t),
            angular_velocity=Vec3(*body.angular_velocity) * (1 / t),
            com=Vec3(*body.com) * d,
        )
        for body in scene.bodies
    ]
    return Scene(bodies, scene.pairs, [c._replace(position=Vec3(*c.position) * d) for c in scene.contacts])


@pytest.mark.parametrize("law", [Law.FRICTIONLESS, Law.COULOMB, Law.MOREAU])
@pytest.mark.parametrize("units", [(2, 0, 0), (40, 0, 0), (0, 6, 0), (0, 0, 7), (20, -10, -8)])
def test_units_that_are_powers_of_two_change_no_bit(law, units):
    """Even powers for mass, whose root is taken."""
    mass, length, time = (2.0**k for k in units)
    for seed in range(60, 80):
        scene = any_scene(seed)
        one, other = scene.resolve(law), in_units(scene, *units).resolve(law)
        assert [t.linear * (length / time) for t in one.changes] == [t.linear for t in other.changes]
        assert [P * (mass * length / time) for P in one.impulses] == list(other.impulses)
        assert (one.regimes, one.error_bound, one.model, one.adjustments) == (
            other.regimes,
            other.error_bound,
            other.model,
            other.adjustments,
        )
        energy = mass * (length / time) ** 2
        for field in ("kinetic_energy_after", "energy_lost_restitution", "energy_lost_friction"):
            assert getattr(one, field) * energy == getattr(other, field)


@pytest.mark.parametrize("law", [Law.FRICTIONLESS, Law.COULOMB, Law.MOREAU])
@pytest.mark.parametrize(
    "units", [(0, 0, -485), (400, 0, -285), (800, 0, -85), (0, 0, 450), (-400, 0, 100), (-600, 0, 300)]
)
@pytest.mark.parametrize("restitution", [None, 0.5, 1.0])
def test_units_change_no_bit_at_the_end_of_float64(law, units, restitution):
    """Energies would overflow with a factor of two more, or are 0; velocities and impulses are in range."""
    for seed in range(60, 80):
        scene = any_scene(seed)
        if restitution is not None:
            scene = scene.with_contacts(restitution=restitution, friction=0.0)
        one, other = scene.resolve(law), in_units(scene, *units).resolve(law)
        assert [t.linear * 2.0 ** -units[2] for t in one.changes] == [t.linear for t in other.changes]
        assert (one.regimes, one.error_bound, one.model) == (other.regimes, other.error_bound, other.model)


@pytest.mark.parametrize("law", [Law.FRICTIONLESS, Law.MOREAU])
@pytest.mark.parametrize("e", [0.0, 0.5, 1.0])
def test_the_largest_energy_has_a_bound(law, e):
    """2^1021 J for a box that lands flat. The inverse of its mass has few digits beyond those of a float."""
    answer = in_units(box(e=e), 1000, 0, -11).resolve(law)
    assert answer.twists[0].linear == (0, 0, e * 2.0**11)
    assert answer.error_bound < 1e-8


@pytest.mark.parametrize("law", [Law.FRICTIONLESS, Law.COULOMB, Law.MOREAU, Law.ROUTH_STRONGE])
@pytest.mark.parametrize(
    "units",
    [
        (266, 0, 538), (530, 0, 540), (800, 0, 850), (-266, 0, -515), (-800, 0, -850),
        (354, -476, 82), (452, -386, 192), (340, -178, 368), (-376, 494, -32), (-96, 228, -318),
    ],
)  # fmt: skip
@pytest.mark.parametrize("options", [{}, {"orders": 1}])
@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_squares_of_speeds_may_leave_float64(law, units, options, friction):
    """Energies and regimes are the same as in usual units."""
    mass, length, time = units
    flying = Body.dynamic(1.5, (0.1, 0, 0, 0.2, 0, 0.3), (9, 9, 9), None, (1, 2, 3), (3, 2, 1))
    fields = (
        "kinetic_energy_before",
        "kinetic_energy_after",
        "energy_lost_restitution",
        "energy_lost_friction",
    )
    for seed in (60, 69, 70, 97, 98):
        scene = any_scene(seed).with_contacts(restitution=0.5, friction=friction)
        scene = scene._replace(bodies=[*scene.bodies, flying])
        one, other = (given.resolve(law, options=options) for given in (scene, in_units(scene, *units)))
        assert (other.status, other.regimes, other.adjustments) == (one.status, one.regimes, one.adjustments)
        # A path goes by roots of stiffnesses and time, which are rounded in each unit.
        tolerance = 1e-9 if law is Law.ROUTH_STRONGE else 2.0**-50
        for field in fields:
            energy = math.ldexp(getattr(other, field), 2 * (time - length) - mass)
            assert energy == pytest.approx(getattr(one, field), abs=tolerance * one.kinetic_energy_before)


@pytest.mark.parametrize("units", [(0, 0, -485), (800, 0, -85), (0, 0, 450), (-400, 0, 200), (-600, 0, 300)])
@pytest.mark.parametrize("friction", [0.0, 0.3])
def test_stronge_does_not_depend_on_units(units, friction):
    """Squares of small speeds and impulses decide when a spring rests and when a contact sticks.

    The same path is followed, so changes differ by some roundings at most.
    """
    for seed in (60, 62, 64, 66, 67, 70):
        scene = any_scene(seed).with_contacts(restitution=0.5, friction=friction)
        one, other = scene.resolve(Law.ROUTH_STRONGE), in_units(scene, *units).resolve(Law.ROUTH_STRONGE)
        assert other.error_bound == pytest.approx(one.error_bound, rel=1e-6)
        size = max((t.linear.norm() for t in one.changes), default=0.0)
        for x, y in zip(one.changes, other.changes, strict=True):
            assert tuple(y.linear * 2.0 ** units[2]) == pytest.approx(tuple(x.linear), abs=1e-12 * size)


@pytest.mark.parametrize("law", [Law.FRICTIONLESS, Law.COULOMB, Law.MOREAU, Law.ROUTH_STRONGE])
@pytest.mark.parametrize("power", range(1010, 1091, 8))
def test_impulses_below_float64_are_refused(law, power):
    """A ball in a corner with 2^-power kg m/s; the smallest impulse is 2^-1074, and just above it a bound is
    given.
    """
    ball = Body.dynamic(math.ldexp(1.0, -power // 2), velocity=[-math.ldexp(1.0, power // 2 - power)] * 3)
    contacts = [Contact.of((0, 0, 0), n, 0.5) for n in ((1, 0, 0), (0, 1, 0))]
    scene = [ball, Body.static()], [(0, 1)] * 2, contacts, ImpactModel(law)
    if power > 1075:
        with refused(StatusCode.OUT_OF_RANGE):
            resolve_scene(*scene)
        return
    answer = resolve_scene(*scene)
    v = answer.twists[0].linear * math.ldexp(1.0, power - power // 2)
    assert math.hypot(v.x - 0.5, v.y - 0.5) <= answer.error_bound * 1.5 * math.sqrt(2)


LENGTHS = (2.0**-1000, 2.0**-660, 2.0**-101, 2.0**101, 2.0**660, 2.0**1000)


@pytest.mark.parametrize("law", [Law.FRICTIONLESS, Law.COULOMB, Law.MOREAU, Law.ROUTH_STRONGE])
@pytest.mark.parametrize("contacts", [2, 3])
@pytest.mark.parametrize("slip", [0.0, 1e-15, 1.0])
def test_normals_may_have_any_length(law, contacts, slip):
    """Two balls above a floor and one on the other; the lengths must not change a bit."""
    bodies = [
        Body.dynamic(1.0, velocity=(slip, 0, -1)),
        Body.dynamic(2.0, velocity=(0, 0, -2)),
        Body.static(),
    ]
    pairs = [(0, 2), (1, 2), (0, 1)][:contacts]

    def answer(*lengths: float):
        touches = [Contact.of((0, 0, 0), (0, 0, length), 0.5, 0.5) for length in lengths[:contacts]]
        return resolve_scene(bodies, pairs, touches, ImpactModel(law))

    usual = answer(1.0, 1.0, 1.0)
    assert usual.status is StatusCode.OK
    for i, length in enumerate(LENGTHS):
        other = answer(length, LENGTHS[i - 1], LENGTHS[i - 2])
        assert (other.status, other.twists, other.impulses) == (usual.status, usual.twists, usual.impulses)


@pytest.mark.parametrize("law", [Law.FRICTIONLESS, Law.COULOMB, Law.MOREAU, Law.ROUTH_STRONGE])
@pytest.mark.parametrize("contacts", [2, 3])
def test_an_energy_beyond_float64_is_refused(law, contacts):
    bodies = [Body.dynamic(m * 1e200, velocity=(0, 0, -m * 1e150)) for m in (1, 2)]
    touches = [Contact.of((0, 0, 0), (0, 0, 1), 0.5, 0.5)] * contacts
    with refused(StatusCode.OUT_OF_RANGE):
        pairs = [(0, 2), (1, 2), (0, 1)][:contacts]
        resolve_scene([*bodies, Body.static()], pairs, touches, ImpactModel(law))


BEYOND = {
    "a floor that comes fast": ((1, 1), {"velocity": Vec3(0.0, 0.0, 1e308)}),
    "a floor that slides fast": ((1, 1), {"velocity": Vec3(1e308, 0.0, 0.0)}),
    "a floor that turns fast": ((1, 1), {"angular_velocity": Vec3(1e308, 1e308, 0.0)}),
    "a floor far away that turns": (
        (1, 1),
        {"position": Vec3(1e200, 0.0, 0.0), "angular_velocity": Vec3(0.0, 1e200, 0.0)},
    ),
    "a body far away": ((1, 0), {"position": Vec3(1e308, 0.0, 0.5)}),
    "a body that hardly resists turning": ((1, 0), {"inertia": (1e-320, 0.0, 0.0, 1e-320, 0.0, 1e-320)}),
    "a contact far away": ((2, 3), {"position": Vec3(1e308, 0.0, 0.0)}),
}


@pytest.mark.parametrize("law", [Law.FRICTIONLESS, Law.COULOMB, Law.MOREAU, Law.ROUTH_STRONGE])
@pytest.mark.parametrize("beyond", BEYOND)
@pytest.mark.parametrize("options", [{}, {"exponent": 1.0}], ids=["in kernels", "in Python"])
def test_intermediate_results_beyond_float64_are_refused(law, beyond, options):
    scene = box((1, 0, -1), (0.1, 0.2, 0), e=0.5, mu=0.3)
    bodies = [*map(Body._make, scene.bodies[:1]), Body.kinematic()]
    (table, place), change = BEYOND[beyond]
    tables = {1: bodies, 2: list(scene.contacts)}
    tables[table][place] = tables[table][place]._replace(**change)
    with pytest.raises(ImpactError) as refused:
        resolve_scene(bodies, scene.pairs, tables[2], ImpactModel(law), **options)
    codes = [StatusCode.OUT_OF_RANGE, *[StatusCode.PATH_TOO_LONG] * (law is Law.ROUTH_STRONGE)]
    assert refused.value.code in codes  # a path may notice first


@pytest.mark.parametrize(
    ("law", "mu"), [(Law.FRICTIONLESS, 0.3), (Law.COULOMB, 0.0), (Law.COULOMB, 0.3), (Law.MOREAU, 0.0)]
)
def test_exact_impulses_beyond_float64_are_refused(law, mu):
    """Only impulses of 1e350 N s separate bodies that contacts clamp from both sides but for 1e-150."""
    ball = Body.dynamic(1e200)
    contacts = [Contact.of((0, 0, 0), (x, 0, 1e-150), 0.0, mu) for x in (1e-9, -0.3)]
    with refused(StatusCode.OUT_OF_RANGE):
        resolve_scene(
            [ball._replace(velocity=Vec3(0, 0, -1e-17)), ball._replace(velocity=Vec3(1.0, 0.0, 1.0))],
            [(0, 1)] * 2,
            contacts,
            ImpactModel(law),
        )


@pytest.mark.parametrize("law", [Law.FRICTIONLESS, Law.COULOMB, Law.MOREAU])
@pytest.mark.parametrize("others", ["touch", "do not"])
def test_energies_whose_sum_is_beyond_float64_are_refused(law, others):
    scene = box((1, 0, -1), e=0.5, mu=0.3)
    heavy = Body.box(1e300, (1, 1, 1), position=(0, 0, 0.5), velocity=(0, 0, -1.2e4))
    bodies = [heavy, scene.bodies[1], heavy._replace(), heavy._replace()]
    pairs = [*scene.pairs, *([(place, 1) for place in (2, 3) for _ in range(4)] if others == "touch" else ())]
    with refused(StatusCode.OUT_OF_RANGE):
        resolve_scene(bodies, pairs, scene.contacts * (len(pairs) // 4), ImpactModel(law))


@pytest.mark.parametrize("law", [Law.FRICTIONLESS, Law.COULOMB, Law.MOREAU, Law.ROUTH_STRONGE])
@pytest.mark.parametrize("power", [-1000, -500, 500, 1000])
def test_quaternions_may_have_any_length(law, power):
    """A power of two changes no bit of the answer."""
    scene = box((1, 0.5, -1), (0.1, 0.2, 0), e=0.5, mu=0.3)
    turn = Quaternion(0.1, -0.7, 0.3, 0.4)
    answers = [
        resolve_scene(
            [scene.bodies[0]._replace(orientation=q), scene.bodies[1]],
            scene.pairs,
            scene.contacts,
            ImpactModel(law),
        )
        for q in (turn, Quaternion(*(math.ldexp(x, power) for x in turn)))
    ]
    assert answers[0] == answers[1]
