"""Write formulas as C++ headers: ``python trace.py PACKAGE FOLDER TARGET``, run by CMakeLists.txt.

``TARGET`` is one of:

* the formula of a law, or ``validity``: a header for each layout that there are kernels for;
* ``changes``, ``column``, ``constants`` or ``fallback``: one header;
* ``lists``: prints CMake code that sets lists of the formulas, targets and headers.

``FOLDER/TARGET.d`` lists the modules that the headers depend on: if one changes, the build runs this again.
What is written is dated back to before the modules were read, so that an edit meanwhile counts as a change. A
header whose text stays the same is not written, so that nothing that includes it is compiled again.
"""

from __future__ import annotations

import os
import sys
import time
import types
from pathlib import Path

START = time.time_ns()


def main(package: Path, folder: Path, target: str) -> None:
    """Write the headers of a target, or print the lists for CMake."""
    # The package without its __init__, which imports the kernels that are about to be built.
    bare = types.ModuleType("collision_response")
    bare.__path__ = [str(package)]
    sys.modules["collision_response"] = bare

    from collision_response.kernels.tracer import headers

    if target == "lists":
        print(headers.cmake_lists())
        return

    for name, body in headers.headers_of(target).items():
        header, text = folder / f"{name}.hpp", headers.HEAD + body()
        if not header.exists() or header.read_text() != text:
            _write(header, text)
    modules = sorted(
        module.__file__
        for name, module in sys.modules.items()
        if name.startswith("collision_response.") and module.__file__
    )
    stamp = folder / f"{target}.stamp"
    _write(stamp, "")
    Path(folder / f"{target}.d").write_text(f"{stamp}: {' '.join(modules)}\n")


def _write(path: Path, text: str) -> None:
    path.write_text(text)
    os.utime(path, ns=(START, START))


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]), sys.argv[3])
