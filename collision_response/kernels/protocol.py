"""What Python and the kernels tell each other by number, besides what is in requests and answers."""

from enum import IntEnum


class Left(IntEnum):
    """Why ``resolve`` of the kernels leaves a request to that of Python."""

    REFUSED = 0
    """Something is wrong with it."""
    NOT_ONLY_NUMBERS = 1
    """The contact has functions for coefficients, or its own tangential restitution."""
    GEOMETRY_TOO_SMALL = 2
    """A forced geometry leaves out what matters."""
    UNKNOWN = 3
    """No number of the answer is known."""
    RATIONAL = 4
    """Fractions, of a law that is rational."""


class Number(IntEnum):
    """The number types that batches are computed in."""

    PLAIN = 0
    FLOAT = 1
    BOUNDED = 2
    EXTENDED = 3
