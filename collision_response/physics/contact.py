"""The contact between two bodies: where they touch, the normal, and the coefficients of the surfaces."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from ..numbers.operations import Scalar
from .vector import Vec3, as_vector


class Contact(NamedTuple):
    """A contact between two bodies. :meth:`of` builds one from plain sequences.

        >>> Contact.of((0, 0, 0), normal=(0, 0, 1), restitution=0.5, friction=0.3).friction
        0.3

    Attributes:
        position: the contact point, in world axes [m].
        normal: direction of the normal impulse on body_a: it points from body_b to body_a, in world axes.
            Any length but 0.
        restitution: coefficient of restitution ``e`` in [0, 1], or a function that returns it for an
            approach speed >= 0 [m/s], such as those of :mod:`~collision_response.physics.restitution`.
        friction: Coulomb's coefficient ``mu`` >= 0, or a function that returns it for a slip speed >= 0
            [m/s], such as those of :mod:`~collision_response.physics.friction`. Given a function, COULOMB and
            MOREAU use its value at the slip speed before the impact. The Routh laws evaluate it as the slip
            speed changes during the impact.
        tangential_restitution: ``e_t`` in [-1, 1], used by COULOMB; ``None`` for the value of the model.
    """

    position: Vec3
    normal: Vec3
    restitution: Scalar
    friction: Scalar
    tangential_restitution: Scalar | None = None

    @classmethod
    def of(
        cls,
        position: Iterable[Scalar],
        normal: Iterable[Scalar],
        restitution: Scalar = 1.0,
        friction: Scalar = 0.0,
        tangential_restitution: Scalar | None = None,
    ) -> Contact:
        """Build a contact from plain sequences.

        Args:
            position: the contact point ``(x, y, z)``, in world axes [m].
            normal: ``(x, y, z)`` from body_b to body_a, in world axes; any length but 0.
            restitution: number or function, as in the attribute.
            friction: number or function, as in the attribute.
            tangential_restitution: as in the attribute.

        Raises:
            TypeError: if ``position`` or ``normal`` does not have three components.
        """
        return cls(
            as_vector("position", position),
            as_vector("normal", normal),
            restitution,
            friction,
            tangential_restitution,
        )
