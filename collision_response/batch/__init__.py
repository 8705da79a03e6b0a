"""Many independent contacts at once: arrays in, arrays out."""

from .resolve_batch import FEW, BatchResult, Preparation, is_bounded, prepare_batch, resolve_batch

__all__ = ["FEW", "BatchResult", "Preparation", "is_bounded", "prepare_batch", "resolve_batch"]
