"""Several contacts at once: answers and times of ``resolve_scene()`` and its peers.

All scenes have e = 1 and no friction. The peers:

* MuJoCo gets the scene. Its contacts are soft. Restitution is set as its guide says ("Restitution" in "Tips
  and tricks"): ``solref`` with a large stiffness and no damping; the impedance is .9999, and a contact lasts
  20 steps. The time is that of the whole impact, until nothing touches.
* pinocchio gets the bodies, the point contacts, and the drift (1 + e) u where they approach. The time
  includes the mass matrix, the Jacobian, the Cholesky decomposition of the constraints and ADMM, to 1e-10.
* Siconos gets the matrix and the vector of the linear complementarity problem, for Lemke's method. The time
  does not include computing them.
"""

from __future__ import annotations

import json
import math
import shutil
import subprocess
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pages
from figures import plt, save
from machine import described, versions

from collision_response import Body, Contact, ImpactModel, Law, resolve, resolve_scene
from collision_response.physics.body import Twist
from collision_response.physics.mass_properties import box, sphere
from collision_response.physics.vector import Vec3
from collision_response.scene.order_sensitivity import resolve_sequentially

Vectors = list[tuple[Any, Any]]
"""Velocity and angular velocity of each movable body."""

STIFFNESS, STEPS = 1e6, 20
"""Stiffness of MuJoCo's contacts [1/s^2], and the number of steps that one lasts."""

PATIENCE = 1.0
"""A program that takes longer than this for one scene does not get a larger one [s]."""

SIZES = (1, 4, 10, 32, 100, 316, 1000, 3160, 10000)
ROUNDS = 5
LIMITS = {"pinocchio": 320, "Siconos": 1000}
"""Largest numbers of contacts, where dense matrices would take too much."""


class Scene(NamedTuple):
    """A scene; ``mjcf`` is the same scene for MuJoCo."""

    bodies: list[Body]
    pairs: list[tuple[int, int]]
    contacts: list[Contact]
    mjcf: str

    def movable(self) -> list[Body]:
        return [body for body in self.bodies if body.is_movable()]

    def velocities(self) -> np.ndarray:
        """The twists of the movable bodies, one after the other."""
        return np.concatenate([[*body.velocity, *body.angular_velocity] for body in self.movable()])

    def masses(self) -> np.ndarray:
        """For each of the velocities the mass, or the moment of inertia."""
        return np.concatenate(
            [[body.mass] * 3 + [body.inertia[i] for i in (0, 3, 5)] for body in self.movable()]
        )


def row(contacts: int) -> Scene:
    """Touching balls in a row; the first one comes at 1 m/s."""
    moments = sphere(1.0, 0.5).inertia
    bodies = [
        Body.dynamic(1.0, moments, (float(i), 0.0, 0.0), None, (float(i == 0), 0.0, 0.0))
        for i in range(contacts + 1)
    ]
    impacts = [Contact.of((i + 0.5, 0.0, 0.0), (-1.0, 0.0, 0.0), 1.0) for i in range(contacts)]
    geom = '<freejoint/><geom type="sphere" size=".5" mass="1"/>'
    balls = "".join(f'<body pos="{i} 0 0">{geom}</body>' for i in range(contacts + 1))
    return Scene(bodies, [(i, i + 1) for i in range(contacts)], impacts, balls)


def boxes(contacts: int) -> Scene:
    """Boxes side by side that land flat at 1 m/s, with four corners each."""
    moments, count = box(1.0, (1.0, 1.0, 1.0)).inertia, max(1, contacts // 4)
    corners = [(x, y) for x in (-0.5, 0.5) for y in (-0.5, 0.5)]
    bodies = [Body.dynamic(1.0, moments, (2.0 * i, 0.0, 0.5), None, (0.0, 0.0, -1.0)) for i in range(count)]
    impacts = [
        Contact.of((2.0 * i + x, y, 0.0), (0.0, 0.0, 1.0), 1.0) for i in range(count) for x, y in corners
    ]
    geom = '<freejoint/><geom type="box" size=".5 .5 .5" mass="1"/>'
    falling = "".join(f'<body pos="{2 * i} 0 .5">{geom}</body>' for i in range(count))
    pairs = [(i, count) for i in range(count) for _ in corners]
    return Scene([*bodies, Body.static()], pairs, impacts, f'<geom type="plane" size="9 9 1"/>{falling}')


def stack(contacts: int) -> Scene:
    """A sliding stack of boxes that lands at 1 m/s, with four corners each; only for this package."""
    moments, count = box(1.0, (1.0, 1.0, 1.0)).inertia, max(1, contacts // 4)
    bodies = [
        Body.dynamic(1.0, moments, (0.0, 0.0, i + 0.5), None, (0.2 * (i + 1), 0.0, -1.0))
        for i in range(count)
    ]
    impacts = [
        Contact.of((x, y, float(i)), (0.0, 0.0, 1.0), 0.5, 0.3)
        for i in range(count)
        for x in (-0.5, 0.5)
        for y in (-0.5, 0.5)
    ]
    pairs = [(i, i - 1 if i else count) for i in range(count) for _ in range(4)]
    return Scene([*bodies, Body.static()], pairs, impacts, "")


def as_detected(scene: Scene, noise: float, seed: int) -> Scene:
    """The scene as a detector of contacts sees it: each number of a contact is off by up to ``noise``."""
    rng = np.random.default_rng(seed)
    contacts = [
        contact._replace(
            position=contact.position + rng.uniform(-noise, noise, 3),
            normal=contact.normal + rng.uniform(-noise, noise, 3),
        )
        for contact in scene.contacts
    ]
    return scene._replace(contacts=contacts)


# Ways to the answer ---------------------------------------------------------------------------


class Way(NamedTuple):
    """One program that resolves a scene.

    Attributes:
        answer: returns the twists after the impact.
        seconds: resolves the scene a number of times and returns the time of one [s].
    """

    answer: Callable[[], Vectors]
    seconds: Callable[[int], float]


def as_vectors(velocities: np.ndarray) -> Vectors:
    return [(tuple(twist[:3]), tuple(twist[3:])) for twist in velocities.reshape(-1, 6)]


def timed(call: Callable[[], Any]) -> Callable[[int], float]:
    """A function that calls a number of times and returns the processor time of one call [s]."""

    def seconds(number: int) -> float:
        start = time.thread_time()
        for _ in range(number):
            call()
        return (time.thread_time() - start) / number

    return seconds


def ours(law: Law) -> Callable[[Scene], Way]:
    def way(scene: Scene) -> Way:
        def call() -> Any:
            return resolve_scene(*scene[:3], ImpactModel(law))

        def answer() -> list[Any]:
            twists = call().twists
            return [tuple(twists[i]) for i, body in enumerate(scene.bodies) if body.is_movable()]

        return Way(answer, timed(call))

    return way


def in_turn(scene: Scene) -> Way:
    """Single impacts, contact by contact, until none approaches, as game engines do."""
    order = range(len(scene.contacts))

    def call() -> list[Twist]:
        return resolve_sequentially(*scene[:3], ImpactModel(), order)

    def answer() -> Vectors:
        bodies = zip(scene.bodies, call(), strict=True)
        return [
            (body.velocity + by.linear, body.angular_velocity + by.angular)
            for body, by in bodies
            if body.is_movable()
        ]

    return Way(answer, timed(call))


def mujoco(scene: Scene) -> Way:
    import mujoco as mj

    step = math.pi / math.sqrt(STIFFNESS) / STEPS
    model = mj.MjModel.from_xml_string(
        f"""<mujoco><size memory="2G"/><option timestep="{step!r}" gravity="0 0 0" integrator="implicitfast"/>
        <default><geom condim="1" solref="{-STIFFNESS!r} 0" solimp=".9999 .9999 .001"/></default>
        <worldbody>{scene.mjcf}</worldbody></mujoco>"""
    )
    data = mj.MjData(model)
    q = data.qpos.copy()
    v = scene.velocities()

    def call() -> Any:
        data.qpos[:], data.qvel[:] = q, v
        data.qacc_warmstart[:] = 0
        steps = 0
        while steps < 2 or data.ncon:
            mj.mj_step(model, data)
            steps += 1
        return data.qvel

    return Way(lambda: as_vectors(call()), timed(call))


def pinocchio(scene: Scene) -> Way:
    import pinocchio as pin

    model = pin.Model()
    joint_of = []
    for body in scene.bodies:
        if not body.is_movable():
            joint_of.append(0)
            continue
        joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), str(model.njoints))
        tensor = np.array(body.inertia.rows())
        model.appendBodyToJoint(joint, pin.Inertia(body.mass, np.zeros(3), tensor), pin.SE3.Identity())
        joint_of.append(joint)
    constraints = pin.StdVec_ConstraintModel()
    for (a, b), contact in zip(scene.pairs, scene.contacts, strict=True):
        n = np.array(contact.normal)
        across = np.cross(n, [0.0, 1.0, 0.0] if abs(n[1]) < 0.5 else [1.0, 0.0, 0.0])
        axes = np.column_stack([across, np.cross(n, across), n])
        places = [
            pin.SE3(
                axes, np.array(contact.position) - (np.array(scene.bodies[i].position) if joint_of[i] else 0)
            )
            for i in (b, a)
        ]
        point = pin.PointContactConstraintModel(model, joint_of[b], places[0], joint_of[a], places[1])
        point.setFriction(0.0)
        constraints.append(pin.ConstraintModel(point))
    q = np.concatenate([[*body.position, 0.0, 0.0, 0.0, 1.0] for body in scene.movable()])
    v, masses = scene.velocities(), scene.masses()
    data, parts = model.createData(), pin.StdVec_ConstraintData()
    for constraint in constraints:
        parts.append(constraint.createData())
    cholesky = pin.ConstraintCholeskyDecomposition(model, data, constraints, parts)
    solver, settings, result = pin.ADMMConstraintSolver(), pin.ADMMSolverSettings(), pin.ADMMSolverResult()
    for kind in ("feasibility", "complementarity"):
        setattr(settings, f"absolute_{kind}_tol", 1e-10)
        setattr(settings, f"relative_{kind}_tol", 1e-10)
    settings.max_iterations = 10_000

    def call() -> np.ndarray:
        pin.crba(model, data, q, pin.Convention.WORLD)
        for constraint, part in zip(constraints, parts, strict=True):
            constraint.calc(model, data, part)
        J = pin.getConstraintsJacobian(model, data, constraints, parts)
        cholesky.compute(model, data, constraints, parts, 1e-12)
        g = J @ v
        g[2::3] += np.minimum(g[2::3], 0.0)
        result.reset()
        if not solver.solve(
            cholesky.getDelassusOperatorCholeskyExpression(), g, constraints, parts, settings, result
        ):
            raise ArithmeticError("ADMM has not converged")
        return J.T @ result.retrieveConstraintImpulses()

    return Way(lambda: as_vectors(v + call() / masses), timed(call))


class Siconos:
    """A process that solves the linear complementarity problems of several scenes."""

    def __init__(self) -> None:
        python = shutil.which("python3", path="/usr/bin")
        check = [python or "python3", "-c", "import siconos.numerics"]
        if python is None or subprocess.run(check, capture_output=True).returncode:
            raise ImportError("no Python in /usr/bin has siconos: apt install python3-siconos")
        self._process = subprocess.Popen(
            [python, Path(__file__).with_name("siconos_lcp.py")],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def ask(self, problem: Any) -> tuple[list[float], float]:
        """Send a line and return the answer: the solution, and the time of one solution [s]."""
        assert self._process.stdin is not None and self._process.stdout is not None
        self._process.stdin.write(json.dumps(problem) + "\n")
        self._process.stdin.flush()
        p, seconds = json.loads(self._process.stdout.readline())
        if p is None:
            raise ArithmeticError("Lemke's method has not found a solution")
        return p, seconds

    def close(self) -> None:
        """End the process."""
        self._process.communicate()

    def __call__(self, scene: Scene) -> Way:
        v, masses = scene.velocities(), scene.masses()
        J = np.zeros((len(scene.contacts), len(v)))
        for line, ((a, b), contact) in enumerate(zip(scene.pairs, scene.contacts, strict=True)):
            for place, sign in ((a, 1), (b, -1)):
                if scene.bodies[place].is_movable():
                    arm = contact.position - scene.bodies[place].position
                    n = contact.normal * sign
                    J[line, 6 * place : 6 * place + 6] = [*n, *Vec3(*arm).cross(n)]
        u = J @ v
        problem = [((J / masses) @ J.T).tolist(), (u + np.minimum(u, 0.0)).tolist()]

        def answer() -> Vectors:
            p, _ = self.ask(problem)
            return as_vectors(v + J.T @ np.array(p) / masses)

        self.ask(problem)

        def seconds(number: int) -> float:
            if number == 1:
                return self.ask(problem)[1]
            self.ask(problem)
            return self.ask(number)[1]

        return Way(answer, seconds)


# Measuring ------------------------------------------------------------------------------------

OURS = {
    "`FRICTIONLESS`": ours(Law.FRICTIONLESS),
    "`MOREAU`": ours(Law.MOREAU),
    "`ROUTH_STRONGE`": ours(Law.ROUTH_STRONGE),
}
FOR_FRICTION = {f"`{law.name}`": ours(law) for law in (Law.FRICTIONLESS, Law.COULOMB, Law.MOREAU)}


def measure(_: object, say: Callable[[str], object]) -> dict[str, Any]:
    """Measure the answers to cradle and flat box, the times by number of contacts, and the targets."""
    skipped: dict[str, str] = {}
    ways: dict[str, Callable[[Scene], Way]] = {**OURS, "one after another": in_turn}
    siconos = None
    try:
        siconos = Siconos()
    except ImportError as missing:
        skipped["siconos"] = str(missing)
    for name, way in {"MuJoCo": mujoco, "pinocchio": pinocchio, "Siconos": siconos}.items():
        try:
            if way is not None:
                way(boxes(4)).answer()
                ways[name] = way
        except Exception as failure:  # an interface has changed; measure the other peers
            skipped[name] = f"{type(failure).__name__}: {failure}"
    answers = {  # as text, because stored numbers keep only three digits
        name: [*_row_cells(way(row(2)).answer()), *_box_cells(way(boxes(4)).answer())]
        for name, way in ways.items()
    }
    costs = {}
    for what, build in (("row", row), ("boxes", boxes)):
        costs[what] = dict(cost(build, ways, max(SIZES), say))
    costs["stack"] = dict(cost(stack, FOR_FRICTION, 120, say))
    targets = [
        {"what": "a box flat on a floor, against one impact, COULOMB", "most": 10.0, "measured": box_ratio()},
        {
            "what": "a cluster of 100 contacts, slowest law except ROUTH_STRONGE [ms]",
            "most": 20.0,
            "measured": 1e3 * max(*costs["stack"]["100"].values(), costs["row"]["100"]["`FRICTIONLESS`"]),
        },
    ]
    if siconos is not None:
        siconos.close()
    return {
        "answers": answers,
        "seconds": costs,
        "tolerances": what_tolerances_cost(),
        "targets": targets,
        "skipped": skipped,
    }


def cost(
    build: Callable[[int], Scene], ways: dict[str, Any], most: int, say: Callable[[str], object]
) -> Iterator[tuple[str, dict[str, float]]]:
    """For each number of contacts, the minimum time of each program over several rounds [s]."""
    remaining = dict(ways)
    for size in SIZES:
        if size > most or (build is not row and size < 4):
            continue
        scene, built = build(size), {}
        for name in list(remaining):
            if size > LIMITS.get(name, most):
                del remaining[name]
                continue
            try:
                built[name] = remaining[name](scene)
            except Exception as failure:  # the scene is too large
                say(f"    {name}, {size} contacts: {type(failure).__name__}: {failure}")
                del remaining[name]
        once = {name: way.seconds(1) for name, way in built.items()}
        best = dict(once)
        for _ in range(ROUNDS):
            for name, way in built.items():
                if once[name] < PATIENCE / 4:
                    best[name] = min(best[name], way.seconds(max(1, int(0.02 / (best[name] + 1e-9)))))
        for name, spent in once.items():
            if spent > PATIENCE:
                del remaining[name]
        number = len(scene.contacts)
        say(
            f"    {build.__name__}, {number} contacts: {', '.join(f'{n} {t:.2g} s' for n, t in best.items())}"
        )
        yield str(number), best


TOLERANCES = (1e-2, 1e-4, 0.0, 1e-8, 1e-10)
"""0: without a tolerance."""


def what_tolerances_cost() -> list[dict[str, float]]:
    """For each tolerance, the time, the error and its bound in stacks of ten boxes with friction.

    The error is the distance of velocities from those with the tolerance 1e-13, relative to the greatest
    change. Time is the mean over some stacks, of the minimum over several rounds; error and bound are the
    greatest of these stacks.
    """
    scenes = [as_detected(stack(40), 1e-5, seed) for seed in range(5)]

    def resolved(scene: Scene, tolerance: float) -> Any:
        return resolve_scene(*scene[:3], ImpactModel(Law.COULOMB, tolerance=tolerance))

    def velocities(twists: Any) -> np.ndarray:
        return np.array([twist.linear for twist in twists])

    def error(answer: Any, finest: Any) -> float:
        off = velocities(answer.changes) - velocities(finest.changes)
        return float(np.abs(off).max() / np.abs(velocities(finest.changes)).max())

    finest = [resolved(scene, 1e-13) for scene in scenes]
    found = []
    for tolerance in TOLERANCES:
        spent = []
        for scene in scenes:
            run = timed(partial(resolved, scene, tolerance))
            spent.append(min(run(3) for _ in range(ROUNDS)))
        answers = [resolved(scene, tolerance) for scene in scenes]
        found.append(
            {
                "tolerance": tolerance,
                "seconds": float(np.mean(spent)),
                "error": max(map(error, answers, finest)),
                "bound": max(answer.error_bound for answer in answers),
            }
        )
    return found


def box_ratio() -> float:
    """Time of a sliding flat box divided by that of one corner; the minimum of each over several rounds."""
    bodies, pairs, contacts, _ = boxes(4)
    bodies = [bodies[0]._replace(velocity=Vec3(0.25, 0.0, -1.0)), bodies[1]]
    contacts = [contact._replace(restitution=0.5, friction=0.3) for contact in contacts]
    together = timed(lambda: resolve_scene(bodies, pairs, contacts))
    alone = timed(lambda: resolve(*bodies, contacts[0]))
    rounds = [(together(100), alone(1000)) for _ in range(15)]
    return min(t for t, _ in rounds) / min(t for _, t in rounds)


# The page -------------------------------------------------------------------------------------


def parts(results: dict[str, Any]) -> dict[str, str]:
    """The generated parts of docs/scenes.md."""
    found = results["scenes"]
    names = {"mujoco": "MuJoCo", "pin": "pinocchio"}
    peers = ", ".join(f"{names[package]} {version}" for package, version in versions(names).items())
    lines = [f"Measured on {results['date']}: {described(results['machine'])}; {peers}."]
    lines += [f"* Skipped: {what}: {why}." for what, why in found["skipped"].items()]
    rows = [[name, *cells] for name, cells in found["answers"].items()]
    head = ["", "cradle: speeds after [m/s]", "energy kept", "flat box: up [m/s]", "spin [rad/s]"]
    tables = []
    heads = {
        "row": "balls in a row, contacts",
        "boxes": "flat boxes, contacts",
        "stack": "a sliding stack of boxes, contacts",
    }
    for what, title in heads.items():
        spent = found["seconds"][what]
        names = list(dict.fromkeys(name for own in spent.values() for name in own))
        head_of = [title, *names]
        cells = [[f"{int(n):,}", *(_time(own.get(name)) for name in names)] for n, own in spent.items()]
        tables.append(pages.table(head_of, cells))
    return {
        "measured": "\n".join(lines),
        "answers": pages.table(head, rows),
        "cost": "\n\n".join(tables),
        "tolerances": _tolerances(found["tolerances"]),
    }


def _tolerances(found: list[dict[str, float]]) -> str:
    """A table of what tolerances cost."""
    rows = [
        [
            f"{row['tolerance']:.0e}" if row["tolerance"] else "none",
            _time(row["seconds"]),
            f"{row['error']:.0e}",
            f"{row['bound']:.0e}",
        ]
        for row in found
    ]
    return pages.table(["`tolerance`", "time", "greatest error", "greatest bound"], rows)


def _row_cells(after: Vectors) -> list[str]:
    speeds = [linear[0] for linear, _ in after]
    return [
        ", ".join(f"{v + 0.0:.5f}" for v in np.round(speeds, 5)),
        f"{100 * sum(v * v for v in speeds):.2f} %",
    ]


def _box_cells(after: Vectors) -> list[str]:
    ((linear, angular),) = after
    return [f"{linear[2]:.5f}", f"{math.hypot(*angular):.5f}"]


def _time(seconds: float | None) -> str:
    if seconds is None:
        return ""
    unit, scale = ("µs", 1e6) if seconds < 1e-3 else ("ms", 1e3) if seconds < 1 else ("s", 1.0)
    return f"{pages.significant(scale * seconds)} {unit}"


COLOURS = {
    "`FRICTIONLESS`": ("#0072b2", "o"),
    "`MOREAU`": ("#56b4e9", "s"),
    "`ROUTH_STRONGE`": ("#e69f00", "^"),
    "one after another": ("#8a8a8a", "v"),
    "MuJoCo": ("#d55e00", "X"),
    "pinocchio": ("#009e73", "D"),
    "Siconos": ("#cc79a7", "P"),
}


def draw(found: dict[str, Any]) -> None:
    """Plot time against the number of contacts, with a panel for each kind of scene."""
    figure, grid = plt.subplots(1, 2, figsize=(9, 4.3), sharex=True, sharey=True, layout="constrained")
    titles = {"row": "balls in a row: one cluster", "boxes": "flat boxes: clusters of four"}
    for axes, (what, title) in zip(grid, titles.items(), strict=True):
        spent = {int(n): own for n, own in found["seconds"][what].items()}
        axes.set(xscale="log", yscale="log", xlabel="contacts")
        axes.set_title(title, loc="left", fontsize=11, fontweight="bold")
        axes.grid(True, lw=0.5, color="#e8e8e8")
        for name, (colour, marker) in COLOURS.items():
            line = [(n, own[name]) for n, own in spent.items() if name in own]
            if line:
                label = name.strip("`")
                axes.plot(*zip(*line, strict=True), marker=marker, color=colour, ms=5, lw=1.6, label=label)
        axes.set_yticks([1e-6, 1e-5, 1e-4, 1e-3, 1e-2, 0.1, 1, 10])
        axes.set_yticklabels(["1 µs", "10 µs", "0.1 ms", "1 ms", "10 ms", "0.1 s", "1 s", "10 s"])
        axes.minorticks_off()
    handles, labels = grid[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4, frameon=False, fontsize=9.5)
    save(figure, "scenes-cost.png")


def write(results: dict[str, Any]) -> None:
    """Write the generated parts of the page, and its plot."""
    pages.rewrite(pages.DOCS / "scenes.md", parts(results))
    draw(results["scenes"])
    print("==> wrote docs/scenes.md")
