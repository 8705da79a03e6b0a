"""The laws against reference values, against the oracle, and in every kind of number."""

from __future__ import annotations

import math
from fractions import Fraction as F
from itertools import product

import numpy as np
import pytest
from scenes import LAWS_WITH_FRICTION, Scene, random_scene

from collision_response import Adjustment, Body, Contact, Geometry, Impact, ImpactModel, Law, Regime, resolve
from collision_response.physics.effective_mass import Planar, Point, Spatial
from collision_response.physics.energy import kinetic_energy
from collision_response.physics.laws import Parameters, chatterjee_ruina, frictionless
from collision_response.physics.laws.moreau import creates_energy, one_step
from collision_response.physics.mass_properties import rod, sphere
from collision_response.physics.orientation import Quaternion
from collision_response.physics.vector import Vec3

DIGITS_GIVEN = 1e-8
"""The reference values have eight digits."""

T1, T2, T3, T3_ELASTIC = "T1", "T2", "T3", "T3 with e=1"
CASES = {
    T1: (math.radians(45), 0.5, (0.0, -1.0)),
    T2: (math.radians(45), 0.5, (1.0, -1.0)),
    T3: (math.atan(2), 0.9, (0.5, -1.0)),
    T3_ELASTIC: (math.atan(2), 1.0, (0.5, -1.0)),
}
REFERENCE = {
    (T1, Law.MOREAU): (9 / 41, 30 / 41, -0.243159),
    (T1, Law.COULOMB): (9 / 41, 30 / 41, -0.243159),
    (T1, Law.ROUTH_POISSON): (9 / 41, 30 / 41, -0.243159),
    (T1, Law.ROUTH_STRONGE): (9 / 41, 30 / 41, -0.243159),
    (T2, Law.MOREAU): (-0.0625, 0.5625, -0.171875),
    (T2, Law.COULOMB): (-0.15254237, 0.50847458, -0.19240161),
    (T2, Law.ROUTH_POISSON): (-0.11412429, 0.50847458, -0.19609148),
    (T2, Law.ROUTH_STRONGE): (-0.11288499, 0.51260558, -0.19430798),
    (T3, Law.COULOMB): (0.1, 1.2625, -0.071875),
    (T3, Law.ROUTH_POISSON): (0.25, 1.28378378, -0.11918828),
    (T3, Law.ROUTH_STRONGE): (0.25579294, 1.30309359, -0.10551032),
    (T3_ELASTIC, Law.COULOMB): (0.1, 1.325, -0.0125),
    (T3_ELASTIC, Law.ROUTH_POISSON): (0.27027027, 1.35135135, -0.06939372),
    (T3_ELASTIC, Law.ROUTH_STRONGE): (0.27670687, 1.3728067, -0.05244936),
}


def rod_on_plane(case: str) -> Scene:
    """A real rod of 1 kg and 1 m strikes a fixed plane with its end, at an angle to it."""
    angle, e, (u_t, u_n) = CASES[case]
    body = Body.dynamic(
        1.0,
        rod(1.0, 1.0).inertia,
        position=(0.5 * math.cos(angle), 0.5 * math.sin(angle), 0.0),
        orientation=(0.0, 0.0, math.sin(angle / 2), math.cos(angle / 2)),
        velocity=(u_t, u_n, 0.0),
    )
    return Scene(body, Body.static(), Contact.of((0, 0, 0), (0, 1, 0), restitution=e, friction=0.3))


@pytest.mark.parametrize("geometry", [Geometry.PLANAR, Geometry.SPATIAL])
@pytest.mark.parametrize(("case", "law"), REFERENCE)
def test_rod_on_plane(case, law, geometry):
    p_t, p_n, energy_change = REFERENCE[case, law]
    impact = rod_on_plane(case).resolve(law, geometry=geometry)
    assert impact.impulse.x == pytest.approx(p_t, abs=DIGITS_GIVEN)
    assert impact.impulse.y == pytest.approx(p_n, abs=DIGITS_GIVEN)
    digits = 1e-6 if case == T1 else DIGITS_GIVEN
    assert impact.kinetic_energy_after - impact.kinetic_energy_before == pytest.approx(
        energy_change, abs=digits
    )
    assert impact.adjustments == Adjustment.NONE


@pytest.mark.parametrize(
    ("case", "gain", "p"), [(T3, 0.01925, (0.37, 1.465)), (T3_ELASTIC, 0.1, (0.4, 1.55))]
)
def test_moreau_creates_energy_on_t3_and_is_replaced(case, gain, p):
    scene = rod_on_plane(case)
    approach = Planar.prepare(*scene)
    raw = one_step(approach, Parameters(scene.contact.restitution, 0.3))
    assert raw.impulse == pytest.approx(p, abs=1e-15 * 10)  # ten roundings of numbers about 1
    assert creates_energy(approach, raw)
    after = scene.body_a.moved_by(approach.respond(raw.impulse).change_a)
    assert kinetic_energy(after) - kinetic_energy(scene.body_a) == pytest.approx(gain, rel=1e-13)

    impact = scene.resolve(Law.MOREAU)
    assert impact.impulse == scene.resolve(Law.COULOMB).impulse
    assert impact.model.law is Law.COULOMB
    assert impact.adjustments == Adjustment.LAW_FALLBACK


@pytest.mark.parametrize("law", LAWS_WITH_FRICTION)
def test_t2_reverses_or_sticks(law):
    regime = rod_on_plane(T2).resolve(law).regime
    assert regime is (Regime.STICKING if law is Law.MOREAU else Regime.REVERSED)


def ball(v: float, surface_speed: float, v_n: float = -1.0) -> Body:
    """A solid sphere of 2 kg and 0.1 m over the plane y = 0, spinning about z."""
    return Body.dynamic(
        2.0, sphere(2.0, 0.1).inertia, (0.0, 0.1, 0.0), None, (v, v_n, 0.0), (0.0, 0.0, -surface_speed / 0.1)
    )


@pytest.mark.parametrize("law", LAWS_WITH_FRICTION)
@pytest.mark.parametrize(("mu", "sticks"), [(0.19, False), (0.1905, True)])
def test_t7_a_sphere_sticks_iff_friction_suffices(law, mu, sticks):
    """``2/7 |u_t| <= mu (1 + e) |v_n|``: with u_t = 1, e = 0.5 the limit is mu = 4/21 = 0.190476."""
    impact = resolve(
        ball(1.0, 0.0), Body.static(), Contact.of((0, 0, 0), (0, 1, 0), 0.5, mu), ImpactModel(law=law)
    )
    assert impact.regime is (Regime.STICKING if sticks else Regime.SLIDING)
    assert impact.impulse.x == pytest.approx(-2 * (2 / 7 if sticks else 1.5 * mu), rel=1e-14)


def test_t7_superball():
    """Garwin's ball, e = e_t = 1: v' = (3v + 4Rw)/7, Rw' = (10v - 3Rw)/7, and nothing is lost."""
    impact = resolve(
        ball(1.0, 3.0),
        Body.static(),
        Contact.of((0, 0, 0), (0, 1, 0), 1.0, friction=10.0),
        ImpactModel(law=Law.COULOMB, tangential_restitution=1.0),
    )
    assert impact.twist_a.linear.x == pytest.approx(15 / 7, rel=1e-14)
    assert -0.1 * impact.twist_a.angular.z == pytest.approx(1 / 7, rel=1e-14)
    assert impact.kinetic_energy_after == pytest.approx(impact.kinetic_energy_before, rel=1e-14)


def test_t9_three_balls_in_a_row():
    """Newton's cradle, one contact at a time: all the motion arrives at the far ball."""
    speeds = [1.0, 0.0, 0.0]
    for i, j in [(0, 1), (1, 2)]:
        left, right = (Body.dynamic(1.0, velocity=(speeds[k], 0.0, 0.0)) for k in (i, j))
        impact = resolve(left, right, Contact.of((0, 0, 0), normal=(-1, 0, 0), restitution=1.0))
        speeds[i], speeds[j] = impact.twist_a.linear.x, impact.twist_b.linear.x
    assert speeds == [0.0, 0.0, 1.0]


def exact_bodies() -> tuple[Body, Body]:
    a = Body.dynamic(
        F(2), map(F, (3, 1, -1, 4, F(1, 2), 5)), map(F, (1, 2, -1)), map(F, (1, 2, -2, 4)),
        map(F, (-1, F(1, 2), 2)), map(F, (F(1, 2), -1, 2)),
    )  # fmt: skip
    b = Body.dynamic(
        F(5), map(F, (6, -1, 1, 7, 2, 8)), map(F, (-1, 0, 1)), None,
        map(F, (2, 1, F(-1, 2))), map(F, (1, F(1, 4), F(-1, 2))),
    )  # fmt: skip
    return a, b


EXACT_CONTACT = Contact.of(map(F, (0, 1, 1)), map(F, (2, 1, -2)), F(3, 4), F(10))
PARAMETERS = Parameters(F(3, 4), F(10), F(1, 2))


@pytest.mark.parametrize("law", [frictionless, chatterjee_ruina])
@pytest.mark.parametrize("geometry", [Point, Planar, Spatial])
def test_conservation_is_exact_in_exact_arithmetic(law, geometry):
    """Momentum, angular momentum, ``u_n+ = -e u_n`` and the energy's books, with no rounding at all."""
    a, b = exact_bodies()
    if geometry is Planar:
        a, b = (body._replace(orientation=None) for body in (a, b))
    approach = geometry.prepare(a, b, EXACT_CONTACT)
    outcome = law(approach, PARAMETERS)
    response = approach.respond(outcome.impulse)
    n = approach.n
    assert n.dot(response.velocity_after) == -PARAMETERS.restitution * approach.n_u

    assert response.change_a.linear * a.mass + response.change_b.linear * b.mass == (0, 0, 0)
    if geometry is Spatial:
        after_a, after_b = a.moved_by(response.change_a), b.moved_by(response.change_b)
        for body, arm, change, impulse in (
            (a, approach.r_a, response.change_a, response.impulse),
            (b, approach.r_b, response.change_b, -response.impulse),
        ):
            q = body.orientation
            in_body = change.angular if q is None else q.to_body(change.angular)
            gained = body.inertia @ in_body
            assert (gained if q is None else q.to_world(gained)) == arm.cross(impulse)
        work = outcome.impulse.dot(approach.u + response.velocity_after) / 2
        energy = [sum(map(kinetic_energy, pair)) for pair in ((a, b), (after_a, after_b))]
        assert energy[1] - energy[0] == work
        assert work < 0


@pytest.mark.parametrize("law", [frictionless, chatterjee_ruina])
@pytest.mark.parametrize("geometry", [Point, Planar, Spatial])
@pytest.mark.parametrize("mu", [0.05, 10.0])
def test_one_law_on_floats_arrays_and_fractions(law, geometry, mu):
    """The array of many contacts gives, element by element, what a float gives alone: to the bit."""
    a, b = exact_bodies()
    speeds = [F(k, 4) for k in range(5)]

    def answer(number, speed):
        bodies = [_converted(body, number) for body in (a, b)]
        bodies[0] = bodies[0]._replace(velocity=bodies[0].velocity._replace(x=number(-1 - speed)))
        approach = geometry.prepare(*bodies, _converted(EXACT_CONTACT, number))
        return law(approach, Parameters(number(F(3, 4)), number(F(mu)), number(F(1, 2)))).impulse

    exact = [answer(F, speed) for speed in speeds] if (law is frictionless or mu > 1) else None
    floats = [answer(float, speed) for speed in speeds]
    whole = np.array([float(-1 - s) for s in speeds])
    bodies = [_converted(body, float) for body in (a, b)]
    bodies[0] = bodies[0]._replace(velocity=bodies[0].velocity._replace(x=whole))
    approach = geometry.prepare(*bodies, _converted(EXACT_CONTACT, float))
    together = law(approach, Parameters(0.75, mu, 0.5)).impulse

    for i in range(len(speeds)):
        assert tuple(np.broadcast_to(c, 5)[i] for c in together) == floats[i]
        if exact is not None:
            # some fifty roundings, at a condition number of K below 20
            assert floats[i] == pytest.approx([float(c) for c in exact[i]], rel=1e-13)


def _converted(value, number):
    if isinstance(value, tuple):
        return type(value)(*(_converted(part, number) for part in value))
    return None if value is None else number(value)


ORACLE_TOLERANCE = {Law.COULOMB: 1e-12, Law.MOREAU: 1e-11, Law.ROUTH_POISSON: 1e-9, Law.ROUTH_STRONGE: 1e-9}
"""Relative, of the impulse: rounding at condition numbers up to 1e3 (a root find's at 1e4) for the
algebraic laws; for the integrated ones what is asked of them."""


@pytest.mark.parametrize("law", [Law.COULOMB, Law.ROUTH_POISSON, Law.ROUTH_STRONGE])
@pytest.mark.parametrize("seed", range(6))
def test_against_the_oracle(law, seed):
    _agree(random_scene(seed), law, ORACLE_TOLERANCE[law])


@pytest.mark.parametrize("law", [Law.ROUTH_POISSON, Law.ROUTH_STRONGE])
@pytest.mark.parametrize(("seed", "mu"), [*product(range(100, 104), [0.5, 1.5, 3.0])])
def test_slender_bodies_against_the_oracle(law, seed, mu):
    _agree(random_scene(seed, slender=True, friction=mu), law, ORACLE_TOLERANCE[law])


def rod_in_space(
    u_t: float, mu: float, *, lean: float = 2.0, drift: float = 0.0, thickness: float = 0.0
) -> Scene:
    """A rod of 1 kg and 1 m on a plane, leaning by ``atan(lean)``, in axes turned any way.

    ``drift`` is slip across the plane of the rod, ``thickness`` that of the rod [m].
    """
    angle = math.atan(lean)
    across = 1 / 12 + thickness**2 / 12
    body = Body.dynamic(
        1.0,
        (thickness**2 / 6, 0.0, 0.0, across, 0.0, across),
        position=(0.5 * math.cos(angle), 0.5 * math.sin(angle), 0.0),
        orientation=(0.0, 0.0, math.sin(angle / 2), math.cos(angle / 2)),
        velocity=(u_t, -1.0, drift),
    )
    scene = Scene(body, Body.static(), Contact.of((0, 0, 0), (0, 1, 0), restitution=0.5, friction=mu))
    return scene.turned(Quaternion(0.3, -0.5, 0.2, 0.6))


PATHS = {
    "slips through": (rod_in_space(1.0, 0.05, drift=0.7), Regime.SLIDING),
    "stops and reverses": (rod_in_space(1.0, 0.3, lean=1.0), Regime.REVERSED),
    "stops and sticks": (rod_in_space(0.2, 0.9, drift=0.1), Regime.STICKING),
    "starts without slip, sticks": (rod_in_space(0.0, 0.9), Regime.STICKING),
    "starts without slip, slips": (rod_in_space(0.0, 0.3), Regime.SLIDING),
    "jams": (rod_in_space(-0.5, 1.9, thickness=0.05), Regime.JAMMED),
    "jams while it turns": (rod_in_space(-0.5, 1.9, drift=0.2, thickness=0.05), Regime.JAMMED),
    "thin, K nearly singular": (rod_in_space(0.4, 0.6, drift=0.3, thickness=1e-5), Regime.STICKING),
    "near-central": (
        Scene(
            ball(1.0, 2.0)._replace(position=Vec3(1e-9, 0.1, -3e-9), velocity=Vec3(1.0, -1.0, 0.5)),
            Body.static(),
            Contact.of((0, 0, 0), (0, 1, 0), 0.6, 0.2),
        ),
        Regime.STICKING,
    ),
}


@pytest.mark.parametrize("law", [Law.ROUTH_POISSON, Law.ROUTH_STRONGE], ids=lambda law: law.name)
@pytest.mark.parametrize("path", PATHS)
def test_every_kind_of_path_against_the_oracle(path, law):
    scene, regime = PATHS[path]
    assert _agree(scene, law, ORACLE_TOLERANCE[law]).regime is regime


@pytest.mark.parametrize("seed", range(200, 206))
def test_moreau_against_the_oracle(seed):
    scene = random_scene(seed)
    approach = Spatial.prepare(*scene)
    raw = one_step(approach, Parameters(scene.contact.restitution, scene.contact.friction))
    expected = scene.by_oracle(Law.MOREAU)
    assert raw.impulse == pytest.approx(
        [float(x) for x in expected.impulse], rel=ORACLE_TOLERANCE[Law.MOREAU]
    )


@pytest.mark.parametrize("tolerance", [1e-3, 1e-6, 1e-9])
@pytest.mark.parametrize("seed", range(300, 304))
def test_routh_is_as_exact_as_asked(tolerance, seed):
    _agree(random_scene(seed), Law.ROUTH_STRONGE, tolerance, tolerance=tolerance)


def _agree(scene: Scene, law: Law, relative: float, **model) -> Impact:
    impact = scene.resolve(law, geometry=Geometry.SPATIAL, **model)
    expected = Vec3(*(float(x) for x in scene.by_oracle(law, digits=20).impulse))
    assert (impact.impulse - expected).norm() <= relative * expected.norm()
    return impact
