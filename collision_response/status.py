"""How a request ends: codes shared by every room, and the one exception of the Python API."""

from __future__ import annotations

from enum import IntEnum


class StatusCode(IntEnum):
    """The codes of ``msg/Status.msg``, where each is explained."""

    UNSET = 0
    OK = 1
    SEPARATING = 2
    INVALID_INERTIA = 3
    INVALID_NORMAL = 4
    INVALID_COEFFICIENT = 5
    NOT_FINITE = 6
    FRAME_MISMATCH = 7
    UNKNOWN_BODY = 8
    STALE_STATE = 9
    INVALID_MODEL = 10
    NO_DYNAMIC_BODY = 11
    INVALID_MASS = 12
    INVALID_ORIENTATION = 13
    INVALID_MOTION_TYPE = 14
    SAME_BODY = 15
    OUT_OF_RANGE = 16
    TOLERANCE_NOT_MET = 17
    PATH_TOO_LONG = 18
    INVALID_TABLE = 19
    BUDGET_EXCEEDED = 20
    SHUTTING_DOWN = 21
    CONTRADICTORY_CONTACTS = 22
    UNKNOWN_MATERIAL = 23
    INTERNAL_ERROR = 100

    @property
    def is_answer(self) -> bool:
        """Whether a result with this code holds valid numbers."""
        return self in (StatusCode.OK, StatusCode.SEPARATING, StatusCode.TOLERANCE_NOT_MET)


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
