"""Constants of materials and numbers of repetitions: refused at once, by the name of the argument."""

from __future__ import annotations

import math
import pickle
from decimal import Decimal
from fractions import Fraction
from itertools import product

import numpy as np
import pytest
from refusals import refused

from collision_response import (
    Body,
    Contact,
    Geometry,
    Law,
    StatusCode,
    Twist,
    Vec3,
    resolve,
    resolve_contact,
    resolve_scene,
)
from collision_response.batch import body_rows, contact_rows, independent_sets, resolve_batch, resolve_scenes
from collision_response.derivatives import differentiate, unit_directions
from collision_response.physics import friction, mass_properties
from collision_response.physics.combine import CombineRule, combine
from collision_response.physics.restitution import johnson, plastic, power_law, tabulated, viscoelastic
from collision_response.physics.stiffness import Elastic, stiffness_ratio

FUNCTIONS = {
    viscoelastic: {"beta": 0.5},
    plastic: {"yield_speed": 0.5},
    johnson: {"yield_speed": 0.5},
    power_law: {"restitution": 0.75, "speed": 2.0, "exponent": 0.25},
    friction.stribeck: {"static": 0.5, "kinetic": 0.25, "speed": 0.125},
}
TABLES = tabulated, friction.tabulated
CONSTANTS = [(function, name) for function, constants in FUNCTIONS.items() for name in constants]
POSITIVE = {"yield_speed", "restitution", "speed"}

each_constant = pytest.mark.parametrize(
    ("function", "name"), CONSTANTS, ids=lambda x: x if isinstance(x, str) else x.__name__
)
each_table = pytest.mark.parametrize("table", TABLES, ids=lambda table: table.__module__.rpartition(".")[2])

NO_NUMBERS = [
    None,
    True,
    np.True_,
    np.array(True),
    "1",
    b"1",
    np.bytes_(b"1"),
    1j,
    np.complex64(1),
    np.array(1j),
    np.array(True, object),
    np.array("1", object),
    {},
    object,
    np.ma.masked,
    np.datetime64(1, "s"),
    np.timedelta64(1, "ns"),
    Decimal("sNaN"),
]
SEQUENCES = [[1.0], (1.0,), np.ones(1), np.ones(2)]
NOT_FINITE = [math.nan, math.inf, -math.inf, np.float32(np.nan), Decimal("inf"), 10**400, -(10**5000)]
TINY = [Fraction(1, 10**400), Decimal("1e-999"), np.longdouble("1e-4000")]
TYPES = [float, Fraction, Decimal, np.float16, np.float32, np.longdouble, np.array]


@each_constant
@pytest.mark.parametrize("value", NO_NUMBERS + SEQUENCES, ids=repr)
def test_a_constant_must_be_a_real_number(function, name, value):
    with pytest.raises(TypeError, match=f"^{name}: must be a real number, is "):
        function(**FUNCTIONS[function] | {name: value})


@each_constant
@pytest.mark.parametrize("value", NOT_FINITE, ids=range(len(NOT_FINITE)))
def test_a_constant_must_be_finite(function, name, value):
    with refused(StatusCode.NOT_FINITE, name, "must be finite"):
        function(**FUNCTIONS[function] | {name: value})


@each_constant
def test_a_constant_must_be_in_its_range(function, name):
    wrong = [-1, -0.5, Fraction(-1, 3), -5e-324]
    wrong += [0, 0.0, -0.0, Decimal(0), *TINY] if name in POSITIVE else []
    wrong += [math.nextafter(1, 2), 1 + Fraction(1, 10**30), 2] if name == "restitution" else []
    for value in wrong:
        with refused(StatusCode.INVALID_COEFFICIENT, name, " must be "):
            function(**FUNCTIONS[function] | {name: value})


@each_constant
@pytest.mark.parametrize("number", TYPES, ids=lambda kind: kind.__name__)
def test_a_constant_may_be_a_number_of_any_type(function, name, number):
    given = FUNCTIONS[function]
    of_floats, of_others = function(**given), function(**given | {name: number(given[name])})
    for same in (of_others, pickle.loads(pickle.dumps(of_others))):
        found = [same(v) for v in (0.0, 0.5, 3.0)]
        assert (found, {*map(type, found)}) == ([of_floats(v) for v in (0.0, 0.5, 3.0)], {float})


@pytest.mark.parametrize("function", FUNCTIONS, ids=lambda function: function.__name__)
def test_every_value_is_a_coefficient_whatever_the_constants_and_the_speed(function):
    """No constant and no speed overflows, and none gives a value out of range."""
    extremes = 0.0, 5e-324, 1e-308, 1e-160, 1e-20, 1.0, 1e20, 1e160, 1.7976931348623157e308
    names = list(FUNCTIONS[function])
    most = extremes[-1] if function is friction.stribeck else 1.0
    for constants in product(extremes, repeat=len(names)):
        given = dict(zip(names, constants, strict=True))
        if not all(given[name] for name in POSITIVE & given.keys()) or given.get("restitution", 1) > 1:
            continue
        coefficient = function(**given)
        for v in extremes:
            assert 0 <= coefficient(v) <= most, (given, v)


@each_table
@pytest.mark.parametrize("value", NO_NUMBERS + SEQUENCES, ids=repr)
@pytest.mark.parametrize("name", ["speeds", "values"])
def test_an_entry_of_a_table_must_be_a_real_number(table, name, value):
    given = {"speeds": [0.0, 1.0, 2.0], "values": [0.5, 0.25, 1.0]}
    given[name] = [*given[name][:2], value]
    with pytest.raises(TypeError, match=rf"^{name}\[2\]: must be a real number, is "):
        table(**given)


@each_table
@pytest.mark.parametrize("name", ["speeds", "values"])
def test_the_columns_of_a_table_must_be_sequences(table, name):
    given = {"speeds": [0.0, 1.0], "values": [0.5, 0.25]}
    for value in (None, 1.0, True, np.float64(1), np.array(1.0)):
        with pytest.raises(TypeError, match=f"^{name}: must be a sequence, is "):
            table(**given | {name: value})
    for wrong in ((0.0,), ()):
        with refused(StatusCode.INVALID_COEFFICIENT, "speeds", "must be as many as values"):
            table(**given | {name: wrong})


@each_table
def test_the_speeds_of_a_table_must_rise_as_floats(table):
    for speeds in ([0, 0], [1, 0], [1, 1 + Fraction(1, 10**30)], [10**17, 10**17 + 1]):
        with refused(StatusCode.INVALID_COEFFICIENT, "speeds[1]", "must be greater than the speed before"):
            table(speeds, [0.5, 0.5])
    for speeds in ([-1, 0], [0, -1.0]):
        with refused(StatusCode.INVALID_COEFFICIENT, None, "must be at least 0"):
            table(speeds, [0.5, 0.5])
    for value, code in ((-1.0, StatusCode.INVALID_COEFFICIENT), (math.inf, StatusCode.NOT_FINITE)):
        with refused(code, "values[1]"):
            table([0, 1], [0.5, value])


@each_table
@pytest.mark.parametrize("kind", [tuple, iter, np.array, lambda x: np.array(x, np.float32)])
def test_the_columns_of_a_table_may_be_of_any_type(table, kind):
    speeds, values = (0.0, 1.0, 4.0), (0.5, 0.25, 1.0)
    coefficient, expected = table(kind(speeds), kind(values)), table(speeds, values)
    for v in (0.0, 0.5, 1.0, 3.0, 9.0):
        assert coefficient(v) == expected(v)


@pytest.mark.parametrize("value", NO_NUMBERS + SEQUENCES, ids=repr)
@pytest.mark.parametrize("material", ["a", "b"])
def test_an_elastic_material_must_have_real_numbers(material, value):
    for field in Elastic._fields:
        given = {"a": Elastic(0.3, 2.0), "b": Elastic(0.25, 1.0)}
        given[material] = given[material]._replace(**{field: value})
        with pytest.raises(TypeError, match=rf"^{material}\.{field}: must be a real number, is "):
            stiffness_ratio(**given)


@pytest.mark.parametrize("material", ["a", "b"])
def test_an_elastic_material_must_be_possible(material):
    given = {"a": Elastic(0.3, 2.0), "b": Elastic(0.25, 1.0)}
    for value in (None, 0.3, (0.3, 1.0), "steel"):
        with pytest.raises(TypeError, match=f"^{material}: must be an Elastic, is "):
            stiffness_ratio(**given | {material: value})
    wrong = [("poisson_ratio", x) for x in (-1, -1.5, 0.6, Fraction(1, 2) + Fraction(1, 10**30), math.nan)]
    wrong += [("shear_modulus", x) for x in (0, -1.0, -math.inf, math.nan, 10**400)]
    wrong += [(field, Decimal("nan")) for field in Elastic._fields]
    for field, value in wrong:
        with refused(StatusCode.INVALID_COEFFICIENT, f"{material}.{field}"):
            stiffness_ratio(**given | {material: given[material]._replace(**{field: value})})


def test_an_elastic_material_may_mix_decimals_with_other_numbers():
    for other in (Elastic(0.25, 2.0), Elastic(Fraction(1, 4), 2), Elastic(Decimal("0.25"), Decimal(2))):
        ratio = stiffness_ratio(Elastic(Decimal("0.375"), Decimal("0.5")), other)
        assert ratio == stiffness_ratio(Elastic(0.375, 0.5), Elastic(0.25, 2.0))


@pytest.mark.parametrize("rule", CombineRule)
@pytest.mark.parametrize("name", ["a", "b", "stiffness_a", "stiffness_b"])
@pytest.mark.parametrize("value", [x for x in NO_NUMBERS if not isinstance(x, Decimal)], ids=repr)
def test_coefficients_to_combine_must_be_real_numbers(rule, name, value):
    with pytest.raises(TypeError, match=f"^{name}: must be a real number, is "):
        combine(rule, **{"a": 0.5, "b": 0.25, "stiffness_a": 1.0, "stiffness_b": 2.0} | {name: value})


@pytest.mark.parametrize("value", NO_NUMBERS[:-1], ids=repr)
def test_particles_must_have_real_numbers(value):
    good = 1.0, (0.0, 0.0, 1.0)
    with pytest.raises(TypeError, match=r"^particles\[1\]\.mass: must be a real number, is "):
        mass_properties.of_particles([good, (value, (0, 0, 0))])
    with pytest.raises(TypeError, match=r"^particles\[1\]\.position\.y: must be a real number, is "):
        mass_properties.of_particles([good, (1.0, (0, value, 0))])
    for one in (value, (1.0,), (1.0, (0, 0))):
        with pytest.raises(TypeError, match=r"^particles\[1\](\.position)?: must be "):
            mass_properties.of_particles([good, one])


BALL, FLOOR = Body.sphere(1.0, 0.5, velocity=(0, 0, -1)), Body.static()
UP = Contact.of((0, 0, -0.5), (0, 0, 1))
TABLES_OF_NONE = np.zeros((4, 2, 0)), np.zeros((4, 0))
COUNTS = {
    "orders": lambda n: resolve_scene([BALL, FLOOR], [(0, 1)], [UP], orders=n),
    "workers": lambda n: resolve_batch(*TABLES_OF_NONE, workers=n),
    "workers of scenes": lambda n: resolve_scenes(
        TABLES_OF_NONE[0][:, 0], TABLES_OF_NONE[1], pairs=np.zeros((2, 0), int), workers=n
    ),
}


@pytest.mark.parametrize("count", COUNTS)
def test_a_number_of_repetitions_must_be_whole_and_in_its_range(count):
    name = count.partition(" ")[0]
    for value in (*NO_NUMBERS, *SEQUENCES, 1.0, Decimal(1), Fraction(1), np.float64(2)):
        with pytest.raises(TypeError, match=f"^{name}: must be a whole number, is "):
            COUNTS[count](value)
    for value in (-1, -(10**5000), np.int8(-1), *([1001, 10**400, 10**5000] if name == "orders" else [0])):
        with refused(StatusCode.INVALID_MODEL, name, "must be "):
            COUNTS[count](value)
    for value in (1, 2, np.int8(2), np.uint64(3), np.array(2), *([10**400] if name == "workers" else [0])):
        COUNTS[count](value)


@pytest.mark.parametrize("value", NO_NUMBERS[:-1], ids=repr)
def test_a_matrix_must_hold_real_numbers(value):
    """Whatever the entry: dates count as integers for NumPy."""
    for i, j in product(range(3), repeat=2):
        matrix = np.eye(6).tolist()
        matrix[i][j] = value
        with pytest.raises((TypeError, ValueError), match=r"^inverse_inertia: must be "):
            Body.articulated(matrix)
        with pytest.raises((TypeError, ValueError), match=r"^K: must be "):
            resolve_contact([row[:3] for row in matrix[:3]], (0, 0, -1), (0, 0, 1))


@pytest.mark.parametrize("rows", [body_rows, contact_rows])
def test_rows_are_those_of_a_geometry(rows):
    for wrong in (Geometry.AUTO, Law.COULOMB, "SPATIAL", 4, None, True, np.ones(2)):
        with pytest.raises(ValueError, match=r"^geometry: must be POINT, PLANAR or SPATIAL, is "):
            rows(wrong)
    for geometry in (Geometry.POINT, Geometry.PLANAR):
        with pytest.raises(ValueError, match=r"^oriented: must be False for the geometry "):
            body_rows(geometry, oriented=True)


@pytest.mark.parametrize("wrong", [None, 1, [[]], [{}], np.ones(2), [Decimal("sNaN")]], ids=repr)
def test_what_is_no_parameter_to_differentiate_by_is_refused(wrong):
    names = wrong if isinstance(wrong, list) else [wrong]
    with pytest.raises((TypeError, ValueError), match=r"^with_respect_to: must be "):
        unit_directions(*names)


@pytest.mark.parametrize("wrong", [3, None, b"contact.friction", Law.COULOMB], ids=repr)
def test_what_is_no_name_is_not_taken_for_an_unknown_parameter(wrong):
    request = Body.sphere(1.0, 1.0), Body.static(), Contact.of((0, 0, 0), (0, 0, 1))
    for names in ([wrong], ["contact.friction", wrong], [wrong, wrong]):
        with pytest.raises(TypeError, match=r"^with_respect_to: must be a sequence of names of parameters"):
            differentiate(*request, with_respect_to=names)
        with pytest.raises(TypeError, match=r"^with_respect_to: must be a sequence of names of parameters"):
            unit_directions(*names)


def test_what_is_no_twist_is_refused():
    body = Body.sphere(1.0, 1.0)
    v, w = Vec3(1.0, 0.0, 0.0), Vec3(0.0, 0.0, 1.0)
    for wrong in ((v, w), v, None, 1.0, resolve(body, Body.static(), Contact.of((0, 0, 0), (0, 0, 1)))):
        with pytest.raises(TypeError, match=r"^twist: must be a Twist, is "):
            body.with_twist(wrong)
    assert body.with_twist(Twist(v, w)) == Body.sphere(1.0, 1.0, velocity=v, angular_velocity=w)


def test_what_is_no_mass_properties_is_refused():
    for wrong in (None, 1.0, (1.0, (0, 0, 0), (1, 0, 0, 1, 0, 1)), {"mass": 1.0}):
        with pytest.raises(TypeError, match=r"^matter: must be MassProperties, is "):
            Body.of(wrong)


@pytest.mark.parametrize("wrong", [[[1, 2], [3]], np.ma.masked_array([True, True], [True, False])], ids=repr)
def test_what_numpy_cannot_read_is_refused_by_name(wrong):
    """Rows of different lengths, and masked elements."""
    given = {"bodies": np.zeros((16, 2)), "contacts": np.zeros((8, 1)), "pairs": np.array([[0], [1]])}
    for name in given:
        with pytest.raises(ValueError, match=f"^{name}: must be "):
            resolve_scenes(**given | {name: wrong})
    with pytest.raises(ValueError, match=r"^movable: must be "):
        independent_sets(given["pairs"], wrong)
