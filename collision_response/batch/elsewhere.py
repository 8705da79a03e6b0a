"""Batches of arrays that are not NumPy's: lazily on Dask, and of any library with the Array API."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..model import ImpactModel
from .resolve_batch import BatchResult
from .resolve_batch import resolve_batch as resolve_here


def resolve_batch(
    bodies: Any, contacts: Any, model: ImpactModel, out: BatchResult | None, workers: int
) -> BatchResult | None:
    """The results in the library of ``bodies``; ``None`` if that is none with arrays of its own.

    Raises:
        ValueError: ``out`` is given: these arrays are not written to.
    """
    library = type(bodies).__module__.partition(".")[0]
    namespace = getattr(bodies, "__array_namespace__", None)
    if library != "dask" and namespace is None and library != "torch":
        return None
    if out is not None:
        raise ValueError(f"out: must be None for arrays of {library}")
    if library == "dask":
        return _lazily(bodies, contacts, model, workers)
    result = resolve_here(np.from_dlpack(bodies), np.from_dlpack(contacts), model, workers=workers)
    if namespace is None:
        import torch

        return BatchResult(*(None if array is None else torch.from_dlpack(array) for array in result))
    xp = namespace()
    return BatchResult(*(None if array is None else xp.asarray(array) for array in result))


def _lazily(bodies: Any, contacts: Any, model: ImpactModel, workers: int) -> BatchResult:
    """Chunk by chunk, cut as the bodies are along their last axis."""
    import dask.array as da
    from dask import delayed

    bodies = bodies.rechunk({0: -1, 1: -1})
    contacts = contacts.rechunk({0: -1, 1: bodies.chunks[2]})
    nothing = np.empty((*bodies.shape[:2], 0), bodies.dtype), np.empty((contacts.shape[0], 0), contacts.dtype)
    like = resolve_here(*nothing, model)
    parts = [
        delayed(resolve_here, pure=True)(b, c, model, workers=workers)
        for b, c in zip(bodies.to_delayed().ravel(), contacts.to_delayed().ravel(), strict=True)
    ]

    def joined(i: int, array: Any) -> Any:
        shapes = [(*array.shape[:-1], n) for n in bodies.chunks[2]]
        pieces = (
            da.from_delayed(part[i], shape, array.dtype) for part, shape in zip(parts, shapes, strict=True)
        )
        return da.concatenate(list(pieces), axis=-1)

    return BatchResult(*(None if array is None else joined(i, array) for i, array in enumerate(like)))
