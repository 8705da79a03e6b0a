"""Batches of arrays that are not NumPy's: lazily on Dask, and of any library with the Array API."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from ..model import ImpactModel

if TYPE_CHECKING:
    from .resolve_batch import BatchResult

Array = np.ndarray[Any, Any]


def as_numpy(name: str, array: Any) -> Array:
    """The same for NumPy, without a copy where that can be.

    Raises:
        ValueError: it is no array, NumPy can't read it where it lies, or some of it is masked.
    """
    check_unmasked(name, array)
    foreign = not isinstance(array, (np.ndarray, np.generic)) and hasattr(array, "__dlpack__")
    try:
        return np.from_dlpack(array) if foreign else np.asarray(array)
    except (BufferError, RuntimeError, TypeError, ValueError) as error:
        raise ValueError(f"{name}: must be an array that NumPy can read: {error}") from error


def check_unmasked(name: str, array: Any) -> None:
    """Raises: ValueError: some of it is masked, which no kernel sees."""
    if isinstance(array, np.ma.MaskedArray) and np.ma.is_masked(array):
        raise ValueError(f"{name}: must be numbers, some are masked")


def is_lazy(array: Any) -> bool:
    """Whether it is Dask's."""
    return _library(array) == "dask"


def maker(array: Any) -> Callable[[Array], Any] | None:
    """What makes arrays of its library of NumPy's; ``None``: it is NumPy's, or of no library with arrays."""
    library = _library(array)
    namespace = getattr(array, "__array_namespace__", None)
    if library == "torch" and namespace is None:
        import torch

        make: Callable[[Array], Any] = torch.from_dlpack
        return make
    return None if library == "numpy" or namespace is None else namespace().asarray


def _library(array: Any) -> str:
    return type(array).__module__.partition(".")[0]


def resolve_batch(
    bodies: Any,
    contacts: Any,
    model: ImpactModel,
    *,
    pairs: Any,
    report: bool,
    out: BatchResult | None,
    workers: int,
) -> BatchResult:
    """The results in the library of ``bodies``, or lazily if any of the arrays is lazy.

    Raises:
        ValueError: something is no array; or ``out`` is given: these arrays are not written to.
    """
    from .resolve_batch import BatchResult
    from .resolve_batch import resolve_batch as resolve_here

    lazy = any(map(is_lazy, (bodies, contacts, pairs)))
    make = None if lazy else maker(bodies)
    if out is not None and (lazy or make is not None):
        raise ValueError(f"out: must be None for arrays of {'dask' if lazy else _library(bodies)}")
    if lazy:
        return _lazily(bodies, contacts, model, pairs, report, workers)
    result = resolve_here(
        as_numpy("bodies", bodies),
        as_numpy("contacts", contacts),
        model,
        pairs=None if pairs is None else as_numpy("pairs", pairs),
        report=report,
        out=out,
        workers=workers,
    )
    if make is None:
        return result
    return BatchResult(*(None if array is None else make(array) for array in result))


def _lazily(
    bodies: Any, contacts: Any, model: ImpactModel, pairs: Any, report: bool, workers: int
) -> BatchResult:
    """Chunk by chunk: cut as the bodies are along their last axis, or with pairs as the contacts are.

    Or as what else has an entry for each contact, if those are not Dask's.
    """
    import dask.array as da
    from dask import delayed

    from .resolve_batch import BatchResult
    from .resolve_batch import resolve_batch as resolve_here

    def lazy(name: str, array: Any) -> Any:
        return array if is_lazy(array) else da.from_array(as_numpy(name, array), chunks=-1)

    given = {"bodies": bodies, "contacts": contacts, "pairs": pairs}
    cutting = ("bodies", "contacts") if pairs is None else ("contacts", "pairs")
    first = next((name for name in cutting if is_lazy(given[name])), "contacts")
    bodies, contacts = lazy("bodies", bodies), lazy("contacts", contacts)
    pairs = no_pairs = None
    if given["pairs"] is not None:
        pairs, no_pairs = lazy("pairs", given["pairs"]), np.empty((2, 0), np.int64)
    nothing = (
        np.empty((*bodies.shape[:-1], 0), bodies.dtype),
        np.empty((*contacts.shape[:-1], 0), contacts.dtype),
    )
    like = resolve_here(*nothing, model, pairs=no_pairs, report=report)
    others, n = (bodies if pairs is None else pairs).shape[-1], contacts.shape[-1]
    if abs(others - n) > 0:  # of unknown ones nothing is said
        of = "bodies" if pairs is None else "pairs"
        raise ValueError(f"contacts: must be as many as the {of}, {others}; are {n}")
    cuts = {"bodies": bodies, "contacts": contacts, "pairs": pairs}[first].chunks[-1]
    if pairs is None:
        of_bodies = bodies.rechunk({0: -1, 1: -1, 2: cuts}).to_delayed().ravel()
        of_pairs = [None] * len(cuts)
    else:
        of_bodies = [bodies.rechunk(-1).to_delayed().item()] * len(cuts)
        of_pairs = pairs.rechunk({0: -1, 1: cuts}).to_delayed().ravel()
    of_contacts = contacts.rechunk({0: -1, 1: cuts}).to_delayed().ravel()
    parts = [
        delayed(resolve_here, pure=True)(b, c, model, pairs=p, report=report, workers=workers)
        for b, c, p in zip(of_bodies, of_contacts, of_pairs, strict=True)
    ]

    def joined(i: int, array: Any) -> Any:
        shapes = [(*array.shape[:-1], n) for n in cuts]
        pieces = (
            da.from_delayed(part[i], shape, array.dtype) for part, shape in zip(parts, shapes, strict=True)
        )
        return da.concatenate(list(pieces), axis=-1)

    return BatchResult(*(None if array is None else joined(i, array) for i, array in enumerate(like)))
