"""The parameters of the node: their declarations, and immutable snapshots of their values."""

from __future__ import annotations

import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor, SetParametersResult
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import HistoryPolicy, ReliabilityPolicy
from rclpy.service_introspection import ServiceIntrospectionState

from ..materials import NO_MATERIALS, Materials
from ..model import ENUMERATIONS, STIFFNESS_RATIOS, ImpactModel, check_model
from ..physics.combine import CombineRule
from ..physics.stiffness import METAL_ON_METAL
from ..recording.recorder import MAX_DURATION, MAX_SIZE, check_name
from ..status import ImpactError, format_range
from .process import StartError

CHOICES: Mapping[str, Mapping[str, Any]] = {
    **{field: {member.name.lower(): member for member in kind} for field, kind in ENUMERATIONS.items()},
    "combine_restitution": {rule.value: rule for rule in CombineRule},
    "combine_friction": {rule.value: rule for rule in CombineRule if rule is not CombineRule.ENERGETIC},
    "service_introspection": {
        "off": ServiceIntrospectionState.OFF,
        "metadata": ServiceIntrospectionState.METADATA,
        "contents": ServiceIntrospectionState.CONTENTS,
    },
}
"""The values that some parameters may have, and what each stands for."""


class Declaration(NamedTuple):
    """A parameter as it is declared; ``least`` and ``most`` are the limits of a number."""

    name: str
    default: Any
    description: str
    least: float = 0.0
    most: float = math.inf
    read_only: bool = False

    def full_description(self) -> str:
        """The description, and the choices if there are some."""
        one_of = f" One of {', '.join(CHOICES[self.name])}." if self.name in CHOICES else ""
        return self.description + one_of

    def descriptor(self) -> ParameterDescriptor:
        """Descriptor that ``ros2 param describe`` shows."""
        descriptor = ParameterDescriptor(description=self.description, read_only=self.read_only)
        if isinstance(self.default, float):
            descriptor.floating_point_range = [FloatingPointRange(from_value=self.least, to_value=self.most)]
        elif type(self.default) is int:
            descriptor.integer_range = [IntegerRange(from_value=int(self.least), to_value=int(self.most))]
        if self.name in CHOICES:
            descriptor.additional_constraints = "one of: " + ", ".join(CHOICES[self.name])
        return descriptor


fixed = partial(Declaration, read_only=True)
"""Declare a parameter that only the start of a node can set."""

DECLARATIONS = (
    Declaration("world_frame", "", "The only frame_id accepted in requests. Empty: any."),
    fixed("body_state_topics", ["body_states"], 'Topics of BodyState to subscribe to. [""]: none.'),
    fixed(
        "max_bodies",
        10_000,
        "Number of body states to keep, and as many again from the last BodyStates table of each publisher. "
        "Beyond, the least recently updated are dropped.",
        1,
        10**6,
    ),
    Declaration(
        "max_state_age",
        0.0,
        "Longest time [s] from a contact to the state of a body by name, else STALE_STATE. 0: no limit.",
    ),
    Declaration(
        "max_state_wait",
        0.5,
        "Longest time [s] to wait for states that not_before of a request asks for.",
        most=60.0,
    ),
    Declaration(
        "restitution", 1.0, "Restitution where no contact, material or pair of bodies gives one.", most=1.0
    ),
    Declaration(
        "friction", 0.0, "Friction where no contact, material or pair of bodies gives one.", most=1000.0
    ),
    Declaration("combine_restitution", "average", "How the restitutions of two bodies are combined."),
    Declaration("combine_friction", "average", "How the frictions of two bodies are combined."),
    fixed(
        "materials_file", "", "YAML file with coefficients of materials and pairs of materials. Empty: none."
    ),
    Declaration("law", "auto", "Impact law. auto: coulomb where there is friction, else frictionless."),
    Declaration("geometry", "auto", "Which motion is modelled. auto: the simplest geometry that is exact."),
    Declaration(
        "precision",
        "auto",
        "Arithmetic. auto: double, or extended where double misses the tolerance or, without one, has an "
        "error bound above 1e-6.",
    ),
    Declaration("tolerance", 0.0, "Greatest error bound that is accepted. 0: any that is finite.", most=1.0),
    Declaration(
        "tangential_restitution",
        0.0,
        "Coefficient of tangential restitution, for the law coulomb. 1: a superball.",
        -1.0,
        1.0,
    ),
    Declaration("restitution_threshold", 0.0, "Approach speed [m/s] below which restitution is taken as 0."),
    Declaration(
        "stiffness_ratio",
        METAL_ON_METAL,
        "Tangential over normal stiffness of the contact, for the law compliant.",
        *STIFFNESS_RATIOS,
    ),
    fixed(
        "scene_tolerance",
        0.0,
        "Log the simplest model with which all of ~/resolve_collision so far meets this tolerance. 0: off.",
    ),
    Declaration("budget.contacts", 200_000, "Greatest number of contacts in one batch.", 1, 10**9),
    Declaration("budget.scene_contacts", 256, "Greatest number of contacts in one scene.", 1, 4096),
    Declaration(
        "budget.time", 60.0, "Longest computing time [s] of one request that is no scene. 0: no limit."
    ),
    fixed(
        "memory_limit",
        2048,
        "Memory [MiB] of the process; what needs more is refused, or does not reach the node. 0: no limit.",
        0,
        10**9,
    ),
    Declaration(
        "shutdown_timeout",
        5.0,
        "Longest time [s] from SIGINT or SIGTERM to the end; requests that have arrived are answered first.",
        most=86_400.0,
    ),
    fixed("service_introspection", "off", "What to publish of each call, for ros2 service echo."),
    fixed("recording.enabled", False, "Record impacts and body states for the rerun viewer."),
    fixed(
        "recording.directory",
        "recordings",
        "Directory of the recordings. Each start of the node makes new files.",
    ),
    fixed(
        "recording.file",
        "",
        "Name of the first file, such as a.rrd, which must not exist yet. Empty: made from the time.",
    ),
    fixed("recording.max_size", MAX_SIZE, "Size [MB] at which the next file begins. 0: no limit."),
    fixed("recording.max_duration", MAX_DURATION, "Time [s] after which the next file begins. 0: no limit."),
)


@dataclass(frozen=True)
class Parameters:
    """Values of the parameters that may change while the node runs.

    The fields are named like the parameters, with an underscore for a dot. ``model`` holds the parameters
    that are fields of :class:`~collision_response.ImpactModel`, ``materials`` the contents of
    ``materials_file``.
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


def materials_in(file: str) -> Materials:
    """Read a file of materials; without a name, return no materials. Raises as :meth:`Materials.read`."""
    return Materials.read(Path(os.path.expanduser(file))) if file else NO_MATERIALS


class LatestParameters:
    """The parameters of a node as they were last set, in ``values``.

    They are read when they change, not for each request.
    """

    def __init__(self, node: Node) -> None:
        self._value_of = partial(value_of, node)
        self._materials = materials_in(self._value_of("materials_file"))
        self._read([])
        node.add_post_set_parameters_callback(self._read)

    def _read(self, _: list[Parameter[Any]]) -> None:
        names = {declaration.name.replace(".", "_"): declaration.name for declaration in DECLARATIONS}
        self.values = Parameters(
            **{
                field: self._value_of(names[field])
                for field in names.keys() & Parameters.__dataclass_fields__
            },
            model=ImpactModel(*map(self._value_of, ImpactModel._fields)),
            materials=self._materials,
        )


QOS_OVERRIDES = "qos_overrides."
"""Prefix of the parameters that set the QoS of a topic."""

POLICIES = {
    kind: [key for key in policy.short_keys() if key != "unknown"]
    for kind, policy in (("history", HistoryPolicy), ("reliability", ReliabilityPolicy))
}

MAX_DEPTH = 2**31 - 1

DECLARED_BY_RCLPY = {"use_sim_time", "start_type_description_service"}
"""Parameters that rclpy declares for every node."""


class DeclaringNode(Node):
    """A node that first declares all parameters that were given, so that :func:`declare` knows them."""

    def __init__(self, name: str, **options: Any) -> None:
        super().__init__(name, automatically_declare_parameters_from_overrides=True, **options)

    def declare_parameters(self, namespace: str, parameters: Any, ignore_override: bool = False) -> Any:
        """Declare parameters. An empty list that was given is refused here: rclpy would not say its name."""
        if ignore_override:  # rclpy declares what was given
            for name, value, _ in parameters:
                if value is None:
                    raise StartError(f"{name}: an empty list has no type: write [''] for none")
        return super().declare_parameters(namespace, parameters, ignore_override)


def declare(node: DeclaringNode, declarations: Sequence[Declaration]) -> set[str]:
    """Declare the parameters of a node, and return the names of those that were given.

    They are declared again here, with descriptions and ranges.

    Raises:
        rclpy.exceptions.ParameterException: if a value that was given is not allowed.
        StartError: if a number that needs a point was given without one, or something that is not text in
            place of text.
    """
    given = node.get_parameters_by_prefix("")
    for name in DECLARED_BY_RCLPY:
        given.pop(name, None)
    for name in given:
        node.undeclare_parameter(name)
    limits = {one.name: (one.least, one.most) for one in declarations}
    node.add_on_set_parameters_callback(partial(validate, limits))
    for declaration in declarations:
        name, default = declaration.name, declaration.default
        value = given[name].value if name in given else default
        if isinstance(default, float) and type(value) is int:
            raise StartError(f"{name}: write it with a point, as in {value}.0")
        if isinstance(default, str) and not isinstance(value, str):
            raise StartError(
                f"{name}: must be text, but YAML reads {value}: write it in quotes, as in \"'...'\""
            )
        node.declare_parameter(name, default, declaration.descriptor())
    return set(given)


def warn_of_unknown(node: Node, given: set[str]) -> None:
    """Warn about parameters that were given but do not exist.

    To be called when the node has its topics, because that declares the parameters of their QoS.
    """
    known = list(node.get_parameters_by_prefix(""))
    for name in sorted(given.difference(known)):
        closest = get_close_matches(name, known, 1)
        hint = f"; did you mean {closest[0]!r}?" if closest else ""
        node.get_logger().warning(f"there is no parameter {name!r}{hint}")


Limits: TypeAlias = Mapping[str, tuple[float, float]]
"""The least and the greatest value of numbers, by the names of their parameters."""


def validate(limits: Limits, parameters: list[Parameter[Any]]) -> SetParametersResult:
    """Accept or refuse new values. rclpy itself checks types, and ranges up to a millionth."""
    try:
        for parameter in parameters:
            _check(parameter.name, parameter.value, limits)
    except ValueError as error:
        return SetParametersResult(successful=False, reason=str(error))
    return SetParametersResult(successful=True)


def _check(name: str, value: Any, limits: Limits) -> None:
    """Raise a ``ValueError`` that says what is wrong with a value."""
    if isinstance(value, float) and not math.isfinite(value):
        raise ValueError(f"{name} must be finite, is {value}")
    if isinstance(value, (int, float)) and name in limits:
        least, most = limits[name]
        if not least <= value <= most:
            raise ValueError(f"{name} must be {format_range(least, most)}; is {value}")
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
    """Check the values for which rclpy would raise errors that do not name the parameter."""
    policy = name.rpartition(".")[2]
    if policy == "depth" and not 0 <= value <= MAX_DEPTH:
        raise ValueError(f"{name} must be {format_range(0, MAX_DEPTH)}; is {value}")
    if policy in POLICIES and value.lower() not in POLICIES[policy]:
        raise ValueError(f"{name} must be one of {', '.join(POLICIES[policy])}; is {value!r}")


def value_of(node: Node, name: str) -> Any:
    """Return the value of a parameter, or what it stands for if it is one of some choices."""
    value = node.get_parameter(name).value
    return CHOICES[name][value] if name in CHOICES else value
