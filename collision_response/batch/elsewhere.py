"""Batches of arrays that are not NumPy's: lazily on Dask, and of any library with the Array API."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..model import ImpactModel
from .resolve_batch import BatchResult
from .resolve_batch import resolve_batch as resolve_here


def resolve_batch(
    bodies: Any,
    contacts: Any,
    model: ImpactModel,
    *,
    pairs: Any,
    report: bool,
    out: BatchResult | None,
    workers: int,
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
        return _lazily(bodies, contacts, model, pairs, report, workers)
    if hasattr(pairs, "__dlpack__"):
        pairs = np.from_dlpack(pairs)
    result = resolve_here(
        np.from_dlpack(bodies), np.from_dlpack(contacts), model, pairs=pairs, report=report, workers=workers
    )
    if namespace is None:
        import torch

        return BatchResult(*(None if array is None else torch.from_dlpack(array) for array in result))
    xp = namespace()
    return BatchResult(*(None if array is None else xp.asarray(array) for array in result))


def _lazily(
    bodies: Any, contacts: Any, model: ImpactModel, pairs: Any, report: bool, workers: int
) -> BatchResult:
    """Chunk by chunk: cut as the bodies are along their last axis, or with pairs as the contacts are."""
    import dask.array as da
    from dask import delayed

    no_pairs = None if pairs is None else np.empty((2, 0), np.int64)
    if pairs is None:
        cuts = bodies.chunks[2]
        of_bodies = bodies.rechunk({0: -1, 1: -1}).to_delayed().ravel()
        of_pairs = [None] * len(cuts)
    else:
        cuts = contacts.chunks[1]
        of_bodies = [bodies.rechunk(-1).to_delayed().item()] * len(cuts)
        of_pairs = da.asarray(pairs).rechunk({0: -1, 1: cuts}).to_delayed().ravel()
    of_contacts = contacts.rechunk({0: -1, 1: cuts}).to_delayed().ravel()
    nothing = (
        np.empty((*bodies.shape[:-1], 0), bodies.dtype),
        np.empty((contacts.shape[0], 0), contacts.dtype),
    )
    like = resolve_here(*nothing, model, pairs=no_pairs, report=report)
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
