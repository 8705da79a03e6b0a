"""Looks at a node from outside: its parameters with their values, and its diagnostics."""

from __future__ import annotations

import time
from typing import Any

from .child import DEADLINE, Parent

PATIENCE = 5.0
"""Seconds; diagnostics come every second."""


def run(order: dict[str, Any], parent: Parent) -> None:
    """As a process: say ``found``."""
    import rclpy
    from rclpy.node import Node
    from rclpy.parameter import parameter_value_to_python
    from rclpy.parameter_client import AsyncParameterClient

    rclpy.init()
    node = Node("look")
    try:
        client = AsyncParameterClient(node, f"{order['namespace']}/collision_response")
        if not client.wait_for_services(DEADLINE):
            raise TimeoutError("the node has no parameters")

        def result(future: Any) -> Any:
            rclpy.spin_until_future_complete(node, future, timeout_sec=DEADLINE)
            return future.result()

        names = result(client.list_parameters(None, None)).result.names
        values = result(client.get_parameters(names)).values
        found = dict(zip(names, map(parameter_value_to_python, values), strict=True))
        parent.say("found", {"parameters": found, "diagnostics": diagnostics(node)})
    finally:
        node.destroy_node()
        rclpy.try_shutdown()


def diagnostics(node: Any) -> dict[str, str]:
    """What is on ``/diagnostics`` next; nothing if the node does not publish any."""
    import rclpy

    try:
        from diagnostic_msgs.msg import DiagnosticArray
    except ImportError:
        return {}
    heard: list[Any] = []
    subscription = node.create_subscription(DiagnosticArray, "/diagnostics", heard.append, 10)
    end = time.monotonic() + PATIENCE
    while not heard and time.monotonic() < end:
        rclpy.spin_once(node, timeout_sec=0.1)
    node.destroy_subscription(subscription)
    return {
        pair.key: pair.value for message in heard[-1:] for status in message.status for pair in status.values
    }
