"""``collision_response call``: send a request in YAML, and print the answer as a table."""

from __future__ import annotations

import argparse
import sys
import time
from difflib import get_close_matches
from typing import Any

from ..ros.take_all import RCLError  # isort: skip  # before rclpy: if that is missing, it says what to install
import numpy as np
import rclpy
from rclpy.exceptions import NameValidationException
from rclpy.qos import HistoryPolicy, QoSProfile
from rclpy.signals import SignalHandlerOptions

from .. import ImpactError, StatusCode
from ..answer import format_columns, format_impact, format_name, format_number
from ..arguments import number_in
from ..model import ENUMERATIONS
from ..msg import BodyState
from ..ros.batch_client import unpack
from ..ros.convert import error_from
from ..ros.tables import LAYOUTS
from ..scene.answer import scene_table
from ..srv import ResolveCollision, ResolveCollisionBatch, ResolveScene
from ..status import format_value
from ..strict_yaml import YAMLError, load_yaml

DESCRIPTION = """Sends a request to the node and prints the answer as a table. The request is YAML, as for
ros2 service call. Fields that are left out have their defaults. Constants may be given by name:

  collision_response call '
  body_a: {inertia: {m: 2.0}, twist: {linear: {z: -3.0}}}
  body_b: {motion_type: STATIC}
  contact: {normal: {z: 1.0}, restitution: 0.5, friction: 0.3}
  model: {law: ROUTH_STRONGE}'

A body without inertia is a point mass. The files in share/collision_response/srv describe all fields, and so
does ros2 interface show collision_response/srv/ResolveCollision. The exit code is 1 if the request is
refused, 2 if it cannot be sent, and 3 if the node does not answer.
"""

NAMES: dict[str, dict[str, int]] = {
    **{field: {member.name: int(member) for member in kind} for field, kind in ENUMERATIONS.items()},
    "motion_type": {name: getattr(BodyState, name) for name in ("DYNAMIC", "KINEMATIC", "STATIC")},
    "layout": {tables.name: number for number, tables in LAYOUTS.items()},
}
"""Numbers by name, for each field whose constants may be given by name."""

MAX_TIMEOUT = 1e6
"""Greatest value of ``--timeout`` [s]."""

SHOWN = 20
"""Number of contacts of a batch that are printed."""


class InvalidRequest(Exception):
    """A request that cannot be sent. The message names the field and says what to write."""


def main(arguments: list[str]) -> int:
    """Send the request and print the answer."""
    parser = argparse.ArgumentParser(
        prog="collision_response call",
        description=DESCRIPTION,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add = parser.add_argument
    add("request", metavar="YAML", help="the request; - to read it from standard input")
    add("--type", choices=SERVICES, default="ResolveCollision", help="type of the service")
    add(
        "--service",
        type=service_name,
        metavar="NAME",
        help="name of the service, if it is not /collision_response/...",
    )
    add("--timeout", type=seconds, default=5.0, metavar="S", help="how long to wait for the node [s]")
    given = parser.parse_args(arguments)
    kind, default, show = SERVICES[given.type]
    try:
        request = kind.Request()
        tree = load_yaml(_read() if given.request == "-" else given.request)
        fill(request, {} if tree is None else tree)  # an empty request has all defaults
        service = f"/collision_response/{default}" if given.service is None else given.service
        print(show(answer(kind, request, service, given.timeout)))
    except (InvalidRequest, YAMLError, TimeoutError) as error:
        print(f"collision_response call: {error}", file=sys.stderr)
        return 3 if isinstance(error, TimeoutError) else 2
    except (NameValidationException, RCLError) as error:
        at = "call: --service:" if isinstance(error, NameValidationException) else "call:"
        print("collision_response", at, *str(error).split(), file=sys.stderr)  # on one line
        return 2
    except ImpactError as error:
        print(f"{error.code}: {error}", file=sys.stderr)
        return 1
    return 0


def seconds(text: str) -> float:
    """Read a timeout; argparse reports a ``ValueError`` with the name of this function."""
    timeout = float(text)
    if not 0 <= timeout <= MAX_TIMEOUT:
        raise argparse.ArgumentTypeError(f"must be in [0, {MAX_TIMEOUT:g}], is {text}")
    return timeout


def service_name(text: str) -> str:
    """Refuse a name that is not text: rclpy would only say that its type is wrong."""
    text.encode()
    return text


def _read() -> str:
    if sys.stdin is None:
        raise InvalidRequest("standard input is closed")
    try:
        return sys.stdin.read()
    except UnicodeDecodeError as error:
        raise InvalidRequest(f"standard input: {error}") from None


def fill(message: Any, tree: Any, path: str = "") -> None:
    """Write a tree of values by field, as read from YAML, into a message, which errors call ``path``."""
    types = message.get_fields_and_field_types()
    if not isinstance(tree, dict):
        must = f"must have some of the fields {', '.join(types)}"
        raise InvalidRequest(f"{path or 'the request'}: {must}; is {format_value(tree)}")
    for name, value in tree.items():
        where = f"{path}.{name}" if path else str(name)
        if name not in types:
            closest = get_close_matches(str(name), types, 1)
            hint = f"did you mean {closest[0]}?" if closest else f"the fields are {', '.join(types)}"
            raise InvalidRequest(f"{where}: there is no such field; {hint}")
        if hasattr(getattr(message, name), "get_fields_and_field_types"):
            fill(getattr(message, name), value, where)
        else:
            setattr(message, name, _value(where, name, value, types[name]))


def _value(where: str, name: str, value: Any, kind: str) -> Any:
    """Return a value for a field of a type of ROS, such as ``sequence<double, 36>``."""
    if kind.startswith("sequence<"):
        if not isinstance(value, list):
            raise InvalidRequest(f"{where}: must be a list in brackets, is {format_value(value)}")
        item, _, bound = kind.removeprefix("sequence<").removesuffix(">").partition(", ")
        if bound and len(value) > int(bound):
            raise InvalidRequest(f"{where}: must have {bound} entries at most, has {len(value)}")
        return [_value(f"{where}[{i}]", name, one, item) for i, one in enumerate(value)]
    if kind == "string":
        if not isinstance(value, str):
            raise InvalidRequest(f"{where}: must be text, is {format_value(value)}: write it in quotes")
        if "\0" in value:
            raise InvalidRequest(f"{where}: must have no NUL character, where ROS would cut it off")
        return value
    if kind == "boolean":
        if not isinstance(value, bool):
            raise InvalidRequest(f"{where}: must be true or false, is {format_value(value)}")
        return value
    if name in NAMES and isinstance(value, str):
        if value.upper() in NAMES[name]:
            return NAMES[name][value.upper()]
        raise InvalidRequest(f"{where}: must be one of {', '.join(NAMES[name])}; is {value}")
    return _number(where, value, kind)


def _number(where: str, value: Any, kind: str) -> float:
    is_float = kind in ("float", "double")
    try:
        if isinstance(value, bool):
            raise ValueError
        if is_float:
            return number_in(value) if isinstance(value, str) else float(value)
        limits = np.iinfo(kind)
        if int(value) != value or not limits.min <= value <= limits.max:
            raise ValueError
        return int(value)
    except (TypeError, ValueError, OverflowError):
        must = "a number" if is_float else f"{'an' if kind.startswith('i') else 'a'} {kind}"
        raise InvalidRequest(f"{where}: must be {must}, is {format_value(value)}") from None


def _client(node: Any, kind: Any, service: str) -> Any:
    try:
        return node.create_client(kind, service, qos_profile=QoSProfile(history=HistoryPolicy.KEEP_ALL))
    except ValueError as error:  # of a name with braces
        raise InvalidRequest(f"--service: {str(error).split(', at ')[0]}") from None


def answer(kind: Any, request: Any, service: str, timeout: float) -> Any:
    """Send a request and return the response.

    Raises:
        InvalidRequest, NameValidationException: if the service cannot have this name.
        TimeoutError: if there is no response within the timeout [s].
        RCLError: if ROS cannot be used.
    """
    sigint = SignalHandlerOptions.SIGINT  # type: ignore[attr-defined]  # rclpy's stub has another spelling
    rclpy.init(args=[], signal_handler_options=sigint)  # SIGTERM ends the process
    node = None
    try:
        node = rclpy.create_node("collision_response_call")
        client = _client(node, kind, service)
        end = time.monotonic() + timeout
        if not client.wait_for_service(timeout):
            advice = _advice_without_service(node, kind, client)
            raise TimeoutError(f"no service {service} within {timeout:g} s; {advice}")
        future = client.call_async(request)
        rclpy.spin_until_future_complete(node, future, timeout_sec=max(end - time.monotonic(), 1.0))
        if not future.done():
            raise TimeoutError(f"no answer from {service} within {timeout:g} s")
        return future.result()
    except RCLError:
        if rclpy.ok():
            raise
        raise KeyboardInterrupt from None  # on Ctrl-C, ROS is shut down before Python hears of it
    finally:
        if node is not None:
            node.destroy_node()
        rclpy.try_shutdown()


def _advice_without_service(node: Any, kind: Any, client: Any) -> str:
    """What to do if the service of a client is not there: it names others of its type."""
    others = [
        name
        for name, types in node.get_service_names_and_types()
        if f"collision_response/srv/{kind.__name__}" in types
        and name != client.service_name  # which this client asks for
        and node.count_services(name)
    ]
    advice = "start the node with: collision_response node"
    return f"{advice}, or give one of these by --service: {', '.join(others)}" if others else advice


def _of_impact(response: Any) -> str:
    result = _valid(response)
    names = format_name(result.contact.body_a) or "body_a", format_name(result.contact.body_b) or "body_b"
    return "\n".join(filter(None, [format_impact(result, names), result.status.message]))


def _of_scene(response: Any) -> str:
    result = _valid(response)
    return "\n".join(filter(None, [scene_table(result, result.clusters), result.status.message]))


def _of_batch(response: Any) -> str:
    batch = unpack(response)
    rows = [
        [
            str(i),
            str(StatusCode(batch.status[i])),
            *(_row(numbers) for numbers in (*batch.velocity[:, :, i].T, batch.impulse[:, i])),
        ]
        for i in range(min(len(batch.status), SHOWN))
    ]
    lines = format_columns(
        ["contact", "status", "velocity a [m/s]", "velocity b [m/s]", "impulse [N s]"], rows
    )
    if len(batch.status) > SHOWN:
        lines.append(f"and {len(batch.status) - SHOWN} more")
    return "\n".join(filter(None, [*lines, response.message]))


def _valid(response: Any) -> Any:
    if response.success:
        return response.result
    status = response.result.status
    raise error_from(status.code, status.message)


def _row(numbers: Any) -> str:
    return f"({', '.join(map(format_number, numbers))})"


SERVICES = {
    "ResolveCollision": (ResolveCollision, "resolve_collision", _of_impact),
    "ResolveScene": (ResolveScene, "resolve_scene", _of_scene),
    "ResolveCollisionBatch": (ResolveCollisionBatch, "resolve_collision_batch", _of_batch),
}
"""The services by their types' names: type, name within the node, and function that formats a response."""
