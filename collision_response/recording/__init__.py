"""Recording of impacts for the rerun viewer, by a worker thread. Importing this does not import rerun."""

from .record import BodyRecord, Gap, Record, Refusal, SceneRecord
from .recorder import Recorder

__all__ = ["BodyRecord", "Gap", "Record", "Recorder", "Refusal", "SceneRecord"]
