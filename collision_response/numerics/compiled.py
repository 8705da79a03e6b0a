"""The optional compiled backend: emitted modules, compiled by numba and kept on disk.

numba keeps its machine code beside the file of a module and finds it again by that file, so a module
is written once, under a name made of its text.
"""

from __future__ import annotations

import hashlib
import importlib.util
import os
import sys
import tempfile
from functools import cache
from pathlib import Path
from types import ModuleType

CACHE_VARIABLE = "COLLISION_RESPONSE_CACHE"
"""The environment variable that names the directory; else it is in the user's cache directory."""


@cache
def is_available() -> bool:
    """Whether numba is installed."""
    return importlib.util.find_spec("numba") is not None


def load(source: str) -> ModuleType:
    """The module of this source; its functions are compiled when first called, or read from disk."""
    name = "impacts_" + hashlib.sha256(source.encode()).hexdigest()[:16]
    if name not in sys.modules:
        path = _written(f"{name}.py", source)
        spec = importlib.util.spec_from_file_location(name, path)
        assert spec and spec.loader
        module = importlib.util.module_from_spec(spec)
        sys.modules[name] = module  # numba looks a cached function's module up by its name
        spec.loader.exec_module(module)
    return sys.modules[name]


def _written(name: str, source: str) -> Path:
    try:
        return _write(cache_directory(), name, source)
    except OSError:
        return _write(Path(tempfile.mkdtemp(prefix="collision_response_")), name, source)


def _write(directory: Path, name: str, source: str) -> Path:
    directory.mkdir(parents=True, exist_ok=True, mode=0o700)
    path = directory / name
    if not path.exists() or path.read_text() != source:
        with tempfile.NamedTemporaryFile("w", dir=directory, suffix=".tmp", delete=False) as file:
            file.write(source)
        os.replace(file.name, path)  # at once: another process may be importing it
    return path


def cache_directory() -> Path:
    """Where the modules and their machine code are kept."""
    named = os.environ.get(CACHE_VARIABLE)
    if named:
        return Path(named)
    base = os.environ.get("XDG_CACHE_HOME")
    return (Path(base) if base else Path.home() / ".cache") / "collision_response"
