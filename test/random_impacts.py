"""Random impacts over the whole range of float64, with several kinds of ill conditioning at once."""

from __future__ import annotations

import math
import random

from collision_response import Body, Contact, Geometry, ImpactError, ImpactModel, Law
from collision_response.physics.vector import ZERO, Vec3
from collision_response.validity import check

Collision = tuple[Body, Body, Contact]


class RandomImpacts:
    """An endless supply of valid requests.

    ``decades`` is the spread of magnitudes: 0 for compact bodies that meet at about their own size and speed,
    10 for careless input, 100 for the whole range of float64.
    """

    def __init__(self, seed: int | str, decades: float) -> None:
        self.draw = random.Random(seed)
        self.decades = decades

    def request(self, law: Law) -> tuple[Collision, ImpactModel]:
        """A collision that can be answered, and a model with any geometry."""
        while True:
            collision = self.collision()
            geometry = self.draw.choice([Geometry.POINT, Geometry.PLANAR, Geometry.SPATIAL, Geometry.SPATIAL])
            e_t = self.draw.choice([0.0, self.draw.uniform(-1, 1)])
            model = ImpactModel(law, geometry, tangential_restitution=e_t)
            try:
                check(*collision, e_t)
            except ImpactError:
                continue
            return collision, model

    def collision(self) -> Collision:
        """Two bodies and their contact, not necessarily valid; often they just graze."""
        body_a, body_b, contact = self._body(), self._body(), self._contact()
        if self.draw.random() < 0.3:
            contact = self._grazing(body_a.velocity - body_b.velocity, contact)
        return body_a, body_b, contact

    def _body(self) -> Body:
        draw = self.draw
        if draw.random() < 0.15:
            return Body.kinematic(self._vector(), self._vector(), self._vector())
        mass, size = self._magnitude(), self._magnitude(0.5)
        second = [mass * size * size * draw.uniform(0.2, 1) * self._magnitude(0.3) for _ in range(3)]
        kind = draw.random()
        if self.decades and kind < 0.1:
            second = [0.0, 0.0, second[0]]
        elif self.decades and kind < 0.2:
            second[0] *= 10 ** draw.uniform(-15, 0)
            second[1] *= 10 ** draw.uniform(-15, 0)
        x, y, z = second
        moments = (y + z, x + z, x + y)
        inertia = (moments[0], 0.0, 0.0, moments[1], 0.0, moments[2])
        if kind > 0.6:
            inertia = rotated_tensor(moments, self._quaternion())
        orientation = self._quaternion() if draw.random() < 0.6 else None
        com = self._vector(size) if draw.random() < 0.3 else ZERO
        spin = self._vector(self._magnitude(0.3))
        return Body.dynamic(mass, inertia, self._vector(size), orientation, self._vector(), spin, com)

    def _contact(self) -> Contact:
        draw = self.draw
        e = draw.choice([0.0, 1.0, draw.random(), draw.random()])
        mu = draw.choice([0.0, draw.random(), 10 ** draw.uniform(-3, 1)])
        return Contact.of(self._vector(self._magnitude(0.2)), self._vector(self._magnitude()), e, mu)

    def _grazing(self, u: Vec3, contact: Contact) -> Contact:
        """The contact with its normal almost perpendicular to the relative velocity."""
        if not 0 < u.norm() < math.inf:
            return contact
        across = u.cross(self._vector()) / u.norm()
        into = u * (-(10 ** self.draw.uniform(-16, -1)) * across.norm() / u.norm())
        return contact._replace(normal=across + into)

    def _magnitude(self, share: float = 1.0) -> float:
        return 10 ** (self.draw.uniform(-1, 1) * self.decades * share)

    def _vector(self, size: float | None = None) -> Vec3:
        size = self._magnitude(0.3) if size is None else size
        return Vec3(*(size * self.draw.gauss(0, 1) for _ in range(3)))

    def _quaternion(self) -> list[float]:
        return [self.draw.gauss(0, 1) for _ in range(4)]


def rotated_tensor(moments: tuple[float, float, float], quaternion: list[float]) -> tuple[float, ...]:
    """The tensor with these principal moments in rotated axes."""
    length = math.sqrt(sum(q * q for q in quaternion))
    x, y, z, w = (q / length for q in quaternion)
    rows = (
        (1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)),
        (2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)),
        (2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)),
    )
    pairs = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))
    return tuple(sum(rows[i][k] * moments[k] * rows[j][k] for k in range(3)) for i, j in pairs)
