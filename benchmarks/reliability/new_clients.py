"""Clients that call as soon as they see the service, one after the other; the node must already know them."""

from __future__ import annotations

from typing import Any

from .child_process import Parent, ros_node
from .client import Client, Order, Report

PATIENCE = 10.0


def run(order: dict[str, Any], parent: Parent) -> None:
    """Main function of the process: send "done" with the report."""
    from rclpy.context import Context

    reports = []
    for number in range(order["number"]):
        with ros_node("new_client", Context()) as (node, executor):
            client = Client(Order(requests=1, seed=number), node)
            parent.wait_until(client.is_ready)
            client.ask()
            quiet = 0.0
            while client.report.unanswered and quiet < PATIENCE and not parent.is_gone():
                executor.spin_once(timeout_sec=0.1)
                quiet += 0.1
        reports.append(client.report)
        if sum(report.unanswered for report in reports) > 3:
            break  # enough to fail
    parent.send("done", vars(Report.together(reports)))
