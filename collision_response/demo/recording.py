"""The recording that the node makes in the demo."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

RECORDING = Path("recordings", "demo.rrd")


def can_record() -> bool:
    """Whether rerun is installed; it may be missing if ROS was not installed by pip."""
    return find_spec("rerun") is not None


def impacts_in(path: Path) -> int:
    """Number of impacts in a recording."""
    from rerun.chunk import RrdReader

    stream = RrdReader(str(path)).stream()
    rows = stream.filter(content="/impact/kinetic_energy", components="Scalars:scalars")
    batches = (chunk.to_record_batch() for chunk in rows.to_chunks())
    return sum(batch.num_rows for batch in batches if "answer" in batch.schema.names)
