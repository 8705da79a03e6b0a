"""The types of the compiled functions. The C++ files that ``module.hpp`` names say what each one does."""

from array import array
from collections.abc import Callable, Iterable, Sequence
from typing import Any, Final, Literal, TypeVar, final

import numpy as np

from ..answer import Impact
from ..model import ImpactModel
from ..physics.body import Body
from ..physics.contact import Contact

_Array = np.ndarray[Any, Any]
_Integers = _Array | array[int]
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
def resolve_columns(
    model: ImpactModel,
    layout: int,
    bodies: _Array,
    contacts: _Array,
    settings: _Array,
    results: tuple[_Array | None, ...],
    /,
) -> None: ...
def find_independent_sets(pairs: _Array, movable: _Array, order: _Array, starts: _Array, /) -> int: ...

# resolve_scene.cpp
def has_fraction(numbers: Any, /) -> bool: ...
def resolve_scene(
    bodies: Sequence[Body],
    pairs: Iterable[Sequence[int]],
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
    numbers: tuple[float | int, ...],
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
def kinetic_energy(body: Body, /) -> float | None: ...

@final
class Cluster:
    is_locked: Final[bool]
    approach_is_uncertain: Final[bool]

    def resolve(
        self,
        law: int,
        threshold: float,
        tolerance: float,
        springs: tuple[list[float] | None, float, int],
        decided: tuple[list[float], list[float], float, float, float, bool] | None,
        /,
    ) -> tuple[int, tuple[Any, ...], float, float | None, int, str, int]: ...
    def approaches_below(self, threshold: float, /) -> list[bool | None]: ...
    def contradictory_contacts(self) -> list[int]: ...
