"""Impacts to a rerun recording: a worker with a queue. Importing this does not import rerun."""

from .record import Gap, Record, Refusal, SceneRecord, Sighting
from .recorder import Recorder

__all__ = ["Gap", "Record", "Recorder", "Refusal", "SceneRecord", "Sighting"]
