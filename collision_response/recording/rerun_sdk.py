"""rerun and PyArrow, which comes with it; or an error that says what to install."""

from __future__ import annotations

import os

from ..optional import missing

# [KiB] rerun and PyArrow reserve memory in pieces of 1 GiB, and that counts against the node's memory_limit.
os.environ.setdefault("MIMALLOC_ARENA_RESERVE", "65536")

try:
    import pyarrow as pa
    import rerun as rr
    import rerun.blueprint as rrb
    from pyarrow import compute
    from rerun.chunk import Chunk, RrdReader
    from rerun.error_utils import RerunWarning
except ImportError:  # not there, or of another version
    raise missing("rerun 0.39 to 0.41", "'rerun-sdk>=0.39,<0.42'") from None

__all__ = ["Chunk", "RerunWarning", "RrdReader", "compute", "pa", "rr", "rrb"]
