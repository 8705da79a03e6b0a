"""Batches of Dask arrays."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from ..model import ImpactModel
from .arrays import Array, as_numpy, is_lazy
from .pairs import check_pairs
from .plan import plan_for
from .result import BatchResult


def resolve_lazily(
    resolve: Callable[..., BatchResult],
    bodies: Any,
    contacts: Any,
    model: ImpactModel,
    pairs: Any,
    report: bool,
    workers: int,
) -> BatchResult:
    """Resolve a batch chunk by chunk, each by ``resolve``, which is ``resolve_batch``.

    Without ``pairs`` the chunks are those of ``bodies`` along the last axis, with ``pairs`` those of
    ``contacts``. If that array is not one of Dask, they are those of the other array that has an entry for
    each contact.
    """
    import dask.array as da
    from dask import delayed

    def as_dask(name: str, array: Any) -> Any:
        if not is_lazy(array):
            return da.from_array(as_numpy(name, array), chunks=-1)
        if any(map(math.isnan, array.shape[:-1])):
            raise ValueError(f"{name}: must have a known number of rows, is of shape {array.shape}")
        return array

    given = {"bodies": bodies, "contacts": contacts} | ({} if pairs is None else {"pairs": pairs})
    per_contact = ("bodies", "contacts") if pairs is None else ("contacts", "pairs")
    chunked = next((name for name in per_contact if is_lazy(given[name])), "contacts")
    arrays = {name: as_dask(name, array) for name, array in given.items()}
    if pairs is not None:
        check_pairs(arrays["pairs"])
    lengths = [length for name in per_contact for length in arrays[name].shape[-1:]]
    n = next((length for length in lengths if not math.isnan(length)), 0)
    shapes = {name: _without_memory(array, n) for name, array in arrays.items()}
    plan = plan_for(shapes["bodies"], shapes["contacts"], model, shapes.get("pairs"))
    chunks = arrays[chunked].chunks[-1]

    def rechunked(name: str, last: Any, what_fits: str) -> Any:
        """Divide an array along its last axis only."""
        array = arrays[name]
        try:
            whole = array.rechunk({**dict.fromkeys(range(array.ndim - 1), -1), array.ndim - 1: last})
        except ValueError:  # not all lengths are known; Dask names no array
            reason = f"must have {what_fits}: call compute_chunk_sizes() of those of unknown length"
            raise ValueError(f"{name}: {reason}") from None
        return whole.to_delayed().ravel()

    def divided(name: str) -> Any:
        return rechunked(name, chunks, f"the chunks of {chunked}")

    contact_chunks = divided("contacts")
    if pairs is None:
        body_chunks, pair_chunks = divided("bodies"), [None] * len(chunks)
    else:
        body_chunks = [*rechunked("bodies", -1, "chunks of known length")] * len(chunks)
        pair_chunks = divided("pairs")
    results = [
        delayed(resolve, pure=True)(b, c, model, pairs=p, report=report, workers=workers)
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
