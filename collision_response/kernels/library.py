"""The compiled functions. ``setup`` gives them the Python objects that they use."""

from __future__ import annotations

from enum import IntEnum
from fractions import Fraction
from importlib.machinery import EXTENSION_SUFFIXES
from pathlib import Path

from ..answer import Impact
from ..model import Adjustment, model_as_used, plan_model
from ..physics.body import Body, Twist
from ..physics.contact import Contact
from ..physics.laws import Regime
from ..physics.vector import Vec3
from ..status import ImpactError, StatusCode

try:
    from . import _compiled
    from ._compiled import *  # noqa: F403  # what module.hpp names
except ImportError as error:
    built = [path.name for path in Path(__file__).parent.glob("_compiled*.so")]
    if {f"_compiled{suffix}" for suffix in EXTENSION_SUFFIXES} & {*built}:
        raise
    if built:
        raise ImportError(
            f"{Path(__file__).parents[1]} is compiled for another Python: {built[0]}"
        ) from error
    raise ImportError(
        f"{Path(__file__).parents[1]} is not compiled. In a source tree, Python takes the directory of that "
        "name for the package: run .venv/bin/python -I, which does not, or change to another directory"
    ) from error

_REFUSALS = {
    StatusCode.OUT_OF_RANGE: ("result", "a number of the answer is beyond float64"),
    StatusCode.PATH_TOO_LONG: ("contact", "the path of the impulse did not end within its budget of steps"),
    StatusCode.INTERNAL_ERROR: (
        "result",
        "breaks a law of mechanics: a fault of this package, please report it",
    ),
}


def refusal(code: int) -> ImpactError:
    """Return the error for a valid request that a kernel could not answer."""
    status = StatusCode(code)
    return ImpactError(status, *_REFUSALS[status])


def _by_number(enumeration: type[IntEnum]) -> tuple[IntEnum | None, ...]:
    members = {int(member): member for member in enumeration}
    return tuple(members.get(i) for i in range(max(members) + 1))


_compiled.setup(
    Impact,
    Twist,
    Vec3,
    Body,
    Contact,
    Fraction,
    _by_number(StatusCode),
    _by_number(Regime),
    tuple(Adjustment(i) for i in range(2 * max(Adjustment))),
    plan_model,
    model_as_used,
    refusal,
)
