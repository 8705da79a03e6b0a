"""How a request ended: the status codes of the whole package, and the one exception of the Python API."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, NoReturn

from .named_enum import NamedEnum


class StatusCode(NamedEnum):
    """How a request ended. The codes are those of ``msg/Status.msg``."""

    UNSET = 0
    """The message was default-constructed: there is no answer."""
    OK = 1
    """The answer is valid."""
    SEPARATING = 2
    """The answer is valid: the bodies do not approach each other, so the impulse is 0."""
    INVALID_INERTIA = 3
    """No real body has this inertia: it is not positive semi-definite, or a principal moment is greater than
    the sum of the other two."""
    INVALID_NORMAL = 4
    """The normal has length 0, or no part in the plane of PLANAR."""
    INVALID_COEFFICIENT = 5
    """Restitution, friction, tangential restitution or stiffness ratio is out of range."""
    NOT_FINITE = 6
    """A number is NaN or infinite."""
    FRAME_MISMATCH = 7
    """The bodies and the contact do not have the same ``frame_id``. From the node only."""
    UNKNOWN_BODY = 8
    """There is no body of this name or index."""
    STALE_STATE = 9
    """The latest state of a body is too far from the time of the contact, or older than requested. From the
    node only."""
    INVALID_MODEL = 10
    """The law, geometry, precision, tolerance or an option is unknown, out of range or not available."""
    NO_DYNAMIC_BODY = 11
    """Neither body can move."""
    INVALID_MASS = 12
    """A mass is not positive, or so small that its inverse overflows."""
    INVALID_ORIENTATION = 13
    """A quaternion has length 0."""
    INVALID_MOTION_TYPE = 14
    """The motion type is unknown, or a static body moves. From the node only."""
    SAME_BODY = 15
    """Both bodies of a contact are the same body, or a name appears twice."""
    OUT_OF_RANGE = 16
    """A number of the answer is beyond float64."""
    TOLERANCE_NOT_MET = 17
    """There is an answer, but its error bound is above the requested tolerance, or infinite."""
    PATH_TOO_LONG = 18
    """The path or search of a law did not end within its budget of steps."""
    INVALID_TABLE = 19
    """A table of a batch, a scene or a file does not have the right size or content."""
    BUDGET_EXCEEDED = 20
    """The request takes more contacts, time or memory than the node allows for one request."""
    SHUTTING_DOWN = 21
    """The node is shutting down and did not get to this request."""
    CONTRADICTORY_CONTACTS = 22
    """No velocities keep all contacts of the scene from approaching."""
    UNKNOWN_MATERIAL = 23
    """The node has no entry for a material. From the node only."""
    INTERNAL_ERROR = 100
    """A fault of this package: please report the message."""

    @property
    def is_answer(self) -> bool:
        """Whether a result with this code holds valid numbers."""
        return self in (StatusCode.OK, StatusCode.SEPARATING, StatusCode.TOLERANCE_NOT_MET)


def format_value(value: object, spell: Callable[[Any], str] = repr) -> str:
    """Return ``spell(value)`` for an error message, or its first ``LONGEST`` characters.

    Python refuses to spell out a large integer; then the text says so.

    Args:
        value: any value.
        spell: ``str``, ``repr`` or a similar function.
    """
    try:
        text = spell(value)
    except ValueError:  # the limit of sys.set_int_max_str_digits
        return "of more digits than are shown"
    return text if len(text) <= LONGEST else f"{text[:LONGEST]}..."


LONGEST = 1000
"""Characters of a value that an error message shows."""


POSITIVE = math.nextafter(0, 1)
"""The least positive float: as the lower limit of a range, it excludes 0."""

BELOW_ONE = math.nextafter(1, 0)
"""The greatest float below 1: as the upper limit of a range, it excludes 1."""


def format_range(least: float, most: float) -> str:
    """Return "at least 0", "positive" or "in [0, 1]" for an error message.

    Integers and floats read the same.
    """
    low, high = (str(limit).removesuffix(".0") for limit in (least, most))
    if most == BELOW_ONE:
        return f"in [{low}, 1)"
    if least == POSITIVE:
        return "positive" if most == math.inf else f"in (0, {high}]"
    return f"at least {low}" if most == math.inf else f"in [{low}, {high}]"


class ImpactError(ValueError):
    """A request cannot be answered.

    Attributes:
        code: why, as a :class:`StatusCode`; the service answers with the same number.
        field: the argument that is wrong, with dots and brackets for its parts: ``body_a.mass``. The node
            names the field of the message: ``body_a.inertia.m``.
        reason: what is wrong with the field, and its value.
    """

    def __init__(self, code: StatusCode, field: str, reason: str) -> None:
        super().__init__(f"{field}: {reason}")
        self.code = code
        self.field = field
        self.reason = reason

    def __reduce__(self) -> tuple[type[ImpactError], tuple[StatusCode, str, str]]:
        """Pickle by the three arguments; ``args`` holds only the text."""
        return type(self), (self.code, self.field, self.reason)

    def within(self, owner: str) -> ImpactError:
        """Return the same error with ``owner.`` in front of its field."""
        return ImpactError(self.code, f"{owner}.{self.field}", self.reason)

    def renamed(self, names: Mapping[str, str]) -> ImpactError:
        """Return the same error with its field renamed as by :func:`renamed`."""
        return ImpactError(self.code, renamed(self.field, names), self.reason)


def renamed(text: str, names: Mapping[str, str]) -> str:
    """Rename the field that a text begins with, such as ``body_a.mass`` or ``body_a.mass: must be ...``.

    Args:
        text: a field, or the text of an error.
        names: new names of fields. Of those that contain the field, the innermost counts; if there is none,
            the text stays as it is.
    """
    owners = [name for name in names if text.startswith(name) and text[len(name) :][:1] in ("", *".:([")]
    owner = max(owners, key=len, default="")
    return names.get(owner, owner) + text[len(owner) :]


def raise_renamed(error: ImpactError | TypeError, names: Mapping[str, str]) -> NoReturn:
    """Raise an error with its field renamed as by :func:`renamed`.

    A TypeError that names no such field is from a function of the caller's, and is raised as it is.
    """
    if isinstance(error, ImpactError):
        raise error.renamed(names) from None
    text = renamed(str(error), names)
    if text == str(error):
        raise error
    raise TypeError(text) from None
