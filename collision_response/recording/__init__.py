"""Impacts to a rerun recording: a worker with a queue. Importing this does not import rerun."""

from .record import BodyRecord, Gap, Record, Refusal, SceneRecord
from .recorder import Recorder

__all__ = ["BodyRecord", "Gap", "Record", "Recorder", "Refusal", "SceneRecord"]
