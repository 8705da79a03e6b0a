"""Writes the formulas down as C++: run by the build, ``python trace.py PACKAGE FOLDER WHAT``.

``WHAT`` is the formula of a law, ``validity``, ``column``, ``changes`` or ``sizes``; or a list of formulas,
which is printed. A formula gives a header for each layout that there are kernels for. ``FOLDER/WHAT.d`` says
which modules they were made from: the build runs this again if one changes. A header that comes out as it
was is left alone, and nothing that includes it is compiled again.
"""

from __future__ import annotations

import sys
import types
from pathlib import Path


def main(package: Path, folder: Path, what: str) -> None:
    """Write the headers."""
    # The package without what its __init__ imports: that needs the kernels that are to be built.
    bare = types.ModuleType("collision_response")
    bare.__path__ = [str(package)]
    sys.modules["collision_response"] = bare

    from collision_response.kernels import programs

    if what in programs.FORMULA_LISTS:
        print(end=";".join(programs.FORMULA_LISTS[what]))
        return

    for name, text in programs.headers(what):
        header = folder / f"{name}.hpp"
        if not header.exists() or header.read_text() != text:
            header.write_text(text)
    modules = sorted(
        module.__file__
        for name, module in sys.modules.items()
        if name.startswith("collision_response.") and module.__file__
    )
    stamp = folder / f"{what}.stamp"
    stamp.touch()
    Path(folder / f"{what}.d").write_text(f"{stamp}: {' '.join(modules)}\n")


if __name__ == "__main__":
    main(Path(sys.argv[1]), Path(sys.argv[2]), sys.argv[3])
