"""A simulator's step with arrays only: balls that fly in a box and strike its walls and each other.

    python examples/step_of_arrays.py

The balls and the six walls are columns of one table. Each step finds the contacts, resolves them one after
the other, each with the velocities that the previous ones left, and moves the balls. No Python loop runs over
balls or contacts. The printed momentum is that of balls and walls together. Energy is only lost, to
restitution and friction.
"""

from __future__ import annotations

from itertools import pairwise
from typing import NamedTuple

import numpy as np

from collision_response import Geometry
from collision_response.batch import (
    body_rows,
    contact_rows,
    independent_sets,
    resolve_batch,
    scatter_velocities,
)

BODY, CONTACT = body_rows(Geometry.SPATIAL), contact_rows(Geometry.SPATIAL)
RADIUS, MASS, BOX = 0.1, 1.0, 2.0
STEP = 0.01
RESTITUTION, FRICTION = 0.8, 0.3

WALLS = np.repeat(np.eye(3), 2, axis=0) * np.tile([1.0, -1.0], 3)[:, np.newaxis]
"""Inward normals of the walls: for each axis one wall through 0 and one through BOX."""


class Step(NamedTuple):
    """Number of contacts, momentum, energy and lost energy of one step."""

    contacts: int
    momentum: np.ndarray
    energy: float
    lost: float


def balls_and_walls(balls: int, seed: int) -> np.ndarray:
    """The table of bodies; the walls are the last six."""
    random = np.random.default_rng(seed)
    bodies = np.zeros((BODY.height, balls + len(WALLS)))
    bodies[BODY.mass, :balls] = MASS
    bodies[BODY.mass, balls:] = np.inf
    for moment in (0, 3, 5):  # xx, yy, zz
        bodies[BODY.inertia][moment, :balls] = 0.4 * MASS * RADIUS**2
    bodies[BODY.position, :balls] = random.uniform(RADIUS, BOX - RADIUS, size=(3, balls))
    bodies[BODY.velocity, :balls] = random.normal(size=(3, balls))
    bodies[BODY.angular_velocity, :balls] = random.normal(size=(3, balls)) / RADIUS
    return bodies


def contacts_of(bodies: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Pairs and contacts of the balls that touch each other or a wall."""
    centres = bodies[BODY.position, : -len(WALLS)]
    n = centres.shape[1]
    a, b = np.triu_indices(n, 1)
    apart = centres[:, a] - centres[:, b]
    near = (apart**2).sum(axis=0) < (2 * RADIUS) ** 2
    a, b, apart = a[near], b[near], apart[:, near]

    above = WALLS @ centres + np.where(WALLS.sum(axis=1) < 0, BOX, 0.0)[:, np.newaxis]
    wall, ball = np.nonzero(above < RADIUS)
    pairs = np.array([np.append(a, ball), np.append(b, n + wall)])

    contacts = np.empty((CONTACT.height, pairs.shape[1]))
    contacts[CONTACT.normal] = np.hstack([apart, WALLS[wall].T])
    at_ball = centres[:, ball] - RADIUS * WALLS[wall].T
    contacts[CONTACT.position] = np.hstack([(centres[:, a] + centres[:, b]) / 2, at_ball])
    contacts[CONTACT.restitution], contacts[CONTACT.friction] = RESTITUTION, FRICTION
    return pairs, contacts


def energy_of(bodies: np.ndarray) -> float:
    """Kinetic energy of the balls."""
    balls = bodies[:, : -len(WALLS)]
    spin = balls[BODY.angular_velocity] ** 2
    moments = balls[BODY.inertia][[0, 3, 5]]
    return float((balls[BODY.mass] * balls[BODY.velocity] ** 2).sum() + (moments * spin).sum()) / 2


def steps(balls: int, count: int, seed: int = 0) -> list[Step]:
    """Simulate some steps."""
    bodies = balls_and_walls(balls, seed)
    movable = np.isfinite(bodies[0])
    to_walls = np.zeros(3)
    done = []
    for _ in range(count):
        pairs, contacts = contacts_of(bodies)
        lost = 0.0
        for some in independent_sets(pairs, movable):
            result = resolve_batch(bodies, contacts[:, some], pairs=pairs[:, some], report=True)
            scatter_velocities(bodies, pairs[:, some], result)
            lost += (result.energy_lost_restitution + result.energy_lost_friction).sum()
            to_walls -= result.impulse[:, pairs[1, some] >= balls].sum(axis=1)
        momentum = MASS * bodies[BODY.velocity, :balls].sum(axis=1) + to_walls
        done.append(Step(pairs.shape[1], momentum, energy_of(bodies), float(lost)))
        bodies[BODY.position] += STEP * bodies[BODY.velocity]
    return done


if __name__ == "__main__":
    print("step  contacts  momentum of balls and walls [N s]        energy [J]")
    done = steps(balls=200, count=100)
    for number, step in enumerate(done):
        if number % 10 == 0:
            momentum = "  ".join(f"{x:11.8f}" for x in step.momentum)
            print(f"{number:4d}  {step.contacts:8d}  {momentum}  {step.energy:10.4f}")
    drift = max(np.abs(step.momentum - done[0].momentum).max() for step in done)
    error = max(abs(before.energy - after.energy - after.lost) for before, after in pairwise(done))
    print(f"momentum drifts by {drift:.1g} N s; energy is lost as reported, to {error:.1g} J per step")
    assert drift < 1e-10
    assert error < 1e-10
