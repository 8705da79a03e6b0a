"""A batch that does not fit in memory, in chunks on a Dask cluster.

    pip install "dask[array,distributed]"
    python examples/dask_batch.py            # two workers on this machine
    python examples/dask_batch.py tcp://scheduler:8786

``resolve_batch`` is lazy for Dask arrays. A worker makes or loads a chunk, resolves it and keeps only what is
needed. So each worker needs memory for a few chunks, however many contacts there are.
"""

from __future__ import annotations

import math
import sys

import dask.array as da
from dask.distributed import Client

from collision_response import Geometry, StatusCode
from collision_response.batch import body_rows, contact_rows, resolve_batch


def random_scene(n: int, chunk: int) -> tuple[da.Array, da.Array]:
    """Random pairs of spheres of 1 kg and 0.1 m, and their contacts."""
    rows, touch = body_rows(Geometry.SPATIAL), contact_rows(Geometry.SPATIAL)
    random = da.random.default_rng(0)
    ones = da.ones((1, 2, n), chunks=(1, 2, chunk))
    inertia = [ones * moment for moment in (0.004, 0.0, 0.0, 0.004, 0.0, 0.004)]
    motion = random.normal(size=(rows.height - 7, 2, n), chunks=(rows.height - 7, 2, chunk))
    bodies = da.concatenate([ones, *inertia, motion]).rechunk((rows.height, 2, chunk))
    places = random.normal(size=(6, n), chunks=(6, chunk))
    coefficients = random.random(size=(touch.height - 6, n), chunks=(touch.height - 6, chunk))
    return bodies, da.concatenate([places, coefficients]).rechunk((touch.height, chunk))


if __name__ == "__main__":
    address = {"address": sys.argv[1]} if len(sys.argv) > 1 else {"n_workers": 2, "threads_per_worker": 1}
    with Client(**address):
        n = 20_000_000
        result = resolve_batch(*random_scene(n, chunk=500_000))
        met = int((result.status == StatusCode.OK).sum().compute())
    off = abs(met - n / 2) / math.sqrt(n / 4)
    print(
        f"{met:,} contacts of {n:,} met; half of them should, and {off:.1f} standard deviations are missing"
    )
    assert off < 5
