"""The problems that a batch can be about, and their quantities in symbols."""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum
from typing import NamedTuple

from ..model import Geometry, Law
from ..numerics.program import Slot
from ..numerics.tape import Symbol, Tape
from ..physics.body import Body
from ..physics.contact import Contact
from ..physics.number import Scalar
from ..physics.orientation import Quaternion
from ..physics.tensor import ZERO_TENSOR, Symmetric3
from ..physics.vector import ZERO, Vec3
from ..soundness import Scene
from .rows import body_rows, contact_rows


class Tangential(Enum):
    """Where the tangential restitution of a batch comes from."""

    ZERO = "there is none"
    MODEL = "one number for all"
    CONTACTS = "a row of the contacts"


class Arithmetic(Enum):
    """What is computed, and how."""

    PLAIN = "as the arrays have it"
    BOUNDED = "as the arrays have it, with an error bound for each contact"
    DOUBLED = "in double-double arithmetic, with an error bound for each contact"


class Problem(NamedTuple):
    """What is traced.

    Attributes:
        geometry: POINT, PLANAR or SPATIAL.
        law: FRICTIONLESS or COULOMB.
        oriented: whether the bodies have orientations, else their axes are those of the world.
        tangential: where ``e_t`` comes from.
        threshold: whether there is an approach speed under which restitution is taken as 0.
        arithmetic: see :class:`Arithmetic`.
    """

    geometry: Geometry
    law: Law
    oriented: bool = False
    tangential: Tangential = Tangential.ZERO
    threshold: bool = False
    arithmetic: Arithmetic = Arithmetic.PLAIN


TANGENTIAL = Slot("model", 0)
THRESHOLD = Slot("model", 1)
"""What is one number for all contacts."""


class Inputs(NamedTuple):
    """What a program takes.

    Attributes:
        slots: in the order in which a scalar form takes them.
        scene: the same, as symbols.
        threshold: the approach speed under which restitution is taken as 0.
    """

    slots: tuple[Slot, ...]
    scene: Scene
    threshold: Symbol | None


def contact_count(problem: Problem) -> int:
    """How many rows of ``contacts`` are read."""
    at = contact_rows(problem.geometry)
    if problem.law is Law.FRICTIONLESS:
        return at.friction.start
    return at.height + (problem.tangential is Tangential.CONTACTS)


def inputs_of(problem: Problem, tape: Tape) -> Inputs:
    """The inputs of a problem, on a tape."""
    rows, at = body_rows(problem.geometry, oriented=problem.oriented), contact_rows(problem.geometry)
    slots = [Slot("bodies", row, lane) for row in range(rows.height) for lane in (0, 1)]
    slots += [Slot("contacts", row) for row in range(contact_count(problem))]
    slots += [TANGENTIAL] * (problem.tangential is Tangential.MODEL) + [THRESHOLD] * problem.threshold
    symbols = {slot: tape.input(slot) for slot in slots}

    def read(array: str, rows: slice, lane: int | None = None) -> list[Symbol]:
        return [symbols[Slot(array, row, lane)] for row in range(rows.start, rows.stop)]

    def body(lane: int) -> Body:
        mass = read("bodies", rows.mass, lane)[0]
        return Body(
            mass,
            1 / mass,
            _tensor(read("bodies", rows.inertia, lane)),
            _vector(read("bodies", rows.position, lane)),
            Quaternion(*read("bodies", rows.orientation, lane)) if problem.oriented else None,
            _vector(read("bodies", rows.velocity, lane)),
            _spin(read("bodies", rows.angular_velocity, lane)),
        )

    position, normal = _vector(read("contacts", at.position)), _vector(read("contacts", at.normal))
    friction = read("contacts", at.friction)[0] if problem.law is Law.COULOMB else 0.0
    contact = Contact(position, normal, read("contacts", at.restitution)[0], friction)
    in_contacts = problem.tangential is Tangential.CONTACTS
    e_t = read("contacts", at.tangential_restitution)[0] if in_contacts else symbols.get(TANGENTIAL, 0.0)
    return Inputs(tuple(slots), Scene(body(0), body(1), contact, e_t), symbols.get(THRESHOLD))


def _tensor(components: Sequence[Scalar]) -> Symmetric3:
    return Symmetric3(*components) if len(components) == 6 else ZERO_TENSOR._replace(zz=sum(components))


def _vector(components: Sequence[Scalar]) -> Vec3:
    return Vec3(*components, *ZERO[len(components) :])


def _spin(components: Sequence[Scalar]) -> Vec3:
    return Vec3(*ZERO[len(components) :], *components)
