"""resolve(): what AUTO chooses, what is refused, and what is reported."""

from __future__ import annotations

import math
import re
from decimal import Decimal
from fractions import Fraction as F
from functools import partial
from itertools import product

import numpy as np
import pytest
from collisions import EVERY_LAW, Collision, collisions, planar_collisions
from hypothesis import given, settings
from refusals import refused

from collision_response import (
    Adjustment,
    Body,
    Contact,
    Geometry,
    ImpactError,
    ImpactModel,
    Law,
    Precision,
    Regime,
    StatusCode,
    resolve,
    resolve_scene,
)
from collision_response.batch import body_rows, contact_rows, resolve_batch
from collision_response.derivatives import differentiate
from collision_response.physics.combine import combine
from collision_response.physics.energy import kinetic_energy
from collision_response.physics.mass_properties import Particle, box, of_particles, rod
from collision_response.physics.orientation import Quaternion
from collision_response.physics.vector import ZERO, Vec3
from collision_response.status import LONGEST

BALL = Body.dynamic(1.0, (0.4, 0.0, 0.0, 0.4, 0.0, 0.4), (0.0, 0.0, 1.0), None, (0.0, 0.0, -2.0))
FLOOR = Body.static()
CONTACT = Contact.of((0.0, 0.0, 0.0), normal=(0.0, 0.0, 1.0), restitution=0.5)
EXTENDED = ImpactModel(precision=Precision.EXTENDED)
NAN, INF = math.nan, math.inf


def body(**changes) -> Body:
    given = {"mass": 1.0, "inertia": (0.4, 0.0, 0.0, 0.4, 0.0, 0.4), **changes}
    return Body.dynamic(**given)


def strike(floor: Body = FLOOR, contact: Contact = CONTACT, model: ImpactModel | None = None, **changes):
    """A body with ``changes`` strikes a floor."""
    return resolve(body(**changes), floor, contact, model or ImpactModel())


def touch(**changes):
    """The ball strikes the floor at a contact with ``changes``."""
    return resolve(BALL, FLOOR, CONTACT._replace(**changes))


def answer_by(**fields):
    """A body strikes the floor, by a model with these fields."""
    return strike(model=ImpactModel(**fields))


ROTATED, INERTIA = "body_a.orientation", "body_a.inertia"
REFUSALS = [
    *(("INVALID_MASS", "body_a.mass", partial(strike, mass=mass)) for mass in (0.0, -1.0, -INF, 5e-309)),
    ("NOT_FINITE", "body_a.mass", partial(strike, mass=NAN)),
    *(
        ("NOT_FINITE", f"body_b.{field}", partial(resolve, BALL, body(**{field: (0.0, wrong, 0.0)}), CONTACT))
        for field in ("position", "velocity", "angular_velocity", "com")
        for wrong in (NAN, INF)
    ),
    ("NOT_FINITE", INERTIA, partial(strike, inertia=(1.0, 0.0, 0.0, 1.0, NAN, 1.0))),
    ("INVALID_INERTIA", INERTIA, partial(strike, mass=INF)),  # of an immovable body
    ("INVALID_INERTIA", INERTIA, partial(strike, inertia=(-1.0, 0.0, 0.0, 1.0, 0.0, 1.0))),
    ("INVALID_INERTIA", INERTIA, partial(strike, inertia=(1.0, 1.1, 0.0, 1.0, 0.0, 1.5))),  # indefinite
    ("INVALID_INERTIA", INERTIA, partial(strike, inertia=(1.0, 0.0, 0.0, 1.0, 0.0, 2.001))),  # no triangle
    ("INVALID_INERTIA", INERTIA, partial(strike, inertia=(0.0, 1.0, 0.0, 0.0, 0.0, 0.0))),
    ("INVALID_ORIENTATION", ROTATED, partial(strike, orientation=(0.0, 0.0, 0.0, 0.0))),
    ("NOT_FINITE", ROTATED, partial(strike, orientation=(0.0, NAN, 0.0, 1.0))),
    ("INVALID_NORMAL", "contact.normal", partial(touch, normal=Vec3(0.0, 0.0, 0.0))),
    ("NOT_FINITE", "contact.normal", partial(touch, normal=Vec3(0.0, 0.0, NAN))),
    ("NOT_FINITE", "contact.position", partial(touch, position=Vec3(0.0, 0.0, INF))),
    (  # across the plane
        "INVALID_NORMAL",
        "contact.normal",
        partial(strike, position=(0.1, 0.0, 1.0), model=ImpactModel(geometry=Geometry.PLANAR)),
    ),
    *(("INVALID_COEFFICIENT", "contact.restitution", partial(touch, restitution=e)) for e in (-0.1, 1.1)),
    ("NOT_FINITE", "contact.restitution", partial(touch, restitution=NAN)),
    (
        "INVALID_COEFFICIENT",
        "contact.restitution(approach_speed)",
        partial(touch, restitution=lambda speed: speed),
    ),
    ("INVALID_COEFFICIENT", "contact.friction", partial(touch, friction=-0.1)),
    ("NOT_FINITE", "contact.friction", partial(touch, friction=INF)),
    ("INVALID_COEFFICIENT", "model.tangential_restitution", partial(answer_by, tangential_restitution=1.5)),
    ("INVALID_MODEL", "model.law", partial(answer_by, law=17)),
    ("INVALID_MODEL", "model.geometry", partial(answer_by, geometry=0)),
    ("INVALID_MODEL", "model.precision", partial(answer_by, precision="double")),
    ("INVALID_MODEL", "model.tolerance", partial(answer_by, tolerance=-1e-3)),
    ("INVALID_MODEL", "model.restitution_threshold", partial(answer_by, restitution_threshold=-1.0)),
    *(
        ("NOT_FINITE", f"model.{field}", partial(answer_by, **{field: value}))
        for field in ("tolerance", "restitution_threshold", "tangential_restitution")
        for value in (NAN, INF)
    ),
    ("NO_DYNAMIC_BODY", "body_a", partial(resolve, Body.kinematic(velocity=(1.0, 0.0, 0.0)), FLOOR, CONTACT)),
    ("SAME_BODY", "body_b", partial(resolve, BALL, BALL, CONTACT)),
    ("NOT_FINITE", "body_a.velocity", partial(strike, velocity=(10**400, 0, -1))),
    ("OUT_OF_RANGE", "result", partial(strike, velocity=(0.0, 0.0, -1e308), position=(0.0, 0.0, 1.0))),
]


@pytest.mark.parametrize(("code", "field", "call"), REFUSALS)
def test_an_invalid_request_is_refused_with_its_code_and_field(code, field, call):
    with refused(StatusCode[code], field, "^" + re.escape(field)):
        call()


def test_an_impact_error_is_a_value_error_with_the_reason():
    with pytest.raises(ValueError, match=r"body_a\.inertia.*greater than the sum of the other two.* 2\.001"):
        resolve(body(inertia=(1.0, 0.0, 0.0, 1.0, 0.0, 2.001)), FLOOR, CONTACT)


@pytest.mark.parametrize(
    "inertia",
    [rod(1.0, 2.0).inertia, box(1.0, (1.0, 1.0, 0.0)).inertia, (0.0,) * 6],
    ids=["rod", "plate", "point"],
)
@pytest.mark.parametrize("orientation", [None, (0.1, -0.7, 0.3, 0.5)])
def test_rods_plates_and_points_are_valid(inertia, orientation):
    falling = body(
        inertia=inertia, orientation=orientation, position=(0.3, 0.2, 0.5), velocity=(0.0, 0.0, -1.0)
    )
    impact = resolve(falling, FLOOR, CONTACT)
    assert impact.normal_velocity_after == pytest.approx(0.5, rel=1e-14)
    assert impact.kinetic_energy_after < impact.kinetic_energy_before


DUMBBELLS = [
    *((round(math.cos(i), 2), round(math.sin(2 * i), 2), round(math.sin(3 * i), 1)) for i in range(1, 60)),
    *((1.0, 0.3 * 10.0**-i, -0.7 * 10.0**-j) for i, j in product(range(0, 9, 2), repeat=2)),
]


@pytest.mark.parametrize("law", [Law.FRICTIONLESS, Law.COULOMB, Law.MOREAU, Law.ROUTH_STRONGE])
@pytest.mark.parametrize("precision", [Precision.AUTO, Precision.DOUBLE, Precision.EXTENDED])
def test_two_particles_have_no_inertia_about_their_line_in_any_axes(law, precision):
    """Rounding gives the tensor a moment of 1e-16 there. Whether that counts must not depend on the axes."""
    contact, model = CONTACT._replace(friction=0.3), ImpactModel(law, precision=precision)
    for place, order in product(DUMBBELLS, ((0, 1, 2), (1, 2, 0), (2, 0, 1), (1, 0, 2))):
        arm = Vec3(*(place[i] for i in order))
        mass, _, inertia = of_particles([Particle(0.7, arm), Particle(0.7, -arm)])
        dumbbell = Body.dynamic(
            mass, inertia, (0.3, 0.2, 0.5), velocity=(0.1, -0.2, -1.0), angular_velocity=arm
        )
        # the same rod along x, turned by half a turn about the axis halfway between x and the arm
        halfway = arm + Vec3(arm.norm(), 0.0, 0.0)
        length = mass * arm.dot(arm)
        own_axes = dumbbell._replace(
            inertia=dumbbell.inertia._replace(xx=0.0, xy=0.0, xz=0.0, yy=length, yz=0.0, zz=length),
            orientation=(*halfway, 0.0),
        )
        impact, expected = (resolve(one, FLOOR, contact, model) for one in (dumbbell, own_axes))
        assert impact.adjustments & Adjustment.MASSLESS_SPIN
        allowed = {"rel": 1e-12, "abs": 1e-12 + 2 * impact.error_bound}  # the two tensors differ by rounding
        assert impact.error_bound < 1e-10
        assert impact.impulse == pytest.approx(expected.impulse, **allowed)
        assert impact.change_a.angular == pytest.approx(expected.change_a.angular, **allowed)


@pytest.mark.parametrize("angle", [0.02 * k for k in range(1, 79)])
def test_the_tensor_of_a_rod_in_a_plane_has_no_inertia_about_it(angle):
    """``I (1 - a a^T)`` has roundings of the size of ``I``, also where its component is small."""
    c, s = math.cos(angle), math.sin(angle)
    rod = Body.dynamic(
        1.0,
        ((1 - c * c) / 3, 0.0, -c * s / 3, 1 / 3, 0.0, (1 - s * s) / 3),
        (c, 0.0, s),
        velocity=(0.3, 0.1, -1.0),
        angular_velocity=(0.2, 0.1, 0.3),
    )
    for law in Law:
        impact = resolve(rod, FLOOR, CONTACT._replace(position=ZERO, friction=0.1), ImpactModel(law))
        assert impact.error_bound < 1e-9
        assert impact.adjustments == Adjustment.MASSLESS_SPIN
        assert abs(impact.change_a.angular.dot(Vec3(c, 0.0, s))) < 1e-9


@pytest.mark.parametrize("precision", [Precision.SINGLE, Precision.DOUBLE, Precision.EXTENDED])
def test_a_rod_that_turns_across_its_axis_has_no_massless_spin(precision):
    """The spins are exactly perpendicular to the rods. Turning them into body axes adds rounding."""
    contact, model = CONTACT._replace(restitution=0.5), ImpactModel(precision=precision)
    for x, y, z, w in product((0.0, 1.0, 2.0), (0.0, 2.0), (1.0, 3.0), (1.0, 2.0)):
        axis = Vec3(w * w + x * x - y * y - z * z, 2 * (x * y + w * z), 2 * (x * z - w * y))
        across = Vec3(1.0, 2.0, 3.0).cross(axis)
        rod = Body.rod(
            1.0, 1.0, orientation=(x, y, z, w), velocity=(0.0, 0.0, -99.0), angular_velocity=across
        )
        turning, rolling = rod, rod._replace(angular_velocity=across + axis)
        for body, expected in ((turning, Adjustment.NONE), (rolling, Adjustment.MASSLESS_SPIN)):
            answers = resolve(body, FLOOR, contact, model), resolve_scene([body, FLOOR], [(0, 1)], [contact])
            for answer in answers:
                assert answer.adjustments & Adjustment.MASSLESS_SPIN == expected


def test_a_point_mass_does_not_spin():
    point = Body.dynamic(1.0, position=(0.3, 0.0, 0.0), velocity=(0.0, 0.0, -1.0), angular_velocity=(0, 9, 0))
    impact = resolve(point, FLOOR, CONTACT)
    assert impact.twist_a == ((0, 0, 0.5), (0, 9, 0))
    assert impact.adjustments == Adjustment.MASSLESS_SPIN
    assert resolve(point._replace(angular_velocity=ZERO), FLOOR, CONTACT).adjustments == Adjustment.NONE


def test_a_kinematic_body_spins_as_prescribed():
    wheel = Body.kinematic((0.0, 0.0, -1.0), angular_velocity=(0.0, 2.0, 0.0))
    impact = resolve(BALL, wheel, CONTACT._replace(friction=0.1), ImpactModel(Law.COULOMB))
    assert impact.adjustments == Adjustment.NONE
    assert impact.impulse.x == pytest.approx(
        0.1 * impact.impulse.z, rel=1e-14
    )  # friction drags the ball along


# Geometry.


@pytest.mark.parametrize(
    ("geometry", "collision"),
    [
        (Geometry.POINT, Collision(BALL, FLOOR, CONTACT)),
        (
            Geometry.POINT,
            Collision(Body.dynamic(1.0), Body.dynamic(2.0), Contact.of((5, 6, 7), (1, 2, 3), friction=0.5)),
        ),
        (Geometry.SPATIAL, Collision(BALL, FLOOR, CONTACT._replace(friction=0.3))),
        (Geometry.SPATIAL, Collision(BALL, FLOOR, Contact.of((0.1, 0, 0), (0, 0, 1)))),
        (Geometry.PLANAR, Collision(body(position=(0.1, 1.0, 0.0)), FLOOR, Contact.of((0, 0, 0), (0, 1, 0)))),
        (
            Geometry.SPATIAL,
            Collision(body(position=(0.1, 1.0, 0.1)), FLOOR, Contact.of((0, 0, 0), (0, 1, 0))),
        ),
        (
            Geometry.SPATIAL,
            Collision(
                body(position=(0.1, 1.0, 0.0), velocity=(0, -1, 0.5)),
                FLOOR,
                Contact.of((0, 0, 0), (0, 1, 0), friction=0.5),
            ),
        ),
        (
            Geometry.PLANAR,
            Collision(
                body(position=(0.1, 1.0, 0.0), velocity=(0, -1, 0.5)), FLOOR, Contact.of((0, 0, 0), (0, 1, 0))
            ),
        ),
        (
            Geometry.SPATIAL,
            Collision(
                body(position=(0.1, 1.0, 0.0), inertia=(0.4, 0.0, 0.1, 0.4, 0.0, 0.4)),
                FLOOR,
                Contact.of((0, 0, 0), (0, 1, 0)),
            ),
        ),
    ],
    ids=[
        "central",
        "points rub",
        "rubs",
        "off-centre",
        "in plane",
        "off plane",
        "slides out",
        "glides",
        "coupled",
    ],
)
def test_the_cheapest_exact_geometry_is_chosen_and_named(geometry, collision):
    assert resolve(*collision).model.geometry is geometry
    assert resolve(*collision, ImpactModel(tolerance=0.5)).model.geometry is geometry


@pytest.mark.parametrize("friction", [0.0, 0.4])
def test_the_chosen_geometry_is_exact(friction):
    @settings(max_examples=40, deadline=None)
    @given(collision=planar_collisions() | collisions())
    def holds(collision: Collision) -> None:
        contact = collision.contact._replace(friction=friction)
        chosen = resolve(collision.body_a, collision.body_b, contact)
        spatial = resolve(collision.body_a, collision.body_b, contact, ImpactModel(geometry=Geometry.SPATIAL))
        for name in ("twist_a", "twist_b"):
            for part, exact in zip(getattr(chosen, name), getattr(spatial, name), strict=True):
                # rounding, at condition numbers below 1e3
                assert (part - exact).norm() <= 1e-11 * (exact.norm() + 1e-3)

    holds()


@pytest.mark.parametrize("geometry", [Geometry.POINT, Geometry.PLANAR])
def test_the_bound_covers_what_a_forced_geometry_leaves_out(geometry):
    """Against the full answer, in the norm of the bound. Twists must differ by the changes."""
    left_out = 0

    @settings(max_examples=60, deadline=None)
    @given(collision=collisions())
    def holds(collision: Collision) -> None:
        nonlocal left_out
        if not (collision.contact.normal.x or collision.contact.normal.y):
            return
        flat, whole = collision.resolve(Law.AUTO, geometry=geometry), collision.resolve(Law.AUTO)
        assert flat.model.geometry is geometry
        if flat.error_bound == math.inf:
            assert flat.status is StatusCode.TOLERANCE_NOT_MET
            return
        left_out += flat.error_bound > 1e-3
        room = flat.error_bound * whole.impulse.norm() * (1 + 1e-9)
        assert (flat.impulse - whole.impulse).norm() <= room
        for before, change, after in (
            (collision.body_a, flat.change_a, flat.twist_a),
            (collision.body_b, flat.change_b, flat.twist_b),
        ):
            assert after.linear == before.velocity + change.linear
            assert after.angular == before.angular_velocity + change.angular
        if geometry is Geometry.POINT:
            assert flat.change_a.angular == (0, 0, 0)
        else:
            assert flat.impulse.z == flat.change_a.linear.z == flat.change_a.angular.x == 0

    holds()
    assert left_out > 5


@pytest.mark.parametrize("law", EVERY_LAW)
@pytest.mark.parametrize("friction", [0.0, 0.3])
@pytest.mark.parametrize("geometry", [Geometry.POINT, Geometry.PLANAR])
def test_a_forced_geometry_reports_the_energy_of_its_twists(geometry, friction, law):
    """Also if the reference point is not the centre of mass, and the body turns about axes that are left out.

    Products of inertia then couple what is left out to the rotation about z. No twists gain energy.
    """
    for com, coupling, orientation in product(
        product((-0.25, 0.25), repeat=3), (-0.1, 0.0, 0.1), (None, (1, 2, 3, 4), (0, 0, 1, -2))
    ):
        inertia = (0.3, 0, coupling, 0.4, coupling / 2, 0.5)
        thrown = Body.dynamic(2.0, inertia, (0.2, 1, 0.1), orientation, (0.5, -3, 0.25), (1.5, -2, 0.75), com)
        contact = Contact.of((0, 0, 0), (0, 1, 0), 1.0, friction)
        impact = resolve(thrown, FLOOR, contact, ImpactModel(law, geometry, tolerance=10.0))
        assert impact.regime is not Regime.SEPARATING
        before, after = kinetic_energy(thrown), kinetic_energy(thrown.with_twist(impact.twist_a))
        rounding = 1e-14 * before
        assert impact.kinetic_energy_before == pytest.approx(before, abs=rounding)
        assert impact.kinetic_energy_after == pytest.approx(after, abs=rounding)
        assert after <= before + rounding


@pytest.mark.parametrize("friction", [0.0, 0.2])
def test_planar_uses_the_moment_about_the_axis_that_the_body_turns_about(friction):
    """That is the y axis of the body, which points along z, so PLANAR leaves out nothing."""
    turned = Body.dynamic(
        1.0, (1, 0, 0, 2, 0, 3), (0.3, 1, 0), (1, 0, 0, 1), (0.5, -1, 0), (0, 0, 0.4), com=(0.1, 0, 0.2)
    )
    contact = Contact.of((0, 0, 0), (0, 1, 0), 1.0, friction)
    planar = resolve(turned, FLOOR, contact, ImpactModel(geometry=Geometry.PLANAR, tolerance=1e-12))
    assert planar.status is StatusCode.OK
    assert planar.kinetic_energy_after == pytest.approx(
        kinetic_energy(turned.with_twist(planar.twist_a)), rel=1e-14
    )


def test_planar_ignores_the_rounding_of_a_moment_that_is_0():
    """A thin rod, turned so that its axis is along z up to rounding: no rotation is excited."""
    rod_along_z = Body.dynamic(
        1.0, (0, 0, 0, 1, 0, 1), (0, 1, 0), (0, -math.sqrt(0.5), 0, math.sqrt(0.5)), (0, -1, 0)
    )
    contact = Contact.of((0.25, 0, 0), (0, 1, 0), 0.5)
    planar = resolve(rod_along_z, FLOOR, contact, ImpactModel(geometry=Geometry.PLANAR))
    assert planar.impulse.y == pytest.approx(1.5, rel=1e-14)


def test_a_geometry_that_leaves_nothing_out_is_exact():
    for geometry in (Geometry.POINT, Geometry.PLANAR, Geometry.SPATIAL):
        contact = CONTACT._replace(normal=Vec3(0.0, 1.0, 0.0))
        falling = BALL._replace(position=Vec3(0.0, 1.0, 0.0), velocity=Vec3(0.0, -2.0, 0.0))
        impact = resolve(falling, FLOOR, contact, ImpactModel(geometry=geometry))
        assert impact.twist_a.linear == (0, 1, 0)
        assert impact.error_bound < 1e-14
        assert impact.model.geometry is geometry


PARTICLE, SPHERE = Body.dynamic(2.0), Body.sphere(2.0, 0.5)
DOWN_AND_ACROSS = Vec3(-1.0, 0.0, -3.0)


@pytest.mark.parametrize("number", [float, F], ids=["floats", "fractions"])
@pytest.mark.parametrize("body", [PARTICLE, SPHERE], ids=["particle", "sphere"])
def test_planar_is_planar_where_point_suffices(body, number):
    """POINT moves in space: it suffices here, but is no smaller than PLANAR."""
    arm = Vec3(-0.5, 0.0, 0.0) if body is SPHERE else ZERO
    body = body._replace(velocity=Vec3(*map(number, DOWN_AND_ACROSS)))
    contact = Contact.of(arm, (1, 0, 0), number(1))
    assert resolve(body, Body.static(), contact).model.geometry is Geometry.POINT
    impact = resolve(body, Body.static(), contact, ImpactModel(geometry=Geometry.PLANAR))
    assert (impact.model.geometry, impact.impulse) == (Geometry.PLANAR, (4, 0, 0))
    assert impact.twist_a.linear == (1, 0, -3)
    assert impact.error_bound < 1e-14


@pytest.mark.parametrize("friction", [0.5, lambda slip_speed: 0.5], ids=["number", "function"])
@pytest.mark.parametrize("law", [Law.COULOMB, Law.ROUTH_STRONGE], ids=lambda law: law.name)
def test_friction_in_the_plane_leaves_out_slip_across_it(law, friction):
    """Coulomb's limit is 1 N s here. All slip is along z, so the whole tangential impulse is left out."""
    body = PARTICLE._replace(velocity=DOWN_AND_ACROSS)
    contact = Contact.of((0, 0, 0), (1, 0, 0), 0.0, friction)
    impact = resolve(body, Body.static(), contact, ImpactModel(law, Geometry.PLANAR))
    assert impact.impulse == (2, 0, 0)
    assert 1 <= impact.error_bound * math.hypot(2, 1) < 1 + 1e-10  # with the error of the path


def test_planar_refuses_a_normal_out_of_its_plane_where_point_suffices():
    body = PARTICLE._replace(velocity=DOWN_AND_ACROSS)
    with refused(StatusCode.INVALID_NORMAL, "contact.normal", "must not be along z"):
        resolve(body, Body.static(), Contact.of((0, 0, 0), (0, 0, 1)), ImpactModel(geometry=Geometry.PLANAR))


@pytest.mark.parametrize(("mass", "moment"), [(1e-200, 1e150), (1e-160, 1e160)])
def test_the_bound_of_a_forced_geometry_is_known_whatever_the_radius_of_gyration(mass, moment):
    """A body is struck at its radius of gyration by a point of the same mass: 1/m + 1/m + 1/m = n.Kn.

    Without rotation the impulse is 3/2 as large. Relative to the change of twist, dv is wrong by 1/2 and
    dw by all of it, and both have the same size.
    """
    arm = math.sqrt(moment) / math.sqrt(mass)
    wheel = Body.dynamic(mass, (moment, 0, 0, moment, 0, moment), velocity=(0.0, 0.0, -1.0))
    point = Body.dynamic(mass, position=(arm, 0.0, 0.0))
    contact = Contact.of((arm, 0.0, 0.0), normal=(0.0, 0.0, 1.0), restitution=0.5)
    impact = resolve(wheel, point, contact, ImpactModel(geometry=Geometry.POINT))
    assert impact.impulse.z == pytest.approx(1.5 * resolve(wheel, point, contact).impulse.z, rel=1e-12)
    assert impact.error_bound == pytest.approx(math.sqrt((0.5**2 + 1) / 2), rel=1e-9)


@pytest.mark.parametrize("normal", [(0.0, 0.0, 1.0), (F(0), F(1, 3), F(1))])
def test_fractions_beyond_float64_in_a_forced_geometry_are_out_of_range(normal):
    big = F(10) ** 308
    contact = Contact.of((0.5, 0.0, 0.0), normal, restitution=1.0)
    fast = body(mass=F(1), velocity=(big, 0, -big), angular_velocity=(big, big, big))
    assert resolve(fast, FLOOR, contact).error_bound == 0.0
    with refused(StatusCode.OUT_OF_RANGE, "result"):
        resolve(fast, FLOOR, contact, ImpactModel(geometry=Geometry.POINT))


def test_a_tolerance_below_float64_is_a_tolerance():
    model, falling = ImpactModel(tolerance=F(1, 10**400)), {"velocity": (0.3, 0.1, -1.0)}
    rounded = strike(model=model, position=(0.1, 0.2, 0.3), **falling)
    assert rounded.error_bound > 0 and rounded.status is StatusCode.TOLERANCE_NOT_MET
    exact = strike(model=model, position=(F(1, 10), F(1, 5), F(3, 10)), **falling)
    assert exact.error_bound == 0 and exact.status is StatusCode.OK


def test_a_forced_geometry_that_misses_the_tolerance_says_so():
    ball = body(position=(0.1, 0.0, 1.0), velocity=(0.0, 0.0, -1.0))
    rough = resolve(ball, FLOOR, CONTACT, ImpactModel(geometry=Geometry.POINT, tolerance=1e-3))
    assert rough.status is StatusCode.TOLERANCE_NOT_MET
    assert 1e-3 < rough.error_bound < math.inf or rough.error_bound == math.inf
    fine = resolve(ball, FLOOR, CONTACT, ImpactModel(tolerance=1e-3))
    assert fine.status is StatusCode.OK
    assert fine.model.geometry is Geometry.SPATIAL


# What is reported.


def test_separating_bodies_get_no_impulse():
    impact = resolve(BALL._replace(velocity=-BALL.velocity), FLOOR, CONTACT)
    assert impact.status is StatusCode.SEPARATING
    assert impact.regime is Regime.SEPARATING
    assert impact.impulse == (0, 0, 0)
    assert impact.twist_a.linear == (0, 0, 2)
    assert impact.effective_mass == 1.0


def test_an_answer_says_what_was_modelled():
    impact = resolve(BALL, FLOOR, CONTACT._replace(friction=0.3))
    assert impact.model == ImpactModel(Law.COULOMB, Geometry.SPATIAL, Precision.DOUBLE)
    frictionless = resolve(BALL, FLOOR, CONTACT._replace(friction=0.3), ImpactModel(law=Law.FRICTIONLESS))
    assert frictionless.contact.friction == 0.0


def test_a_quaternion_of_another_length_is_normalised_and_reported():
    tilted = body(orientation=(0.0, 0.0, 0.3, 0.4), position=(0.3, 0.1, 1.0), velocity=(0.0, 0.0, -1.0))
    unit = tilted._replace(orientation=type(tilted.orientation)(0.0, 0.0, 0.6, 0.8))
    said, silent = resolve(tilted, FLOOR, CONTACT), resolve(unit, FLOOR, CONTACT)
    assert said.adjustments == Adjustment.NORMALISED_ORIENTATION
    assert silent.adjustments == Adjustment.NONE
    assert said.twist_a == silent.twist_a


@pytest.mark.parametrize("exponent", [-1040, -1000, -540, -500, 0, 500, 540, 1000])
def test_a_body_converts_vectors_by_quaternions_of_any_length(exponent):
    q, v = (0.125, -0.375, 0.25, 0.5), Vec3(3.0, -2.0, 7.0)
    exact = body()._replace(orientation=Quaternion(*map(F, q)))
    orientation = [math.ldexp(x, exponent) for x in q]
    long = body(inertia=(0.4, 0, 0, 0.5, 0, 0.6), orientation=orientation, angular_velocity=v)
    for converted, expected in ((long.to_world(v), exact.to_world(v)), (long.to_body(v), exact.to_body(v))):
        assert converted == pytest.approx([float(x) for x in expected], rel=1e-15)
    assert kinetic_energy(long) == kinetic_energy(long._replace(orientation=Quaternion(*q)))


# Numbers of any type come in, floats go out.


def test_the_bound_covers_the_rounding_of_the_input():
    third = resolve(body(mass=F(1, 3), velocity=(0, 0, -1)), FLOOR, CONTACT, ImpactModel(Law.COULOMB))
    exact = F(3, 2) * F(1, 3)
    assert abs(F(third.impulse.z) - exact) <= F(third.error_bound) * exact
    assert third.error_bound >= 2.0**-54
    promised = resolve(
        body(mass=F(1, 3), velocity=(0, 0, -1)),
        FLOOR,
        CONTACT,
        ImpactModel(Law.COULOMB, precision=Precision.EXTENDED),
    )
    assert promised.error_bound >= 2.0**-54


@pytest.mark.parametrize(
    "great",
    [10**400, F(10**400), Decimal("1e400"), Decimal("1e5000")],
    ids=["int", "fraction", "decimal", "great decimal"],
)
@pytest.mark.parametrize("field", ["mass", "velocity"])
def test_finite_numbers_beyond_float64_are_refused(field, great):
    """Unlike infinity, such a mass does not make a body immovable."""
    value = great if field == "mass" else (0, 0, -great)
    with refused(
        StatusCode.NOT_FINITE, match=f"^body_a.{field}: must be (a number that float64 holds|finite); is"
    ):
        strike(**{field: value})
    ball = body(mass=2.0, velocity=(0, 0, -1))
    for infinite in (INF, np.float32(INF), Decimal("inf")):
        immovable = resolve(ball, Body.dynamic(infinite), CONTACT)
        assert immovable.twist_a == resolve(ball, Body.static(), CONTACT).twist_a


@pytest.mark.parametrize(
    ("field", "wrong"),
    [
        ("body_a.mass", lambda: strike(mass="1")),
        ("body_a.mass", lambda: strike(mass=True)),
        ("body_a.mass", lambda: strike(mass=1j)),
        ("body_a.velocity.z", lambda: strike(velocity=(0, 0, None))),
        ("body_a.velocity", lambda: resolve(BALL._replace(velocity=(0, 0)), FLOOR, CONTACT)),
        ("body_b", lambda: resolve(BALL, (1, 2), CONTACT)),
        ("contact", lambda: resolve(BALL, FLOOR, None)),
        ("model", lambda: resolve(BALL, FLOOR, CONTACT, Law.COULOMB)),
        ("model.tolerance", lambda: strike(model=ImpactModel(tolerance="1e-3"))),
    ],
)
def test_an_argument_of_the_wrong_type_is_a_type_error_that_names_it(field, wrong):
    with pytest.raises(TypeError, match=f"^{re.escape(field)}: "):
        wrong()


@pytest.mark.parametrize(
    "wrong",
    [
        lambda n: resolve(BALL, FLOOR, CONTACT, ImpactModel(law=n)),
        lambda n: resolve(BALL, FLOOR, CONTACT, ImpactModel(tolerance=n)),
        lambda n: resolve(BALL, FLOOR, CONTACT, n),
        lambda n: resolve(n, FLOOR, CONTACT),
        lambda n: resolve(BALL, n, CONTACT),
        lambda n: resolve(BALL, FLOOR, n),
        lambda n: resolve(BALL._replace(velocity=n), FLOOR, CONTACT),
        lambda n: resolve(BALL._replace(velocity=[n]), FLOOR, CONTACT),
        lambda n: resolve(BALL._replace(mass=[n]), FLOOR, CONTACT),
        lambda n: strike(mass=n),
        lambda n: strike(velocity=n),
        lambda n: strike(inertia=n),
        lambda n: strike(orientation=n),
        lambda n: resolve_scene([n, FLOOR], [(0, 1)], [CONTACT]),
        lambda n: resolve_scene([BALL, FLOOR], [n], [CONTACT]),
        lambda n: resolve_scene([BALL, FLOOR], [(0, 1)], [n]),
        lambda n: resolve_scene([BALL, FLOOR], [(0, n)], [CONTACT]),
        lambda n: resolve_batch(np.zeros((4, 2, 0)), np.zeros((4, 0)), workers=-n),
        lambda n: differentiate(BALL, FLOOR, CONTACT, with_respect_to=[n]),
        lambda n: combine(n, 0.5, 0.5),
    ],
)
def test_integers_too_long_to_print_are_refused(wrong):
    with pytest.raises((TypeError, ValueError), match="of more digits than are shown"):
        wrong(10**5000)


@pytest.mark.parametrize(
    ("ask", "hint"),
    [
        (lambda many: resolve(Body.dynamic(1.0)._replace(velocity=many), FLOOR, CONTACT), ""),
        (lambda many: resolve(Body.dynamic(many), FLOOR, CONTACT), ""),
        (lambda many: resolve(many, FLOOR, CONTACT), "; Body.dynamic(...) and Body.static() make one"),
        (lambda many: Body.dynamic(1.0, velocity=many), ""),
        (lambda many: resolve_scene([Body.dynamic(1.0), FLOOR], [many], [CONTACT]), ""),
    ],
)
def test_a_message_quotes_no_more_than_the_beginning_of_a_value(ask, hint):
    many = [0.5] * 10**5
    with pytest.raises(TypeError) as raised:
        ask(many)
    assert str(raised.value).endswith(f" is {str(many)[:LONGEST]}...{hint}")


def test_a_kinematic_body_keeps_its_twist():
    pusher = Body.kinematic(velocity=(0.0, 0.0, 3.0), angular_velocity=(1.0, 0.0, 0.0))
    impact = resolve(BALL, pusher, CONTACT)
    assert impact.twist_b == (pusher.velocity, pusher.angular_velocity)
    assert impact.twist_a.linear.z == pytest.approx(3.0 + 0.5 * 5.0)


@pytest.mark.parametrize("law", [law for law in Law if law is not Law.AUTO])
@pytest.mark.parametrize("turn", [(3.0, 4.0, 0.0), (1.0, 2.0, 2.0), (2.0, -3.0, 6.0)])
@pytest.mark.parametrize("way", [0.0, 2.0**-40, -(2.0**-40)])
def test_whether_bodies_approach_does_not_depend_on_the_law(law, turn, way):
    """A ball that slips along an oblique wall, or moves very slowly into it or away from it."""
    n = Vec3(*turn)
    along = Vec3(n[1], -n[0], 0.0) + n * way
    ball = Body.sphere(2.0, 1.0, position=n, velocity=along)
    impact = resolve(ball, Body.static(), Contact.of((0, 0, 0), n, 0.75, 0.5), ImpactModel(law))
    assert (impact.status is StatusCode.SEPARATING) == (way >= 0)
    assert way < 0 or (impact.error_bound, impact.model.law, tuple(impact.impulse)) == (0, law, (0, 0, 0))


def test_a_precision_that_leaves_no_digit_is_refused_by_name():
    """In DOUBLE the effective mass of this body, 1e13 m from its reference point, is all rounding."""
    far = Body.dynamic(1.0, (1.5, 0, 0, 1.5, 0, 2), (0, 0, -1e13), (0, 1, 0, 1), (0, 0, -1))
    request = far._replace(com=Vec3(0.0, 0.0, 1e13)), Body.dynamic(2.0, (0.2, 0, 0, 0.2, 0, 0.2))
    contact = Contact.of((0, 0, 0), (0, 0, 1), restitution=0.0, friction=1.0)
    with refused(StatusCode.OUT_OF_RANGE, "model.precision"):
        resolve(*request, contact, ImpactModel(precision=Precision.DOUBLE))
    pytest.importorskip("flint")  # the bound needs its digits
    assert resolve(*request, contact).error_bound < 1e-15


@pytest.mark.parametrize("precision", Precision)
@pytest.mark.parametrize("law", [Law.COULOMB, Law.MOREAU, Law.ROUTH_POISSON, Law.ROUTH_STRONGE])
def test_the_normal_impulse_is_not_negative(law, precision):
    """Here it is so much smaller than the tangential impulse that rounding could make it negative."""
    for axis, (friction, slip) in product(
        range(3), [(1e10, 2e10), (1e12, -4e12), (1e20, 1e21), (1e10, 1e20)]
    ):
        turned = tuple(
            np.roll(v, axis) for v in ((4.0, 4.0, 0.5), (slip, -12.0, 0.25 * slip), (0.0, 3.0, 1.0))
        )
        lever, velocity, normal = (tuple(map(float, v)) for v in turned)
        body = Body.dynamic(1.0, (16.0, 0, 0, 16.0, 0, 16.0), tuple(-x for x in lever), velocity=velocity)
        contact = Contact.of((0, 0, 0), normal, 0.5, friction)
        try:
            impact = resolve(body, Body.static(), contact, ImpactModel(law, precision=precision))
        except ImpactError:  # not known at this precision
            continue
        assert impact.normal_impulse >= 0


def test_an_answer_and_its_parts_have_the_hash_of_equal_tuples():
    contact, model = CONTACT._replace(friction=0.5), ImpactModel(Law.FRICTIONLESS, restitution_threshold=9.0)
    impact = resolve(BALL, FLOOR, contact, model)
    for part in (impact, impact.contact, impact.twist_a, impact.change_a, impact.impulse):
        assert hash(part) == hash(type(part)(*part))
    contacts = [contact, contact._replace(position=(0.1, 0.0, 0.0))]
    scene = resolve_scene([BALL, FLOOR], [(0, 1)] * 2, contacts, model)
    for part in (*scene.contacts, *scene.twists, *scene.changes, *scene.impulses):
        assert hash(part) == hash(type(part)(*part))


def test_the_model_of_an_answer_has_the_numbers_of_the_request():
    """Plans of models are kept: not one of a model with another sign of zero, or another type."""
    for number in (0.0, -0.0, 0, F(0), np.float64(0.0), np.float64(-0.0), -0.0, 0.0):
        model = ImpactModel(Law.COULOMB, tangential_restitution=number)
        reported = resolve(BALL, FLOOR, CONTACT, model).model.tangential_restitution
        assert type(reported) is type(number)
        assert math.copysign(1, reported) == math.copysign(1, number)


@pytest.mark.parametrize(
    ("field", "first", "second"),
    [
        ("restitution_threshold", 0.5, 3.0),
        ("tangential_restitution", 0.0, 0.5),
        ("tolerance", 1e-6, 1e-20),
        ("stiffness_ratio", 0.5, 2.0),
    ],
)
@pytest.mark.parametrize("is_new", [False, True])
def test_a_number_that_changes_between_calls(field, first, second, is_new):
    """An array of no dimensions is a number, and a plan that is kept for it would be that of the old one."""
    body, contact = Body.dynamic(1.0, velocity=(0.3, 0.0, -1.0)), Contact.of((0, 0, 0), (0, 0, 1), 0.5, 0.3)
    law = Law.COMPLIANT if field == "stiffness_ratio" else Law.COULOMB
    number = np.array(first)
    model = ImpactModel(law=law, **{field: number})
    rows, contact_row = body_rows(Geometry.POINT), contact_rows(Geometry.POINT)
    bodies, contacts = np.zeros((rows.height, 2, 1)), np.zeros((contact_row.height, 1))
    bodies[rows.mass, :, 0], bodies[rows.velocity, 0, 0] = (1, math.inf), body.velocity
    contacts[contact_row.normal, 0], contacts[contact_row.restitution] = contact.normal, contact.restitution
    contacts[contact_row.friction] = contact.friction
    answers = []
    for value in first, second:
        number[...] = value
        asked = ImpactModel(law=law, **{field: number}) if is_new else model
        answers.append(resolve(body, Body.static(), contact, asked))
        assert answers[-1] == resolve(body, Body.static(), contact, ImpactModel(law=law, **{field: value}))
        if law is Law.COULOMB and field != "tolerance":
            batch = resolve_batch(bodies, contacts, asked)
            assert batch.velocity[:, 0, 0].tolist() == list(answers[-1].twist_a.linear)
    assert getattr(answers[0].model, field) == first


def test_reading_a_number_may_resolve_with_other_models():
    """Python code may run while a request is read: in a number's ``__float__``, or in another thread."""
    others = [ImpactModel(Law.ROUTH_STRONGE, tolerance=1e-3 + i * 1e-6) for i in range(20)]
    contact, body = CONTACT._replace(friction=0.3), BALL._replace(velocity=(0.5, 0.0, -1.0))

    class Speed:
        def __float__(self):
            for model in others:
                resolve(body, FLOOR, contact, model)
            return -1.0

    for model in (ImpactModel(Law.COULOMB), ImpactModel(Law.COULOMB, precision=Precision.DOUBLE)):
        impact = resolve(body._replace(velocity=(0.5, 0.0, Speed())), FLOOR, contact, model)
        expected = resolve(body, FLOOR, contact, model)
        assert (impact.model, impact.impulse) == (expected.model, expected.impulse)


class OnlyConvertible:
    """A number of a library whose numbers convert to floats, but do not compare with them."""

    def __init__(self, value):
        self.value = value

    def __float__(self):
        return self.value


@pytest.mark.parametrize(
    ("field", "is_function"),
    [
        ("restitution", False),
        ("restitution", True),
        ("friction", False),
        ("friction", True),
        ("tangential_restitution", False),
    ],
)
def test_coefficients_need_only_convert_to_floats(field, is_function):
    """Numbers, and what functions of a speed return."""
    contact = Contact.of((0, 0, 0), (0, 0, 1), 0.5, 0.25, 0.125)
    ball = Body.sphere(1.0, 0.5, position=(0.0, 0.0, 0.5), velocity=(1.0, 0.0, -1.0))

    def answer(value):
        given = (lambda speed: value) if is_function else value
        return resolve(ball, FLOOR, contact._replace(**{field: given}))

    assert answer(OnlyConvertible(0.75)).impulse == answer(0.75).impulse
    assert answer(np.array(0.75)).impulse == answer(0.75).impulse
    name = f"contact.{field}"
    with pytest.raises(ImpactError) as refusal:
        answer(OnlyConvertible(-1.5))
    assert refusal.value.field.startswith(name)


@pytest.mark.parametrize("precision", [Precision.SINGLE, Precision.DOUBLE, Precision.EXTENDED])
@pytest.mark.parametrize("length", [1e-165, 1e-162, 1e-160, 1e-155, 1e-24, 1e-23, 1e-22, 1e23, 1e160])
def test_a_normal_of_any_length_reports_the_same_of_bodies_that_separate(precision, length):
    """Its square leaves the range of floats, which a bound of 0 does not show."""
    ball = Body.sphere(
        0.3, 1 / 3, position=(0.1, 0.2, 0.4), velocity=(0.1, 1, 1), angular_velocity=(0.3, 0.7, 0.1)
    )
    found, usual = (
        resolve(
            ball,
            Body.static(),
            Contact.of((0.1, 0.02, 0.03), (0, 3 * x, 0.7 * x), 0.5, 0.3),
            ImpactModel(precision=precision),
        )
        for x in (length, 1.0)
    )
    assert found.status is StatusCode.SEPARATING
    rounding = 2.0**-20 if precision is Precision.SINGLE else 2.0**-50
    for field in ("normal_velocity_before", "normal_velocity_after", "effective_mass"):
        assert getattr(found, field) == pytest.approx(getattr(usual, field), rel=rounding)


@pytest.mark.parametrize("lift", [0.0, 0.25])
def test_single_precision_does_not_round_a_twist_that_nothing_changes(lift):
    """A belt moves on as it is given, whatever hits it; so does a body that does not approach."""
    belt = Body.kinematic((0, 0, 0), velocity=(0.1, 0, lift / -3), angular_velocity=(0, 0, 0.3))
    ball = Body.sphere(1.0, 0.5, position=(0, 0, 0.5), velocity=(0.1, 0, 0.7 if lift else -0.7))
    contact = Contact.of((0, 0, 0), (0, 0, 1), 0.5, 0.3)
    impact = resolve(ball, belt, contact, ImpactModel(precision=Precision.SINGLE))
    assert impact.twist_b == (belt.velocity, belt.angular_velocity)
    assert (impact.twist_a == (ball.velocity, ball.angular_velocity)) == (lift > 0)


def test_a_forced_geometry_of_fractions_bounds_what_floats_round():
    ball = Body.sphere(F(1), F(1, 10), position=(0, 0, F(1, 10)), velocity=(0, 0, F(-1, 3)))
    contact = Contact.of((F(1, 10**30), 0, 0), (0, 0, 1), F(1, 2))
    answer = resolve(ball, Body.static(), contact, ImpactModel(Law.FRICTIONLESS, Geometry.POINT))
    assert abs(F(answer.twist_a.linear.z) / F(1, 6) - 1) <= answer.error_bound < 1e-15


def test_a_forced_geometry_of_fractions_beyond_float64_is_refused():
    body = Body.dynamic(1.0, (1e-320, 0, 0, 1e-320, 0, 1e-320), velocity=(0, -1e150, 0))
    contact = Contact.of((F(1, 10**160), 0, 0), (0, 1, F(1, 10**30)), 0.5)
    with refused(StatusCode.OUT_OF_RANGE):
        resolve(body, Body.static(), contact, ImpactModel(geometry=Geometry.PLANAR))
