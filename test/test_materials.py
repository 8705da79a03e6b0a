"""Coefficients of pairs of materials: files, laws of restitution, rules, and what the node makes of them."""

from __future__ import annotations

import math
from fractions import Fraction

import pytest

from collision_response import Body, Contact, ImpactError, StatusCode, resolve
from collision_response.physics.combine import CombineRule, combine
from collision_response.physics.restitution import johnson, plastic, power_law, tabulated

pytest.importorskip("yaml")

from collision_response.materials import NOTHING, PUBLISHED, Materials

FILE = """
pairs:
  - materials: [steel, glass]
    restitution: {power: 0.25, speed: 2.0, value: 0.5}
    friction: 0.1
    tangential_restitution: 0.25
    source: a page
  - materials: [rubber, rubber]
    friction: 1.5
materials:
  steel: {restitution: 0.6, friction: 0.5, stiffness: 3}
  rubber: {restitution: 0.8, friction: 0.125, stiffness: 1}
"""


@pytest.fixture
def materials(tmp_path):
    path = tmp_path / "materials.yaml"
    path.write_text(FILE)
    return Materials.read(path)


def test_the_entry_of_a_pair_comes_first_in_either_order(materials):
    for pair in (("steel", "glass"), ("glass", "steel")):
        found = materials.find("friction", *pair, CombineRule.AVERAGE)
        assert found == (0.1, True, "a page")
    assert materials.between("glass", "steel").tangential_restitution == 0.25


def test_what_a_pair_leaves_out_is_combined_and_what_nobody_says_is_not_made_up(materials):
    found = materials.find("restitution", "rubber", "rubber", CombineRule.MULTIPLY)
    assert found == (0.8 * 0.8, False, "multiply")
    assert materials.find("friction", "steel", "rubber", CombineRule.HARMONIC_MEAN).value == 0.2
    assert materials.find("restitution", "rubber", "glass", CombineRule.AVERAGE) is None


def test_the_energetic_rule_weighs_by_compliance(materials):
    """Steel is three times as stiff, and takes up a quarter: e^2 = (0.36 + 3 0.64) / 4 = 0.57."""
    found = materials.find("restitution", "steel", "rubber", CombineRule.ENERGETIC)
    assert found.value == pytest.approx(math.sqrt(0.57), rel=1e-15)


def test_energy_lost_in_two_springs_is_what_the_energetic_rule_says():
    """Of the energy W of compression k_b / (k_a + k_b) is in spring a, which gives back e_a^2 of it."""
    k_a, k_b, e_a, e_b = map(Fraction, (2, 5, "3/5", "4/5"))
    kept = (k_b * e_a**2 + k_a * e_b**2) / (k_a + k_b)
    e = combine(CombineRule.ENERGETIC, float(e_a), float(e_b), float(k_a), float(k_b))
    assert e**2 == pytest.approx(float(kept), rel=1e-15)


def test_the_harmonic_mean():
    assert combine(CombineRule.HARMONIC_MEAN, 0.5, 0.125) == 0.2
    assert combine(CombineRule.HARMONIC_MEAN, 0.0, 0.0) == 0.0
    assert combine(CombineRule.HARMONIC_MEAN, 0.0, 0.7) == 0.0


def test_restitution_by_speed_is_used_at_the_speed_of_the_impact(materials):
    e = materials.find("restitution", "steel", "glass", CombineRule.AVERAGE).value
    impact = resolve(
        Body.dynamic(1.0, velocity=(0, 0, -32.0)), Body.static(), Contact.of((0, 0, 0), (0, 0, 1), e)
    )
    assert impact.twist_a.linear.z == pytest.approx(8.0, rel=1e-15)  # 0.5 (32 / 2)^-0.25 = 0.25
    assert impact.contact.restitution == pytest.approx(0.25, rel=1e-15)


def test_a_power_law_is_capped():
    e = power_law(0.5, 2.0, 0.25)
    assert e(2.0) == pytest.approx(0.5, rel=1e-15)
    assert e(0.125) == pytest.approx(1.0, rel=1e-15)  # 0.5 (1/16)^-0.25
    assert e(0.0) == e(1e-300) == e(0.1) == 1.0
    assert power_law(0.5, 2.0, 0.0)(0.0) == 0.5


def test_johnson_is_what_thornton_comes_to_for_high_speed():
    for v in (1e8, 1e12):
        assert johnson(0.5)(v) == pytest.approx(plastic(0.5)(v), rel=1 / v)  # the next term goes as 1/v
    assert johnson(0.5)(0.5) == 1.0


def test_a_table_is_followed_by_straight_lines():
    e = tabulated([1.0, 2.0, 4.0], [1.0, 0.5, 0.25])
    assert [e(v) for v in (0.0, 1.0, 1.5, 2.0, 3.0, 4.0, 9.0)] == [1.0, 1.0, 0.75, 0.5, 0.375, 0.25, 0.25]


E = "pairs[0].restitution"


def pair(text):
    return f"pairs: [{{materials: [a, b], {text}}}]"


@pytest.mark.parametrize(
    ("text", "code", "field"),
    [
        (pair("restitution: 1.5"), "INVALID_COEFFICIENT", E),
        (pair("restitution: -0.1"), "INVALID_COEFFICIENT", E),
        (pair("restitution: .nan"), "NOT_FINITE", E),
        (pair("restitution: high"), "INVALID_TABLE", E),
        (pair("restitution: true"), "INVALID_TABLE", E),
        (pair("restitution: {speeds: [1, 3, 2], values: [1, 1, 1]}"), "INVALID_COEFFICIENT", E),
        (pair("restitution: {speeds: [1, 1], values: [1, 1]}"), "INVALID_COEFFICIENT", E),
        (pair("restitution: {speeds: [1, 2], values: [1, 2]}"), "INVALID_COEFFICIENT", E),
        (pair("restitution: {speeds: [1, 2], values: [1]}"), "INVALID_COEFFICIENT", E),
        (pair("restitution: {speeds: [], values: []}"), "INVALID_COEFFICIENT", E),
        (pair("restitution: {speeds: 1, values: 1}"), "INVALID_COEFFICIENT", E),
        (pair("restitution: {yield_speed: 0, after: thornton}"), "INVALID_COEFFICIENT", E),
        (pair("restitution: {yield_speed: 1, after: hertz}"), "INVALID_TABLE", E),
        (pair("restitution: {power: 1, speed: 1, value: 2}"), "INVALID_COEFFICIENT", E),
        (pair("friction: -1"), "INVALID_COEFFICIENT", "pairs[0].friction"),
        (pair("tangential_restitution: 2"), "INVALID_COEFFICIENT", "pairs[0].tangential_restitution"),
        (pair("stiffness_ratio: 0"), "INVALID_COEFFICIENT", "pairs[0].stiffness_ratio"),
        (pair("fricton: 0.1"), "INVALID_TABLE", "pairs[0]"),
        ("pairs: [{friction: 0.1}]", "INVALID_TABLE", "pairs[0].materials"),
        ("pairs: [{materials: [a, b, c]}]", "INVALID_TABLE", "pairs[0].materials"),
        ("pairs: [{materials: [a, b]}, {materials: [b, a]}]", "INVALID_TABLE", "pairs[1].materials"),
        ("pairs: {a: b}", "INVALID_TABLE", "pairs"),
        ("pair: []", "INVALID_TABLE", "materials file"),
        ("materials: {steel: {restitution: 2}}", "INVALID_COEFFICIENT", "materials.steel.restitution"),
        ("materials: {steel: 0.5}", "INVALID_TABLE", "materials.steel"),
        ("- 1", "INVALID_TABLE", "materials file"),
    ],
)
def test_a_bad_file_is_refused_by_code_and_field(tmp_path, text, code, field):
    path = tmp_path / "materials.yaml"
    path.write_text(text)
    with pytest.raises(ImpactError) as refusal:
        Materials.read(path)
    assert (refusal.value.code.name, refusal.value.field) == (code, field)


def test_what_is_no_yaml_is_refused_in_one_line(tmp_path):
    path = tmp_path / "materials.yaml"
    path.write_text("pairs: [")
    with pytest.raises(ImpactError, match="is no YAML") as refusal:
        Materials.read(path)
    assert "\n" not in str(refusal.value)


def test_an_unknown_material_is_refused_with_those_that_are_known(materials):
    with pytest.raises(ImpactError, match="'cheese'; known are glass, rubber, steel") as refusal:
        materials.check("body_a.material", "cheese")
    assert (refusal.value.code.name, refusal.value.field) == ("UNKNOWN_MATERIAL", "body_a.material")
    with pytest.raises(ImpactError, match="known are none"):
        NOTHING.check("body_a.material", "steel")


def test_an_empty_file_says_nothing(tmp_path):
    path = tmp_path / "materials.yaml"
    path.write_text("")
    assert Materials.read(path) == NOTHING


def test_the_published_values_name_their_sources():
    published = Materials.read(PUBLISHED)
    assert published.pairs
    assert all("(" in one.source for one in published.pairs.values())
    pair = published.between("soda-lime glass", "aluminium oxide")
    assert (pair.restitution, pair.friction) == (0.98, 0.092)
    assert pair.stiffness_ratio == pytest.approx(
        2 * (1 - 0.23) / (2 - 0.23), abs=5e-4
    )  # two digits are given


def test_friction_of_a_pair_may_depend_on_the_slip_speed():
    read = Materials.of(
        {
            "pairs": [
                {"materials": ["a", "b"], "friction": {"static": 0.5, "kinetic": 0.25, "speed": 2}},
                {"materials": ["a", "c"], "friction": {"speeds": [1, 3], "values": [2.0, 1.0]}},
            ]
        }
    )
    assert read.find("friction", "b", "a", CombineRule.AVERAGE).value(2.0) == pytest.approx(
        0.25 + 0.25 / math.e, rel=1e-15
    )
    assert read.find("friction", "a", "c", CombineRule.AVERAGE).value(2.0) == 1.5


@pytest.mark.parametrize(
    ("friction", "code"),
    [
        ({"static": 0.5, "kinetic": 0.2}, StatusCode.INVALID_TABLE),
        ({"power": 1, "speed": 1, "value": 0.5}, StatusCode.INVALID_TABLE),
        ({"static": -0.5, "kinetic": 0.2, "speed": 1}, StatusCode.INVALID_COEFFICIENT),
        ({"static": "high", "kinetic": 0.2, "speed": 1}, StatusCode.INVALID_COEFFICIENT),
        ({"speeds": [1, 1], "values": [0.1, 0.2]}, StatusCode.INVALID_COEFFICIENT),
        (None, StatusCode.INVALID_TABLE),
        (-1, StatusCode.INVALID_COEFFICIENT),
    ],
)
def test_friction_by_speed_is_checked(friction, code):
    with pytest.raises(ImpactError) as error:
        Materials.of({"pairs": [{"materials": ["a", "b"], "friction": friction}]})
    assert (error.value.code, error.value.field) == (code, "pairs[0].friction")
