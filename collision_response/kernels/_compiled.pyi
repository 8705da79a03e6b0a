"""The types of the compiled functions. The C++ files that ``module.hpp`` names say what each one does."""

from array import array
from collections.abc import Callable, Sequence
from typing import Any, Final, Literal, TypeVar, final

import numpy as np

from ..answer import Impact
from ..model import ImpactModel
from ..physics.body import Body
from ..physics.contact import Contact

_Array = np.ndarray[Any, Any]
_Integers = _Array | array[int]
_Impulses = tuple[bytes, list[float] | None, float, float, float | None, bool]
_Other = TypeVar("_Other")
_InPython = Callable[[Body, Body, Contact, ImpactModel, Impact | int], _Other]

def setup(*objects: Any) -> None: ...
def limit_vectors(bits: int, /) -> None: ...

# resolve.cpp
def resolve(
    body_a: Body, body_b: Body, contact: Contact, model: ImpactModel, in_python: _InPython[_Other], /
) -> Impact | _Other: ...
def numbers_with_errors(body_a: Body, body_b: Body, contact: Contact, /) -> tuple[bytes, bytes]: ...

# resolve_batch.cpp
def batch(
    law: int,
    layout: int,
    number_type: int,
    bodies: _Array,
    pairs: _Array | None,
    contacts: _Array,
    settings: _Array,
    results: tuple[_Array | None, ...],
    start: int,
    stop: int,
    /,
) -> tuple[int, float] | None: ...
def find_independent_sets(pairs: _Array, movable: _Array, order: _Array, starts: _Array, /) -> int: ...

# resolve_scene.cpp
def has_fraction(numbers: Any, /) -> bool: ...
def resolve_scene(
    bodies: Sequence[Body],
    pairs: Sequence[tuple[int, int]],
    contacts: Sequence[Contact],
    model: ImpactModel,
    threshold: float,
    /,
) -> tuple[Any, ...] | None: ...
def find_clusters(
    pairs: _Integers, movable: _Array | bytes, order: _Integers, starts: _Integers, cluster: _Integers, /
) -> int: ...
def resolve_clusters(
    layout: int,
    law: int,
    numbers: tuple[float, ...],
    bodies: _Array,
    pairs: _Array,
    contacts: _Array,
    order: _Array,
    starts: _Array,
    results: tuple[_Array, ...],
    wanted: _Array,
    start: int,
    stop: int,
    /,
) -> None: ...

# cluster_object.cpp
def assemble(
    bodies: list[Body], pairs: list[tuple[int, int]], contacts: list[Contact], counts: list[int], /
) -> Cluster | Literal[False] | None: ...

@final
class Cluster:
    is_locked: Final[bool]
    approach_is_uncertain: Final[bool]
    is_out_of_range: Final[bool]

    def no_impulses(self) -> bytes: ...
    def impulses_from_floats(self, p: list[float], /) -> bytes: ...
    def contradictory_contacts(self) -> list[int]: ...
    def velocity_size(self, p: bytes, /) -> float: ...
    def reflections(self, threshold: float, /) -> _Impulses | None: ...
    def effect_of(
        self, p: bytes, tangential: list[float] | None, error: float, sticks_by_slip: bool, /
    ) -> tuple[Any, ...]: ...
    def least_work_friction(self, p: bytes, error: float, /) -> _Impulses: ...
    def moreau(self, has_friction: bool, /) -> _Impulses | None: ...
    def follow_springs(
        self, stiffness: list[float], exponent: float, tolerance: float, budget: int, has_friction: bool, /
    ) -> tuple[bytes, list[float] | None, float, int] | Literal[False] | None: ...
