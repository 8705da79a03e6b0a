"""Recording of impacts for the rerun viewer. Importing this does not import rerun.

The files::

    record.py            the entries of a recording
    recorder.py          a worker thread takes entries from a queue, so that no caller waits
    writer.py            writes entries for the viewer; viewer_layout.py: where it shows them; colours.py
        equivalent_solid.py, piped_file.py    the shape of a body; a file that rerun writes to
    table.py, scenes.py  the tables of impacts and of scenes: written, read and computed again
    rerun_sdk.py         imports rerun, or says what to install
    report.py            a summary in words, and as an HTML page
"""

from .record import BodyRecord, Gap, Record, Refusal, SceneRecord
from .recorder import Recorder

__all__ = ["BodyRecord", "Gap", "Record", "Recorder", "Refusal", "SceneRecord"]
