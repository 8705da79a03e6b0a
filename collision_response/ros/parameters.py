"""The parameters of the node: declared with descriptions and ranges, read as frozen snapshots."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from enum import IntEnum
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor, SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import HistoryPolicy, ReliabilityPolicy
from rclpy.service_introspection import ServiceIntrospectionState

from ..materials import NO_MATERIALS, Materials
from ..model import STIFFNESS_RATIOS, Geometry, ImpactModel, Precision, check_model
from ..physics.combine import CombineRule
from ..physics.laws import Law
from ..physics.stiffness import METAL_ON_METAL
from ..recording.recorder import MAX_DURATION, MAX_SIZE, check_name
from ..status import ImpactError, format_range


def _by_name(kind: type[IntEnum]) -> dict[str, IntEnum]:
    return {member.name.lower(): member for member in kind}


CHOICES: Mapping[str, Mapping[str, Any]] = {
    "law": _by_name(Law),
    "geometry": _by_name(Geometry),
    "precision": _by_name(Precision),
    "combine_restitution": {rule.value: rule for rule in CombineRule},
    "combine_friction": {rule.value: rule for rule in CombineRule if rule is not CombineRule.ENERGETIC},
    "service_introspection": {
        "off": ServiceIntrospectionState.OFF,
        "metadata": ServiceIntrospectionState.METADATA,
        "contents": ServiceIntrospectionState.CONTENTS,
    },
}
"""The words that some parameters may be, and what they mean."""


class Declaration(NamedTuple):
    """A parameter as it is declared; ``least`` and ``most`` are for numbers."""

    name: str
    default: Any
    description: str
    least: float = 0.0
    most: float = math.inf
    read_only: bool = False

    def descriptor(self) -> ParameterDescriptor:
        """What ``ros2 param describe`` shows."""
        descriptor = ParameterDescriptor(description=self.description, read_only=self.read_only)
        if isinstance(self.default, float):
            descriptor.floating_point_range = [FloatingPointRange(from_value=self.least, to_value=self.most)]
        elif type(self.default) is int:
            descriptor.integer_range = [IntegerRange(from_value=int(self.least), to_value=int(self.most))]
        if self.name in CHOICES:
            descriptor.additional_constraints = "one of: " + ", ".join(CHOICES[self.name])
        return descriptor


DECLARATIONS = (
    Declaration("world_frame", "", "Only frame_id accepted in requests. Empty: any one."),
    Declaration(
        "body_state_topics", ["body_states"], "Topics of BodyState to listen to; '' for none.", read_only=True
    ),
    Declaration("max_bodies", 10_000, "States remembered; more: the stalest are forgotten.", 1, 10**6, True),
    Declaration(
        "max_state_age", 0.0, "Time [s] between a state and the contact above which it is refused. 0: any."
    ),
    Declaration(
        "max_state_wait",
        0.5,
        "Longest wait [s] for a state that not_before of a request asks for.",
        most=60.0,
    ),
    Declaration("restitution", 1.0, "Where neither the contact nor both bodies give one.", most=1.0),
    Declaration("friction", 0.0, "Where neither the contact nor both bodies give one.", most=1000.0),
    Declaration("combine_restitution", "average", "How the bodies' two coefficients become one."),
    Declaration("combine_friction", "average", "How the bodies' two coefficients become one."),
    Declaration(
        "materials_file",
        "",
        "YAML file with the coefficients of pairs of materials. Empty: none.",
        read_only=True,
    ),
    Declaration("law", "auto", "Impact law. auto: coulomb where there is friction, else frictionless."),
    Declaration("geometry", "auto", "How much motion is modelled. auto: the cheapest that is exact."),
    Declaration("precision", "auto", "Arithmetic. auto: double, or what the tolerance asks for."),
    Declaration(
        "tolerance", 0.0, "Greatest relative error of the impulse wanted. 0: any that is known.", most=1.0
    ),
    Declaration("tangential_restitution", 0.0, "For the law coulomb; 1: superball.", -1.0, 1.0),
    Declaration("restitution_threshold", 0.0, "Approach speed [m/s] under which restitution is taken as 0."),
    Declaration(
        "stiffness_ratio",
        METAL_ON_METAL,
        "Tangential over normal stiffness, for the law compliant.",
        *STIFFNESS_RATIOS,
    ),
    Declaration(
        "scene_tolerance",
        0.0,
        "Log the least that meets this tolerance in every impact so far, when it grows. 0: do not.",
        read_only=True,
    ),
    Declaration("budget.contacts", 200_000, "Contacts that one batch may have.", 1, 10**9),
    Declaration("budget.scene_contacts", 256, "Contacts that one scene may have.", 1, 4096),
    Declaration("budget.time", 60.0, "Computing time [s] that one request may take. 0: any."),
    Declaration("memory_limit", 2048, "Memory [MiB] that the process may take. 0: any.", 0, 10**9, True),
    Declaration(
        "shutdown_timeout",
        5.0,
        "Time [s] from SIGINT or SIGTERM to the end, in which requests are answered.",
        most=86_400.0,
    ),
    Declaration(
        "service_introspection",
        "off",
        "What of each call is published for ros2 service echo.",
        read_only=True,
    ),
    Declaration("recording.enabled", False, "Record every impact for the rerun viewer.", read_only=True),
    Declaration(
        "recording.directory", "recordings", "Where to; new files for each start of the node.", read_only=True
    ),
    Declaration(
        "recording.file",
        "",
        "Name of the first file, which must be new. Empty: made from the time.",
        read_only=True,
    ),
    Declaration(
        "recording.max_size", MAX_SIZE, "Size [MB] at which the next file begins. 0: any.", read_only=True
    ),
    Declaration(
        "recording.max_duration",
        MAX_DURATION,
        "Time [s] after which the next file begins. 0: any.",
        read_only=True,
    ),
)

NAMES = {declaration.name.replace(".", "_"): declaration.name for declaration in DECLARATIONS}
"""Of the parameters, by the fields that hold them."""


@dataclass(frozen=True)
class Parameters:
    """What may change while the node runs, as it was at one moment.

    Fields are named as the parameters, with an underscore for a dot.
    """

    world_frame: str
    max_state_age: float
    max_state_wait: float
    budget_contacts: int
    budget_scene_contacts: int
    budget_time: float
    shutdown_timeout: float
    restitution: float
    friction: float
    combine_restitution: CombineRule
    combine_friction: CombineRule
    model: ImpactModel
    materials: Materials = NO_MATERIALS

    @classmethod
    def of(cls, node: Node) -> Parameters:
        """The present values of a node."""
        return cls(
            **{field: _value(node, NAMES[field]) for field in PARAMETERS},
            model=ImpactModel(*(_value(node, field) for field in ImpactModel._fields)),
            materials=materials_in(_value(node, "materials_file")),
        )


@cache
def materials_in(file: str) -> Materials:
    """What a file says; nothing without one. Read once. Raises: see :meth:`Materials.read`."""
    return Materials.read(Path(file)) if file else NO_MATERIALS


PARAMETERS = tuple(field for field in Parameters.__dataclass_fields__ if field not in ("model", "materials"))


class LatestParameters:
    """The parameters of a node as they were last set: reading them costs a request nothing.

    Attributes:
        values: the present ones.
    """

    def __init__(self, node: Node) -> None:
        """Read them, now and after each change; all must have been declared."""
        self._node = node
        self.values = Parameters.of(node)
        node.add_post_set_parameters_callback(self._read)

    def _read(self, _: list[Parameter[Any]]) -> None:
        self.values = Parameters.of(self._node)


@dataclass(frozen=True)
class StartParameters:
    """What is read once."""

    body_state_topics: tuple[str, ...]
    recording_directory: Path | None
    """``None``: do not record."""
    recording_file: str
    recording_max_size: float
    """Of a file [MB]; 0: any."""
    recording_max_duration: float
    """Of a file [s]; 0: any."""
    scene_tolerance: float
    """0: do not log what the scene requires."""
    max_bodies: int
    service_introspection: ServiceIntrospectionState

    @classmethod
    def of(cls, node: Node) -> StartParameters:
        """The values a node was started with."""
        values = {field: _value(node, NAMES[field]) for field in cls.__dataclass_fields__}
        values["body_state_topics"] = tuple(filter(None, dict.fromkeys(values["body_state_topics"])))
        is_recording, directory = _value(node, "recording.enabled"), values["recording_directory"]
        values["recording_directory"] = Path(directory) if is_recording else None
        return cls(**values)


QOS_OVERRIDES = "qos_overrides."
"""What the parameters begin with that set the QoS of a topic."""

POLICIES = {
    kind: [key for key in policy.short_keys() if key != "unknown"]
    for kind, policy in (("history", HistoryPolicy), ("reliability", ReliabilityPolicy))
}

MOST_DEPTH = 2**31 - 1

OWN_BY_RCLPY = {"use_sim_time", "start_type_description_service"}
"""What every node declares by itself."""


def declare(node: Node, declarations: Iterable[Declaration]) -> None:
    """Declare every parameter of a node, and warn of those that it was given and does not have.

    Args:
        node: made with ``automatically_declare_parameters_from_overrides``, which tells what it was given.
        declarations: of its parameters.

    Raises:
        rclpy.exceptions.ParameterException: the node was started with a value that is not allowed.
    """
    given = set(node.get_parameters_by_prefix("")) - OWN_BY_RCLPY
    for name in given:
        node.undeclare_parameter(name)
    node.add_on_set_parameters_callback(validate)
    known = []
    for declaration in declarations:
        node.declare_parameter(declaration.name, declaration.default, declaration.descriptor())
        known.append(declaration.name)
    for name in sorted(given.difference(known)):
        if not name.startswith(QOS_OVERRIDES):
            (like,) = get_close_matches(name, known, 1, 0.0)
            node.get_logger().warning(f"there is no parameter {name!r}; did you mean {like!r}?")


def validate(parameters: list[Parameter[Any]]) -> SetParametersResult:
    """Accept new values, or say what is wrong with one; types and ranges rclpy checks itself."""
    try:
        for parameter in parameters:
            _check(parameter.name, parameter.value)
    except ValueError as error:
        return SetParametersResult(successful=False, reason=str(error))
    return SetParametersResult(successful=True)


def _check(name: str, value: Any) -> None:
    """Raises: ValueError: it says what is wrong."""
    if isinstance(value, float) and not math.isfinite(value):
        raise ValueError(f"{name} must be finite, is {value}")
    if name == "recording.file":
        try:
            check_name(value)
        except ValueError as error:
            raise ValueError(f"{name} {error}") from None
    if name == "materials_file":
        try:
            materials_in(value)
        except (ImpactError, ImportError, OSError) as error:
            raise ValueError(f"{name}: {error}") from None
    if name.startswith(QOS_OVERRIDES):
        _check_qos(name, value)
    choices = CHOICES.get(name)
    if choices is not None and value not in choices:
        raise ValueError(f"{name} must be one of {', '.join(choices)}; is {value!r}")
    if name in ImpactModel._fields:
        check_model(ImpactModel()._replace(**{name: value if choices is None else choices[value]}))


def _check_qos(name: str, value: Any) -> None:
    """What rclpy would raise errors of that do not name the parameter."""
    policy = name.rpartition(".")[2]
    if policy == "depth" and not 0 <= value <= MOST_DEPTH:
        raise ValueError(f"{name} must be {format_range(0, MOST_DEPTH)}; is {value}")
    if policy in POLICIES and value.lower() not in POLICIES[policy]:
        raise ValueError(f"{name} must be one of {', '.join(POLICIES[policy])}; is {value!r}")


def _value(node: Node, name: str) -> Any:
    value = node.get_parameter(name).value
    return CHOICES[name][value] if name in CHOICES else value
