"""``collision_response report``: summarise a recording."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

from ..answer import format_name
from ..recording import scenes
from ..recording.report import Summary, in_words, page
from ..recording.rerun_sdk import compute, pa
from ..recording.table import read

DESCRIPTION = """Prints a summary of recordings, and writes it, with plots, to one page for any browser. The
page needs no other files. Several files are treated as one recording."""

MAGIC = b"RRF2"
"""The first bytes of a recording."""


def main(arguments: list[str]) -> int:
    """Print the summary, and write the page and, if requested, the table."""
    parser = argparse.ArgumentParser(prog="collision_response report", description=DESCRIPTION)
    parser.add_argument("files", nargs="+", metavar="FILE.rrd")
    parser.add_argument("--html", type=Path, metavar="PAGE", help="default: the first file's name, .html")
    parser.add_argument(
        "--csv", type=Path, metavar="TABLE", help="also write every impact and refusal as a row"
    )
    given = parser.parse_args(arguments)
    try:
        impacts = read(given.files)
        summary = Summary.of(impacts, scenes.read(given.files))
        target = given.html or Path(given.files[0]).with_suffix(".html")
        if given.csv is not None and given.csv.resolve() == target.resolve():
            parser.error(f"--csv {given.csv} would overwrite the page")
        for path in filter(None, (target, given.csv)):
            spare_recordings(path)
    except (OSError, RuntimeError, ValueError) as error:
        return _failed(error)
    print("\n".join(map(format_name, in_words(summary))))
    writing = target
    try:
        target.write_text(page(summary, [Path(file).name for file in given.files]), encoding="utf-8")
        if given.csv is not None:
            writing = given.csv
            write_csv(impacts, given.csv)
    except OSError as error:
        return _failed(f"cannot write {writing}: {error.strerror or error}")
    print(f"\nplots: {format_name(str(target))}")
    if given.csv is not None:
        print(f"table: {format_name(str(given.csv))}")
    return 0


def _failed(error: Exception | str) -> int:
    print(f"collision_response report: {error}", file=sys.stderr)
    return 2


def spare_recordings(target: Path) -> None:
    """Refuse to overwrite a recording, as ``--csv *.rrd`` would do.

    Raises:
        ValueError: if the file to be written is a recording.
    """
    if not target.is_file():
        return
    with target.open("rb") as file:
        if file.read(len(MAGIC)) == MAGIC:
            raise ValueError(f"{target} is a recording and is not overwritten")


def write_csv(impacts: Any, target: Path) -> None:
    """Write a table, with a column for each component of a vector: ``impulse.0``, ``impulse.1`` ..."""
    from pyarrow import csv

    flat = {}
    for name, column in zip(impacts.column_names, impacts.columns, strict=True):
        if pa.types.is_list(column.type):  # of files by versions whose models have more or fewer numbers
            longest = compute.max(compute.list_value_length(column)).as_py()
            column = compute.list_slice(column, 0, longest, return_fixed_size_list=True)
        if pa.types.is_fixed_size_list(column.type):
            for i in range(column.type.list_size):
                flat[f"{name}.{i}"] = compute.list_element(column, i)
        else:
            flat[name] = column
    with target.open("wb") as file:
        csv.write_csv(pa.table(flat), file)
