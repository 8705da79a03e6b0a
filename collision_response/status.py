"""How a request ends: codes that the whole package shares, and the one exception of the Python API."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

from .named_enum import NamedEnum


class StatusCode(NamedEnum):
    """How a request ended: the codes of ``msg/Status.msg``."""

    UNSET = 0
    """Of a default-constructed message: no answer."""
    OK = 1
    """The answer holds."""
    SEPARATING = 2
    """The bodies do not approach, so the impulse is zero. An answer, too."""
    INVALID_INERTIA = 3
    """Of no real body: not positive semi-definite, or against the triangle inequality."""
    INVALID_NORMAL = 4
    """Of length 0."""
    INVALID_COEFFICIENT = 5
    """Restitution, friction or tangential restitution out of range."""
    NOT_FINITE = 6
    """NaN or infinite number."""
    FRAME_MISMATCH = 7
    """``frame_id`` is not the same of the bodies and the contact. Of the node only."""
    UNKNOWN_BODY = 8
    """A body given by name only, and no state of that name received. Of the node only."""
    STALE_STATE = 9
    """A body's last state is too old. Of the node only."""
    INVALID_MODEL = 10
    """Unknown or unavailable law, geometry, precision or tolerance."""
    NO_DYNAMIC_BODY = 11
    """Neither body can move."""
    INVALID_MASS = 12
    """Not positive, or so small that its inverse overflows."""
    INVALID_ORIENTATION = 13
    """A quaternion of length 0."""
    INVALID_MOTION_TYPE = 14
    """Unknown, or a static body that moves. Of the node only."""
    SAME_BODY = 15
    """``body_a`` and ``body_b`` are one body."""
    OUT_OF_RANGE = 16
    """A number of the answer is beyond float64."""
    TOLERANCE_NOT_MET = 17
    """An answer, but its error bound is above the tolerance asked for, or infinite."""
    PATH_TOO_LONG = 18
    """A law's path or search did not end within its budget of steps."""
    INVALID_TABLE = 19
    """Of a batch or scene: a table whose size does not fit."""
    BUDGET_EXCEEDED = 20
    """More contacts, time or memory than the node allows one request."""
    SHUTTING_DOWN = 21
    """The node is shutting down and did not get to this request."""
    CONTRADICTORY_CONTACTS = 22
    """Of a scene: no velocities keep all contacts from approaching."""
    UNKNOWN_MATERIAL = 23
    """A material that the node has no entry for. Of the node only."""
    INTERNAL_ERROR = 100
    """A fault of this package: please report the message."""

    @property
    def is_answer(self) -> bool:
        """Whether a result with this code holds valid numbers."""
        return self in (StatusCode.OK, StatusCode.SEPARATING, StatusCode.TOLERANCE_NOT_MET)


def format_value(value: object, spell: Callable[[Any], str] = repr) -> str:
    """``repr(value)``, or what is said of numbers that Python does not spell out.

    Args:
        value: anything.
        spell: ``str`` or ``repr``.
    """
    try:
        return spell(value)
    except ValueError:  # of sys.set_int_max_str_digits
        return "of more digits than are shown"


def format_range(least: float, most: float) -> str:
    """What a number must be, in the words of all messages: 1 is 1 there, as an integer or not."""
    low, high = (str(limit).removesuffix(".0") for limit in (least, most))
    return f"at least {low}" if most == math.inf else f"in [{low}, {high}]"


class ImpactError(ValueError):
    """A request that cannot be answered.

    Attributes:
        code: why, as a :class:`StatusCode`; the service answers with the same number.
        field: the offending field, dotted as in the messages (``body_a.mass``).
        reason: what is wrong with it, with its value.
    """

    def __init__(self, code: StatusCode, field: str, reason: str) -> None:
        super().__init__(f"{field}: {reason}")
        self.code = code
        self.field = field
        self.reason = reason

    def __reduce__(self) -> tuple[type[ImpactError], tuple[StatusCode, str, str]]:
        """How it is pickled: an exception is made again from its ``args``, which hold the text alone."""
        return type(self), (self.code, self.field, self.reason)

    def within(self, owner: str) -> ImpactError:
        """The same error, seen from ``owner``, of which ``field`` is a part."""
        return ImpactError(self.code, f"{owner}.{self.field}", self.reason)

    def with_owner(self, owner: str) -> ImpactError:
        """The same error, of another owner: that is what ``field`` begins with, up to the first dot."""
        _, dot, rest = self.field.partition(".")
        return ImpactError(self.code, f"{owner}{dot}{rest}", self.reason)
