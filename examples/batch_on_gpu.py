"""A million impacts as one program of JAX: on a GPU if JAX finds one, else on the CPU.

    pip install jax    # for a GPU: pip install "jax[cuda13]"
    python examples/batch_on_gpu.py

`resolve_batch` takes arrays on a GPU, too, but it computes on the CPU and copies them there and back. Here
the formula itself runs where the arrays are. It checks no input and has no error bound, and the law is
FRICTIONLESS or COULOMB: the others have loops, which JAX cannot compile.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from time import perf_counter
from typing import Any

import jax
import numpy as np

from collision_response import Body, Contact, Geometry, ImpactModel, Law
from collision_response.batch import body_rows, contact_rows, resolve_batch
from collision_response.impact import impact
from collision_response.physics.tensor import Symmetric3
from collision_response.physics.vector import Vec3

N = 1_000_000
ROWS, CONTACT = body_rows(Geometry.SPATIAL), contact_rows(Geometry.SPATIAL)


def random_impacts() -> tuple[np.ndarray, np.ndarray]:
    """Tables of bodies and contacts, as `resolve_batch` takes them."""
    random = np.random.default_rng(1)
    bodies, contacts = np.zeros((ROWS.height, 2, N)), np.zeros((CONTACT.height, N))
    bodies[ROWS.mass] = random.uniform(0.5, 2.0, (1, 2, N))
    bodies[ROWS.inertia] = np.multiply.outer([1.0, 0.0, 0.0, 1.0, 0.0, 1.0], random.uniform(0.1, 0.5, (2, N)))
    for rows in (ROWS.position, ROWS.velocity, ROWS.angular_velocity):
        bodies[rows] = random.uniform(-1.0, 1.0, (3, 2, N))
    normals = random.standard_normal((3, N))
    contacts[CONTACT.normal] = normals / np.linalg.norm(normals, axis=0)
    contacts[CONTACT.restitution], contacts[CONTACT.friction] = random.uniform(0.0, 1.0, (2, 1, N))
    return bodies, contacts


def body(rows: jax.Array) -> Body:
    vectors = [Vec3(*rows[of]) for of in (ROWS.position, ROWS.velocity, ROWS.angular_velocity)]
    position, velocity, angular_velocity = vectors
    inertia = Symmetric3(*rows[ROWS.inertia])
    return Body(*rows[ROWS.mass], inertia, position, None, velocity, angular_velocity)


@jax.jit
def impulses(bodies: jax.Array, contacts: jax.Array) -> Vec3:
    contact = Contact(
        Vec3(*contacts[CONTACT.position]),
        Vec3(*contacts[CONTACT.normal]),
        *contacts[CONTACT.restitution],
        *contacts[CONTACT.friction],
    )
    return impact(body(bodies[:, 0]), body(bodies[:, 1]), contact, Law.COULOMB).changes.impulse


def milliseconds(function: Callable[..., Any], *arguments: Any) -> float:
    """The shortest time of five calls. A first one compiles."""
    times = []
    for _ in range(6):
        start = perf_counter()
        jax.block_until_ready(function(*arguments))
        times.append(perf_counter() - start)
    return 1e3 * min(times[1:])


def main() -> None:
    jax.config.update("jax_enable_x64", True)
    bodies, contacts = random_impacts()
    here = jax.device_put((bodies, contacts))
    answer = resolve_batch(bodies, contacts, ImpactModel(Law.COULOMB))
    differences = np.abs(np.array(impulses(*here)) - answer.impulse)
    print(f"{(differences > 0).mean():.0%} of the impulses differ, by {differences.max():.1e} N s at most")
    assert differences.max() < 1e-13 * np.abs(answer.impulse).max()
    print(f"formula, on {jax.devices()[0].device_kind}: {milliseconds(impulses, *here):.1f} ms")
    for workers in (1, 2):
        resolve = partial(resolve_batch, bodies, contacts, ImpactModel(Law.COULOMB), workers=workers)
        print(f"resolve_batch, workers={workers}: {milliseconds(resolve):.1f} ms")


if __name__ == "__main__":
    main()
