"""Many independent contacts at once: arrays in, arrays out."""

from .resolve_batch import BatchResult, is_bounded, resolve_batch, resolve_with_pauses
from .rows import BodyRows, ContactRows, body_rows, contact_rows

__all__ = [
    "BatchResult",
    "BodyRows",
    "ContactRows",
    "body_rows",
    "contact_rows",
    "is_bounded",
    "resolve_batch",
    "resolve_with_pauses",
]
