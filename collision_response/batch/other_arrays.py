"""Batches of arrays that are not NumPy's: lazy ones of Dask, and those of any library with the Array API."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from ..model import ImpactModel

if TYPE_CHECKING:
    from .resolve_batch import BatchResult

Array = np.ndarray[Any, Any]


def as_numpy(name: str, array: Any) -> Array:
    """Return the array as one of NumPy, without a copy if possible.

    Raises:
        ValueError: if it is not an array, if NumPy cannot read its memory, or if elements are masked.
    """
    check_unmasked(name, array)
    is_foreign = not isinstance(array, (np.ndarray, np.generic)) and hasattr(array, "__dlpack__")
    try:
        return np.from_dlpack(array) if is_foreign else np.asarray(array)
    except (BufferError, RuntimeError, TypeError, ValueError) as error:
        raise ValueError(f"{name}: must be an array that NumPy can read: {error}") from error


def check_unmasked(name: str, array: Any) -> None:
    """Raises: ValueError: if elements are masked. The kernels would not see the mask."""
    if isinstance(array, np.ma.MaskedArray) and np.ma.is_masked(array):
        raise ValueError(f"{name}: must be numbers, some are masked")


def is_lazy(array: Any) -> bool:
    """Whether the array is one of Dask."""
    return _library(array) == "dask"


def converter_like(array: Any) -> Callable[[Array], Any] | None:
    """Return a function that converts arrays of NumPy to the library of ``array``.

    ``None`` if ``array`` is NumPy's, or of a library without the Array API.
    """
    library = _library(array)
    namespace = getattr(array, "__array_namespace__", None)
    if library == "torch" and namespace is None:
        import torch

        convert: Callable[[Array], Any] = torch.from_dlpack
        return convert
    return None if library == "numpy" or namespace is None else namespace().asarray


def _library(array: Any) -> str:
    return type(array).__module__.partition(".")[0]


def resolve_other_arrays(
    bodies: Any,
    contacts: Any,
    model: ImpactModel,
    *,
    pairs: Any,
    report: bool,
    out: BatchResult | None,
    workers: int,
) -> BatchResult:
    """Resolve a batch. The results are in the library of ``bodies``, or lazy if any of the arrays is lazy.

    Raises:
        ValueError: if an argument is not an array, or if ``out`` is given: it is only for arrays of NumPy.
    """
    from .resolve_batch import resolve_batch

    lazy = any(map(is_lazy, (bodies, contacts, pairs)))
    convert = None if lazy else converter_like(bodies)
    if out is not None and (lazy or convert is not None):
        raise ValueError(f"out: must be None for arrays of {'dask' if lazy else _library(bodies)}")
    if lazy:
        return _resolve_lazily(bodies, contacts, model, pairs, report, workers)
    result = resolve_batch(
        as_numpy("bodies", bodies),
        as_numpy("contacts", contacts),
        model,
        pairs=None if pairs is None else as_numpy("pairs", pairs),
        report=report,
        out=out,
        workers=workers,
    )
    return result if convert is None else result.mapped(convert)


def _resolve_lazily(
    bodies: Any, contacts: Any, model: ImpactModel, pairs: Any, report: bool, workers: int
) -> BatchResult:
    """Resolve a batch chunk by chunk.

    Without ``pairs`` the chunks are those of ``bodies`` along the last axis, with ``pairs`` those of
    ``contacts``. If that array is not one of Dask, they are those of the other array that has an entry for
    each contact.
    """
    import dask.array as da
    from dask import delayed

    from .pairs import check_pairs
    from .resolve_batch import BatchResult, plan_for, resolve_batch

    def as_dask(name: str, array: Any) -> Any:
        if not is_lazy(array):
            return da.from_array(as_numpy(name, array), chunks=-1)
        if any(map(math.isnan, array.shape[:-1])):
            raise ValueError(f"{name}: must have a known number of rows, is of shape {array.shape}")
        return array

    given = {"bodies": bodies, "contacts": contacts, "pairs": pairs}
    candidates = ("bodies", "contacts") if pairs is None else ("contacts", "pairs")
    chunked = next((name for name in candidates if is_lazy(given[name])), "contacts")
    bodies, contacts = as_dask("bodies", bodies), as_dask("contacts", contacts)
    if pairs is not None:
        pairs = as_dask("pairs", pairs)
        check_pairs(pairs)
    lengths = (*contacts.shape[-1:], *(bodies if pairs is None else pairs).shape[-1:])
    n = next((length for length in lengths if not math.isnan(length)), 0)
    plan = plan_for(
        _without_memory(bodies, n),
        _without_memory(contacts, n),
        model,
        None if pairs is None else _without_memory(pairs, n),
    )
    chunks = {"bodies": bodies, "contacts": contacts, "pairs": pairs}[chunked].chunks[-1]
    if pairs is None:
        body_chunks = bodies.rechunk({0: -1, 1: -1, 2: chunks}).to_delayed().ravel()
        pair_chunks = [None] * len(chunks)
    else:
        body_chunks = [bodies.rechunk(-1).to_delayed().item()] * len(chunks)
        pair_chunks = pairs.rechunk({0: -1, 1: chunks}).to_delayed().ravel()
    contact_chunks = contacts.rechunk({0: -1, 1: chunks}).to_delayed().ravel()
    results = [
        delayed(resolve_batch, pure=True)(b, c, model, pairs=p, report=report, workers=workers)
        for b, c, p in zip(body_chunks, contact_chunks, pair_chunks, strict=True)
    ]

    def joined(field: int, shape: tuple[int, ...], dtype: np.dtype[Any]) -> Any:
        pieces = [
            da.from_delayed(result[field], (*shape[:-1], size), dtype)
            for result, size in zip(results, chunks, strict=True)
        ]
        return da.concatenate(pieces, axis=-1)

    fields = enumerate(plan.result_fields(0, report))
    return BatchResult(*(None if array is None else joined(field, *array) for field, array in fields))


def _without_memory(array: Any, n: int) -> Array:
    """Return an array with the shape and type of one of Dask. A length that Dask does not know is ``n``."""
    shape = [n if math.isnan(length) else length for length in array.shape]
    return np.broadcast_to(np.empty((), array.dtype), shape)
