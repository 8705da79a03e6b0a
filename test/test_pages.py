"""The pages: links lead somewhere, and docs/scenes.md shows what the package computes. `make docs` checks the
generated site.
"""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from programs import run_python
from scene_cases import row_of_balls, speeds

from collision_response import Law

ROOT = Path(__file__).parent.parent
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("*.md"))]


def anchors(page: Path) -> set[str]:
    """The anchors of a page's headings, as GitHub and GitLab generate them."""
    without_code = re.sub(r"^```.*?^```", "", page.read_text(), flags=re.MULTILINE | re.DOTALL)
    headings = re.findall(r"^#+ (.*)$", without_code, flags=re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_every_link_leads_to_a_file_and_a_heading(page):
    links = re.findall(r"\]\(([\w./-]*)(?:#([\w-]+))?\)", page.read_text())
    lost = [
        f"{target}#{anchor}"
        for target, anchor in links
        if not (page.parent / target).exists()
        or (anchor and anchor not in anchors(page.parent / target if target else page))
    ]
    assert links
    assert lost == []


SCENES = (ROOT / "docs" / "scenes.md").read_text(encoding="utf-8")


NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:e[-+]?\d+)?")


def generated(name: str) -> str:
    (text,) = re.findall(rf"<!-- generated: {name} -->\n(.*?)<!-- end -->", SCENES, re.DOTALL)
    return text.strip()


def test_the_example_of_a_scene_prints_what_the_page_shows():
    code, _ = re.findall(r"```python\n(.*?)```", SCENES, re.DOTALL)
    run = run_python("-c", code)
    printed, shown = run.stdout.strip(), generated("example").strip("`\n")
    assert re.sub(r"\s+", " ", NUMBER.sub("", printed)) == re.sub(r"\s+", " ", NUMBER.sub("", shown))
    numbers = [list(map(float, NUMBER.findall(text))) for text in (printed, shown)]
    assert numbers[0] == pytest.approx(numbers[1], rel=1e-5, abs=1e-6)  # the digits that are printed


@pytest.mark.parametrize("line", generated("laws").splitlines()[2:])
def test_the_speeds_in_the_table_of_laws_are_right(line):
    name, *cells, _ = (cell.strip() for cell in line.strip("|").split("|"))
    law = Law[name.split("`")[1]]
    options = {"exponent": float(name.rpartition(" ")[2])} if "exponent" in name else {}
    for cell, (count, e) in zip(cells, ((3, 1.0), (3, 0.5), (5, 1.0)), strict=True):
        answer = row_of_balls((1, *[0] * (count - 1)), e, number=float).resolve(law, options=options)
        assert speeds(answer) == pytest.approx(list(map(float, cell.split(", "))), abs=5.1e-5)


def test_the_example_of_many_scenes_prints_what_the_page_shows():
    _, code = re.findall(r"```python\n(.*?)```", SCENES, re.DOTALL)
    run = run_python("-c", code)
    assert run.stdout.startswith("[0.5 0.5 0.5] ")
