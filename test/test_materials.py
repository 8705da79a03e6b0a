"""Coefficients of pairs of materials: files, speed-dependent restitution and rules of combination."""

from __future__ import annotations

import math
import multiprocessing
import os
import pickle
import subprocess
import sys

import pytest
from refusals import refused

from collision_response import Body, Contact, ImpactError, StatusCode, resolve
from collision_response.physics.combine import CombineRule
from collision_response.physics.restitution import johnson, plastic, power_law, tabulated, viscoelastic

pytest.importorskip("yaml")

from collision_response.materials import FUNCTIONS, NO_MATERIALS, PUBLISHED, Material, Materials

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
def write(tmp_path):
    """Write a file of materials; return its path."""

    def write(text):
        path = tmp_path / "materials.yaml"
        path.write_text(text)
        return path

    return write


@pytest.fixture
def materials(write):
    return Materials.read(write(FILE))


def test_a_pair_entry_has_priority_in_either_order(materials):
    for pair in (("steel", "glass"), ("glass", "steel")):
        found = materials.find("friction", *pair, CombineRule.AVERAGE)
        assert found == (0.1, True, "a page")
    assert materials.between("glass", "steel").tangential_restitution == 0.25


@pytest.mark.parametrize("e_t", [-1.0, 1.0])
def test_a_pair_may_have_any_tangential_restitution(write, e_t):
    materials = Materials.read(write(f"pairs: [{{materials: [a, b], tangential_restitution: {e_t}}}]"))
    assert materials.between("a", "b").tangential_restitution == e_t


def test_missing_pair_values_are_combined_from_the_materials_or_none(materials):
    found = materials.find("restitution", "rubber", "rubber", CombineRule.MULTIPLY)
    assert found == (0.8 * 0.8, False, "multiply")
    assert materials.find("friction", "steel", "rubber", CombineRule.HARMONIC_MEAN).value == 0.2
    assert materials.find("restitution", "rubber", "glass", CombineRule.AVERAGE) is None


def test_the_energetic_rule_weighs_by_compliance(materials):
    """Steel is three times as stiff and takes a quarter of the energy: e^2 = (0.36 + 3 0.64) / 4 = 0.57."""
    found = materials.find("restitution", "steel", "rubber", CombineRule.ENERGETIC)
    assert found.value == pytest.approx(math.sqrt(0.57), rel=1e-15)


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


def test_johnson_is_the_high_speed_limit_of_thornton():
    for v in (1e8, 1e12):
        assert johnson(0.5)(v) == pytest.approx(plastic(0.5)(v), rel=1 / v)  # the next term is of order 1/v
    assert johnson(0.5)(0.5) == 1.0


def test_a_table_is_interpolated():
    e = tabulated([1.0, 2.0, 4.0], [1.0, 0.5, 0.25])
    assert [e(v) for v in (0.0, 1.0, 1.5, 2.0, 3.0, 4.0, 9.0)] == [1.0, 1.0, 0.75, 0.5, 0.375, 0.25, 0.25]


PICKLED = {
    "restitution": [
        {"value": 0.5, "speed": 2.0, "power": 0.25},
        {"value": 0.5, "speed": 2.0, "power": 0},
        {"yield_speed": 0.02, "after": "thornton"},
        {"yield_speed": 0.02, "after": "johnson"},
        {"speeds": [0.1, 1.0], "values": [0.9, 0.7]},
    ],
    "friction": [{"static": 0.5, "kinetic": 0.3, "speed": 0.1}, {"speeds": [0.1, 1.0], "values": [0.5, 1.7]}],
}
"""Every function of speed that a file may have."""
SPEEDS = [0.0, 0.01, 0.3, 1.0, 40.0, 1e300]


def values_of_functions(materials):
    functions = [x for pair in materials.pairs.values() for x in (pair.restitution, pair.friction) if x]
    return [function(v) for function in functions for v in SPEEDS]


def test_functions_of_speed_can_be_sent_to_another_process():
    assert {name: {*map(frozenset, laws)} for name, laws in PICKLED.items()} == {
        name: {frozenset(key.partition(":")[0] for key in keys) for keys in laws}
        for name, laws in FUNCTIONS.items()
    }
    pairs = [
        {"materials": [name, str(i)], name: law}
        for name, laws in PICKLED.items()
        for i, law in enumerate(laws)
    ]
    materials = Materials.of({"pairs": pairs})
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        assert pool.apply(values_of_functions, (materials,)) == values_of_functions(materials)


def test_a_contact_of_viscoelastic_spheres_can_be_pickled():
    ball = Body.dynamic(1.0, velocity=(0.0, 0.0, -2.0))
    contact = Contact.of((0, 0, 0), (0, 0, 1), restitution=viscoelastic(0.1))
    again = pickle.loads(pickle.dumps(contact))
    assert resolve(ball, Body.static(), again) == resolve(ball, Body.static(), contact)


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
        (pair('restitution: {yield_speed: 1, "after: thornton": 5}'), "INVALID_TABLE", E),
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
def test_a_bad_file_is_refused_by_code_and_field(write, text, code, field):
    with refused(StatusCode[code], field):
        Materials.read(write(text))


def test_invalid_yaml_is_refused_in_one_line(write):
    with pytest.raises(ImpactError, match="is not valid YAML") as refusal:
        Materials.read(write("pairs: ["))
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize("odd", [r"\uD800", r"a \udfff", r"\ud83d\ude00"])
@pytest.mark.parametrize(
    "text",
    [
        'pairs: [{{materials: [a, b], source: "{}"}}]',
        'pairs: [{{materials: [a, "{}"]}}]',
        'materials: {{"{}": {{friction: 0.5}}}}',
    ],
    ids=["source", "pair", "material"],
)
def test_half_a_surrogate_pair_is_no_text(write, text, odd):
    """A node could not send it: its answers name materials and sources."""
    with refused(StatusCode.INVALID_TABLE, match="cannot be read as str"):
        Materials.read(write(text.format(odd)))


@pytest.mark.parametrize(
    "text", ["1e7", "1E7", "1e+7", "1.e7", "1.0e7", "+.1e8", "1.0e+7", "10000000", "1e07"]
)
def test_numbers_with_exponents_are_numbers(write, text):
    found = Materials.read(write(f"materials: {{steel: {{stiffness: {text}}}}}"))
    assert found.materials["steel"].stiffness == 1e7


@pytest.mark.parametrize(("text", "value"), [("-.5", -0.5), ("+.5", 0.5), (".5", 0.5), ("-0.5", -0.5)])
def test_numbers_without_a_digit_before_the_point_are_numbers(write, text, value):
    pairs = f"pairs: [{{materials: [steel, steel], tangential_restitution: {text}}}]"
    found = Materials.read(write(f"materials: {{steel: {{}}}}\n{pairs}"))
    assert [pair.tangential_restitution for pair in found.pairs.values()] == [value]


@pytest.mark.parametrize("text", ["1e", "e7", "1e7x", "1e7.0", "1 e7", "1e+-7", "-.", "+.5x"])
def test_what_only_looks_like_a_number_is_refused(write, text):
    with refused(StatusCode.INVALID_TABLE, match="stiffness"):
        Materials.read(write(f"materials: {{steel: {{stiffness: {text}}}}}"))


@pytest.mark.parametrize("text", ["1:30", "-1:30.5", "010", "-0_10", "1_0", "1_0.5"])
def test_numbers_that_yaml_1_1_reads_in_its_own_way_are_refused(write, text):
    with refused(StatusCode.INVALID_TABLE, match="cannot be read as (int|float): quote it if it is text"):
        Materials.read(write(f"materials: {{steel: {{stiffness: {text}}}}}"))


def test_an_unknown_material_is_refused_with_the_known_ones(materials):
    known = "'cheese'; the file has glass, rubber, steel"
    with refused(StatusCode.UNKNOWN_MATERIAL, "body_a.material", known):
        materials.check("body_a.material", "cheese")
    with pytest.raises(ImpactError, match="the file has none"):
        NO_MATERIALS.check("body_a.material", "steel")
    many = Materials({}, {f"m{i:03}": Material() for i in range(1000)})
    with refused(StatusCode.UNKNOWN_MATERIAL, "body_a.material", "the file has m000, m001, .{,500} [.]{3}$"):
        many.check("body_a.material", "x" * 4000)


def test_an_empty_file_has_no_materials(write):
    assert Materials.read(write("")) == NO_MATERIALS


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
def test_invalid_friction_by_speed_is_refused(friction, code):
    with refused(code, "pairs[0].friction"):
        Materials.of({"pairs": [{"materials": ["a", "b"], "friction": friction}]})


LONG = "1" + "0" * 400
DIGITS = "1" + "0" * 5000


@pytest.mark.parametrize(
    ("text", "key"),
    [
        ("materials: {steel: {restitution: 0.9}, steel: {restitution: 0.1}}", "steel"),
        ("materials: {steel: {restitution: 0.9}, 'steel': {restitution: 0.1}}", "steel"),
        ("materials: {steel: {restitution: 0.9, restitution: 0.9}}", "restitution"),
        ("pairs: []\npairs: []", "pairs"),
        ("materials: {}\nmaterials: {}", "materials"),
        (pair("friction: 0.1, friction: 0.5"), "friction"),
        (pair("friction: 0.1, materials: [c, d]"), "materials"),
        (pair("restitution: {speeds: [1], values: [1], values: [0]}"), "values"),
        (pair("friction: {static: 1, kinetic: 1, speed: 1, static: 2}"), "static"),
    ],
)
def test_duplicate_keys_are_refused_at_every_level(write, text, key):
    path = write(text)
    with refused(StatusCode.INVALID_TABLE, str(path), f"'{key}' appears twice .* line "):
        Materials.read(path)


def test_merged_keys_may_be_overridden(write):
    path = write(
        "materials:\n  a: &a {friction: 0.1, restitution: 0.2}\n  b: &b {<<: *a, restitution: 0.3}\n"
        "  c: {<<: *b, friction: 0.4}"
    )
    found = Materials.read(path).materials
    assert [(one.friction, one.restitution) for one in found.values()] == [(0.1, 0.2), (0.1, 0.3), (0.4, 0.3)]


@pytest.mark.parametrize("name", ["no", "yes", "304", "1.50", "0123", "~", "0x1f", "1:30", ".inf", "[a]"])
def test_names_that_yaml_does_not_read_as_text_must_be_quoted(tmp_path, name):
    path = tmp_path / "materials.yaml"
    singles, pairs = f"materials: {{{name}: {{friction: 0.5}}}}", f"pairs: [{{materials: [{name}, b]}}]"
    for text in (singles, pairs):
        path.write_text(text)
        with refused(StatusCode.INVALID_TABLE, match=r"quote|unhashable"):
            Materials.read(path)
        path.write_text(text.replace(name, f'"{name}"'))
        assert name in Materials.read(path).known


@pytest.mark.parametrize("name", [None, True, 304, 1.5, ("a", "b"), b"steel"])
def test_names_must_be_text_in_python_trees_too(name):
    with pytest.raises(ImpactError, match=r"^materials: .* quote "):
        Materials.of({"materials": {name: {}}})
    with pytest.raises(ImpactError, match=r"^pairs\[0\]\.materials: .* quote "):
        Materials.of({"pairs": [{"materials": ["a", name]}]})


@pytest.mark.parametrize(
    ("field", "tree"),
    [
        ("materials", {"materials": {"": {}}}),
        (r"pairs\[0\]\.materials", {"pairs": [{"materials": ["", "a"]}]}),
    ],
)
def test_a_material_without_a_name_is_refused(field, tree):
    with pytest.raises(ImpactError, match=rf"^{field}: must have names; the empty name means no material"):
        Materials.of(tree)


@pytest.mark.parametrize("value", ["false", "0", '""', "{}", "3", "text"])
@pytest.mark.parametrize("field", ["pairs", "materials"])
def test_empty_values_of_the_wrong_type_are_refused_by_field(write, field, value):
    path = write(f"{field}: {value}")
    if (field, value) == ("materials", "{}"):
        assert Materials.read(path) == NO_MATERIALS
        return
    with refused(StatusCode.INVALID_TABLE, match=f"^{field}: must be a "):
        Materials.read(path)


@pytest.mark.parametrize(
    ("written", "source"),
    [
        ("2026-02-30", "2026-02-30"),
        ("2026-02-20", "2026-02-20"),
        ("2026", "2026"),
        ("", ""),
        ("~", ""),
        ("our tests, 2026", "our tests, 2026"),
    ],
)
def test_a_source_is_read_as_text(write, written, source):
    path = write(f"pairs:\n- materials: [a, b]\n  source: {written}\n")
    assert Materials.read(path).between("a", "b").source == source


@pytest.mark.parametrize(
    "text",
    [
        pair("friction: !!float abc"),
        pair('friction: !!float ""'),
        pair("friction: !!bool abc"),
        pair('friction: !!int ""'),
        pair("friction: !!int abc"),
        pair("friction: !!timestamp abc"),
        pytest.param(pair(f"friction: {DIGITS}"), id="5001 digits"),
        pytest.param(pair(f"friction: {':'.join(['1'] * 400)}.0"), id="400 places to the base 60"),
        pytest.param("[" * 2000 + "]" * 2000, id="2000 lists"),
        pytest.param("{a: " * 2000 + "}" * 2000, id="2000 mappings"),
        pair("source: [1]"),
        pair("source: no"),
        pair("source: {a: b}"),
        pair("restitution: {yield_speed: 1, after: [thornton]}"),
        pair("restitution: {1: 2, speeds: 3}"),
        pair("restitution: {[a]: 2}"),
        "pairs: &a [*a]",
        "&a {pairs: *a}",
        "&a {materials: *a}",
    ],
)
def test_malformed_files_are_refused_in_one_line(write, text):
    path = write(text)
    with refused(StatusCode.INVALID_TABLE) as refusal:
        Materials.read(path)
    assert "\n" not in str(refusal.value)
    assert len(str(refusal.value)) < 300 + len(str(path))


@pytest.mark.parametrize(
    ("text", "reason"),
    [
        ("restitution: {speeds: {0: 1, 1: 2}, values: {0: .5, 1: .6}}", "speeds: must be a list of numbers"),
        ("restitution: {speeds: '01', values: [1, 1]}", "speeds: must be a list of numbers, is '01'"),
        ("restitution: {speeds: [1], values: 1}", "values: must be a list of numbers, is 1"),
        ('restitution: {speeds: ["0", 1], values: [1, 1]}', r"speeds\[0\]: must be a real number, is '0'"),
        ("restitution: {speeds: [0, 1], values: [1, true]}", r"values\[1\]: must be a real number, is True"),
        (f"restitution: {{speeds: [0, {LONG}], values: [1, 1]}}", r"speeds\[1\]: must be finite"),
        (f"friction: {{speeds: [0, 1], values: [{LONG}, 1]}}", r"values\[0\]: must be finite"),
        ("restitution: {power: a, speed: 1, value: 0.5}", "power: must be a real number, is 'a'"),
        ("restitution: {power: 1, speed: [1], value: 0.5}", r"speed: must be a real number, is \[1\]"),
        ("restitution: {power: 1, speed: 1, value: true}", "value: must be a real number, is True"),
        (f"restitution: {{power: {LONG}, speed: 1, value: 1}}", "power: must be finite"),
        ("restitution: {yield_speed: ~, after: johnson}", "yield_speed: must be a real number, is None"),
        ("friction: {static: 1, kinetic: .nan, speed: 1}", "kinetic: must be finite; is nan"),
        ("friction: {static: 1, kinetic: 1, speed: high}", "speed: must be a real number, is 'high'"),
    ],
)
def test_invalid_constants_are_refused_by_name(write, text, reason):
    field = text.partition(":")[0]
    with refused(StatusCode.INVALID_COEFFICIENT, match=rf"^pairs\[0\]\.{field}: {reason}"):
        Materials.read(write(pair(text)))


@pytest.mark.parametrize("rule", ["energetic", "energetix", None, 3])
@pytest.mark.parametrize("pair", [("steel", "glass"), ("steel", "rubber")])
def test_an_unknown_rule_is_refused_by_name(materials, rule, pair):
    with pytest.raises(TypeError, match=r"^rule: must be one of CombineRule\.AVERAGE, .*, is "):
        materials.find("friction", *pair, rule)


@pytest.mark.parametrize("coefficient", ["stiffness_ratio", "stiffness", "frction"])
def test_an_unknown_coefficient_is_refused_by_name(materials, coefficient):
    with pytest.raises(ValueError, match=r"^coefficient: must be restitution or friction, is "):
        materials.find(coefficient, "steel", "glass")


@pytest.mark.parametrize("name", [None, 304, ["steel"]])
def test_the_name_of_a_material_is_text(materials, name):
    for field, names in (("a", (name, "steel")), ("b", ("steel", name))):
        with pytest.raises(TypeError, match=f"^{field}: must be the name of a material, is "):
            materials.find("friction", *names)


@pytest.mark.parametrize("rule", CombineRule)
def test_combined_friction_is_finite_or_refused(rule):
    """Only the product of two numbers can exceed both."""
    great = Materials.of({"materials": {"a": {"friction": 1.7e308}, "b": {"friction": 1e308}}})
    if rule is CombineRule.MULTIPLY:
        with refused(
            StatusCode.OUT_OF_RANGE, match=r"^contact.friction: exceeds float64 by the rule multiply: a has "
        ):
            great.find("friction", "a", "b", rule)
    else:
        assert 1e308 <= great.find("friction", "a", "b", rule).value <= 1.7e308


@pytest.mark.parametrize("power", [5e-4, 1e-6, 1e-320])
def test_a_flat_power_law_of_a_file_is_used(power):
    law = {"power": power, "speed": 1.0, "value": 0.5}
    e = Materials.of({"pairs": [{"materials": ["a", "b"], "restitution": law}]}).find("restitution", "a", "b")
    drop = Body.dynamic(1.0, velocity=(0, 0, -1.0))
    impact = resolve(drop, Body.static(), Contact.of((0, 0, 0), (0, 0, 1), e.value))
    assert impact.twist_a.linear.z == 0.5


def test_a_file_is_in_utf_8_whatever_the_locale(tmp_path):
    path = tmp_path / "materials.yaml"
    path.write_bytes("materials: {stål: {friction: 0.5}}".encode())
    program = (
        "import sys, pathlib\n"
        "from collision_response.materials import Materials\n"
        "print(ascii([*Materials.read(pathlib.Path(sys.argv[1])).known]))"
    )
    environment = {**os.environ, "LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
    command = [sys.executable, "-c", program, str(path)]
    run = subprocess.run(command, env=environment, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert run.stdout == "['st\\xe5l']\n", run.stderr
