"""Budgets, reasons and flags that Python and the compiled kernels share."""

from enum import IntEnum

REFLECTIONS = 10_000
"""Greatest number of reflections in a cluster of contacts. A chain of n equal balls takes n."""

RATIONAL_CONTACTS = 8
"""Clusters of at most this many contacts are computed in fractions if the kernels cannot tell enough."""

SPRING_WORK = 1_500_000_000
"""Budget for the paths of ROUTH_STRONGE in a cluster, roughly in nanoseconds: a second or two."""

LEAST_SPRING_RESTITUTION = 0.05
"""Least restitution for ROUTH_STRONGE in a cluster. The less it is, the longer springs take to part."""


USUAL_EXPONENT = 100
"""Clusters scale the normals and quaternions whose largest number is above 2^100, or below its inverse."""


class Handover(IntEnum):
    """Why the kernels' ``resolve`` hands a request over to Python instead of answering it."""

    INVALID = 0
    """The request breaks a rule of :mod:`~collision_response.validity`."""
    NOT_ONLY_NUMBERS = 1
    """The contact has a coefficient that is a function, or a tangential restitution of its own."""
    GEOMETRY_TOO_SMALL = 2
    """The model forces a geometry that leaves out part of the impact."""
    NOTHING_KNOWN = 3
    """The answer is not finite, and its error bound is infinite."""
    RATIONAL = 4
    """A number is a fraction, the law FRICTIONLESS, and no body articulated: the answer can be exact."""


class ValidityFlag(IntEnum):
    """The places of the flags that the check of a request sets for a valid one."""

    POINT_IF_FRICTIONLESS = 0
    """The geometry POINT is enough for a law without friction."""
    POINT_SUFFICES = 1
    """The geometry POINT is enough."""
    PLANAR_IF_FRICTIONLESS = 2
    """The geometry PLANAR is enough for a law without friction."""
    PLANAR_SUFFICES = 3
    """The geometry PLANAR is enough."""
    IS_OFF_UNIT = 4
    """A quaternion is not of unit length."""


class NumberType(IntEnum):
    """The number types that batches are computed in."""

    PLAIN = 0
    """float64, without error bounds."""
    FLOAT = 1
    """float32, without error bounds."""
    BOUNDED = 2
    """float64 with error bounds."""
    EXTENDED = 3
    """Double-doubles with error bounds."""
