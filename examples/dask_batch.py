"""A batch that does not fit in memory: contacts by the chunk, on a Dask cluster.

    pip install "dask[array,distributed]"
    python examples/dask_batch.py            # two workers on this machine
    python examples/dask_batch.py tcp://scheduler:8786

A worker makes or loads a chunk, resolves it and keeps what is asked for. So memory is that of a few
chunks on each worker, however many contacts there are.
"""

from __future__ import annotations

import sys

import dask.array as da
import numpy as np
from dask.distributed import Client

from collision_response import Geometry, StatusCode
from collision_response.batch import resolve_batch
from collision_response.batch.rows import body_rows, contact_rows

ROWS = 16  # of a chunk of results: velocity and angular velocity of both bodies, impulse, status


def resolve_chunk(bodies: np.ndarray, contacts: np.ndarray) -> np.ndarray:
    """Resolve one chunk; its results are the rows of one array, as Dask wants them."""
    result = resolve_batch(bodies, contacts)
    n = bodies.shape[-1]
    velocities = (v.reshape(-1, n) for v in (result.velocity, result.angular_velocity))
    return np.concatenate([*velocities, result.impulse, result.status[np.newaxis]])


def resolve(bodies: da.Array, contacts: da.Array) -> da.Array:
    """``resolve_batch`` for Dask arrays that are cut along their last axis only."""
    return da.blockwise(
        *(resolve_chunk, "on", bodies, "rln", contacts, "cn"),
        **{"new_axes": {"o": ROWS}, "concatenate": True, "dtype": bodies.dtype},
    )


def random_scene(n: int, chunk: int) -> tuple[da.Array, da.Array]:
    """Spheres of 1 kg and 0.1 m that meet at random."""
    of, at = body_rows(Geometry.SPATIAL), contact_rows(Geometry.SPATIAL)
    random = da.random.default_rng(0)
    ones = da.ones((1, 2, n), chunks=(1, 2, chunk))
    inertia = [ones * moment for moment in (0.004, 0.0, 0.0, 0.004, 0.0, 0.004)]
    motion = random.normal(size=(of.height - 7, 2, n), chunks=(of.height - 7, 2, chunk))
    bodies = da.concatenate([ones, *inertia, motion]).rechunk((of.height, 2, chunk))
    places = random.normal(size=(6, n), chunks=(6, chunk))
    coefficients = random.random(size=(at.height - 6, n), chunks=(at.height - 6, chunk))
    return bodies, da.concatenate([places, coefficients]).rechunk((at.height, chunk))


if __name__ == "__main__":
    address = {"address": sys.argv[1]} if len(sys.argv) > 1 else {"n_workers": 2, "threads_per_worker": 1}
    with Client(**address):
        results = resolve(*random_scene(n=20_000_000, chunk=500_000))
        answered = (results[-1] == StatusCode.OK).sum()
        print(f"{answered.compute():,} contacts of 20,000,000 met")
