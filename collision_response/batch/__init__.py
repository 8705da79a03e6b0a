"""Many contacts, or many scenes, at once: arrays in, arrays out.

The files::

    rows.py             the tables: which row holds what
    resolve_batch.py    many contacts, each by itself, by the plan of plan.py; result.py: the answer
        one_by_one.py   - the few that kernels cannot answer well enough, by resolve()
    resolve_scenes.py   many clusters of contacts
    pairs.py            contacts between bodies of one table
    arrays.py           arrays of other libraries; dask_arrays.py
    threads.py          several workers
"""

from .pairs import independent_sets, scatter_velocities
from .resolve_batch import resolve_batch
from .resolve_scenes import ScenesResult, resolve_scenes
from .result import BatchResult, is_bounded
from .rows import BodyRows, ContactRows, body_rows, contact_rows

__all__ = [
    "BatchResult",
    "BodyRows",
    "ContactRows",
    "ScenesResult",
    "body_rows",
    "contact_rows",
    "independent_sets",
    "is_bounded",
    "resolve_batch",
    "resolve_scenes",
    "scatter_velocities",
]
