"""Clients that ask at the first moment they can, one after the other: who answers must already know them."""

from __future__ import annotations

from typing import Any

from .child import Parent
from .client import Client, Order, Report

PATIENCE = 10.0


def run(order: dict[str, Any], parent: Parent) -> None:
    """As a process: say ``done``, and what came of it."""
    import rclpy
    from rclpy.context import Context
    from rclpy.executors import SingleThreadedExecutor
    from rclpy.node import Node

    reports = []
    for number in range(order["number"]):
        context = Context()
        rclpy.init(context=context)
        node, executor = Node("newcomer", context=context), SingleThreadedExecutor(context=context)
        executor.add_node(node)
        client = Client(Order(order["namespace"], requests=1, seed=number), node)
        parent.wait_until(client.is_ready)
        client.ask()
        quiet = 0.0
        while client.report.unanswered and quiet < PATIENCE and not parent.is_gone():
            executor.spin_once(timeout_sec=0.1)
            quiet += 0.1
        reports.append(client.report)
        executor.shutdown()
        node.destroy_node()
        rclpy.shutdown(context=context)
        if sum(report.unanswered for report in reports) > 3:
            break  # that is enough to know
    parent.say("done", Report.together(reports).to_json())
