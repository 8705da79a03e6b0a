"""Coulomb's conditions at several contacts: MOREAU against 50 digits, and where rolling bodies pile up."""

from __future__ import annotations

import itertools
import math
import random
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import pytest

pytest.importorskip("mpmath")

from mpmath import mp, mpf
from scene_cases import Scene, distance, distance_of_changes, shuffled

from collision_response import Adjustment, Body, Contact, Law, SceneImpact
from collision_response.physics.body import Twist
from collision_response.physics.vector import Vec3

NORMALS = [(3, 4), (-3, 4), (4, 3), (-4, 3), (5, 12), (-5, 12), (12, -5), (-12, 5), (1, 0), (0, 1)]
"""In the plane x, z. Their lengths are whole numbers."""


def corner(rng: random.Random) -> Scene:
    """A body in the plane that touches two walls."""
    inertia = rng.uniform(0.05, 1.0)
    body = Body.dynamic(
        1.0,
        (inertia, 0, 0, inertia, 0, inertia),
        velocity=(rng.uniform(-1, 1), 0, rng.uniform(-1, 1)),
        angular_velocity=(0, rng.uniform(-2, 2), 0),
    )
    mu, e = rng.uniform(0, 3), rng.choice([0.0, 0.25, 0.75])
    contacts = [
        Contact.of((rng.uniform(-1, 1), 0, rng.uniform(-1, 1)), (x, 0, z), e, mu)
        for x, z in rng.sample(NORMALS, 2)
    ]
    return Scene([body, Body.static()], [(0, 1)] * 2, contacts)


def answers_in_corners(first: int) -> Iterator[tuple[int, Scene, SceneImpact]]:
    """Yield seeds, a hundred from ``first``, their corners, and the answers of MOREAU."""
    for seed in range(first, first + 100):
        scene = corner(random.Random(seed))
        yield seed, scene, scene.resolve(Law.MOREAU)


class Equations(NamedTuple):
    """Of a body in a corner, for the velocities along the normal and tangent of each contact."""

    weights: mp.matrix
    """The inverses of its masses."""
    rows: mp.matrix
    """The velocities by its twist."""
    before: mp.matrix
    """The velocities before the impact."""

    def effect(self) -> mp.matrix:
        """Return K: the velocities by impulses."""
        return self.rows * self.weights * self.rows.T


def equations_of(scene: Scene) -> Equations:
    body = scene.bodies[0]
    rows = []
    for contact in scene.contacts:
        length = math.hypot(contact.normal.x, contact.normal.z)
        n = mpf(contact.normal.x) / length, mpf(contact.normal.z) / length
        arm = mpf(contact.position.x), mpf(contact.position.z)
        rows += [[a, b, arm[1] * a - arm[0] * b] for a, b in (n, (-n[1], n[0]))]
    twist = mp.matrix([body.velocity.x, body.velocity.z, body.angular_velocity.y])
    return Equations(mp.diag([1, 1, 1 / mpf(body.inertia.yy)]), mp.matrix(rows), mp.matrix(rows) * twist)


def impulses(scene: Scene, slips: Sequence[float | None]) -> mp.matrix:
    """By the linear equations of contacts that slide, stick (a slip of 0), or part (None)."""
    equations = equations_of(scene)
    K, u = equations.effect(), equations.before
    M, rhs = mp.eye(4), mp.matrix(4, 1)
    for i, (contact, slip) in enumerate(zip(scene.contacts, slips, strict=True)):
        normal, tangent = 2 * i, 2 * i + 1
        if slip is None:
            continue
        M[normal, :], rhs[normal] = K[normal, :], -u[normal] - mpf(contact.restitution) * min(u[normal], 0)
        if slip:
            M[tangent, normal] = mpf(contact.friction) * (1 if slip > 0 else -1)
        else:
            M[tangent, :], rhs[tangent] = K[tangent, :], -u[tangent]
    return mp.lu_solve(M, rhs)


def in_fifty_digits(scene: Scene, answer: SceneImpact) -> list[Twist]:
    """The changes of twists, where contacts stick, slide or part as in an answer."""
    twist, slips = answer.twists[0], []
    for contact, impulse in zip(scene.contacts, answer.impulses, strict=True):
        after = twist.linear + twist.angular.cross(contact.position)
        slip = after.cross(contact.normal).y / contact.normal.norm()
        slips.append(None if impulse.norm() == 0 else slip if abs(slip) > 1e-9 else 0.0)
    equations = equations_of(scene)
    change = equations.weights * equations.rows.T * impulses(scene, slips)
    x, z, turn = (float(by) for by in change)
    return [Twist(Vec3(x, 0.0, z), Vec3(0.0, turn, 0.0)), answer.changes[1]]


@pytest.mark.parametrize("first", range(0, 1000, 100))
def test_bodies_in_corners(first):
    """The estimate of the error holds. Most have an answer; where bodies are wedged there may be none."""
    compared = 0
    with mp.workdps(50):
        for seed, scene, answer in answers_in_corners(first):
            if answer.adjustments & Adjustment.LAW_FALLBACK or answer.error_bound == math.inf:
                continue
            off = distance_of_changes(scene, answer.changes, in_fifty_digits(scene, answer))
            assert off <= answer.error_bound < 1e-8, seed
            compared += 1
    assert compared > 80


def energies_gained(scene: Scene) -> list[mpf]:
    """By every solution of Coulomb's conditions: the contacts part, stick, or slide to either side."""
    equations, gains = equations_of(scene), []
    K, u = equations.effect(), equations.before
    for slips in itertools.product((None, 0, 1, -1), repeat=2):
        P = impulses(scene, slips)
        after = u + K * P
        # The equations of two contacts that stick may contradict each other.
        obeys = max(abs(p) for p in P) < 1e20
        for i, (contact, slip) in enumerate(zip(scene.contacts, slips, strict=True)):
            p, t = P[2 * i], P[2 * i + 1]
            rebound = after[2 * i] + mpf(contact.restitution) * min(u[2 * i], 0)
            rubs = after[2 * i + 1] * slip >= 0 if slip else abs(t) <= contact.friction * p
            obeys = obeys and (rebound >= 0 if slip is None else p >= 0 and rubs)
        if obeys:
            gains.append((P.T * (u + after))[0] / 2)
    return gains


@pytest.mark.parametrize("first", range(0, 1000, 100))
def test_moreau_falls_back_where_no_solution_keeps_energy(first):
    fell_back = 0
    with mp.workdps(50):
        for seed, scene, answer in answers_in_corners(first):
            if answer.adjustments & Adjustment.LAW_FALLBACK:
                assert all(gain > 0 for gain in energies_gained(scene)), seed
                fell_back += 1
    assert fell_back


def heap(rng: random.Random, mu: float) -> Scene:
    """Five rows of discs between two walls, which roll a little and have come down by one step of gravity."""
    bodies, pairs, contacts = [], [], []

    def touch(a: int, b: int, position: Vec3, normal: Vec3) -> None:
        turned = normal + Vec3(rng.gauss(0, 0.02), 0.0, rng.gauss(0, 0.02))
        pairs.append((a, b))
        contacts.append(Contact.of(position, turned, 0.0, mu))

    place = {}
    for row in range(5):
        for column in range(4 - row % 2):
            place[row, column] = len(bodies)
            at = Vec3(column + row % 2 / 2, 0.0, 0.5 + row * math.sqrt(0.75))
            spin = rng.gauss(0, 0.02)
            velocity = (rng.gauss(0, 0.01), 0, -0.01 + rng.gauss(0, 0.01))
            bodies.append(Body.dynamic(1.0, (0.125, 0, 0, 0.125, 0, 0.125), at, None, velocity, (0, spin, 0)))
    ground = len(bodies)
    for (row, column), disc in place.items():
        at = bodies[disc].position
        for r, c in ((row, column - 1), (row - 1, column - 1 + row % 2), (row - 1, column + row % 2)):
            if (r, c) in place:
                other = bodies[place[r, c]].position
                touch(disc, place[r, c], (at + other) * 0.5, at - other)
        if row == 0:
            touch(disc, ground, at - Vec3(0.0, 0.0, 0.5), Vec3(0.0, 0.0, 1.0))
        for is_last, side in ((column == 0, -0.5), (column == 3 - row % 2, 0.5)):
            if is_last and not row % 2:
                touch(disc, ground, at + Vec3(side, 0.0, 0.0), Vec3(-side, 0.0, 0.0))
    return Scene([*bodies, Body.static()], pairs, contacts)


@pytest.mark.parametrize("mu", [0.05, 0.1, 0.3, 0.6, 1.0])
def test_most_heaps_of_discs_have_an_answer(mu):
    """And the same in any order."""
    answered = 0
    for seed in range(20):
        scene = heap(random.Random(seed), mu)
        other, place = shuffled(scene, seed)
        answer, again = (one.resolve(Law.MOREAU) for one in (scene, other))
        again = again._replace(changes=[again.changes[k] for k in place])
        if not (answer.adjustments | again.adjustments) & Adjustment.LAW_FALLBACK:
            assert distance(scene, answer, again) <= answer.error_bound + again.error_bound
            answered += answer.error_bound < 1e-6
    assert answered >= 17
