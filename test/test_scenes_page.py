"""docs/scenes.md shows what the package computes."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest
from scene_cases import row_of_balls, speeds

from collision_response import Law

ROOT = Path(__file__).parent.parent
PAGE = (ROOT / "docs" / "scenes.md").read_text(encoding="utf-8")
NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:e[-+]?\d+)?")


def generated(name: str) -> str:
    (text,) = re.findall(rf"<!-- generated: {name} -->\n(.*?)<!-- end -->", PAGE, re.DOTALL)
    return text.strip()


def test_the_example_prints_what_the_page_shows():
    code, _ = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    run = subprocess.run([sys.executable, "-I", "-c", code], capture_output=True, text=True, timeout=60)
    printed, shown = run.stdout.strip(), generated("example").strip("`\n")
    assert re.sub(r"\s+", " ", NUMBER.sub("", printed)) == re.sub(r"\s+", " ", NUMBER.sub("", shown))
    numbers = [list(map(float, NUMBER.findall(text))) for text in (printed, shown)]
    assert numbers[0] == pytest.approx(numbers[1], rel=1e-5, abs=1e-6)  # the digits that are printed


@pytest.mark.parametrize("line", generated("laws").splitlines()[2:])
def test_the_speeds_in_the_table_are_right(line):
    name, *cells, _ = (cell.strip() for cell in line.strip("|").split("|"))
    law = Law[name.split("`")[1]]
    options = {"exponent": float(name.rpartition(" ")[2])} if "exponent" in name else {}
    for cell, (count, e) in zip(cells, ((3, 1.0), (3, 0.5), (5, 1.0)), strict=True):
        answer = row_of_balls((1, *[0] * (count - 1)), e, number=float).resolve(law, options=options)
        assert speeds(answer) == pytest.approx(list(map(float, cell.split(", "))), abs=5.1e-5)


def test_the_example_of_many_scenes_prints_what_the_page_shows():
    _, code = re.findall(r"```python\n(.*?)```", PAGE, re.DOTALL)
    run = subprocess.run([sys.executable, "-I", "-c", code], capture_output=True, text=True, timeout=60)
    assert run.stdout.startswith("[0.5 0.5 0.5] ")
