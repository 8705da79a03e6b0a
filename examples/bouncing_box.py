"""A complete simulation: a cube is thrown, tumbles, bounces and comes to rest.

    python examples/bouncing_box.py

Each step moves the cube, finds the corners below the floor, and resolves their impacts at once. The energy,
including the potential energy, never increases.
"""

from __future__ import annotations

from itertools import product

from collision_response import Body, Contact, ImpactModel, resolve_scene

STEP, GRAVITY = 1e-3, 9.81  # s, m/s^2
SIDE = 0.2  # m
CORNERS = list(product((-SIDE / 2, SIDE / 2), repeat=3))
UP = (0.0, 0.0, 1.0)
FLOOR = Body.static()
MODEL = ImpactModel(restitution_threshold=0.1)  # slower approaches do not bounce, so the cube comes to rest


def moved(cube: Body, time: float) -> Body:
    """The cube after free motion. A cube keeps its angular velocity; other boxes would not."""
    x, y, z, w = cube.orientation
    a, b, c = cube.angular_velocity * (time / 2)
    turned = (x + a * w + b * z - c * y, y + b * w + c * x - a * z, z + c * w + a * y - b * x)
    return cube._replace(
        position=cube.position + cube.velocity * time,
        orientation=(*turned, w - a * x - b * y - c * z),  # need not have length 1
    )


def struck(cube: Body) -> Body:
    """The cube after the impact of those corners that strike the floor."""
    corners = [cube.position + cube.to_world(corner) for corner in CORNERS]
    contacts = [Contact.of(at, UP, restitution=0.5, friction=0.4) for at in corners if at.z <= 0]
    if not contacts:
        return cube
    after = resolve_scene([cube, FLOOR], [(0, 1)] * len(contacts), contacts, MODEL).twists[0]
    return cube._replace(velocity=after.linear, angular_velocity=after.angular)


def energy(cube: Body) -> float:
    v, w = cube.velocity, cube.angular_velocity
    kinetic = (cube.mass * v.dot(v) + cube.inertia.xx * w.dot(w)) / 2
    return kinetic + cube.mass * GRAVITY * cube.position.z


def step(cube: Body) -> Body:
    cube = moved(cube, STEP / 2)
    cube = struck(cube._replace(velocity=cube.velocity - (0.0, 0.0, GRAVITY * STEP)))
    return moved(cube, STEP / 2)


def thrown() -> Body:
    return Body.box(
        2.0,
        (SIDE, SIDE, SIDE),
        position=(0.0, 0.0, 0.6),
        orientation=(0.1, 0.3, 0.0, 1.0),
        velocity=(1.0, 0.0, 0.0),
        angular_velocity=(0.0, 4.0, 1.0),
    )


def main() -> None:
    cube = thrown()
    print("time [s]  height [m]  speed [m/s]  energy [J]")
    for i in range(1501):
        if i % 100 == 0:
            height, speed = cube.position.z, cube.velocity.norm()
            print(f"{i * STEP:8.2f}{height:12.3f}{speed:13.3f}{energy(cube):12.3f}")
        cube = step(cube)


if __name__ == "__main__":
    main()
