"""Impacts inside a program of JAX: compiled, and with gradients in reverse mode.

    pip install jax    # or run all examples: make examples
    python examples/gradient_by_jax.py

`bounce` hands an array of JAX to `resolve_batch`, and takes its derivatives from `differentiate_batch`. So
every law works, and the answers are those of `resolve`. A search by gradients then aims balls at a target
behind their bounce.

`bounce_by_formula` runs the formula itself on arrays of JAX, which may be on a GPU. Only FRICTIONLESS and
COULOMB have no loops, so JAX can compile them.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np

from collision_response import Body, Contact, Geometry, ImpactModel, Law
from collision_response.batch import body_rows, contact_rows, resolve_batch
from collision_response.derivatives import RESULTS, differentiate_batch, unit_directions
from collision_response.impact import impact
from collision_response.physics.vector import Vec3

MODEL = ImpactModel(Law.ROUTH_STRONGE)
BALL = Body.sphere(0.5, 0.1, position=(0.0, 0.0, 0.1))
GROUND = Body.static()
CONTACT = Contact.of((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), restitution=0.6, friction=0.3)
TARGET = jnp.array([2.0, 1.0])
GRAVITY = 9.81


def tables(velocity: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The bodies and contacts of balls with these velocities, shape ``(3, N)``, that strike the ground."""
    rows, contact = body_rows(Geometry.SPATIAL), contact_rows(Geometry.SPATIAL)
    bodies = np.zeros((rows.height, 2, velocity.shape[1]))
    contacts = np.zeros((contact.height, velocity.shape[1]))
    bodies[rows.mass, 0], bodies[rows.mass, 1] = BALL.mass, np.inf
    bodies[rows.inertia, 0] = np.reshape(BALL.inertia, (6, 1))
    bodies[rows.position, 0] = np.reshape(BALL.position, (3, 1))
    bodies[rows.velocity, 0] = velocity
    contacts[contact.normal] = np.reshape(CONTACT.normal, (3, 1))
    contacts[contact.restitution], contacts[contact.friction] = CONTACT.restitution, CONTACT.friction
    return bodies, contacts


@jax.custom_jvp
def bounce(velocity: jax.Array) -> jax.Array:
    """The velocities of the balls after they strike the ground, shape ``(3, N)``, as those before."""

    def after(velocity: np.ndarray) -> np.ndarray:
        return resolve_batch(*tables(np.asarray(velocity)), MODEL).velocity[:, 0]

    return jax.pure_callback(after, velocity, velocity, vmap_method="sequential")


@bounce.defjvp
def _change_of_bounce(velocity: tuple[jax.Array], change: tuple[jax.Array]) -> tuple[jax.Array, jax.Array]:
    def after(velocity: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        directions = unit_directions("body_a.velocity")
        batch = differentiate_batch(*tables(np.asarray(velocity)), directions, MODEL)
        return batch.result.velocity[:, 0], batch.jacobian[RESULTS["twist_a.linear"]]

    matrices = jax.ShapeDtypeStruct((3, *velocity[0].shape), velocity[0].dtype)
    answer, jacobian = jax.pure_callback(after, (velocity[0], matrices), *velocity, vmap_method="sequential")
    return answer, jnp.einsum("ijn,jn->in", jacobian, *change)


def bounce_by_formula(velocity: jax.Array) -> jax.Array:
    """The velocity of one ball after it strikes the ground by COULOMB."""
    ball, ground, contact = jax.tree.map(jnp.asarray, (BALL, GROUND, CONTACT))
    answer = impact(ball._replace(velocity=Vec3(*velocity)), ground, contact, Law.COULOMB)
    return jnp.stack(list(answer.report.twist_a.linear))


@jax.jit
def misses(velocity: jax.Array) -> jax.Array:
    """The squared distances from the target at which the balls land again."""
    after = bounce(velocity)
    return jnp.sum((after[:2] * 2 * after[2] / GRAVITY - TARGET[:, None]) ** 2, axis=0)


def main() -> None:
    jax.config.update("jax_enable_x64", True)
    velocity = jnp.array([[3.0, 5.0, 0.5], [0.0, 1.0, 4.0], [-4.0, -6.0, -8.0]])
    slope = jax.jit(jax.grad(lambda velocity: misses(velocity).sum()))
    for _ in range(200):
        velocity = velocity - 0.5 * slope(velocity)
    print("distances from the target:", jnp.sqrt(misses(velocity)))
    assert misses(velocity).max() < 1e-12

    head_on = jnp.array([0.0, 0.0, -4.0])
    gradient = jax.jit(jax.jacrev(bounce_by_formula))(head_on)
    own = differentiate_batch(
        *tables(np.asarray(head_on)[:, None]), unit_directions("body_a.velocity"), ImpactModel(Law.COULOMB)
    )
    difference = jnp.abs(gradient - own.jacobian[RESULTS["twist_a.linear"], :, 0]).max()
    print(f"JAX's gradient of the formula differs from differentiate_batch() by {difference:.1e}")
    assert difference < 1e-12


if __name__ == "__main__":
    main()
