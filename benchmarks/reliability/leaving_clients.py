"""Clients that send one request and leave at once, many a second: the node sees few of them in time."""

from __future__ import annotations

from typing import Any

from .child_process import Parent, ros_node
from .client import Client, Order, Report


def run(order: dict[str, Any], parent: Parent) -> None:
    """Main function of the process: "ready", wait for "go", all clients, "done" with their reports."""
    reports = []
    with ros_node("leaving_clients") as (node, _):
        parent.send("ready")
        parent.wait_for("go")
        for number in range(order["number"]):
            client = Client(Order(requests=1, seed=number), node)
            parent.wait_until(client.is_ready)
            client.ask()
            client.destroy(node)
            reports.append(client.report)
            parent.pause(order["pause"])
    parent.send("done", vars(Report.together(reports)))
