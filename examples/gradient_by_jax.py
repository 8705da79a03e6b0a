"""The gradient of an impact by reverse-mode JAX: the formula runs on arrays as it does on floats.

    pip install jax    # or run all examples: make examples
    python examples/gradient_by_jax.py

Use this if your optimisation is written in JAX. Otherwise `differentiate` of `collision_response.derivatives`
is a hundred times faster, and marks the edges where a derivative jumps. Here a ball strikes the ground head
on. Its slip is 0, where a square root in the branch that is not taken has no derivative.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np

from collision_response import Body, Contact, ImpactModel, Law
from collision_response.derivatives import differentiate
from collision_response.impact import impact
from collision_response.physics.vector import Vec3

BALL = Body.sphere(1.0, 1.0, position=(0.0, 0.0, 1.0), velocity=(0.0, 0.0, -1.0))
CONTACT = Contact.of((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), restitution=0.5, friction=0.3)


def impulse(velocity: jax.Array) -> jax.Array:
    """Impulse of the ground on the ball."""
    body_a, body_b, contact = jax.tree.map(jnp.asarray, (BALL, Body.static(), CONTACT))
    answer = impact(body_a._replace(velocity=Vec3(*velocity)), body_b, contact, Law.COULOMB)
    return jnp.stack(list(answer.changes.impulse))


def main() -> None:
    jax.config.update("jax_enable_x64", True)
    gradient = np.asarray(jax.jacrev(impulse)(jnp.array(BALL.velocity)))
    own = differentiate(BALL, Body.static(), CONTACT, ImpactModel(Law.COULOMB), ["body_a.velocity"])
    print(gradient)
    difference = np.abs(gradient - own.of("impulse", "body_a.velocity")).max()
    print(f"JAX differs from differentiate() by {difference:.1e}")
    assert difference < 1e-12


if __name__ == "__main__":
    main()
