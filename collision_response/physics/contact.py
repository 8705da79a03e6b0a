"""Where two bodies touch, and of what they are made."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from ..numbers.operations import Scalar
from .vector import Vec3, as_vector


class Contact(NamedTuple):
    """A contact: build one with :meth:`of`.

    Attributes:
        position: of the contact point, in world axes [m].
        normal: from body_b to body_a: it pushes body_a away. Any length but 0.
        restitution: ``e`` in [0, 1], or a function that gives it for an approach speed [m/s].
        friction: Coulomb's coefficient, >= 0, or a function that gives it for a slip speed [m/s]: COULOMB and
            MOREAU take its value at first touch, Routh's laws follow it along the path of one impact.
        tangential_restitution: ``e_t`` in [-1, 1], for COULOMB; ``None``: that of the model.
    """

    position: Vec3
    normal: Vec3
    restitution: Scalar
    friction: Scalar
    tangential_restitution: Scalar | None = None

    @classmethod
    def of(
        cls,
        position: Sequence[Scalar],
        normal: Sequence[Scalar],
        restitution: Scalar = 1.0,
        friction: Scalar = 0.0,
        tangential_restitution: Scalar | None = None,
    ) -> Contact:
        """A contact from plain sequences.

        Raises:
            TypeError: position or normal has not three components.
        """
        return cls(
            as_vector("position", position),
            as_vector("normal", normal),
            restitution,
            friction,
            tangential_restitution,
        )
