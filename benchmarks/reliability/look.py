"""Looks at a node from outside: its parameters with their values, and what the graph offers."""

from __future__ import annotations

from typing import Any

from .child import DEADLINE, Parent


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
        topics = {name: kinds[0] for name, kinds in node.get_topic_names_and_types()}
        parent.say("found", {"parameters": found, "topics": topics})
    finally:
        node.destroy_node()
        rclpy.try_shutdown()
