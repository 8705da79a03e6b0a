"""One frictionless impact in space: the bare law in plain Python against pinocchio's ``impulseDynamics``.

Both get the lever arms ready-made: pinocchio as its Jacobian, the law as ``r x n``. Pinocchio is C++
called from Python; the law is what :mod:`collision_response.batch.kernels` traces and writes out.
"""

from __future__ import annotations

import gc
import math
import time
from collections.abc import Callable
from statistics import median
from typing import Any

import numpy as np
from batch import scene

from collision_response import Body, Contact, Geometry, Law
from collision_response.batch.kernels import bare, general, unchecked
from collision_response.batch.problem import Problem
from collision_response.numerics.emit_scalar import emit_scalar
from collision_response.numerics.program import Program, Slot
from collision_response.physics.effective_mass import Spatial
from collision_response.physics.laws import Parameters, frictionless

PROBLEM = Problem(Geometry.SPATIAL, Law.FRICTIONLESS)
BODIES, CONTACTS = (array[..., 0] for array in scene(Geometry.SPATIAL, 1))


def by_program(program: Program) -> Callable[[], tuple[float, ...]]:
    """A call of its code with ready-made arguments."""
    names: dict[str, Any] = {"inf": math.inf, "nan": math.nan, "sqrt": math.sqrt}
    exec(emit_scalar(program), names)
    kernel, arguments = names["kernel"], [float(_value(slot)) for slot in program.inputs]
    return lambda: kernel(*arguments)


def _value(slot: Slot) -> float:
    if slot.array == "contacts":
        return CONTACTS[slot.row]
    if slot.array == "arms":
        return np.cross(CONTACTS[:3] - BODIES[7:10, slot.lane], CONTACTS[3:6])[slot.row]
    return BODIES[slot.row, slot.lane]


def by_physics() -> Callable[[], object]:
    """The formulas as they are written, over floats."""
    b, c = BODIES.tolist(), CONTACTS.tolist()

    def body(lane: int) -> Body:
        rows = [row[lane] for row in b]
        return Body.dynamic(rows[0], rows[1:7], rows[7:10], None, rows[10:13], rows[13:16])

    pair, contact = (body(0), body(1)), Contact.of(c[:3], c[3:6], c[6])

    def run() -> object:
        approach = Spatial.prepare(*pair, contact)
        response = approach.respond(frictionless(approach, Parameters(contact.restitution)).impulse)
        return pair[0].moved_by(response.change_a), pair[1].moved_by(response.change_b)

    return run


def by_pinocchio() -> dict[str, Callable[[], object]]:
    """With the Jacobian ready, and with one written by hand; nothing if pinocchio is not installed."""
    try:
        import pinocchio as pin
    except ImportError:
        return {}
    model = pin.Model()
    for lane in (0, 1):
        xx, xy, xz, yy, yz, zz = BODIES[1:7, lane]
        tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        joint = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), f"body_{lane}")
        model.appendBodyToJoint(joint, pin.Inertia(BODIES[0, lane], np.zeros(3), tensor), pin.SE3.Identity())
    data, q, v = model.createData(), pin.neutral(model), BODIES[10:16].T.ravel().copy()
    q[:3], q[7:10] = BODIES[7:10].T
    point, normal, restitution = CONTACTS[:3].copy(), CONTACTS[3:6].copy(), float(CONTACTS[6])

    def jacobian() -> np.ndarray[Any, Any]:
        J = np.empty((1, 12))
        (ax, ay, az), (bx, by, bz), (x, y, z) = (
            (point - q[:3]).tolist(),
            (point - q[7:10]).tolist(),
            normal.tolist(),
        )
        arm_a = (ay * z - az * y, az * x - ax * z, ax * y - ay * x)
        J[0] = (x, y, z, *arm_a, -x, -y, -z, bz * y - by * z, bx * z - bz * x, by * x - bx * y)
        return J

    J = jacobian()
    return {
        "pinocchio": lambda: pin.impulseDynamics(model, data, q, v, J, restitution),
        "pinocchio, J by hand": lambda: pin.impulseDynamics(model, data, q, v, jacobian(), restitution),
    }


def measure(turns: int = 15, calls: int = 2000) -> dict[str, dict[str, float]]:
    """Microseconds of each, and its ratio to pinocchio's bare call, as medians over the turns."""
    runs = {
        "bare law": by_program(bare(PROBLEM)),
        "law from positions": by_program(unchecked(PROBLEM)),
        "law and all checks": by_program(general(PROBLEM)),
        "formulas as written": by_physics(),
        **by_pinocchio(),
    }
    spent: dict[str, list[float]] = {name: [] for name in runs}
    gc.disable()
    for _ in range(turns):
        for name, run in runs.items():
            start = time.perf_counter()
            for _ in range(calls):
                run()
            spent[name].append((time.perf_counter() - start) / calls * 1e6)
    gc.enable()
    figures = {name: {"us": median(times)} for name, times in spent.items()}
    for name, times in spent.items():
        if "pinocchio" in spent:
            figures[name]["ratio"] = median(a / b for a, b in zip(times, spent["pinocchio"], strict=True))
    return figures


if __name__ == "__main__":
    for name, figures in measure().items():
        print(f"{name:24}" + "".join(f"{key} {value:8.2f}   " for key, value in figures.items()))
