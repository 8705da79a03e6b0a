"""The parameters of the node: declared, validated and used."""

from __future__ import annotations

import math
import re
from itertools import product

import pytest

pytest.importorskip("rclpy")

from rclpy.exceptions import ParameterException
from rclpy.parameter import Parameter
from rclpy.qos import ReliabilityPolicy
from ros_graph import balls_meet, wait_until

from collision_response import Law, StatusCode
from collision_response.msg import ImpactModel
from collision_response.ros.parameters import CHOICES, DECLARATIONS

DEFAULTS = {
    "world_frame": "",
    "body_state_topics": ["body_states"],
    "max_bodies": 10_000,
    "max_state_age": 0.0,
    "max_state_wait": 0.5,
    "restitution": 1.0,
    "friction": 0.0,
    "combine_restitution": "average",
    "combine_friction": "average",
    "materials_file": "",
    "law": "auto",
    "geometry": "auto",
    "precision": "auto",
    "tolerance": 0.0,
    "tangential_restitution": 0.0,
    "restitution_threshold": 0.0,
    "stiffness_ratio": 14 / 17,
    "scene_tolerance": 0.0,
    "budget.contacts": 200_000,
    "budget.scene_contacts": 256,
    "budget.time": 60.0,
    "memory_limit": 2048,
    "shutdown_timeout": 5.0,
    "service_introspection": "off",
    "recording.enabled": False,
    "recording.directory": "recordings",
    "recording.file": "",
    "recording.max_size": 50.0,
    "recording.max_duration": 3600.0,
}


def test_parameters_have_defaults_descriptions_and_limits(shared_node):
    node = shared_node.node
    names = [declaration.name for declaration in DECLARATIONS]
    assert {name: node.get_parameter(name).value for name in names} == DEFAULTS
    for name, default in DEFAULTS.items():
        descriptor = node.describe_parameter(name)
        assert descriptor.description.endswith(".")
        assert len(descriptor.floating_point_range) == isinstance(default, float)
        assert len(descriptor.integer_range) == (type(default) is int)
        for choice in CHOICES.get(name, ()):
            assert choice in descriptor.additional_constraints


@pytest.mark.parametrize(
    ("name", "value", "reason"),
    [
        ("restitution", 1.5, "1.5"),
        ("restitution", math.nan, "nan"),
        ("friction", -0.25, "-0.25"),
        ("friction", math.inf, "inf"),
        ("friction", math.nan, "nan"),
        ("tolerance", math.nan, "nan"),
        ("max_state_age", -1.0, "-1.0"),
        ("tangential_restitution", -1.5, "-1.5"),
        ("tolerance", math.inf, "inf"),
        ("tolerance", 2.0, "2.0"),
        ("friction", 1e300, "1e+300"),
        ("shutdown_timeout", 1e10, "10000000000.0"),
        ("budget.contacts", 0, "0"),
        ("budget.scene_contacts", 4097, "4097"),
        ("max_state_wait", 61.0, "61.0"),
        ("max_state_wait", 60.00005, "must be in [0, 60]; is 60.00005"),
        ("restitution", 1.0000009, "must be in [0, 1]; is 1.0000009"),
        ("max_bodies", 5, "read-only"),
        ("law", "coulomp", "frictionless, coulomb"),
        ("geometry", "flat", "point, planar, spatial"),
        ("precision", "half", "single, double, extended"),
        ("combine_friction", "mean", "geometric_mean"),
        ("friction", "high", "type"),
        ("recording.enabled", True, "read-only"),
        ("body_state_topics", ["other"], "read-only"),
    ],
)
def test_invalid_values_are_refused_with_the_reason(shared_node, name, value, reason):
    node = shared_node.node
    (outcome,) = node.set_parameters([Parameter(name, value=value)])
    assert not outcome.successful
    assert reason in outcome.reason
    assert node.get_parameter(name).value == DEFAULTS[name]


@pytest.mark.parametrize(
    ("name", "value"),
    [("tangential_restitution", -1.0), ("budget.scene_contacts", 4096), ("max_state_wait", 60.0)],
)
def test_ranges_include_their_ends(graph, name, value):
    (outcome,) = graph.serve().set_parameters([Parameter(name, value=value)])
    assert outcome.successful


def test_a_new_value_applies_from_the_next_answer(graph):
    node = graph.serve(restitution=0.5)
    request = balls_meet()
    request.contact.restitution = -1.0
    assert graph.call(request).result.normal_velocity_after == 2.0
    (outcome,) = node.set_parameters([Parameter("restitution", value=0.25)])
    assert outcome.successful
    result = graph.call(request).result
    assert (result.normal_velocity_after, result.contact.restitution) == (1.0, 0.25)


def test_atomic_changes_apply_together_or_not_at_all(graph):
    node = graph.serve()
    request = balls_meet()
    request.contact.restitution = request.contact.friction = -1.0

    def used():
        result = graph.call(request).result
        return result.contact.restitution, result.contact.friction, result.model.law

    wanted = {"restitution": 0.25, "friction": 0.5, "law": "moreau"}
    together = [Parameter(name, value=value) for name, value in wanted.items()]
    assert node.set_parameters_atomically(together).successful
    assert used() == (0.25, 0.5, ImpactModel.MOREAU)

    refused = [Parameter("restitution", value=0.75), Parameter("law", value="coulomp")]
    assert not node.set_parameters_atomically(refused).successful
    assert used() == (0.25, 0.5, ImpactModel.MOREAU)


@pytest.mark.parametrize(
    ("rule", "restitution", "friction"),
    [
        ("average", 0.625, 1.25),
        ("multiply", 0.25, 1.0),
        ("minimum", 0.25, 0.5),
        ("maximum", 1.0, 2.0),
        ("geometric_mean", 0.5, 1.0),
    ],
)
def test_the_coefficients_of_two_bodies_are_combined(graph, rule, restitution, friction):
    graph.serve(combine_restitution=rule, combine_friction=rule, restitution=0.75, friction=0.75)
    request = balls_meet()
    request.contact.restitution = request.contact.friction = -1.0
    request.body_a.restitution, request.body_b.restitution = 0.25, 1.0
    request.body_a.friction, request.body_b.friction = 0.5, 2.0
    contact = graph.call(request).result.contact
    assert (contact.restitution, contact.friction) == (restitution, friction)


def test_the_contact_comes_before_the_bodies_and_both_before_the_parameter(graph):
    graph.serve(restitution=0.75, friction=0.375)
    request = balls_meet()
    request.contact.restitution, request.contact.friction = 0.5, -1.0
    request.body_a.restitution, request.body_b.restitution = 0.0, 0.0
    request.body_a.friction = 0.25  # of only one body: no use
    contact = graph.call(request).result.contact
    assert (contact.restitution, contact.friction) == (0.5, 0.375)


MATERIALS = """
pairs:
  - materials: [glass, steel]
    restitution: {yield_speed: 0.25, after: johnson}
    friction: 0.125
    tangential_restitution: 0.5
    source: a page
materials: {rubber: {restitution: 1.0, friction: 1.0}, steel: {restitution: 0.25}}
"""


def test_a_pair_of_materials_overrides_all_but_the_contact(graph, tmp_path, monkeypatch):
    monkeypatch.setenv("HOME", str(tmp_path))
    (tmp_path / "materials.yaml").write_text(MATERIALS)
    graph.serve(materials_file="~/materials.yaml", combine_restitution="geometric_mean", friction=0.75)
    request = balls_meet()
    request.contact.restitution = request.contact.friction = -1.0
    request.body_a.material, request.body_b.material = "steel", "glass"
    request.body_a.restitution = request.body_b.restitution = 0.5
    result = graph.call(request).result
    assert (result.restitution_from, result.friction_from) == (result.FROM_PAIR, result.FROM_PAIR)
    assert (result.restitution_rule, result.friction_rule) == ("a page", "a page")
    johnson = 1.185 * (0.25 / 4.0) ** 0.25  # four digits
    assert result.contact.restitution == pytest.approx(johnson, rel=1e-3)
    assert (result.contact.friction, result.model.tangential_restitution) == (0.125, 0.5)

    request.body_b.material = "rubber"
    request.body_a.friction, request.body_b.friction = 0.25, 0.75
    result = graph.call(request).result
    assert (result.restitution_from, result.restitution_rule) == (result.FROM_MATERIALS, "geometric_mean")
    assert (result.friction_from, result.friction_rule) == (result.FROM_BODIES, "average")
    assert (result.contact.restitution, result.contact.friction) == (0.5, 0.5)
    assert result.model.tangential_restitution == 0.0

    request.contact.restitution = 0.75
    result = graph.call(request).result
    assert (result.restitution_from, result.restitution_rule) == (result.FROM_CONTACT, "")

    request.body_b.material = "cheese"
    status = graph.call(request).result.status
    assert status.code == StatusCode.UNKNOWN_MATERIAL
    assert status.message.startswith("body_b.material: is 'cheese'; the file has glass, rubber, steel")


def test_friction_by_slip_speed_is_evaluated_once_and_refused_by_path_laws(graph, tmp_path):
    file = tmp_path / "materials.yaml"
    friction = "{static: 0.5, kinetic: 0.25, speed: 1.0}"
    file.write_text(f"pairs: [{{materials: [glass, steel], friction: {friction}}}]")
    graph.serve(materials_file=str(file))
    request = balls_meet()
    request.contact.friction = -1.0
    request.body_a.material, request.body_b.material = "steel", "glass"
    assert 0.25 < graph.call(request).result.contact.friction <= 0.5
    for law in (Law.ROUTH_POISSON, Law.ROUTH_STRONGE, Law.COMPLIANT):
        request.model.law = law
        status = graph.call(request).result.status
        assert status.code == StatusCode.INVALID_MODEL
        assert status.message.startswith("contact.friction: ")
        assert law.name in status.message


def test_a_node_does_not_start_with_a_bad_file_of_materials(graph, tmp_path):
    file = tmp_path / "materials.yaml"
    file.write_text("materials: {steel: {restitution: 2}}")
    with pytest.raises(ParameterException, match=r"materials\.steel\.restitution: must be in \[0, 1\]; is 2"):
        graph.serve(materials_file=str(file))


def test_parameters_fill_in_what_a_request_leaves_open(graph):
    graph.serve(law="coulomb", geometry="spatial", tangential_restitution=0.5, restitution_threshold=5.0)
    request = balls_meet()
    result = graph.call(request).result
    assert (result.model.law, result.model.geometry) == (ImpactModel.COULOMB, ImpactModel.SPATIAL)
    assert (result.model.tangential_restitution, result.model.restitution_threshold) == (0.5, 5.0)
    assert result.contact.restitution == 0.0  # at 4 m/s

    request.model.law, request.model.geometry = ImpactModel.FRICTIONLESS, ImpactModel.POINT
    result = graph.call(request).result
    assert (result.model.law, result.model.geometry) == (ImpactModel.FRICTIONLESS, ImpactModel.POINT)


def test_every_law_works_with_every_precision(graph):
    node = graph.serve()
    for law, precision in product(CHOICES["law"], CHOICES["precision"]):
        wanted = [Parameter("law", value=law), Parameter("precision", value=precision)]
        assert node.set_parameters_atomically(wanted).successful
        assert graph.call(balls_meet()).success, (law, precision)


@pytest.mark.parametrize("topic", ["body_states.subscription", "collision_response/result.publisher"])
@pytest.mark.parametrize(
    ("policy", "value", "must"),
    [
        ("reliability", "bogus", "one of system_default, reliable, best_effort"),
        ("reliability", "", "one of system_default, reliable, best_effort"),
        ("history", "unknown", "one of system_default, keep_last, keep_all; is 'unknown'"),
        ("depth", -1, "in [0, 2147483647]; is -1"),
        ("depth", 2**31, "in [0, 2147483647]; is 2147483648"),
    ],
)
def test_an_invalid_qos_override_is_refused_by_name(graph, topic, policy, value, must):
    name = f"qos_overrides.{graph.namespace}/{topic}.{policy}"
    with pytest.raises(ParameterException, match=re.escape(f"{name} must be {must}")):
        graph.serve(**{name: value})


@pytest.mark.parametrize("value", ["best_effort", "BEST_EFFORT"])
def test_a_qos_override_may_be_upper_case(graph, value):
    graph.serve(**{f"qos_overrides.{graph.namespace}/collision_response/result.publisher.reliability": value})
    topic = graph.node.impact_service.answer_log.topics[0]
    (publisher,) = wait_until(lambda: graph.user.get_publishers_info_by_topic(topic))
    assert publisher.qos_profile.reliability is ReliabilityPolicy.BEST_EFFORT


@pytest.mark.parametrize(
    ("given", "meant"),
    [
        ("/all_body_states.subscription.depth", "{}/all_body_states.subscription.depth"),
        ("{}/body_state.subscription.depth", "{}/body_states.subscription.depth"),
        ("{}/body_states.subscription.durability", "{}/body_states.subscription.reliability"),
        ("{}/diagnostics.publisher.depth", "/diagnostics.publisher.depth"),
    ],
)
def test_a_qos_override_that_overrides_nothing_is_warned_about(graph, given, meant):
    logged = graph.log()
    given, meant = (f"qos_overrides.{name.format(graph.namespace)}" for name in (given, meant))
    graph.serve(**{given: 3})
    expected = f"there is no parameter {given!r}; did you mean {meant!r}?"
    assert wait_until(lambda: [text for text in logged if "there is no" in text]) == [expected]


def test_no_far_name_is_proposed_for_an_unknown_parameter(graph):
    logged = graph.log()
    graph.serve(nosuch=3)
    said = wait_until(lambda: [text for text in logged if "there is no" in text])
    assert said == ["there is no parameter 'nosuch'"]


def test_a_qos_override_applies_to_one_topic(graph):
    name = f"qos_overrides.{graph.namespace}/collision_response/result.publisher"
    graph.serve(**{f"{name}.reliability": "best_effort", f"{name}.depth": 3})
    topic = f"{graph.namespace}/collision_response/scene_result"
    (publisher,) = wait_until(lambda: graph.user.get_publishers_info_by_topic(topic))
    assert publisher.qos_profile.reliability is ReliabilityPolicy.RELIABLE
