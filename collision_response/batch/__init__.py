"""Many contacts, or many scenes, at once: arrays in, arrays out."""

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
