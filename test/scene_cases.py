"""Scenes of several contacts for many tests, and measures of their answers."""

from __future__ import annotations

import math
import random
from fractions import Fraction
from typing import Any, NamedTuple

from collision_response import Body, Contact, ImpactModel, Law, SceneImpact, resolve_scene
from collision_response.physics.orientation import Quaternion
from collision_response.physics.vector import Vec3


class Scene(NamedTuple):
    """Bodies, the pairs of them that touch, and their contacts."""

    bodies: list[Body]
    pairs: list[tuple[int, int]]
    contacts: list[Contact]

    def resolve(
        self, law: Law = Law.AUTO, *, options: dict[str, Any] | None = None, **model: Any
    ) -> SceneImpact:
        return resolve_scene(*self, ImpactModel(law, **model), **(options or {}))

    def in_fractions(self) -> Scene:
        """The same scene with one mass as a fraction, so that it is resolved in fractions."""
        bodies = list(self.bodies)
        first = next(i for i, body in enumerate(bodies) if body.is_movable())
        bodies[first] = bodies[first]._replace(mass=Fraction(bodies[first].mass))
        return self._replace(bodies=bodies)

    def with_contacts(self, **fields: Any) -> Scene:
        return self._replace(contacts=[contact._replace(**fields) for contact in self.contacts])


def row_of_balls(velocities, e: Any = 1, masses=None, number: Any = Fraction) -> Scene:
    """Balls in a row along x that touch."""
    masses = masses or [1] * len(velocities)
    zero = number(0)
    bodies = [
        Body.dynamic(number(m), position=(number(i), zero, zero), velocity=(number(v), zero, zero))
        for i, (v, m) in enumerate(zip(velocities, masses, strict=True))
    ]
    contacts = [
        Contact.of((number(2 * i + 1) / 2, zero, zero), (number(-1), zero, zero), number(e))
        for i in range(len(bodies) - 1)
    ]
    return Scene(bodies, [(i, i + 1) for i in range(len(contacts))], contacts)


def speeds(answer: SceneImpact) -> list[Any]:
    """The velocities along x."""
    return [twist.linear.x for twist in answer.twists]


def box(
    velocity=(0, 0, -1),
    spin=(0, 0, 0),
    e: Any = 1.0,
    mu: Any = 0.0,
    size=(1, 1, 1),
    mass: Any = 1,
    number: Any = float,
) -> Scene:
    """A box flat on a floor, on its four corners."""
    x, y, z = (number(s) for s in size)
    mass = number(mass)
    inertia = (mass * (y * y + z * z) / 12, 0, 0, mass * (x * x + z * z) / 12, 0, mass * (x * x + y * y) / 12)
    body = Body.dynamic(
        mass,
        tuple(map(number, inertia)),
        (number(0), number(0), z / 2),
        None,
        tuple(map(number, velocity)),
        tuple(map(number, spin)),
    )
    contacts = [
        Contact.of(
            (a * x / 2, b * y / 2, number(0)), (number(0), number(0), number(1)), number(e), number(mu)
        )
        for a in (-1, 1)
        for b in (-1, 1)
    ]
    return Scene([body, Body.static()], [(0, 1)] * 4, contacts)


def tower(count: int, e: Any = 0.0, mu: Any = 0.0, slip: float = 0.0) -> Scene:
    """Cubes on each other that fall on a floor, on four corners each; each slides faster than those below."""
    corners = [(x, y) for x in (-0.5, 0.5) for y in (-0.5, 0.5)]
    bodies = [
        Body.box(1.0, (1, 1, 1), position=(0, 0, i + 0.5), velocity=(slip * (i + 1), 0, -1))
        for i in range(count)
    ]
    pairs = [(i, i - 1 if i else count) for i in range(count) for _ in corners]
    contacts = [Contact.of((x, y, i), (0, 0, 1), e, mu) for i in range(count) for x, y in corners]
    return Scene([*bodies, Body.static()], pairs, contacts)


def rotate(q: Quaternion, v) -> Vec3:
    """``v`` rotated by ``q``."""
    return q.rotation().to_world(Vec3(*v))


def product(p: Quaternion, q: Quaternion) -> Quaternion:
    a, b = Vec3(*p[:3]), Vec3(*q[:3])
    return Quaternion(*(b * p.w + a * q.w + a.cross(b)), p.w * q.w - a.dot(b))


def rotated_body(body: Body, q: Quaternion) -> Body:
    """A body and its motion, rotated about the origin."""
    orientation = body.orientation or Quaternion(0.0, 0.0, 0.0, 1.0)
    return body._replace(
        position=rotate(q, body.position),
        velocity=rotate(q, body.velocity),
        angular_velocity=rotate(q, body.angular_velocity),
        orientation=product(q, orientation) if body.is_movable() else None,
    )


def random_scene(seed: int, e: float | None = None, mu: float | None = None, contacts: int = 12) -> Scene:
    """Bodies with random contacts: patches of contacts, repeated ones, walls that may move.

    Normals point from body to body, more or less, so that some motion separates all contacts.
    """
    rng = random.Random(seed)

    def vector(size: float = 1.0) -> Vec3:
        return Vec3(*(rng.uniform(-size, size) for _ in range(3)))

    bodies = []
    for _ in range(rng.randint(2, 6)):
        mass = math.exp(rng.uniform(-2, 2))
        x, y, z = (mass * rng.uniform(0.02, 0.2) for _ in range(3))
        kind = rng.random()
        inertia = (y + z, 0.0, 0.0, x + z, 0.0, x + y) if kind < 0.8 else (0.0,) * 6
        q = [rng.gauss(0, 1) for _ in range(4)] if kind < 0.5 else None
        com = vector(0.2) if kind < 0.3 else Vec3(0.0, 0.0, 0.0)
        bodies.append(Body.dynamic(mass, inertia, vector(2.0), q, vector(), vector(), com))
    walls = [Body.static(), Body.kinematic((0.0, 0.0, 0.0), vector(0.5), vector(0.2))]
    count = rng.randint(2, contacts)
    pairs, touches = [], []
    movable = len(bodies)
    while len(touches) < count:
        a, b = rng.randrange(movable), rng.randrange(movable + 2)
        if a == b:
            continue
        other = bodies[b].position if b < movable else Vec3(0.0, 0.0, 0.0)
        normal = bodies[a].position - other
        length = normal.norm()
        if length < 0.3:
            continue
        middle = other + normal * 0.5
        normal = (normal * (1 / length) + vector(0.2)) * rng.choice([1.0, 1.0, 3.7])
        ee = rng.choice([0.0, 0.5, 1.0]) if e is None else e
        m = rng.choice([0.0, 0.3, 3.0]) if mu is None else mu
        patch = rng.choice([1, 1, 2, 4])
        for _ in range(min(patch, count - len(touches))):
            pairs.append((a, b))
            touches.append(Contact.of(middle + vector(0.3), normal, ee, m))
        if rng.random() < 0.2:
            pairs.append(pairs[-1])
            touches.append(touches[-1])
    return Scene(bodies + walls, pairs, touches)


def any_scene(seed: int) -> Scene:
    """As :func:`random_scene`; from seed 60 on also stacks, grids and chains, with up to 30 contacts."""
    if seed < 60:
        return random_scene(seed)
    rng = random.Random(seed)
    return rng.choice([heap, stack, grid, chain])(rng)


def heap(rng: random.Random) -> Scene:
    return random_scene(rng.randrange(10**9), contacts=30)


def stack(rng: random.Random) -> Scene:
    """Boxes on four corners each, on top of each other with small shifts; some corners occur twice."""
    bodies, touches, pairs = [], [], []
    for level in range(rng.randint(1, 6)):
        side, shift = rng.uniform(0.8, 1.2), rng.uniform(-0.1, 0.1)
        mass = math.exp(rng.uniform(-2, 2))
        moments = mass * (side * side + 1) / 12, mass * (side * side + 1) / 12, mass * side * side / 6
        bodies.append(
            Body.dynamic(
                mass,
                (moments[0], 0.0, 0.0, moments[1], 0.0, moments[2]),
                (shift, 0.0, level + 0.5),
                None,
                _random_vector(rng),
                _random_vector(rng),
            )
        )
        for corner in [(x, y) for x in (-1, 1) for y in (-1, 1)] + [(1, 1)] * rng.randint(0, 1):
            at = shift + corner[0] * side / 2, corner[1] * side / 2, float(level)
            pairs.append((level, level - 1))
            touches.append(_random_contact(rng, at, (0.0, 0.0, 1.0)))
    floor = rng.choice(
        [Body.static(), Body.kinematic((0.0, 0.0, 0.0), _random_vector(rng), _random_vector(rng))]
    )
    return Scene([*bodies, floor], [(a, b if b >= 0 else len(bodies)) for a, b in pairs], touches)


def grid(rng: random.Random) -> Scene:
    """Balls in rows and columns, sometimes next to a wall; a few are points."""
    rows, columns = rng.randint(2, 4), rng.randint(2, 4)
    bodies = [_random_ball(rng, (float(i), float(k), 0.0)) for i in range(rows) for k in range(columns)]
    pairs, touches = [], []
    for i in range(rows):
        for k in range(columns):
            if i:
                pairs.append((i * columns + k, (i - 1) * columns + k))
                touches.append(_random_contact(rng, (i - 0.5, float(k), 0.0), (1.0, 0.0, 0.0)))
            elif rows < 4:
                pairs.append((k, rows * columns))
                touches.append(_random_contact(rng, (-0.5, float(k), 0.0), (2.0, 0.0, 0.0)))
            if k:
                pairs.append((i * columns + k, i * columns + k - 1))
                touches.append(_random_contact(rng, (float(i), k - 0.5, 0.0), (0.0, 1.0, 0.0)))
    return Scene([*bodies, Body.static()], pairs, touches)


def chain(rng: random.Random) -> Scene:
    """Balls of different masses in a row, sometimes next to a wall."""
    count = rng.randint(3, 30)
    bodies = [_random_ball(rng, (float(i), 0.0, 0.0)) for i in range(count)]
    touches = [_random_contact(rng, (i - 0.5, 0.0, 0.0), (1.0, 0.0, 0.0)) for i in range(count)]
    pairs = [(i, i - 1 if i else count) for i in range(count)]
    first = rng.randint(0, 1)
    return Scene([*bodies, Body.static()], pairs[first:], touches[first:])


def _random_ball(rng: random.Random, at: tuple[float, float, float]) -> Body:
    mass = math.exp(rng.uniform(-2, 2))
    moment = mass * 0.1 if rng.random() < 0.9 else 0.0
    return Body.dynamic(
        mass, (moment, 0.0, 0.0, moment, 0.0, moment), at, None, _random_vector(rng), _random_vector(rng)
    )


def _random_vector(rng: random.Random) -> Vec3:
    return Vec3(*(rng.uniform(-1.0, 1.0) for _ in range(3)))


def _random_contact(rng: random.Random, at, normal) -> Contact:
    return Contact.of(at, normal, rng.choice([0.0, 0.5, 1.0]), rng.choice([0.0, 0.3, 3.0]))


def momentum(scene: Scene, twists) -> tuple[Vec3, Vec3]:
    """Linear momentum, and angular momentum about the origin."""
    linear = angular = Vec3(0, 0, 0)
    for body, twist in zip(scene.bodies, twists, strict=True):
        if body.is_movable():
            c = body.to_world(body.com)
            v = twist.linear + twist.angular.cross(c)
            spin = body.to_world(body.inertia @ body.to_body(twist.angular))
            linear = linear + v * body.mass
            angular = angular + spin + (body.position + c).cross(v) * body.mass
    return linear, angular


def change_norm(scene: Scene, answer: SceneImpact) -> float:
    """The norm of the change of all twists in the metric of kinetic energy."""
    square = 0.0
    for body, change in zip(scene.bodies, answer.changes, strict=True):
        if body.is_movable():
            square += body.mass * change.linear.dot(change.linear)
            square += body.inertia.trace() / 3 * change.angular.dot(change.angular)
    return math.sqrt(float(square))


def energy(scene: Scene, twists) -> Any:
    total: Any = 0
    for body, twist in zip(scene.bodies, twists, strict=True):
        if body.is_movable():
            v = twist.linear + twist.angular.cross(body.to_world(body.com))
            w = body.to_body(twist.angular)
            total += (body.mass * v.dot(v) + w.dot(body.inertia @ w)) / 2
    return total


def distance(scene: Scene, one: SceneImpact, other: SceneImpact) -> float:
    """The distance of two answers relative to the change, in the norm of the error bound over all bodies."""
    return distance_of_changes(scene, one.changes, other.changes)


def distance_of_changes(scene: Scene, one, other) -> float:
    off = size = 0.0
    for body, x, y in zip(scene.bodies, one, other, strict=True):
        if body.is_movable():
            arm = float(body.inertia.trace() / 3)
            off += (
                float(body.mass) * math.dist(x.linear, y.linear) ** 2
                + arm * math.dist(x.angular, y.angular) ** 2
            )
            size += float(body.mass) * math.hypot(*y.linear) ** 2 + arm * math.hypot(*y.angular) ** 2
    return math.sqrt(off / size) if size else math.sqrt(off)


def assert_within_bound(scene: Scene, answer: SceneImpact, exact: SceneImpact) -> None:
    """Check that every change of twist is within the bound, relative to the largest one of its cluster."""
    assert answer.error_bound < math.inf
    for cluster in answer.clusters:
        errors, sizes = [], []
        for i in {i for contact in cluster for i in scene.pairs[contact] if scene.bodies[i].is_movable()}:
            body, change, right = scene.bodies[i], answer.changes[i], exact.changes[i]
            roots = [math.sqrt(body.mass)] * 3 + [math.sqrt(body.inertia.trace() / 3)] * 3
            right = [x for v in right for x in v]
            off = [float(Fraction(x) - y) for x, y in zip((x for v in change for x in v), right, strict=True)]
            errors.append(math.hypot(*(w * x for w, x in zip(roots, off, strict=True))))
            sizes.append(math.hypot(*(w * float(x) for w, x in zip(roots, right, strict=True))))
        assert max(errors) <= answer.error_bound * max(sizes) * (1 + 1e-9)


def shuffled(scene: Scene, seed: int) -> tuple[Scene, list[int]]:
    """The same scene with bodies and contacts in another order, and the new place of each body."""
    rng = random.Random(seed)
    bodies, contacts = (rng.sample(range(n), n) for n in (len(scene.bodies), len(scene.contacts)))
    place = [bodies.index(b) for b in range(len(bodies))]
    pairs = [(place[a], place[b]) for a, b in (scene.pairs[i] for i in contacts)]
    return Scene([scene.bodies[b] for b in bodies], pairs, [scene.contacts[i] for i in contacts]), place


def reordered(scene: Scene, turn: int) -> Scene:
    """The same contacts in another order, some with their bodies swapped."""
    count = len(scene.pairs)
    order = [(i * 7 + turn) % count for i in range(count)] if count % 7 else list(reversed(range(count)))
    pairs, contacts = [], []
    for place, i in enumerate(order):
        (a, b), contact = scene.pairs[i], scene.contacts[i]
        other_side = place % 2 == 0
        pairs.append((b, a) if other_side else (a, b))
        contacts.append(contact._replace(normal=-Vec3(*contact.normal)) if other_side else contact)
    return Scene(scene.bodies, pairs, contacts)
