"""A robot arm with seven joints strikes a ball; pinocchio computes the arm's inverse inertia.

    pip install pin    # or run all examples: make examples
    python examples/arm_strikes_ball.py

At its tip the arm is a body with the inverse inertia ``J M^-1 J^T``. The impulse gives the joint velocities
after the impact, ``q' + M^-1 J_c^T P``; pinocchio's ``impulseDynamics`` agrees to 1e-12. The effective mass
of the last link alone is wrong by a factor of 3.5.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin

from collision_response import Body, Contact, Impact, ImpactModel, Law, resolve

PI = np.pi
LINKS = (
    # placement xyz, rpy; mass, centre of mass, moments about it
    ((0, 0, 0.15), (0, 0, 0), 4.0, (0, -0.03, 0.12), (0.1, 0.09, 0.02)),
    ((0, 0, 0.19), (PI / 2, 0, PI), 4.0, (0.0003, 0.059, 0.042), (0.05, 0.018, 0.044)),
    ((0, 0.21, 0), (PI / 2, 0, PI), 3.0, (0, 0.03, 0.13), (0.08, 0.075, 0.01)),
    ((0, 0, 0.19), (PI / 2, 0, 0), 2.7, (0, 0.067, 0.034), (0.03, 0.01, 0.029)),
    ((0, 0.21, 0), (-PI / 2, PI, 0), 1.7, (0.0001, 0.021, 0.076), (0.02, 0.018, 0.005)),
    ((0, 0.06, 0.19), (PI / 2, 0, 0), 1.8, (0, 0.0006, 0.0004), (0.005, 0.0036, 0.0047)),
    ((0, 0.081, 0.06), (-PI / 2, PI, 0), 0.3, (0, 0, 0.02), (0.001, 0.001, 0.001)),
)
TIP = pin.SE3(np.eye(3), np.array([0, 0, 0.1]))
Q = np.array([0.3, -0.5, 0.2, -1.2, 0.4, 0.8, -0.1])
V = np.array([0.5, -0.8, 0.3, 1.1, -0.4, 0.9, 2.0])
BALL, RADIUS = 0.4, 0.05
NORMAL = np.array([0.6, -0.48, 0.64])
BALL_VELOCITY = np.array([0.289520859636, -0.291186592097, 1.419473269682])
BALL_SPIN = np.array([3.0, -5.0, 2.0])


def arm(*, with_ball: bool) -> pin.Model:
    """Model of the arm, optionally with the ball as a free body."""
    model = pin.Model()
    parent = 0
    for i, (xyz, rpy, mass, com, moments) in enumerate(LINKS):
        place = pin.SE3(pin.rpy.rpyToMatrix(*rpy), np.array(xyz))
        parent = model.addJoint(parent, pin.JointModelRZ(), place, f"joint{i + 1}")
        model.appendBodyToJoint(
            parent, pin.Inertia(mass, np.array(com), np.diag(moments)), pin.SE3.Identity()
        )
    model.addFrame(pin.Frame("tip", parent, TIP, pin.FrameType.OP_FRAME))
    if with_ball:
        free = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), "ball")
        moment = 0.4 * BALL * RADIUS**2
        model.appendBodyToJoint(free, pin.Inertia(BALL, np.zeros(3), moment * np.eye(3)), pin.SE3.Identity())
    return model


class Arm:
    """The arm in its pose: mass matrix, and position and Jacobian of its tip in world axes."""

    def __init__(self, model: pin.Model) -> None:
        data = model.createData()
        frame = model.getFrameId("tip")
        pin.framesForwardKinematics(model, data, Q)
        self.tip, self.rotation = data.oMf[frame].translation.copy(), data.oMf[frame].rotation.copy()
        axes = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
        self.J = pin.computeFrameJacobian(model, data, Q, frame, axes)
        upper = np.triu(pin.crba(model, data, Q))
        self.M = upper + np.triu(upper, 1).T

    def body(self) -> Body:
        """The tip as a body."""
        twist = self.J @ V
        inverse_inertia = self.J @ np.linalg.solve(self.M, self.J.T)
        return Body.articulated(inverse_inertia, self.tip, twist[:3], twist[3:])

    def last_link(self) -> Body:
        """The last link without the rest of the arm."""
        mass, com, (xx, yy, zz) = LINKS[-1][2:]
        turn, twist = pin.Quaternion(self.rotation).coeffs(), self.J @ V
        inertia, centre = (xx, 0, 0, yy, 0, zz), np.array(com) - TIP.translation
        return Body.dynamic(mass, inertia, self.tip, turn, twist[:3], twist[3:], centre)

    def joints_after(self, impact: Impact) -> Any:
        """Joint velocities ``q'`` after an impact at the tip."""
        return V + np.linalg.solve(self.M, self.J[:3].T @ np.array(impact.impulse))


def ball(tip: Any) -> Body:
    """The ball, in contact with the tip."""
    centre = tip - RADIUS * NORMAL
    return Body.sphere(BALL, RADIUS, position=centre, velocity=BALL_VELOCITY, angular_velocity=BALL_SPIN)


def by_pinocchio(rows: Any, restitution: float) -> Any:
    """``q'`` of arm and ball after an impact that multiplies the velocity along ``rows`` by ``-e``."""
    model = arm(with_ball=True)
    data = model.createData()
    tip = Arm(arm(with_ball=False)).tip
    q = np.concatenate([Q, tip - RADIUS * NORMAL, [0, 0, 0, 1]])
    v = np.concatenate([V, BALL_VELOCITY, BALL_SPIN])
    pin.computeAllTerms(model, data, q, v)
    frame = model.getFrameId("tip")
    of_arm = pin.computeFrameJacobian(model, data, q, frame, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)[:3]
    of_ball = np.zeros_like(of_arm)
    of_ball[:, 7:10], of_ball[:, 10:] = np.eye(3), -pin.skew(RADIUS * NORMAL)
    J = np.atleast_2d(rows @ (of_arm - of_ball))
    return np.array(pin.impulseDynamics(model, data, q, v, J, restitution))


def main() -> None:
    """Print how far two laws are from pinocchio, and the effective masses of the arm and of its last link."""
    mechanism = Arm(arm(with_ball=False))
    tip, struck = mechanism.body(), ball(mechanism.tip)
    e = 0.7
    rough = ImpactModel(Law.COULOMB, tangential_restitution=e)
    for name, friction, model, rows in (
        ("FRICTIONLESS", 0.0, ImpactModel(Law.FRICTIONLESS), NORMAL),
        ("COULOMB that sticks", 5.0, rough, np.eye(3)),
    ):
        impact = resolve(tip, struck, Contact.of(mechanism.tip, NORMAL, e, friction), model)
        after, peer = mechanism.joints_after(impact), by_pinocchio(rows, e)
        apart = max(np.abs(after - peer[:7]).max(), np.abs(impact.twist_b.linear - peer[7:10]).max())
        print(f"{name}: impulse {np.linalg.norm(impact.impulse):.4f} N s, pinocchio differs by {apart:.1e}")
        assert apart < 1e-12
    wall, contact = Body.static(), Contact.of(mechanism.tip, NORMAL, e)
    whole, alone = (resolve(body, wall, contact).effective_mass for body in (tip, mechanism.last_link()))
    print(f"effective mass at the tip: {whole:.4f} kg; of the last link alone: {alone:.4f} kg")
    assert abs(whole - 0.366583042049) < 1e-11


if __name__ == "__main__":
    main()
