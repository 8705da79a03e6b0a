"""Makes docs/images/recording.png from recordings/demo.rrd, which `make demo` writes:

    .venv/bin/python -I docs/recording_picture.py

The viewer needs no screen, but a Vulkan driver; on Debian and Ubuntu:
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

from collision_response.recording.table import read
from collision_response.recording.viewer_layout import blueprint

ROOT = Path(__file__).resolve().parent.parent
RECORDING = ROOT / "recordings" / "demo.rrd"
PICTURE = ROOT / "docs" / "images" / "recording.png"
VIEWER = Path(rerun_cli.__file__).with_name("rerun")
APPLICATION = "collision_response"
PORT = 9433

WINDOW = "1060x720"
"""Width and height of the window: small, so that its text can be read on a page 880 pixels wide."""

BARS = 36, 32
"""Heights of the menu at the top and of the time bar at the bottom, which the picture leaves out [pixels]."""

SETTLING = 3.0
"""Time for the viewer to load and draw everything [s]."""

ANSWER = 33
"""Number of the answer that the picture shows: a ball that comes back from two cushions strikes another."""

SPAN = 1.0
"""Time from shortly before the first impact that the plots show [s]."""

EYE = rrb.EyeControls3D(position=(0.46, -0.52, 0.72), look_target=(0.46, 0.19, 0.0), eye_up=(0.0, 0.0, 1.0))


def times() -> tuple[np.datetime64, np.datetime64]:
    """Time shortly before the first impact, and that of the impact that the picture shows."""
    stamps = read([RECORDING])["ros_time"].to_numpy()
    return stamps[0] - np.timedelta64(30, "ms"), stamps[ANSWER - 1]


def with_layout(start: np.datetime64, folder: Path) -> Path:
    """The recording with another layout: it looks at the rack, and the plots show the time of the break."""
    ends = (start, start + np.timedelta64(int(SPAN * 1e9), "ns"))
    bounds = (rrb.TimeRangeBoundary.absolute(int(end.astype("int64"))) for end in ends)
    bare, layout, merged = folder / "bare.rrd", folder / "layout.rbl", folder / "merged.rrd"
    RrdReader(str(RECORDING)).stream().write_rrd(bare, application_id=APPLICATION, recording_id="demo")
    time_axis = rrb.TimeAxis(view_range=rrb.TimeRange(*bounds))
    blueprint(EYE, time_axis).save(APPLICATION, str(layout))
    subprocess.run([VIEWER, "rrd", "merge", bare, layout, "-o", merged], check=True)
    return merged


def screenshot(recording: Path, at: np.datetime64) -> Image.Image:
    """Screenshot of the viewer."""
    process = subprocess.Popen([VIEWER, "--headless", "--window-size", WINDOW, "--port", str(PORT)])
    try:
        time.sleep(SETTLING)
        viewer = ViewerClient(f"rerun+http://127.0.0.1:{PORT}/proxy")
        viewer.open(str(recording))
        time.sleep(SETTLING)
        viewer.set_time("ros_time", timestamp=at, play_state="paused")
        time.sleep(SETTLING)
        return Image.open(io.BytesIO(viewer.take_screenshot()))
    finally:
        process.terminate()
        process.wait()


def main() -> None:
    """Open the recording in a viewer without a screen, and save a picture without its controls."""
    start, at = times()
    with tempfile.TemporaryDirectory() as folder:
        picture = screenshot(with_layout(start, Path(folder)), at)
    top, bottom = BARS
    shown = (0, top, picture.width, picture.height - bottom)
    picture.convert("RGB").crop(shown).save(PICTURE, optimize=True)


if __name__ == "__main__":
    main()
