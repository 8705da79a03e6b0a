"""MuJoCo finds the contacts, the service resolves them, and MuJoCo continues with the new velocities.

    pip install mujoco    # or run all examples: make examples
    python examples/mujoco_bounce.py

MuJoCo's own contacts are springs with dampers, whose stiffness decides how high a ball bounces. Here
restitution is a number, and the ball bounces as high as it says. The loss of kinetic energy that MuJoCo
computes agrees with the loss that the service reports.

The time step is Moreau's: first forces change velocities, then impacts do, then bodies move.
"""

from __future__ import annotations

import os
from typing import Any, NamedTuple

import mujoco
import numpy as np
import rclpy
from rclpy.qos import HistoryPolicy, QoSProfile

from collision_response import Body, Contact, ImpactModel, Law
from collision_response.demo.__main__ import free_domain
from collision_response.demo.node_process import NodeProcess
from collision_response.ros.scene_client import pack
from collision_response.srv import ResolveScene

BALL, BOX = 1, 2
HEIGHT, RADIUS = 1.0, 0.1
RESTITUTION = {BALL: 0.8, BOX: 0.4}
FRICTION = 0.3
GRAVITY, STEP, STEPS = 9.81, 0.001, 1600

SCENE = f"""
<mujoco>
  <option timestep="{STEP}" gravity="0 0 -{GRAVITY}"/>
  <default><geom friction="{FRICTION} 0 0"/></default>
  <worldbody>
    <geom type="plane" size="5 5 0.1"/>
    <body pos="0 0 {HEIGHT + RADIUS}"><freejoint/><geom type="sphere" size="{RADIUS}" mass="1"/></body>
    <body pos="1 0 0.6" euler="20 30 0">
      <freejoint/>
      <geom type="box" size="0.2 0.15 0.1" mass="2"/>
      <geom type="sphere" size="0.05" pos="0.1 0.05 0.05" mass="1"/>
    </body>
  </worldbody>
</mujoco>
"""


class Run(NamedTuple):
    """The results of a run.

    Attributes:
        heights: height of the lowest point of the ball after each step [m].
        gained: largest gain of the kinetic energy of all bodies in a scene [J].
        misfit: largest difference between MuJoCo's energies and those of the answers [J].
        impacts: number of requests.
    """

    heights: np.ndarray
    gained: float
    misfit: float
    impacts: int


def body_of(model: Any, data: Any, i: int) -> Body:
    """A body of MuJoCo, free or immovable.

    The velocity of a free joint in MuJoCo is that of the origin, in world axes; the angular velocity is in
    body axes. The inertia is about the centre of mass, in its own axes.
    """
    if not model.body_dofnum[i]:
        return Body.static()
    turn = np.empty(9)
    mujoco.mju_quat2Mat(turn, model.body_iquat[i])
    inertia = turn.reshape(3, 3) @ np.diag(model.body_inertia[i]) @ turn.reshape(3, 3).T
    velocity, spin = data.qvel[dofs(model, i)].reshape(2, 3)
    w, x, y, z = data.xquat[i]
    to_world = data.xmat[i].reshape(3, 3)
    place, com = data.xpos[i], model.body_ipos[i]
    return Body.dynamic(model.body_mass[i], inertia, place, (x, y, z, w), velocity, to_world @ spin, com)


def dofs(model: Any, i: int) -> slice:
    """Indices of the six velocities of a free body."""
    return slice(model.body_dofadr[i], model.body_dofadr[i] + 6)


def request_of(model: Any, data: Any) -> ResolveScene.Request:
    """All contacts that MuJoCo found. Its normals point to the second body, ours to the first."""
    bodies = [body_of(model, data, i) for i in range(model.nbody)]
    pairs, contacts = [], []
    for contact in data.contact:
        b, a = (int(model.geom_bodyid[geom]) for geom in contact.geom)
        e = min(RESTITUTION.get(a, 1.0), RESTITUTION.get(b, 1.0))
        pairs.append((a, b))
        contacts.append(Contact.of(contact.pos, contact.frame[:3], e, contact.friction[0]))
    return pack(bodies, pairs, contacts, ImpactModel(Law.COULOMB))


def energy(model: Any, data: Any) -> float:
    """Kinetic energy from MuJoCo's mass matrix."""
    momentum = np.empty(model.nv)
    mujoco.mj_mulM(model, data, momentum, data.qvel)
    return float(data.qvel @ momentum) / 2


def simulate(model: Any, ask: Any) -> Run:
    """Run MuJoCo without its contact forces."""
    data = mujoco.MjData(model)
    heights, gained, misfit, impacts = [], 0.0, 0.0, 0
    for _ in range(STEPS):
        mujoco.mj_forward(model, data)
        data.qvel += STEP * data.qacc_smooth
        if data.ncon:
            result, before = ask(request_of(model, data)), energy(model, data)
            for i, twist in enumerate(result.twists):
                if model.body_dofnum[i]:
                    spin = [twist.angular.x, twist.angular.y, twist.angular.z] @ data.xmat[i].reshape(3, 3)
                    data.qvel[dofs(model, i)] = twist.linear.x, twist.linear.y, twist.linear.z, *spin
            change = energy(model, data) - before
            misfit = max(misfit, abs(change + result.energy_lost_restitution + result.energy_lost_friction))
            gained, impacts = max(gained, change), impacts + 1
        mujoco.mj_integratePos(model, data.qpos, data.qvel, STEP)
        heights.append(data.qpos[2] - RADIUS)
    return Run(np.array(heights), gained, misfit, impacts)


def rebounds(heights: np.ndarray) -> np.ndarray:
    """Largest heights between bounces."""
    inner = heights[1:-1]
    return inner[(inner > heights[:-2]) & (inner >= heights[2:]) & (inner > 0)]


def main() -> None:
    """Print how high the ball bounces, and check it."""
    model = mujoco.MjModel.from_xml_string(SCENE)
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
    os.environ["ROS_DOMAIN_ID"] = str(free_domain())
    with NodeProcess({}):
        rclpy.init()
        node = rclpy.create_node("mujoco_bounce")
        qos = QoSProfile(history=HistoryPolicy.KEEP_ALL)
        client = node.create_client(ResolveScene, "collision_response/resolve_scene", qos_profile=qos)
        client.wait_for_service()

        def ask(request: ResolveScene.Request) -> Any:
            future = client.call_async(request)
            rclpy.spin_until_future_complete(node, future)
            response = future.result()
            assert response.success, response.result.status.message
            return response.result

        run = simulate(model, ask)
        node.destroy_node()
        rclpy.shutdown()

    e = RESTITUTION[BALL]
    exact, found = HEIGHT * e ** (2 * np.arange(1, 3)), rebounds(run.heights)[:2]
    print(f"a ball falls {HEIGHT:g} m, e = {e:g}; after two bounces it should rise to {exact} m: {found} m")
    print(f"{run.impacts} scenes of ball and box; largest energy gained in one: {run.gained:.1e} J")
    print(f"MuJoCo's energies differ from those of the answers by {run.misfit:.1e} J")
    way = STEP * np.sqrt(2 * GRAVITY * HEIGHT)  # motion in one step, by which a contact may be found too late
    assert np.abs(found - exact).max() < 2 * way
    assert run.misfit < 1e-12
    assert run.gained < 1e-12


if __name__ == "__main__":
    main()
