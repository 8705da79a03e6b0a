"""What to model, and how exactly: the numbers of ``msg/ImpactModel.msg``, with names."""

from __future__ import annotations

from enum import IntEnum, IntFlag
from typing import NamedTuple


class Law(IntEnum):
    """The impact laws; see ``docs/impact-laws.md`` for which to choose."""

    AUTO = 0
    """COULOMB where there is friction, else FRICTIONLESS."""
    FRICTIONLESS = 1
    COULOMB = 2
    MOREAU = 3
    ROUTH_POISSON = 4
    ROUTH_STRONGE = 5


EXACT_LAWS = (Law.FRICTIONLESS, Law.COULOMB)
"""The laws that are formulas, and so can be computed to any precision."""


class Geometry(IntEnum):
    """How much of the motion is modelled."""

    AUTO = 1
    """The cheapest that is exact for the bodies and the contact at hand."""
    POINT = 2
    PLANAR = 3
    SPATIAL = 4


class Precision(IntEnum):
    """The tiers of arithmetic."""

    AUTO = 1
    """The cheapest that meets the tolerance."""
    SINGLE = 2
    DOUBLE = 3
    EXTENDED = 4


class Adjustment(IntFlag):
    """What was changed from what was asked, so that a result need not be searched for it."""

    NONE = 0
    NORMALISED_ORIENTATION = 1
    RESTITUTION_THRESHOLD = 2
    LAW_FALLBACK = 4


class ImpactModel(NamedTuple):
    """What to model, and how exactly.

    Attributes:
        law: see :class:`Law`.
        geometry: see :class:`Geometry`.
        precision: see :class:`Precision`.
        tolerance: greatest relative error of the impulse wanted; 0: whatever DOUBLE gives.
        tangential_restitution: ``e_t`` in [-1, 1], for COULOMB.
        restitution_threshold: approach speed [m/s] under which restitution is taken as 0.
    """

    law: Law = Law.AUTO
    geometry: Geometry = Geometry.AUTO
    precision: Precision = Precision.AUTO
    tolerance: float = 0.0
    tangential_restitution: float = 0.0
    restitution_threshold: float = 0.0
