"""Compile C++ for a test. The package is built from source, so there is a compiler."""

from __future__ import annotations

import ctypes
import os
import shlex
import subprocess
from pathlib import Path

KERNELS = Path(__file__).parents[1] / "collision_response" / "kernels"
OPTIONS = ("-std=c++17", "-O1", "-fPIC", "-shared", "-ffp-contract=off", "-Wno-psabi")
"""The options of CMakeLists.txt that matter here."""


def compile_library(source: str, directory: Path) -> ctypes.CDLL:
    """Compile a source that may include the headers of the kernels, and those in ``directory``."""
    file, library = directory / "test.cpp", directory / "test.so"
    file.write_text(source)
    compiler = shlex.split(os.environ.get("CXX", "c++"))
    headers = f"-I{KERNELS}", f"-I{directory}"
    subprocess.run([*compiler, *OPTIONS, *headers, str(file), "-o", str(library)], check=True)
    return ctypes.CDLL(str(library))
