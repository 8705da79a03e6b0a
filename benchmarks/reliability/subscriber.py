"""A bare rclpy subscription that counts what it receives."""

from __future__ import annotations

from typing import Any

from .child_process import Parent, ros_node


def run(order: dict[str, Any], parent: Parent) -> None:
    """Main function of the process: "ready", wait for "stop", "heard" with the number of bodies."""
    from rclpy.qos import HistoryPolicy, QoSProfile, ReliabilityPolicy

    from collision_response import msg

    names: set[str] = set()

    def receive(message: Any) -> None:
        names.update(message.names if order["type"] == "BodyStates" else [getattr(message, "name", "")])

    reliability = ReliabilityPolicy.RELIABLE if order["reliable"] else ReliabilityPolicy.BEST_EFFORT
    qos = QoSProfile(history=HistoryPolicy.KEEP_LAST, depth=1000, reliability=reliability)
    with ros_node("subscriber") as (node, executor):
        node.create_subscription(getattr(msg, order["type"]), order["topic"], receive, qos)
        parent.send("ready")
        while not parent.has_sent("stop") and not parent.is_gone():
            executor.spin_once(timeout_sec=0.1)
        parent.send("heard", len(names))
