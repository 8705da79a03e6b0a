"""Python programs in processes of their own, which import the package that the tests import."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path


def run_python(*arguments: str | Path) -> subprocess.CompletedProcess[str]:
    """Run Python where the source directory ``collision_response`` does not hide the installed package.

    Its option ``-I`` would do that, too, but it ignores ``PYTHONPATH``, where a sourced colcon build is.
    """
    return subprocess.run(
        [sys.executable, *arguments], cwd="/", capture_output=True, text=True, timeout=300, check=False
    )
