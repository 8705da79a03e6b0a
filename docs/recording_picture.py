"""Makes docs/images/recording.png from recordings/demo.rrd, which `make demo` writes:

    .venv/bin/python -I docs/recording_picture.py

The viewer needs no screen for that, but a Vulkan driver; on Debian and Ubuntu:
apt install mesa-vulkan-drivers libvulkan1 libxkbcommon-x11-0 libegl1
"""

from __future__ import annotations

import io
import subprocess
import tempfile
import time
from pathlib import Path

import numpy as np
import rerun.blueprint as rrb
import rerun_cli
from PIL import Image
from rerun.chunk import RrdReader
from rerun.experimental import ViewerClient

from collision_response.recording.layout import blueprint

ROOT = Path(__file__).resolve().parent.parent
RECORDING = ROOT / "recordings" / "demo.rrd"
PICTURE = ROOT / "docs" / "images" / "recording.png"
SIZE = (1200, 760)
PORT = 9871

SETTLING = 3.0
"""For the viewer to load everything and to draw it [s]."""

AT = 0.2
"""Time into the break [s]."""

SPAN = 1.0
"""Time of the break that the plots show [s]."""

EYE = rrb.EyeControls3D(position=(0.35, -1.1, 0.9), look_target=(0.45, 0.0, 0.0), eye_up=(0.0, 0.0, 1.0))


def begin() -> np.datetime64:
    """When the recording begins."""
    chunks = RrdReader(str(RECORDING)).stream().filter(content="/world/bodies/cue").to_chunks()
    batches = (chunk.to_record_batch() for chunk in chunks)
    stamps = [b.column("ros_time").cast("int64").to_pylist() for b in batches if "ros_time" in b.schema.names]
    return np.datetime64(min(min(column) for column in stamps), "ns")


def picture_of(recording: Path, layout: Path, at: np.datetime64) -> Image.Image:
    """What the viewer shows."""
    program = Path(rerun_cli.__file__).with_name("rerun")
    command = [
        program,
        "--headless",
        "--hide-welcome-screen",
        f"--port={PORT}",
        "--window-size={}x{}".format(*SIZE),
        recording,
        layout,
    ]
    viewer = subprocess.Popen(command, stderr=subprocess.DEVNULL)
    try:
        client = connect()
        time.sleep(SETTLING)
        client.set_time("ros_time", timestamp=at, play_state="paused")
        time.sleep(SETTLING)
        return Image.open(io.BytesIO(client.take_screenshot()))
    finally:
        viewer.terminate()
        viewer.wait(10)


def connect() -> ViewerClient:
    """To a viewer that may not be up yet."""
    deadline = time.monotonic() + 20
    while True:
        try:
            return ViewerClient(f"rerun+http://127.0.0.1:{PORT}/proxy")
        except ConnectionError:
            if time.monotonic() > deadline:
                raise
            time.sleep(0.2)


def main() -> None:
    """Open the recording in a viewer without a screen, and take a picture."""
    start = begin()
    ends = (int((start + np.timedelta64(int(seconds * 1e9), "ns")).astype("int64")) for seconds in (0, SPAN))
    axis = rrb.TimeAxis(view_range=rrb.TimeRange(*map(rrb.TimeRangeBoundary.absolute, ends)))
    with tempfile.TemporaryDirectory() as directory:
        layout = Path(directory, "layout.rbl")
        blueprint(EYE, axis).save("collision_response", str(layout))
        picture = picture_of(RECORDING, layout, start + np.timedelta64(int(AT * 1e9), "ns"))
    print(picture.size)
    picture.convert("RGB").quantize(128).save(PICTURE, optimize=True)


if __name__ == "__main__":
    main()
