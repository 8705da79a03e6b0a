"""Properties of every answer for a scene, on many random ones; benchmarks/scene_properties.py checks more."""

from __future__ import annotations

import functools
import itertools
import math
import random
from contextlib import suppress
from fractions import Fraction
from pathlib import Path

import pytest
from programs import run_python
from scene_cases import (
    Scene,
    any_scene,
    assert_within_bound,
    change_norm,
    distance,
    distance_of_changes,
    energy,
    momentum,
    random_scene,
    rotate,
    rotated_body,
    row_of_balls,
)
from scene_cases import box as box_on_floor

from collision_response import (
    Adjustment,
    Body,
    Contact,
    ImpactError,
    ImpactModel,
    Law,
    Regime,
    resolve,
    resolve_scene,
)
from collision_response.physics.mass_properties import box
from collision_response.physics.orientation import Quaternion
from collision_response.physics.vector import Vec3

SEEDS = range(100)
LAWS = [Law.FRICTIONLESS, Law.COULOMB, Law.MOREAU]
each_law = pytest.mark.parametrize("law", LAWS, ids=lambda law: law.name)

ENOUGH = {Law.FRICTIONLESS: 1e-9, Law.COULOMB: 1e-6, Law.MOREAU: 1e-6}
"""How far two answers to the same question may differ: the bound of COULOMB is the root of a rounding."""


def each_seed(test):
    """Run a test for ten seeds at a time, because most scenes take less time than a test does."""

    @functools.wraps(test)
    def of_ten(seed, **others):
        for one in range(seed, seed + 10):
            test(seed=one, **others)

    return pytest.mark.parametrize("seed", SEEDS[::10])(of_ten)


def agrees(scene: Scene, one, other, law: Law) -> bool:
    """Whether two answers agree, or depend on a decision that neither is sure of."""
    if not (one.error_bound < 1 and other.error_bound < 1):
        return True
    if law is Law.MOREAU and (one.model.law, other.model.law) != (law, law):
        return True
    return distance(scene, one, other) <= ENOUGH[law] + 2 * (one.error_bound + other.error_bound)


@each_seed
@each_law
def test_momentum_energy_and_separation(seed, law):
    scene = any_scene(seed)
    answer = scene.resolve(law)
    scale = change_norm(scene, answer)
    assert answer.energy_lost_restitution + answer.energy_lost_friction >= 0
    # Impulses and changes agree, and the energies with the twists.
    linear_change = [Vec3(0, 0, 0)] * len(scene.bodies)
    angular_change = [Vec3(0, 0, 0)] * len(scene.bodies)
    for (a, b), contact, impulse in zip(scene.pairs, answer.contacts, answer.impulses, strict=True):
        for body, P in ((a, impulse), (b, -impulse)):
            linear_change[body] += P
            angular_change[body] += contact.position.cross(P)
    before = [
        type(t)(Vec3(*b.velocity), Vec3(*b.angular_velocity))
        for b, t in zip(scene.bodies, answer.twists, strict=True)
    ]
    for i, body in enumerate(scene.bodies):
        only = Scene([body], [], [])
        if body.is_movable():
            (p, before_), (q, after_) = momentum(only, [before[i]]), momentum(only, [answer.twists[i]])
            size = sum(P.norm() for P in answer.impulses) + 1e-300
            assert (q - p - linear_change[i]).norm() <= 1e-9 * (size + p.norm())
            idle = body.inertia.trace() == 0
            if not idle:
                assert (after_ - before_ - angular_change[i]).norm() <= 1e-9 * (3 * size + before_.norm())
        else:
            assert answer.twists[i] == before[i]
    assert answer.kinetic_energy_after == pytest.approx(energy(scene, answer.twists), rel=1e-9)
    # No contact approaches.
    bound = (answer.error_bound if law is Law.FRICTIONLESS else 1e-6) * scale
    lightest = min(body.mass for body in scene.bodies if body.is_movable())
    if answer.error_bound < 1:
        for u in answer.normal_velocities_after:
            assert u >= -1e3 * (bound + 1e-12 * scale) / math.sqrt(lightest)
    # Impulses push, and friction is in its cone.
    for contact, P in zip(answer.contacts, answer.impulses, strict=True):
        n = contact.normal * (1 / contact.normal.norm())
        normal = P.dot(n)
        assert normal >= -1e-12 * P.norm()
        across = (P - n * normal).norm()
        assert across <= contact.friction * normal * (1 + 1e-9) + 1e-9 * scale


NUMBERS = (0.0, 0.5, 1.0, -1.0, 2.0, -0.25, 0.1, 3.0)


def scene_of_few_numbers(seed: int) -> Scene:
    """A scene with many ties, of heavy, light and turned bodies, often held from all sides."""
    draw = random.Random(seed)

    def vector() -> tuple[float, ...]:
        return tuple(draw.choice(NUMBERS) for _ in range(3))

    def body() -> Body:
        if draw.random() < 0.3:
            return Body.static(vector())
        mass, axis = draw.choice([0.5, 1.0, 1e3]), draw.choice([None, (0, 0, 1, 1), (1, 2, 3, 4)])
        moments = box(mass, (1.0, 2.0, 3.0)).inertia
        return Body.dynamic(mass, moments, vector(), axis, vector(), vector())

    bodies = [body() for _ in range(draw.randint(1, 3))] + [Body.static()]
    elastic = draw.random() < 0.5
    pairs, contacts = [], []
    for _ in range(draw.randint(2, 6)):
        a, b = draw.sample(range(len(bodies)), 2)
        normal = vector()
        if any(normal) and (bodies[a].is_movable() or bodies[b].is_movable()):
            e, mu = 1.0 if elastic else draw.choice([0.0, 0.25, 0.9]), draw.choice([0.0, 0.3, 1.0, 5.0])
            pairs.append((a, b))
            contacts.append(Contact.of(vector(), normal, e, mu))
    return Scene(bodies, pairs, contacts)


@pytest.mark.parametrize("seed", range(0, 2000, 100))
@each_law
def test_no_energy_is_gained(seed, law):
    """Not even by rounding: a loss is never negative."""
    for one in range(seed, seed + 100):
        with suppress(ImpactError):
            answer = scene_of_few_numbers(one).resolve(law)
            assert answer.energy_lost_restitution + answer.energy_lost_friction >= 0, one
            if law is Law.FRICTIONLESS:
                assert answer.energy_lost_friction == 0


@each_seed
@each_law
def test_the_order_of_contacts_and_of_bodies_does_not_matter(seed, law):
    scene = any_scene(seed)
    answer = scene.resolve(law)
    rng = random.Random(seed)
    order, places = list(range(len(scene.pairs))), list(range(len(scene.bodies)))
    rng.shuffle(order)
    rng.shuffle(places)
    swap = [rng.random() < 0.5 for _ in order]
    shuffled = Scene(
        [scene.bodies[places.index(i)] for i in range(len(places))],
        [
            (places[b], places[a]) if swapped else (places[a], places[b])
            for (a, b), swapped in zip((scene.pairs[i] for i in order), swap, strict=True)
        ],
        [
            scene.contacts[i]._replace(normal=-scene.contacts[i].normal) if swapped else scene.contacts[i]
            for i, swapped in zip(order, swap, strict=True)
        ],
    )
    other = shuffled.resolve(law)
    back = other._replace(changes=tuple(other.changes[place] for place in places))
    assert agrees(scene, answer, back, law)


@each_seed
@each_law
def test_a_contact_given_again_changes_no_velocity(seed, law):
    scene = any_scene(seed)
    answer = scene.resolve(law)
    rng = random.Random(seed)
    again = [rng.randrange(len(scene.pairs)) for _ in range(3)]
    doubled = Scene(
        scene.bodies,
        scene.pairs + [scene.pairs[i] for i in again],
        scene.contacts + [scene.contacts[i] for i in again],
    )
    other = doubled.resolve(law)
    if all(len(cluster) > 1 for cluster in answer.clusters):
        assert [t.linear for t in other.twists] == [t.linear for t in answer.twists]
    assert agrees(scene, answer, other, law) or len(answer.clusters) < len(scene.pairs)


@each_seed
@each_law
def test_a_mirror_shows_the_mirrored_answer(seed, law):
    scene = any_scene(seed)
    answer = scene.resolve(law)

    def polar(v):
        return Vec3(-v[0], v[1], v[2])

    def axial(v):
        return Vec3(v[0], -v[1], -v[2])

    def mirrored(body: Body) -> Body:
        xx, xy, xz, yy, yz, zz = body.inertia
        q = body.orientation
        return body._replace(
            inertia=type(body.inertia)(xx, -xy, -xz, yy, yz, zz),
            position=polar(body.position),
            orientation=None if q is None else Quaternion(q.x, -q.y, -q.z, q.w),
            velocity=polar(body.velocity),
            angular_velocity=axial(body.angular_velocity),
            com=polar(body.com),
        )

    image = Scene(
        [mirrored(body) for body in scene.bodies],
        scene.pairs,
        [c._replace(position=polar(c.position), normal=polar(c.normal)) for c in scene.contacts],
    ).resolve(law)
    back = image._replace(changes=tuple(type(t)(polar(t.linear), axial(t.angular)) for t in image.changes))
    assert agrees(scene, answer, back, law)


@each_seed
@each_law
def test_every_observer_sees_the_same(seed, law):
    """In a moving and rotated frame."""
    scene = any_scene(seed)
    answer = scene.resolve(law)
    rng = random.Random(seed)
    boost = Vec3(*(rng.uniform(-3, 3) for _ in range(3)))
    q = Quaternion(*(rng.gauss(0, 1) for _ in range(4)))

    def seen(body: Body) -> Body:
        body = rotated_body(body, q)
        return body._replace(velocity=body.velocity + boost)

    other = Scene(
        [seen(body) for body in scene.bodies],
        scene.pairs,
        [c._replace(position=rotate(q, c.position), normal=rotate(q, c.normal)) for c in scene.contacts],
    ).resolve(law)
    inverse = Quaternion(-q.x, -q.y, -q.z, q.w)
    back = other._replace(
        changes=tuple(type(t)(rotate(inverse, t.linear), rotate(inverse, t.angular)) for t in other.changes)
    )
    assert agrees(scene, answer, back, law)
    bounds = answer.error_bound + other.error_bound
    if bounds < 1 and answer.model.law is other.model.law:
        lost, other_lost = (x.energy_lost_restitution + x.energy_lost_friction for x in (answer, other))
        # The work on nearly equal velocities is nearly equal.
        assert (
            abs(lost - other_lost)
            <= (ENOUGH[law] + 4 * bounds) * change_norm(scene, answer) ** 2 + 1e-5 * lost
        )


@pytest.mark.parametrize("exponent", [1.0, 1.5, 10.0])
@pytest.mark.parametrize("mu", [0.0, 1e-12, 0.1, 1.0])
@pytest.mark.parametrize("slip", [0.0, 0.5])
def test_springs_create_no_energy(exponent, mu, slip):
    """Elastic balls of different masses in a row: without slip they lose nothing, so every error counts.

    The sums of energies are rounded.
    """
    for seed in range(30):
        rng = random.Random(seed)
        masses = [math.exp(rng.uniform(-3, 3)) for _ in range(rng.randint(3, 5))]
        scene = row_of_balls([1.0] + [0.0] * (len(masses) - 1), 1.0, masses, float).with_contacts(friction=mu)
        first = scene.bodies[0]._replace(velocity=Vec3(1.0, slip, 0.0))
        ratios = [math.exp(rng.uniform(-3, 3)) for _ in masses[1:]]
        answer = scene._replace(bodies=[first, *scene.bodies[1:]]).resolve(
            Law.ROUTH_STRONGE, options={"stiffness": ratios, "exponent": exponent}
        )
        before, after = answer.kinetic_energy_before, answer.kinetic_energy_after
        lost = answer.energy_lost_restitution, answer.energy_lost_friction
        assert min(lost) >= 0
        assert after <= before * (1 + 1e-14)
        assert before - after == pytest.approx(sum(lost), abs=1e-14 * before)


@each_seed
@pytest.mark.parametrize("law", [*LAWS, Law.ROUTH_POISSON, Law.ROUTH_STRONGE], ids=lambda law: law.name)
def test_one_contact_equals_resolve(seed, law):
    scene = any_scene(seed)
    model = ImpactModel(law)
    (a, b), contact = scene.pairs[0], scene.contacts[0]
    one = resolve(scene.bodies[a], scene.bodies[b], contact, model)
    answer = resolve_scene(scene.bodies, [(a, b)], [contact], model)
    assert (answer.twists[a], answer.twists[b]) == (one.twist_a, one.twist_b)
    assert (answer.changes[a], answer.impulses[0]) == (one.change_a, one.impulse)
    assert (answer.contacts[0], answer.model, answer.error_bound) == (one.contact, one.model, one.error_bound)
    assert answer.status is one.status
    assert answer.regimes == (one.regime,)
    assert answer.energy_lost_friction == one.energy_lost_friction


@each_seed
@each_law
def test_far_clusters_equal_separate_calls(seed, law):
    one, other = any_scene(seed), any_scene(seed + 1000)
    shift = len(one.bodies)
    both = Scene(
        one.bodies + other.bodies,
        one.pairs + [(a + shift, b + shift) for a, b in other.pairs],
        one.contacts + other.contacts,
    )
    first, second, answer = one.resolve(law), other.resolve(law), both.resolve(law)
    assert answer.twists == first.twists + second.twists
    assert answer.impulses == first.impulses + second.impulses
    assert answer.error_bound == max(first.error_bound, second.error_bound)
    count = len(one.pairs)
    assert answer.clusters == first.clusters + tuple(tuple(i + count for i in c) for c in second.clusters)


@each_seed
def test_without_restitution_the_answer_is_the_projection(seed):
    """Against Dykstra's alternating projections, an independent method."""
    scene = random_scene(seed, e=0.0, contacts=6)
    answer = scene.resolve(Law.FRICTIONLESS)
    changes = _dykstra(scene)
    twists = [type(t)(*change) for t, change in zip(answer.twists, changes, strict=True)]
    assert distance_of_changes(scene, twists, answer.changes) < 1e-6 or change_norm(scene, answer) < 1e-9


def _dykstra(scene: Scene):
    """The nearest velocities, in the metric of kinetic energy, at which no contact approaches."""
    from collision_response.physics.effective_mass import ContactKinematics

    seen = [
        ContactKinematics.of(scene.bodies[a], scene.bodies[b], c)
        for (a, b), c in zip(scene.pairs, scene.contacts, strict=True)
    ]
    zero = Vec3(0.0, 0.0, 0.0)
    changes = [[zero, zero] for _ in scene.bodies]
    pushes = [0.0] * len(seen)
    for _ in range(100_000):
        most = 0.0
        for i, ((a, b), k) in enumerate(zip(scene.pairs, seen, strict=True)):
            u = k.n_u
            for body, side, sign in ((a, k.body_a, 1), (b, k.body_b, -1)):
                linear, angular = changes[body]
                u += sign * k.n.dot(linear + angular.cross(side.d))
            by = max(-u / k.n_Kn, -pushes[i])
            pushes[i] += by
            most = max(most, abs(by) * k.n_Kn)
            for body, side, sign in ((a, k.body_a, 1), (b, k.body_b, -1)):
                if scene.bodies[body].is_movable():
                    twist = side.twist_change(k.n * (by * sign))
                    changes[body] = [changes[body][0] + twist.linear, changes[body][1] + twist.angular]
        if most < 1e-11:
            break
    return changes


def test_few_random_scenes_have_no_bound():
    unbounded = total = 0
    for seed in range(300):
        scene = random_scene(seed)
        try:
            answer = scene.resolve(Law.FRICTIONLESS)
        except ImpactError:
            continue
        total += 1
        unbounded += not answer.error_bound < 1e-6
    assert total > 150
    assert unbounded * 8 <= total


@pytest.mark.parametrize("seed", range(25))
def test_errors_against_rationals_are_within_the_bound(seed):
    scene = random_scene(seed, contacts=4)
    answer = scene.resolve(Law.FRICTIONLESS)
    exact = scene.in_fractions().resolve(Law.FRICTIONLESS)
    assert exact.error_bound == 0
    if answer.error_bound < math.inf:
        assert_within_bound(scene, answer, exact)


@pytest.mark.parametrize("restitutions", list(itertools.product((0.0, 0.5, 1.0), repeat=4)))
@pytest.mark.parametrize("spin", [(0, 0, 0), (1, 0, 0), (0.5, -0.25, 0)])
def test_contacts_that_leave_faster_than_they_rebound_have_no_impulse_by_moreau(restitutions, spin):
    """Four corners share three equations: the least norm must not spread the load to the other corners."""
    flat = box_on_floor((0, 0, -1), spin)
    contacts = [c._replace(restitution=e) for c, e in zip(flat.contacts, restitutions, strict=True)]
    scene = flat._replace(pairs=[(0, 1)] * 5, contacts=[*contacts, contacts[0]])
    answer, exact = scene.resolve(Law.MOREAU), scene.in_fractions().resolve(Law.MOREAU)
    assert Adjustment.LAW_FALLBACK not in answer.adjustments | exact.adjustments
    for e, before, after, P in zip(
        (*restitutions, restitutions[0]),
        exact.normal_velocities_before,
        exact.normal_velocities_after,
        exact.impulses,
        strict=True,
    ):
        assert P.z == 0 or after == -Fraction(e) * before
    for P, exactly in zip(answer.impulses, exact.impulses, strict=True):
        assert tuple(P) == pytest.approx(tuple(map(float, exactly)), abs=2.0**-50)


@each_seed
def test_the_rest_of_the_answer_is_consistent(seed):
    scene = any_scene(seed)
    answer = scene.resolve(Law.COULOMB)
    for body, twist, change in zip(scene.bodies, answer.twists, answer.changes, strict=True):
        for after, before, by in (
            (twist.linear, body.velocity, change.linear),
            (twist.angular, body.angular_velocity, change.angular),
        ):
            assert after == pytest.approx(Vec3(*before) + by, abs=1e-15)
    for regime, impulse in zip(answer.regimes, answer.impulses, strict=True):
        assert (regime is Regime.SEPARATING) == (not any(impulse))
    assert sorted(i for cluster in answer.clusters for i in cluster) == list(range(len(scene.pairs)))
    assert str(answer).count("\n") >= len(scene.bodies) + len(scene.pairs)


def test_two_far_balls_on_one_floor_are_two_clusters():
    balls = [Body.dynamic(1.0, position=(x, 0.0, 1.0), velocity=(0.0, 0.0, -1.0)) for x in (0.0, 9.0)]
    contacts = [Contact.of((x, 0.0, 0.0), (0.0, 0.0, 1.0)) for x in (0.0, 9.0)]
    answer = resolve_scene([*balls, Body.static()], [(0, 2), (1, 2)], contacts)
    assert answer.clusters == ((0,), (1,))


def test_the_benchmark_checks_each_property():
    """For one scene, without violation."""
    benchmark = Path(__file__).parents[1] / "benchmarks" / "scene_properties.py"
    ran = run_python(benchmark, "--scenes", "1")
    ran.check_returncode()
    repeated = sum(hasattr(test, "__wrapped__") for name, test in globals().items() if "test_" in name)
    assert ran.stdout.count("\n| ") == repeated + 1
