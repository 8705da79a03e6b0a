"""What the node has recorded, read back."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path

RECORDING = Path("recordings", "demo.rrd")


def can_record() -> bool:
    """Whether rerun is there; where ROS comes from elsewhere than pip it may not be."""
    return find_spec("rerun") is not None


def impacts_in(path: Path) -> int:
    """The number of impacts that a recording holds."""
    from rerun.chunk import RrdReader

    stream = RrdReader(str(path)).stream()
    rows = stream.filter(content="/impact/kinetic_energy", components="Scalars:scalars")
    batches = (chunk.to_record_batch() for chunk in rows.to_chunks())
    return sum(batch.num_rows for batch in batches if "answer" in batch.schema.names)
