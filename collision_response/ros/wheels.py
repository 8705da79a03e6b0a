"""Check that the installed ROS wheels belong to the release that this package was built with."""

from __future__ import annotations

import re
from importlib import metadata

from ..optional import missing

PINNED = re.compile(r"(?P<name>ros-[\w-]+)(\[\w+\])?==(?P<series>[\d.]+\.)\*")

MISSING = "(missing)"

PACKAGE = "collision_response"


def check_release() -> None:
    """Check the ROS wheels that this package requires.

    If colcon has built it, it has no list of requirements: nothing is checked.

    Raises:
        ImportError: if a wheel is missing or of another release. The message says what to install.
    """
    try:
        requirements = metadata.requires(PACKAGE) or []
    except metadata.PackageNotFoundError:
        return
    pinned = [match for match in map(PINNED.fullmatch, requirements) if match]  # without those of extras
    wrong = [
        f"{match['name']} {installed}"
        for match in pinned
        if not (installed := _version(match["name"])).startswith(match["series"])
    ]
    if wrong:
        wanted = " ".join(f"'{match.group()}'" for match in pinned)
        if sum(wheel.endswith(MISSING) for wheel in wrong) == len(pinned):
            raise missing("ROS", wanted)
        other = f"was built with other ROS wheels than {', '.join(wrong)}"
        raise ImportError(f"{PACKAGE} {other}: pip install {wanted}")


def _version(name: str) -> str:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return MISSING
