"""One impact: ``resolve()`` and its peers, called from Python.

The peers get bodies whose axes are parallel to the world's, without friction. Engines that find contacts
themselves get two small balls that are fixed to the bodies and touch at the contact point.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from math import sqrt
from typing import Any, NamedTuple

import numpy as np
from cases import ALIGNED, FLAT, PAIR, Scene, of_numpy, separating
from timing import interleaved, ratio, spread
from truth import Answer, error_of_impulse, error_of_twists, true_error, truth_of

from collision_response import Contact, ImpactModel, Law, Precision, resolve
from collision_response.derivatives import differentiate

BALL = 0.05
"""Radius of the balls [m]."""

RESOLVE, PINOCCHIO, PINOCCHIO_J = "resolve()", "pinocchio, J given", "pinocchio, J by hand"
MUJOCO, PYBULLET, PYMUNK = "MuJoCo, one step", "pybullet, one step", "pymunk, one step"
WAYS = (RESOLVE, PINOCCHIO, PINOCCHIO_J, MUJOCO, PYBULLET, PYMUNK)
"""In the order of the table."""

Timed = tuple[str, float, Scene, ImpactModel]

TARGETS: tuple[Timed, ...] = (
    ("FRICTIONLESS", 0.8, PAIR, ImpactModel(Law.FRICTIONLESS)),
    ("COULOMB", 0.8, PAIR, ImpactModel(Law.COULOMB)),
    ("separating bodies", 0.8, separating(PAIR), ImpactModel(Law.COULOMB)),
    ("COULOMB in the plane", 0.8, FLAT, ImpactModel(Law.COULOMB)),
    ("COULOMB, restitution threshold", 1.0, PAIR, ImpactModel(Law.COULOMB, restitution_threshold=0.01)),
    ("COULOMB, tolerance 1e-9", 1.0, PAIR, ImpactModel(Law.COULOMB, tolerance=1e-9)),
    ("COULOMB, NumPy scalars", 1.0, of_numpy(PAIR), ImpactModel(Law.COULOMB)),
    ("COULOMB, EXTENDED", 1.6, PAIR, ImpactModel(Law.COULOMB, precision=Precision.EXTENDED)),
    ("COULOMB, tolerance 1e-15", 1.6, PAIR, ImpactModel(Law.COULOMB, tolerance=1e-15)),
    ("MOREAU", 1.5, PAIR, ImpactModel(Law.MOREAU)),
    ("ROUTH_STRONGE in the plane", 1.2, FLAT, ImpactModel(Law.ROUTH_STRONGE)),
    ("ROUTH_STRONGE", 6.0, PAIR, ImpactModel(Law.ROUTH_STRONGE)),
)
"""Timed requests, each with the largest allowed ratio to pinocchio for two bodies in space, J by hand."""

ANEW = "COULOMB, contact and model built in every call"
"""A request that is built in every call, as pinocchio's row of J is."""

JACOBIAN, MOST_FOR_JACOBIAN = "`differentiate()`, COULOMB, by everything", 10.0
"""The timed Jacobian, and its largest allowed ratio to ``resolve()`` for the same impact."""


class Peer(NamedTuple):
    """A way to compute the answer: the timed call, and the error of what it returns."""

    call: Callable[[], Any]
    error: Callable[[Any, Answer], float]


def by_resolve(scene: Scene, model: ImpactModel) -> Peer:
    """This package."""
    return Peer(lambda: resolve(*scene, model), true_error)


def is_planar(scene: Scene) -> bool:
    """Whether all motion is in the x-y plane."""
    return scene.contact.normal.z == 0


def pinocchio(scene: Scene) -> Iterator[tuple[str, Peer]]:
    """``impulseDynamics`` for free bodies; the contact is a row of J for the normal velocity."""
    import pinocchio as pin

    planar, model = is_planar(scene), pin.Model()
    joint = pin.JointModelPlanar if planar else pin.JointModelFreeFlyer
    configuration: list[float] = []
    for name, body in zip("ab", scene[:2], strict=True):
        number = model.addJoint(0, joint(), pin.SE3.Identity(), name)
        tensor = np.array(body.inertia.rows())
        model.appendBodyToJoint(number, pin.Inertia(body.mass, np.zeros(3), tensor), pin.SE3.Identity())
        x, y, z = body.position
        configuration += [x, y, 1.0, 0.0] if planar else [x, y, z, 0.0, 0.0, 0.0, 1.0]
    kept = [0, 1, 5] if planar else [0, 1, 2, 3, 4, 5]
    q = np.array(configuration)
    v = np.concatenate([np.array([*body.velocity, *body.angular_velocity])[kept] for body in scene[:2]])
    e, jacobian, data = scene.contact.restitution, _jacobian_of(scene, planar), model.createData()
    J = np.array([jacobian()])

    def by_hand() -> np.ndarray:
        return pin.impulseDynamics(model, data, q, v, np.array([jacobian()]), e)

    def error(_: Any, truth: Answer) -> float:
        return error_of_impulse(np.array(scene.contact.normal) * data.impulse_c[0], truth)

    yield PINOCCHIO, Peer(lambda: pin.impulseDynamics(model, data, q, v, J, e), error)
    yield PINOCCHIO_J, Peer(by_hand, error)


def _jacobian_of(scene: Scene, planar: bool) -> Callable[[], list[float]]:
    """A function that computes the row of J in plain Python, as fast as possible."""
    position, normal = scene.contact.position, scene.contact.normal
    bodies = [(body.position, sign) for body, sign in zip(scene[:2], (1.0, -1.0), strict=True)]

    def in_space() -> list[float]:
        row = []
        c_x, c_y, c_z = position
        n_x, n_y, n_z = normal
        for (x, y, z), s in bodies:
            x, y, z = c_x - x, c_y - y, c_z - z
            row += (s * n_x, s * n_y, s * n_z)
            row += (s * (y * n_z - z * n_y), s * (z * n_x - x * n_z), s * (x * n_y - y * n_x))
        return row

    def in_plane() -> list[float]:
        row = []
        n_x, n_y, _ = normal
        for (x, y, _), s in bodies:
            row += (s * n_x, s * n_y, s * ((position[0] - x) * n_y - (position[1] - y) * n_x))
        return row

    return in_plane if planar else in_space


def mujoco(scene: Scene) -> Iterator[tuple[str, Peer]]:
    """One step so short that nothing moves; the damping of the contact is chosen to give the restitution."""
    import mujoco as mj

    step = 1e-6
    damping = (1 + scene.contact.restitution) / step
    parts = []
    for body, sign in zip(scene[:2], (1.0, -1.0), strict=True):
        geom = f'<geom type="sphere" size="{BALL}" pos="{_words(_ball(scene, body, sign))}"/>'
        moments = _words((body.inertia.xx, body.inertia.yy, body.inertia.zz))
        inertial = f'<inertial pos="0 0 0" mass="{body.mass!r}" diaginertia="{moments}"/>'
        parts.append(f'<body pos="{_words(body.position)}"><freejoint/>{inertial}{geom}</body>')
    xml = f"""<mujoco><option timestep="{step}" gravity="0 0 0"/><default><geom condim="1" margin="0.001"
        solref="0 {-damping!r}" solimp="0.9999 0.9999 0.001"/></default>
        <worldbody>{"".join(parts)}</worldbody></mujoco>"""
    model = mj.MjModel.from_xml_string(xml)
    data = mj.MjData(model)
    q = data.qpos.copy()
    v = np.concatenate([[*body.velocity, *body.angular_velocity] for body in scene[:2]])
    qpos, qvel = data.qpos, data.qvel

    def call() -> np.ndarray:
        qpos[:] = q
        qvel[:] = v
        mj.mj_step(model, data)
        return qvel

    yield MUJOCO, Peer(call, lambda after, truth: error_of_twists(np.reshape(after, (-1, 6)), scene, truth))


def pymunk(scene: Scene) -> Iterator[tuple[str, Peer]]:
    """One very short step; only in the plane."""
    import pymunk as pm

    if not is_planar(scene):
        return
    space, bodies = pm.Space(), []
    for body, sign in zip(scene[:2], (1.0, -1.0), strict=True):
        its = pm.Body(body.mass, body.inertia.zz)
        x, y, _ = _ball(scene, body, sign)
        ball = pm.Circle(its, BALL * (1 + 1e-14), (x, y))
        ball.elasticity = sqrt(scene.contact.restitution)  # a pair has the product of both
        space.add(its, ball)
        bodies.append((its, tuple(body.position[:2]), tuple(body.velocity[:2]), body.angular_velocity.z))

    def call() -> list[tuple[Any, float]]:
        for its, position, velocity, spin in bodies:
            its.position, its.angle, its.velocity, its.angular_velocity = position, 0.0, velocity, spin
        space.step(1e-14)
        return [(its.velocity, its.angular_velocity) for its, *_ in bodies]

    def error(after: Any, truth: Answer) -> float:
        return error_of_twists([(v.x, v.y, 0.0, 0.0, 0.0, w) for v, w in after], scene, truth)

    yield PYMUNK, Peer(call, error)


def pybullet(scene: Scene) -> Iterator[tuple[str, Peer]]:
    """One short step."""
    import pybullet as pb

    world = pb.connect(pb.DIRECT)
    there = {"physicsClientId": world}
    pb.setTimeStep(1e-6, world)
    pb.setPhysicsEngineParameter(contactSlop=0.0, **there)
    moving = []
    for body, sign in zip(scene[:2], (1.0, -1.0), strict=True):
        place = tuple(_ball(scene, body, sign))
        shape = pb.createCollisionShape(pb.GEOM_SPHERE, radius=BALL, collisionFramePosition=place, **there)
        number = pb.createMultiBody(body.mass, shape, basePosition=tuple(body.position), **there)
        restitution = sqrt(scene.contact.restitution)  # a pair has the product of both
        undamped = {"lateralFriction": 0.0, "linearDamping": 0.0, "angularDamping": 0.0}
        moments = [body.inertia.xx, body.inertia.yy, body.inertia.zz]
        pb.changeDynamics(
            number, -1, restitution=restitution, localInertiaDiagonal=moments, **undamped, **there
        )
        moving.append((number, tuple(body.position), tuple(body.velocity), tuple(body.angular_velocity)))
    level = (0.0, 0.0, 0.0, 1.0)

    def call() -> list[tuple[Any, Any]]:
        for number, position, velocity, spin in moving:
            pb.resetBasePositionAndOrientation(number, position, level, world)
            pb.resetBaseVelocity(number, velocity, spin, world)
        pb.stepSimulation(world)
        return [pb.getBaseVelocity(number, world) for number, *_ in moving]

    yield (
        PYBULLET,
        Peer(call, lambda after, truth: error_of_twists([(*v, *w) for v, w in after], scene, truth)),
    )


PEERS = {"pin": pinocchio, "mujoco": mujoco, "pybullet": pybullet, "pymunk": pymunk}
"""The peers, by the names of their pip packages."""


def _ball(scene: Scene, body: Any, sign: float) -> tuple[float, ...]:
    """Position of a body's ball relative to its centre of mass."""
    return tuple(scene.contact.position + scene.contact.normal * (sign * BALL) - body.position)


def _words(numbers: Any) -> str:
    return " ".join(repr(float(number)) for number in numbers)


# Measuring ------------------------------------------------------------------------------------


def peers_of(scene: Scene, skipped: dict[str, str]) -> dict[str, Peer]:
    """The installed peers; missing ones are noted in ``skipped``."""
    found: dict[str, Peer] = {}
    for package, builder in PEERS.items():
        try:
            found |= dict(builder(scene))
        except ImportError as missing:
            skipped[package] = str(missing)
        except Exception as failure:  # an interface has changed; measure the other peers
            skipped[package] = f"{type(failure).__name__}: {failure}"
            print(f"    {package}: {skipped[package]}", file=sys.stderr)
    return found


def measure(skipped: dict[str, str], _: object) -> dict[str, Any]:
    """Measure times [s] and errors of all ways in space and in the plane, and the targets."""
    scenes = {}
    flat = FLAT._replace(
        body_a=FLAT.body_a._replace(orientation=None), body_b=FLAT.body_b._replace(orientation=None)
    )
    for name, scene in (("in space", ALIGNED), ("in the plane", flat)):
        scene = scene._replace(contact=scene.contact._replace(friction=0.0))
        ways = {RESOLVE: by_resolve(scene, ImpactModel()), **peers_of(scene, skipped)}
        samples = interleaved({way: peer.call for way, peer in ways.items()})
        truth = truth_of(scene, Law.FRICTIONLESS)
        scenes[name] = {
            way: {"s": spread(samples[way]), "error": peer.error(peer.call(), truth)}
            for way, peer in ways.items()
        }
    return {"scenes": scenes, **targets(skipped)}


def targets(skipped: dict[str, str]) -> dict[str, Any]:
    """Measure all kinds of request, compared with pinocchio, and a Jacobian."""
    calls = {what: by_resolve(scene, model).call for what, _, scene, model in TARGETS}
    calls[ANEW] = built_anew(PAIR)
    peer = peers_of(ALIGNED, skipped).get(PINOCCHIO_J)
    if peer is not None:
        calls[PINOCCHIO_J] = peer.call
    samples = interleaved(calls)
    measured = [
        {"what": f"`resolve()`, {what}", "most": most, "measured": ratio(samples, what, PINOCCHIO_J)}
        for what, most, *_ in TARGETS
    ]
    measured.append(jacobian())
    return {"s": {what: spread(times) for what, times in samples.items()}, "targets": measured}


def built_anew(scene: Scene) -> Callable[[], Any]:
    """``resolve()`` with a contact and a model that are built in every call."""
    body_a, body_b, contact = scene

    def call() -> Any:
        built = Contact.of(contact.position, contact.normal, contact.restitution, contact.friction)
        return resolve(body_a, body_b, built, ImpactModel(Law.COULOMB))

    return call


def jacobian() -> dict[str, Any]:
    """Measure all derivatives of an impact, compared with the impact."""
    model = ImpactModel(Law.COULOMB)
    samples = interleaved(
        {RESOLVE: lambda: resolve(*PAIR, model), JACOBIAN: lambda: differentiate(*PAIR, model)}
    )
    what = f"{JACOBIAN}, against `resolve()`"
    return {"what": what, "most": MOST_FOR_JACOBIAN, "measured": ratio(samples, JACOBIAN, RESOLVE)}
