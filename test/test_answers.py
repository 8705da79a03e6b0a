"""How answers, enumerations and errors print, and what the constructors of bodies accept."""

from __future__ import annotations

import gc
import math
import pickle
import re
import sys
from decimal import Decimal
from fractions import Fraction as F
from pathlib import Path

import numpy as np
import pytest
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
    resolve_contact,
    resolve_scene,
)
from collision_response.answer import format_vector
from collision_response.physics import mass_properties
from collision_response.physics.body import Twist
from collision_response.physics.vector import Vec3
from collision_response.status import renamed

BALL = Body.sphere(2.0, 0.1, position=(0.0, 0.0, 0.1), velocity=(1.0, 0.0, -3.0))
FLOOR = Body.static()
TOUCH = Contact.of((0.0, 0.0, 0.0), normal=(0.0, 0.0, 1.0), restitution=0.5, friction=0.3)


def test_an_impact_prints_as_a_table():
    """Rolling friction: the impulse across is 2/7 of m v, and 2/7 of that kinetic energy is lost."""
    impact = resolve(BALL, FLOOR, TOUCH)
    head, *rows = str(impact).splitlines()
    assert re.fullmatch(r"OK by COULOMB \(SPATIAL, DOUBLE\), relative error at most \d(\.\d)?e-1\d", head)
    assert rows == [
        "regime    e    mu   u before [m/s]  u after [m/s]  impulse [N s]",
        "STICKING  0.5  0.3  -3              1.5            (-0.571429, 0, 9)",
        "body    velocity [m/s]      angular velocity [rad/s]",
        "body_a  (0.714286, 0, 1.5)  (0, 7.14286, 0)",
        "body_b  (0, 0, 0)           (0, 0, 0)",
        "energy 10 -> 2.96429 J; lost: 6.75 restitution, 0.285714 friction",
    ]
    assert repr(impact).startswith("Impact(OK, COULOMB, STICKING, impulse=(-0.571429, 0, 9), error_bound=")
    assert pickle.loads(pickle.dumps(impact)) == impact


def test_of_a_link_the_change_of_the_energy_is_printed():
    link = Body.articulated([[float(i == j) for j in range(6)] for i in range(6)], velocity=(0.0, 0.0, -3.0))
    text = str(resolve(link, FLOOR, TOUCH))
    assert "\nenergy changed by -3.375 J; lost: 3.375 restitution, 0 friction\n" in text


def test_a_contact_impact_prints_as_a_table():
    """The contact slips too slowly to go on slipping: it sticks."""
    K = [[4, 0, 0], [0, 4, 0], [0, 0, 1]]
    impact = resolve_contact(K, (0.25, 0, -1), (0, 0, 1), 0.5, 0.3)
    head, *rows = str(impact).splitlines()
    assert re.fullmatch(r"OK by COULOMB \(DOUBLE\), relative error at most \d(\.\d)?e-1\d", head)
    assert rows == [
        "regime    velocity after [m/s]  impulse [N s]",
        "STICKING  (0, 0, 0.5)           (-0.0625, 0, 1.5)",
        "energy changed by -0.382812 J; lost: 0.375 restitution, 0.0078125 friction",
    ]
    assert repr(impact).startswith("ContactImpact(OK, COULOMB, STICKING, impulse=(-0.0625, 0, 1.5), error")


@pytest.mark.parametrize(
    ("components", "text"),
    [
        ((0.55, 4e-25, -1e-17), "(0.55, 0, 0)"),
        ((0.5, 1e-16, -1e-15), "(0.5, 1e-16, -1e-15)"),
        ((1e-24, -4e-16, -0.0), "(1e-24, -4e-16, 0)"),
        ((F(10) ** 400, F(1), F(-1, 3)), "(1.00000e+400, 0, 0)"),
        ((F(1, 3), F(1, 10**9), F(0)), "(0.333333, 1e-09, 0)"),
        ((math.inf, math.nan, 1.0), "(inf, nan, 0)"),
    ],
)
def test_components_that_are_rounding_print_as_zero(components, text):
    assert format_vector(Vec3(*components)) == text


def test_adjustments_are_in_the_table():
    turning = Body.dynamic(1.0, velocity=(0.0, 0.0, -1.0), angular_velocity=(1.0, 0.0, 0.0))
    slow = ImpactModel(restitution_threshold=2.0)
    text = str(resolve(turning, FLOOR, TOUCH, slow))
    assert text.splitlines()[-1] == "adjusted: RESTITUTION_THRESHOLD, MASSLESS_SPIN"


@pytest.mark.parametrize("kind", [Law, Geometry, Precision, Regime, StatusCode])
def test_enumerations_print_as_their_names(kind):
    for member in kind:
        assert (str(member), f"{member:>12}") == (member.name, member.name.rjust(12))
        assert int(member) == member
    assert str(Adjustment(9)) == "NORMALISED_ORIENTATION, MASSLESS_SPIN"
    assert str(Adjustment.NONE) == "NONE"


def test_every_enumeration_member_has_a_docstring():
    """Editors show the string below a member."""
    room = Path(mass_properties.__file__).parent
    for file in (room.parent / "status.py", room.parent / "model.py", room / "laws" / "law.py"):
        lines = file.read_text().splitlines()
        members = [i for i, line in enumerate(lines) if re.match(r"    [A-Z_]+ = \d+$", line)]
        assert members
        assert [
            lines[i] for i in members if not lines[i + 1].startswith('    """') and "NONE" not in lines[i]
        ] == []


class TestInertia:
    def test_inertia_may_be_a_matrix_or_six_numbers(self):
        six = (2.0, 0.1, 0.2, 3.0, 0.3, 4.0)
        xx, xy, xz, yy, yz, zz = six
        rows = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]
        for given in (rows, np.array(rows), np.array(six), iter(six)):
            assert Body.dynamic(1.0, given).inertia == six

    @pytest.mark.parametrize("number", [int, np.int8, np.uint8, np.longdouble, np.float32, Decimal, F])
    def test_a_matrix_may_hold_numbers_of_any_type(self, number):
        xx, xy, xz, yy, yz, zz = six = tuple(map(number, (120, 20, 0, 100, 3, 90)))
        assert Body.dynamic(1.0, [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]).inertia == six

    @pytest.mark.parametrize("great", [10**400, F(10) ** 400, Decimal("1e400")], ids=type)
    def test_a_matrix_beyond_float64_is_refused_when_it_is_used(self, great):
        for inertia in (
            (great, 0, 0, great, 0, great),
            np.diag([great] * 3),
            [[great, 0, 0], [0, great, 0], [0, 0, 1]],
        ):
            body = Body.dynamic(1.0, inertia)
            with refused(StatusCode.NOT_FINITE, "body_a.inertia"):
                resolve(body, Body.static(), Contact.of((0, 0, 0), (0, 0, 1)))

    def test_the_matrix_may_be_asymmetric_by_rounding_only(self):
        rows = [[2.0, 0.1, 0.0], [0.1 + 2e-10, 3.0, 0.0], [0.0, 0.0, 4.0]]
        assert Body.dynamic(1.0, rows).inertia.xy == pytest.approx(0.1 + 1e-10, abs=1e-16)
        rows[0][1] = 0.2
        with pytest.raises(ValueError, match=r"^inertia: must be symmetric, is \("):
            Body.dynamic(1.0, rows)

    @pytest.mark.parametrize("wrong", [(1.0, 2.0, 3.0), [[1.0, 2.0], [3.0, 4.0]], ()])
    def test_other_shapes_are_refused(self, wrong):
        with pytest.raises(ValueError, match=r"^inertia: must be \(xx, xy, xz, yy, yz, zz\) or three rows"):
            Body.dynamic(1.0, wrong)
        with pytest.raises(TypeError, match=r"^inertia: must be .* is 3\.0"):
            Body.dynamic(1.0, 3.0)


def solid_of_revolution(radius_at, low, high, n=2000):
    """Centre, axial and transverse moments per unit mass, by Simpson's rule."""
    z = np.linspace(low, high, 2 * n + 1)
    weights = np.ones_like(z)
    weights[1:-1:2], weights[2:-1:2] = 4, 2
    weights *= (high - low) / (6 * n)
    r = radius_at(z)
    volume = (weights * np.pi * r**2).sum()
    centre = (weights * np.pi * r**2 * z).sum() / volume
    axial = (weights * np.pi * r**4 / 2).sum() / volume
    across = (weights * np.pi * (r**4 / 4 + r**2 * (z - centre) ** 2)).sum() / volume
    return centre, axial, across


class TestShapes:
    def test_a_capsule_is_the_integral_of_its_discs(self):
        radius, length = 0.3, 1.1

        def at(z):
            return np.sqrt(np.maximum(radius**2 - np.maximum(abs(z) - length / 2, 0.0) ** 2, 0.0))

        inertia = mass_properties.capsule(2.0, radius, length).inertia
        _, axial, across = solid_of_revolution(at, -length / 2 - radius, length / 2 + radius)
        assert (inertia.zz, inertia.xx, inertia.yy) == pytest.approx(
            (2 * axial, 2 * across, 2 * across), rel=1e-5
        )  # Simpson's rule is less accurate at the poles, where the slope is infinite

    def test_a_cone_is_the_integral_of_its_discs(self):
        radius, height = 0.3, 1.1

        def at(z):
            return radius * (3 / 4 - z / height)

        inertia = mass_properties.cone(2.0, radius, height).inertia
        centre, axial, across = solid_of_revolution(at, -height / 4, 3 * height / 4)
        assert centre == pytest.approx(0.0, abs=1e-15)
        assert (inertia.zz, inertia.xx) == pytest.approx((2 * axial, 2 * across), rel=1e-12)

    def test_degenerate_shapes_agree_with_simpler_ones(self):
        one = F(1)
        assert mass_properties.capsule(one, one, 0 * one) == mass_properties.sphere(one, one)
        assert mass_properties.cone(one, 0 * one, one).inertia.xx == F(3, 80)
        shell = mass_properties.hollow_sphere(one, one).inertia.xx
        outer, inner = (one * r**5 * F(2, 5) for r in (1, F(999, 1000)))
        volume = 1 - F(999, 1000) ** 3
        assert float((outer - inner) / volume) == pytest.approx(
            float(shell), rel=2e-3
        )  # one part in a thousand thick

    def test_every_shape_makes_a_body(self):
        where = {"position": (1.0, 2.0, 3.0), "velocity": (0.0, 0.0, -1.0)}
        bodies = [
            Body.sphere(1.0, 0.1, **where),
            Body.hollow_sphere(1.0, 0.1, **where),
            Body.box(1.0, (0.1, 0.2, 0.3), **where),
            Body.cylinder(1.0, 0.1, 0.2, **where),
            Body.capsule(1.0, 0.1, 0.2, **where),
            Body.cone(1.0, 0.1, 0.2, **where),
            Body.rod(1.0, 0.2, **where),
        ]
        for body in bodies:
            assert body[2:5] == ((1.0, 2.0, 3.0), None, (0.0, 0.0, -1.0))
            assert resolve(body, FLOOR, TOUCH).status is StatusCode.OK
        with pytest.raises(TypeError, match="speed"):
            Body.sphere(1.0, 0.1, speed=3.0)

    def test_a_mesh_of_a_box_has_the_mass_properties_of_the_box(self):
        trimesh = pytest.importorskip("trimesh")

        shape = trimesh.creation.box(extents=(0.1, 0.2, 0.3))
        shape.apply_translation((1.0, 0.0, 0.0))
        shape.density = 7.0
        found, exact = mass_properties.mesh(2.0, shape), mass_properties.box(2.0, (0.1, 0.2, 0.3))
        assert found.com == pytest.approx((1.0, 0.0, 0.0), abs=1e-12)
        assert found.inertia == pytest.approx(exact.inertia, abs=1e-12)
        assert Body.mesh(2.0, shape).com == found.com
        shape.faces = shape.faces[1:]
        with pytest.raises(ValueError, match="does not enclose a volume"):
            Body.mesh(2.0, shape)


def test_vectors_scale_from_both_sides():
    v = Vec3(1.0, -2.0, 3.0)
    assert 2 * v == v * 2 == 2.0 * v == Vec3(2.0, -4.0, 6.0)


def test_a_tuple_plus_a_vector_is_a_vector_sum():
    v = Vec3(1.0, -2.0, 3.0)
    assert (1, 1, 1) + v == v + (1, 1, 1) == Vec3(2.0, -1.0, 4.0)  # noqa: RUF005
    assert (1, 1, 1) - v == -(v - (1, 1, 1)) == Vec3(0.0, 3.0, -2.0)
    assert F(1, 2) * v == v / 2 == Vec3(0.5, -1.0, 1.5)


def test_replacing_the_mass_replaces_the_inverse_mass():
    """No other field of a body depends on its mass."""
    heavy = BALL._replace(mass=4.0)
    assert (heavy.inverse_mass(), heavy.is_movable()) == (0.25, True)
    assert resolve(heavy, FLOOR, TOUCH).impulse.z == pytest.approx(18.0, rel=1e-14)
    assert BALL._replace(mass=math.inf).inverse_mass() == 0


class TestTangentialRestitution:
    def test_the_contact_overrides_the_model(self):
        """A superball: e = e_t = 1, so all energy is kept and the slip reverses."""
        own = TOUCH._replace(restitution=1.0, friction=10.0, tangential_restitution=1.0)
        impact = resolve(BALL, FLOOR, own, ImpactModel(tangential_restitution=-1.0))
        assert impact.kinetic_energy_after == pytest.approx(impact.kinetic_energy_before, rel=1e-14)
        by_model = resolve(BALL, FLOOR, own._replace(tangential_restitution=None), impact.model)
        assert impact[2:] == by_model[2:]
        assert (impact.contact, impact.model.tangential_restitution) == (own, 1.0)
        alone = resolve_scene([BALL, FLOOR], [(0, 1)], [own])
        assert alone.impulses == (impact.impulse,)

    def test_zero_in_the_contact_overrides_the_model(self):
        impact = resolve(
            BALL, FLOOR, TOUCH._replace(tangential_restitution=0.0), ImpactModel(tangential_restitution=1.0)
        )
        assert impact.impulse == resolve(BALL, FLOOR, TOUCH).impulse

    @pytest.mark.parametrize("wrong, code", [(1.1, "INVALID_COEFFICIENT"), (math.nan, "NOT_FINITE")])
    def test_invalid_values_are_refused(self, wrong, code):
        with pytest.raises(ImpactError, match=r"contact\.tangential_restitution") as error:
            resolve(BALL, FLOOR, TOUCH._replace(tangential_restitution=wrong))
        assert error.value.code.name == code

    def test_it_is_refused_for_several_contacts(self):
        own = TOUCH._replace(tangential_restitution=0.5)
        with pytest.raises(ImpactError, match=r"contacts\[1\]\.tangential_restitution: must be 0"):
            resolve_scene([BALL, FLOOR], [(0, 1)] * 2, [TOUCH._replace(position=Vec3(0.1, 0.0, 0.0)), own])


class TestErrorsSayWhatToWrite:
    def test_a_field_is_renamed_by_the_innermost_name(self):
        names = {"body_a": "K", "body_a.velocity": "u"}
        error = ImpactError(StatusCode.NOT_FINITE, "body_a.velocity.x", "must be finite; is nan")
        assert str(error.renamed(names)) == "u.x: must be finite; is nan"
        assert renamed("body_a[0]: must be a Body", names) == "K[0]: must be a Body"
        assert renamed("body_ab: must be a Body", names) == "body_ab: must be a Body"

    @pytest.mark.parametrize(
        "field, wrong, says",
        [
            ("velocity", 3.0, r"velocity: must be \(x, y, z\), is 3\.0"),
            ("position", (1.0, 2.0), r"position: must be \(x, y, z\), is \(1\.0, 2\.0\)"),
            ("orientation", (0.0, 0.0, 1.0), r"orientation: must be a quaternion \(x, y, z, w\), is "),
        ],
    )
    def test_a_vector_of_the_wrong_shape(self, field, wrong, says):
        with pytest.raises(TypeError, match=says):
            Body.dynamic(1.0, **{field: wrong})

    def test_a_normal_of_two_components(self):
        with pytest.raises(TypeError, match=r"normal: must be \(x, y, z\), is \(0, 1\)"):
            Contact.of((0, 0, 0), (0, 1))

    def test_a_law_instead_of_a_model(self):
        with pytest.raises(TypeError, match=r"write ImpactModel\(law=Law\.COULOMB\)"):
            resolve(BALL, FLOOR, TOUCH, Law.COULOMB)

    def test_no_body(self):
        with pytest.raises(TypeError, match=r"body_b: must be a Body, is None; Body\.dynamic\(\.\.\.\)"):
            resolve(BALL, None, TOUCH)

    def test_a_message_instead_of_a_body(self):
        state = type("BodyState", (), {})()
        with pytest.raises(TypeError, match=r"collision_response\.ros\.convert\.body_of"):
            resolve(state, FLOOR, TOUCH)

    def test_a_plain_tuple_instead_of_a_contact(self):
        with pytest.raises(TypeError, match=r"contact: must be a Contact, made by Contact\.of\(\.\.\.\)"):
            resolve(BALL, FLOOR, ((0, 0, 0), (0, 0, 1), 0.5, 0.0))

    @pytest.mark.parametrize("law", list(Law))
    @pytest.mark.parametrize("geometry", list(Geometry))
    @pytest.mark.parametrize("e", [0.5, F(1, 2), lambda v: 0.5])
    def test_plain_tuples_of_all_fields(self, e, geometry, law):
        """They have no attributes, which some laws need, others not."""
        model = ImpactModel(law=law, geometry=geometry)
        contact = TOUCH._replace(restitution=e)
        with pytest.raises(TypeError, match=r"body_a: must be a Body, is \("):
            resolve(tuple(BALL), FLOOR, contact, model)
        with pytest.raises(TypeError, match=r"contact: must be a Contact, made by .*; is \("):
            resolve(BALL, FLOOR, tuple(contact), model)

    def test_a_mass_of_zero(self):
        with pytest.raises(ImpactError, match=r"body_b\.mass: .* Body\.static\(\), motion_type STATIC; is 0"):
            resolve(BALL, Body.dynamic(0.0), TOUCH)


def test_vectors_are_freed_as_other_objects():
    """The kernels free them without Python's general steps."""

    class Named(Vec3):  # a subclass has attributes and a finalizer
        freed = 0

        def __del__(self):
            Named.freed += 1

    gc.collect()  # vectors of other tests, which might be freed meanwhile
    before = sys.getrefcount(Vec3), sys.getrefcount(Twist)
    for _ in range(1000):
        impact = resolve(BALL, FLOOR, TOUCH)
        parts = [*impact.twist_a, Vec3(1.0, 2.0, impact.normal_impulse), Twist(*impact.change_a)]
        gc.collect(0)  # which tracks some of them
    del impact, parts
    assert (sys.getrefcount(Vec3), sys.getrefcount(Twist)) == before
    named = Named(1.0, 2.0, [])
    named.itself = named
    named[2].append(named)
    del named
    gc.collect()
    assert Named.freed == 1


def test_vectors_of_vectors_are_freed_however_deep():
    deep = Vec3(1.0, 2.0, 3.0)
    for _ in range(200_000):
        deep = Vec3(deep, None, None)
    del deep


def test_enumerations_print_as_names_and_format_as_numbers():
    assert (f"{Regime.SLIDING}", f"{StatusCode.OK:d}", f"{Regime.SLIDING:02d}", f"{Law.MOREAU:>8}") == (
        "SLIDING",
        "1",
        "03",
        "  MOREAU",
    )


def test_a_vector_is_not_multiplied_by_a_list():
    with pytest.raises(TypeError, match="dot"):
        Vec3(1.0, 2.0, 3.0) * [1.0, 2.0, 3.0]


@pytest.mark.parametrize("wrong", ["com", "inertia", "vel"])
def test_a_shape_says_what_it_takes(wrong):
    message = (
        rf"^{wrong}: a shape takes position, orientation, velocity and angular_velocity; for inertia or com "
    )
    with pytest.raises(TypeError, match=message):
        Body.sphere(1.0, 0.1, **{wrong: (0, 0, 1)})


def test_three_principal_moments_are_refused_with_the_right_form():
    with pytest.raises(ValueError, match=r"principal moments a, b, c are \(a, 0, 0, b, 0, c\)$"):
        Body.dynamic(1.0, (1.0, 2.0, 3.0))


@pytest.mark.parametrize("values", [b"123", bytearray(3), {1, 2, 3}, frozenset("abc"), {0: 1, 1: 2, 2: 3}])
def test_a_vector_has_an_order(values):
    with pytest.raises(TypeError, match=r"^normal: must be \(x, y, z\), is "):
        Contact.of((0, 0, 0), values)
    with pytest.raises(TypeError, match=r"^body_a\.velocity: must be 3 numbers, is "):
        resolve(BALL._replace(velocity=values), Body.static(), Contact.of((0, 0, 0), (0, 0, 1)))


def test_a_body_takes_a_twist_of_tuples():
    assert Body.dynamic(1.0).with_twist(Twist((0, 0, 1), (0, 2, 0))).velocity.z == 1
    with pytest.raises(TypeError, match=r"^twist\.linear: must be \(x, y, z\)"):
        Body.dynamic(1.0).with_twist(Twist(1.0, (0, 2, 0)))
