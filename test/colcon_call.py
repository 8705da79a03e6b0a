"""Call the node that `make colcon` installed over DDS, and check that it is that one."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import domain_coordinator
import rclpy

import collision_response
from collision_response.msg import BodyState, ImpactModel
from collision_response.srv import ResolveCollision

ROOT = Path(__file__).resolve().parent.parent
INSTALL = ROOT / "install" / "collision_response"
BUILD = ROOT / "build" / "collision_response"  # where --symlink-install points for the generated modules
DEADLINE = 30.0  # seconds


def check(what: str, holds: bool) -> None:
    print(("ok      " if holds else "FAILED  ") + what, flush=True)
    if not holds:
        raise SystemExit(1)


def libraries(pid: int | str) -> set[Path]:
    """The shared libraries of this package that a process has loaded."""
    loaded = {Path(line.split()[-1]) for line in Path(f"/proc/{pid}/maps").read_text().splitlines()}
    return {path for path in loaded if "collision_response" in path.name}


def ball(name: str, position: float, velocity: float) -> BodyState:
    body = BodyState(name=name, motion_type=BodyState.DYNAMIC)
    body.header.frame_id = "world"
    body.pose.position.x = position
    body.twist.linear.x = velocity
    body.inertia.m = 2.0
    body.inertia.ixx = body.inertia.iyy = body.inertia.izz = 0.1
    return body


def head_on() -> ResolveCollision.Request:
    """Two equal balls at e = 1, which exchange their velocities."""
    request = ResolveCollision.Request()
    request.body_a, request.body_b = ball("a", 0.5, -1.0), ball("b", -0.5, 3.0)
    request.contact.header.frame_id = "world"
    request.contact.normal.x = 1.0
    request.contact.restitution, request.contact.friction = 1.0, 0.0
    request.model.law = ImpactModel.FRICTIONLESS
    return request


def call(node_pid: int) -> None:
    rclpy.init()
    client_node = rclpy.create_node("colcon_call")
    client = client_node.create_client(ResolveCollision, "/collision_response/resolve_collision")
    try:
        check("the service is there", client.wait_for_service(timeout_sec=DEADLINE))
        future = client.call_async(head_on())
        rclpy.spin_until_future_complete(client_node, future, timeout_sec=DEADLINE)
        check("it answers", future.done())
        answer = future.result()
        check(f"with success {answer.result.status.message}", answer.success)
        check("twist_a is right", abs(answer.result.twist_a.linear.x - 3.0) < 1e-12)
        check("twist_b is right", abs(answer.result.twist_b.linear.x + 1.0) < 1e-12)
        for who, pid in (("node", node_pid), ("client", "self")):
            loaded = libraries(pid)
            check(
                f"the {who} has loaded {len(loaded)} libraries of ours, all from this colcon build",
                bool(loaded) and all({INSTALL, BUILD} & set(path.parents) for path in loaded),
            )
    finally:
        client_node.destroy_node()
        rclpy.try_shutdown()


def main() -> None:
    check("Python imports the package from install/", INSTALL in Path(collision_response.__file__).parents)
    with domain_coordinator.domain_id() as domain:
        os.environ["ROS_DOMAIN_ID"] = str(domain)
        executable = INSTALL / "lib" / "collision_response" / "collision_response_node"
        node = subprocess.Popen([executable])
        try:
            call(node.pid)
            node.send_signal(signal.SIGINT)
            check("on SIGINT the node exits with 0", node.wait(DEADLINE) == 0)
        finally:
            if node.poll() is None:
                node.kill()
                node.wait()


if __name__ == "__main__":
    sys.exit(main())
