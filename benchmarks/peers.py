"""One frictionless impact off the centre: this package and its peers, as a Python user gets the answer.

In every scene two bodies meet, their axes parallel to the world's. Engines that find contacts
themselves are given two small balls that touch at the contact point, fixed to the bodies.
"""

from __future__ import annotations

import importlib.metadata
import sys
from collections.abc import Callable, Iterator
from fractions import Fraction
from math import inf, nan, sqrt
from typing import Any, NamedTuple

import numpy as np
from tables import tables
from timing import Samples, interleaved, ratio, spread

from collision_response import Body, Contact, Geometry, Law, resolve
from collision_response.physics.effective_mass import Planar, Spatial
from collision_response.physics.laws import Parameters, frictionless

BALL = 0.05
"""Radius of the balls [m]."""

RESOLVE, LAW = "resolve()", "bare law"
KERNEL, UNCHECKED = "bare law, unrolled, r x n given", "bare law, unrolled"
CHECKED, ONE = "the same with all checks", "resolve_batch(), N = 1"
PINOCCHIO, PINOCCHIO_J = "pinocchio, J given", "pinocchio, J by hand"
MUJOCO, PYBULLET, PYMUNK = "MuJoCo, one step", "pybullet, one step", "pymunk, one step"
WAYS = (RESOLVE, LAW, UNCHECKED, KERNEL, CHECKED, ONE, PINOCCHIO, PINOCCHIO_J, MUJOCO, PYBULLET, PYMUNK)
"""In the order of the table."""


class Scene(NamedTuple):
    """Two bodies that meet. ``planar``: all motion is in the x-y plane."""

    body_a: Body
    body_b: Body
    contact: Contact
    planar: bool = False

    def moving(self) -> list[tuple[Body, float]]:
        """The bodies that an impulse moves, each with the sign of the impulse on it."""
        return [(body, sign) for body, sign in ((self.body_a, 1.0), (self.body_b, -1.0)) if body.inverse_mass]


A = Body.dynamic(
    2.0, (0.3, 0.0, 0.0, 0.4, 0.0, 0.5), (0.1, 0.2, 0.6), None, (0.3, -0.2, -1.5), (0.4, -0.7, 0.9)
)
B = Body.dynamic(
    3.0, (0.5, 0.0, 0.0, 0.6, 0.0, 0.7), (-0.2, 0.1, -0.5), None, (-0.1, 0.2, 0.8), (0.2, 0.5, -0.3)
)
FLAT_A = Body.dynamic(
    2.0, (0.3, 0.0, 0.0, 0.4, 0.0, 0.5), (0.1, 0.6, 0.0), None, (0.3, -1.5, 0.0), (0.0, 0.0, 0.9)
)
FLAT_B = Body.dynamic(
    3.0, (0.5, 0.0, 0.0, 0.6, 0.0, 0.7), (-0.2, -0.5, 0.0), None, (-0.1, 0.8, 0.0), (0.0, 0.0, -0.3)
)
SCENES = {
    "wall": Scene(A, Body.static(), Contact.of((0.05, 0.1, 0.02), (0.0, 0.0, 1.0), 0.5)),
    "pair": Scene(A, B, Contact.of((0.05, 0.1, 0.02), (0.0, 0.0, 1.0), 0.5)),
    "plane": Scene(FLAT_A, FLAT_B, Contact.of((0.05, 0.02, 0.0), (0.0, 1.0, 0.0), 0.5), planar=True),
}
WHAT = {
    "wall": "a body on an immovable one, in space",
    "pair": "two bodies, in space",
    "plane": "two bodies, in the plane",
}


class Peer(NamedTuple):
    """A way to the answer.

    Attributes:
        call: what is timed.
        twists: what it returned as an array with a row ``(v, w)`` for each moving body.
    """

    call: Callable[[], Any]
    twists: Callable[[Any], np.ndarray]


# This package ---------------------------------------------------------------------------------


def ours(scene: Scene) -> Iterator[tuple[str, Peer]]:
    """The call that users make, the generic law inside it, and its unrolled form."""
    moving = slice(0, len(scene.moving()))

    def of_impact(impact: Any) -> np.ndarray:
        return np.array([[*twist.linear, *twist.angular] for twist in (impact.twist_a, impact.twist_b)])[
            moving
        ]

    yield RESOLVE, Peer(lambda: resolve(*scene[:3]), of_impact)

    prepare, parameters = (Planar if scene.planar else Spatial).prepare, Parameters(scene.contact.restitution)

    def bare() -> Any:
        approach = prepare(*scene[:3])
        return approach.respond(frictionless(approach, parameters).impulse)

    def of_response(response: Any) -> np.ndarray:
        changes = ((scene.body_a, response.change_a), (scene.body_b, response.change_b))
        after = [body.moved_by(change).twist() for body, change in changes]
        return np.array([[*twist.linear, *twist.angular] for twist in after])[moving]

    yield LAW, Peer(bare, of_response)
    yield from unrolled(scene)


def unrolled(scene: Scene) -> Iterator[tuple[str, Peer]]:
    """The law written out as for batches: as a function of plain floats, and in a batch of one."""
    from collision_response.batch import resolve_batch
    from collision_response.batch.backends import Backend
    from collision_response.batch.kernels import bare, general, unchecked
    from collision_response.batch.problem import Problem

    problem = Problem(Geometry.PLANAR if scene.planar else Geometry.SPATIAL, Law.FRICTIONLESS)
    bodies, contacts = tables(scene, problem.geometry)
    arrays = {"bodies": bodies, "contacts": contacts, "arms": arms(scene)}
    if not scene.planar and all(body.inverse_mass for body in scene[:2]):
        yield KERNEL, _as_function(bare(problem), scene, arrays)
    yield UNCHECKED, _as_function(unchecked(problem), scene, arrays)
    yield CHECKED, _as_function(general(problem), scene, arrays)

    def of_batch(result: Any) -> np.ndarray:
        slots = [slot for slot in general(problem).outputs if "velocity" in slot.array]
        found = {slot: getattr(result, slot.array)[slot.row, slot.lane, 0] for slot in slots}
        return _in_space(found, scene)

    yield ONE, Peer(lambda: resolve_batch(bodies, contacts, backend=Backend.NUMPY), of_batch)


def _as_function(program: Any, scene: Scene, arrays: dict[str, np.ndarray]) -> Peer:
    from collision_response.numerics.emit_scalar import emit_scalar

    names: dict[str, Any] = {"inf": inf, "nan": nan, "sqrt": sqrt}
    exec(emit_scalar(program), names)
    kernel = names["kernel"]
    numbers = [
        float(arrays[slot.array][slot.row, 0 if slot.lane is None else slot.lane].flat[0])
        for slot in program.inputs
    ]
    return Peer(
        lambda: kernel(*numbers),
        lambda outputs: _in_space(dict(zip(program.outputs, outputs, strict=True)), scene),
    )


def arms(scene: Scene) -> np.ndarray:
    """``r x n`` of both bodies: what of J is not the normal itself."""
    position, normal = scene.contact.position, scene.contact.normal
    return np.array([(position - body.position).cross(normal) for body in scene[:2]]).T


def _in_space(outputs: dict[Any, float], scene: Scene) -> np.ndarray:
    """Twists in space from the outputs of a program."""
    twists = np.zeros((2, 6))
    for slot, value in outputs.items():
        if slot.array == "velocity":
            twists[slot.lane, slot.row] = value
        elif slot.array == "angular_velocity":
            twists[slot.lane, 5 if scene.planar else 3 + slot.row] = value
    return twists[: len(scene.moving())]


# Peers ----------------------------------------------------------------------------------------


def pinocchio(scene: Scene) -> Iterator[tuple[str, Peer]]:
    """``impulseDynamics`` of free bodies; the contact is a row of J for the normal velocity."""
    import pinocchio as pin

    model = pin.Model()
    joint = pin.JointModelPlanar if scene.planar else pin.JointModelFreeFlyer
    configuration: list[float] = []
    for index, (body, _) in enumerate(scene.moving()):
        number = model.addJoint(0, joint(), pin.SE3.Identity(), f"body_{index}")
        moments = np.diag([body.inertia.xx, body.inertia.yy, body.inertia.zz])
        model.appendBodyToJoint(number, pin.Inertia(body.mass, np.zeros(3), moments), pin.SE3.Identity())
        x, y, z = body.position
        configuration += [x, y, 1.0, 0.0] if scene.planar else [x, y, z, 0.0, 0.0, 0.0, 1.0]
    kept = [0, 1, 5] if scene.planar else [0, 1, 2, 3, 4, 5]
    q = np.array(configuration)
    v = np.concatenate(
        [np.array([*body.velocity, *body.angular_velocity])[kept] for body, _ in scene.moving()]
    )
    e, jacobian, data = scene.contact.restitution, _jacobian_of(scene), model.createData()
    J = np.array([jacobian()])

    def by_hand() -> np.ndarray:
        return pin.impulseDynamics(model, data, q, v, np.array([jacobian()]), e)

    def twists(after: np.ndarray) -> np.ndarray:
        rows = np.zeros((len(scene.moving()), 6))
        rows[:, kept] = np.reshape(after, (len(rows), len(kept)))
        return rows

    yield PINOCCHIO, Peer(lambda: pin.impulseDynamics(model, data, q, v, J, e), twists)
    yield PINOCCHIO_J, Peer(by_hand, twists)


def _jacobian_of(scene: Scene) -> Callable[[], list[float]]:
    """A function that writes the row of J out by hand, as fast as Python can."""
    position, normal, moving = scene.contact.position, scene.contact.normal, scene.moving()

    def in_space() -> list[float]:
        row = []
        c_x, c_y, c_z = position
        n_x, n_y, n_z = normal
        for body, sign in moving:
            x, y, z = body.position
            x, y, z = c_x - x, c_y - y, c_z - z
            row += [
                *(sign * n_x, sign * n_y, sign * n_z),
                *(sign * (y * n_z - z * n_y), sign * (z * n_x - x * n_z), sign * (x * n_y - y * n_x)),
            ]
        return row

    def in_plane() -> list[float]:
        row = []
        n_x, n_y, _ = normal
        for body, sign in moving:
            x, y, _ = body.position
            row += [sign * n_x, sign * n_y, sign * ((position[0] - x) * n_y - (position[1] - y) * n_x)]
        return row

    return in_plane if scene.planar else in_space


def mujoco(scene: Scene) -> Iterator[tuple[str, Peer]]:
    """One step so short that nothing moves, with the contact's damping chosen to give the restitution."""
    import mujoco as mj

    step = 1e-6
    damping = (1 + scene.contact.restitution) / step
    parts = []
    for body, sign in ((scene.body_a, 1.0), (scene.body_b, -1.0)):
        place = _words(_ball(scene, body, sign))
        geom = f'<geom type="sphere" size="{BALL}" pos="{place}"/>'
        if not body.inverse_mass:
            parts.append(geom)
            continue
        moments = _words((body.inertia.xx, body.inertia.yy, body.inertia.zz))
        inertial = f'<inertial pos="0 0 0" mass="{body.mass!r}" diaginertia="{moments}"/>'
        parts.append(f'<body pos="{_words(body.position)}"><freejoint/>{inertial}{geom}</body>')
    xml = f"""<mujoco><option timestep="{step}" gravity="0 0 0"/><default><geom condim="1" margin="0.001"
        solref="0 {-damping!r}" solimp="0.9999 0.9999 0.001"/></default>
        <worldbody>{"".join(parts)}</worldbody></mujoco>"""
    model = mj.MjModel.from_xml_string(xml)
    data = mj.MjData(model)
    q = data.qpos.copy()
    v = np.concatenate([[*body.velocity, *body.angular_velocity] for body, _ in scene.moving()])
    qpos, qvel = data.qpos, data.qvel

    def call() -> np.ndarray:
        qpos[:] = q
        qvel[:] = v
        mj.mj_step(model, data)
        return qvel

    yield MUJOCO, Peer(call, lambda after: np.reshape(after, (-1, 6)))


def pymunk(scene: Scene) -> Iterator[tuple[str, Peer]]:
    """A step of no length to speak of; in the plane only."""
    import pymunk as pm

    if not scene.planar:
        return
    space, bodies = pm.Space(), []
    for body, sign in scene.moving():
        its = pm.Body(body.mass, body.inertia.zz)
        x, y, _ = _ball(scene, body, sign)
        ball = pm.Circle(its, BALL * (1 + 1e-14), (x, y))
        ball.elasticity = sqrt(scene.contact.restitution)  # of a pair, the product
        space.add(its, ball)
        bodies.append((its, tuple(body.position[:2]), tuple(body.velocity[:2]), body.angular_velocity.z))

    def call() -> list[tuple[Any, float]]:
        for its, position, velocity, spin in bodies:
            its.position, its.angle, its.velocity, its.angular_velocity = position, 0.0, velocity, spin
        space.step(1e-14)
        return [(its.velocity, its.angular_velocity) for its, *_ in bodies]

    yield PYMUNK, Peer(call, lambda after: np.array([[v.x, v.y, 0.0, 0.0, 0.0, w] for v, w in after]))


def pybullet(scene: Scene) -> Iterator[tuple[str, Peer]]:
    """A short step."""
    import pybullet as pb

    world = pb.connect(pb.DIRECT)
    there = {"physicsClientId": world}
    pb.setTimeStep(1e-6, world)
    pb.setPhysicsEngineParameter(contactSlop=0.0, **there)
    numbers = []
    for body, sign in ((scene.body_a, 1.0), (scene.body_b, -1.0)):
        place = tuple(_ball(scene, body, sign))
        shape = pb.createCollisionShape(pb.GEOM_SPHERE, radius=BALL, collisionFramePosition=place, **there)
        number = pb.createMultiBody(body.mass, shape, basePosition=tuple(body.position), **there)
        restitution = sqrt(scene.contact.restitution)  # of a pair, the product
        undamped = {"lateralFriction": 0.0, "linearDamping": 0.0, "angularDamping": 0.0}
        moments = [body.inertia.xx, body.inertia.yy, body.inertia.zz]
        pb.changeDynamics(
            number, -1, restitution=restitution, localInertiaDiagonal=moments, **undamped, **there
        )
        numbers.append(number)
    moving = [
        (number, tuple(body.position), tuple(body.velocity), tuple(body.angular_velocity))
        for number, (body, _) in zip(numbers, scene.moving(), strict=False)
    ]
    level = (0.0, 0.0, 0.0, 1.0)

    def call() -> list[tuple[Any, Any]]:
        for number, position, velocity, spin in moving:
            pb.resetBasePositionAndOrientation(number, position, level, world)
            pb.resetBaseVelocity(number, velocity, spin, world)
        pb.stepSimulation(world)
        return [pb.getBaseVelocity(number, world) for number, *_ in moving]

    yield PYBULLET, Peer(call, lambda after: np.array([[*v, *w] for v, w in after]))


PEERS = {"pin": pinocchio, "mujoco": mujoco, "pybullet": pybullet, "pymunk": pymunk}
"""By the name under which pip knows them."""


def _ball(scene: Scene, body: Body, sign: float) -> tuple[float, ...]:
    """Where a body's ball is, from its centre of mass."""
    return tuple(scene.contact.position + scene.contact.normal * (sign * BALL) - body.position)


def _words(numbers: Any) -> str:
    return " ".join(repr(float(number)) for number in numbers)


# Measuring ------------------------------------------------------------------------------------


def exact_twists(scene: Scene) -> np.ndarray:
    """The law in exact fractions."""

    def exact(value: Any) -> Any:
        if isinstance(value, tuple):
            return type(value)(*(exact(part) for part in value))
        return value if value is None else Fraction(value)

    a, b, contact = (exact(part) for part in scene[:3])
    a, b = (body._replace(inverse_mass=1 / body.mass if body.mass else body.mass) for body in (a, b))
    approach = Spatial.prepare(a, b, contact)
    response = approach.respond(frictionless(approach, Parameters(contact.restitution)).impulse)
    after = [
        body.moved_by(change).twist() for body, change in ((a, response.change_a), (b, response.change_b))
    ]
    rows = [[float(number) for part in twist for number in part] for twist in after]
    return np.array(rows)[: len(scene.moving())]


def error(found: np.ndarray, exact: np.ndarray, scene: Scene) -> float:
    """Of the twists, relative to what the impact changes, in the norm of the kinetic energy."""
    weights = np.array([[body.mass] * 3 + [body.inertia.trace() / 3] * 3 for body, _ in scene.moving()])
    before = np.array([[*body.velocity, *body.angular_velocity] for body, _ in scene.moving()])
    return sqrt(np.sum(weights * (found - exact) ** 2) / np.sum(weights * (exact - before) ** 2))


def measure(skipped: dict[str, str]) -> dict[str, Any]:
    """Times [s] and errors of every way in every scene; what is not there is noted in ``skipped``."""
    scenes, ratios = {}, {}
    for name, scene in SCENES.items():
        ways = {}
        for package, builder in {"collision_response": ours, **PEERS}.items():
            try:
                ways |= dict(builder(scene))
            except ImportError as missing:
                skipped[package] = str(missing)
            except Exception as failure:  # a peer's interface moves; the others are still worth measuring
                skipped[package] = f"{type(failure).__name__}: {failure}"
                print(f"    {package}: {skipped[package]}", file=sys.stderr)
        samples, exact = interleaved({way: peer.call for way, peer in ways.items()}), exact_twists(scene)
        scenes[name] = {
            way: {"s": spread(samples[way]), "error": error(peer.twists(peer.call()), exact, scene)}
            for way, peer in ways.items()
        }
        ratios[name] = ratios_of(samples)
    return {"scenes": scenes, "ratios": ratios, "versions": versions()}


def ratios_of(samples: Samples) -> dict[str, Any]:
    """What the targets ask for."""
    wanted = {
        "bare law": ratio(samples, LAW, PINOCCHIO),
        "unrolled": ratio(samples, UNCHECKED, PINOCCHIO),
        "unrolled, r x n given": ratio(samples, KERNEL, PINOCCHIO),
        "resolve": ratio(samples, RESOLVE, PINOCCHIO_J),
    }
    return {name: value for name, value in wanted.items() if value is not None}


def versions() -> dict[str, str]:
    """Of the peers and of what computes here."""
    found = {}
    for package in (*PEERS, "numba", "numpy", "python-flint"):
        try:
            found[package] = importlib.metadata.version(package)
        except importlib.metadata.PackageNotFoundError:
            continue
    return found
