"""Sphinx configuration of the reference site, for `make docs` and for rosdoc2 (the ROS index).

The pages are Markdown that can be read without the site. This file adds the README as the first page, the
interface files, the API from its docstrings, and every file of the repository that a page links to. It writes
all of these next to the pages, so Sphinx must work on a copy of this folder, as `make docs` and rosdoc2 do.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import Any

from pygments.lexers import find_lexer_class_for_filename
from sphinx.ext.napoleon import Config, GoogleDocstring

HERE = Path(__file__).parent
ROOT = next(path for path in [*HERE.parents, *map(Path, sys.path)] if (path / "package.xml").exists())
sys.path.insert(0, str(ROOT))

project = "collision_response"
copyright = "the contributors of collision_response"
release = (ROOT / "package.xml").read_text().partition("<version>")[2].partition("</version>")[0]
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.mathjax", "sphinx.ext.viewcode"]
# index.rst includes the README. The others are added by rosdoc2; this site has them elsewhere.
exclude_patterns = ["README.md", "CONTRIBUTING.md", "CHANGELOG.rst", "__*", "msg", "srv"]
html_theme = "sphinx_rtd_theme"
html_show_sourcelink = False
html_static_path = ["_static"]
html_css_files = ["site.css"]
myst_enable_extensions = ["dollarmath"]
myst_fence_as_directive = ["math"]
myst_heading_anchors = 4
autodoc_member_order = "bysource"
autodoc_typehints_format = "short"
# The source is read without a build: some of these modules are made by the build, the others are not needed.
autodoc_mock_imports = [
    *(f"collision_response.kernels.{name}" for name in ("_compiled", "_derivatives")),
    *("collision_response.msg", "collision_response.srv"),
    *("builtin_interfaces", "geometry_msgs", "pyarrow", "rcl_interfaces", "rclpy", "rerun", "std_msgs"),
]

API = {
    "collision_response": "One impact, and several at once",
    "collision_response.physics.mass_properties": "Mass and inertia of solids",
    "collision_response.physics.restitution": "Restitution by speed",
    "collision_response.physics.combine": "Coefficients of two bodies",
    "collision_response.physics.stiffness": "Stiffness, for COMPLIANT",
    "collision_response.materials": "Materials",
    "collision_response.batch": "Batches",
    "collision_response.derivatives": "Derivatives",
    "collision_response.identify": "Coefficients from measurements",
    "collision_response.recording": "Recording",
    "collision_response.recording.table": "Recordings as tables",
    "collision_response.ros.batch_client": "Clients of batches",
    "collision_response.ros.scene_client": "Clients of scenes",
}
PAGES = {ROOT / "README.md": "index.rst", ROOT / "CONTRIBUTING.md": "contributing.md"} | {
    path: path.name for path in (ROOT / "docs").glob("*.md")
}
INTERFACES = {path: sorted(path.iterdir()) for path in (ROOT / "srv", ROOT / "msg")}


def in_site(path: Path) -> str:
    """Path in the site of a file or folder of the repository."""
    if path in PAGES:
        return PAGES[path]
    if path in INTERFACES:
        return "interfaces.md"
    if path.parent in INTERFACES:
        return f"interfaces.md#{path.stem.lower()}"
    if path.is_relative_to(ROOT / "docs"):
        return str(path.relative_to(ROOT / "docs"))
    return f"/{source_page(path)}"


def for_site(page: Path, text: str) -> str:
    """Text of a page with links to pages of the site, and with formulas in the syntax of MyST."""

    def site_link(link: re.Match[str]) -> str:
        target = (page.parent / link[1]).resolve()
        return f"]({in_site(target)}{link[2] or ''})" if target.exists() else link[0]  # Sphinx warns about it

    return re.sub(r"\$`(.+?)`\$", r"$\1$", re.sub(r"\]\(([\w./-]+)(#[\w-]+)?\)", site_link, text))


def source_page(path: Path) -> Path:
    """Path of a page that shows a file or lists a folder."""
    name = path.relative_to(ROOT)
    page = Path("source", f"{name}.md")
    if not (HERE / page).exists():
        write(page, "")  # in case the page links to itself
        if path.is_dir():
            files = sorted(file for file in path.iterdir() if file.is_file())
            text = "\n".join(f"* [{file.name}](/{source_page(file)})" for file in files)
        else:
            text = code(path)
        write(page, f"---\norphan: true\n---\n\n# {name}\n\n{text}\n")
    return page


def code(path: Path) -> str:
    """A code block with a file, highlighted by the language of its extension."""
    lexer = find_lexer_class_for_filename(path.name)
    language = lexer.aliases[0] if lexer else "python"  # interfaces have the same comments and numbers
    return f"``````{{code-block}} {language}\n:force:\n\n{path.read_text()}``````\n"


def write(name: Path | str, text: str) -> None:
    path = HERE / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text)


def write_pages(*_: Any) -> None:
    """Write all pages that are not in this folder."""
    for page in PAGES:
        for_site(page, page.read_text())  # writes the pages of the files that it links to
    for page, name in ((ROOT / "README.md", "README.md"), (ROOT / "CONTRIBUTING.md", "contributing.md")):
        write(name, for_site(page, page.read_text()))
    write("changelog.rst", (ROOT / "CHANGELOG.rst").read_text())
    parts = [f"## {path.stem}\n\n{code(path)}" for files in INTERFACES.values() for path in files]
    write("interfaces.md", "\n".join(["# Messages and services\n", *parts]))
    for module, what in API.items():
        write(f"api/{module}.rst", f"{what}\n{'=' * len(what)}\n\n.. automodule:: {module}\n   :members:\n")


def read_page(_: Any, name: str, content: list[str]) -> None:
    page = ROOT / "docs" / f"{name}.md"
    if page in PAGES:
        content[0] = for_site(page, content[0])


def as_sphinx_reads(app: Any, what: str, name: str, member: object, options: Any, lines: list[str]) -> None:
    """Convert docstrings: sections to Sphinx syntax, and indented formulas of a module to literal blocks."""
    kind = "" if what == "attribute" else what  # otherwise their first colon would end a type
    text = str(GoogleDocstring(lines, Config(napoleon_use_ivar=True), app, kind, name, member, options))
    if what == "module":
        formulas = r"^(\S.*(?<!::)\n\n)(?= {4}(?!>>>))"
        text = re.sub(formulas, r"\1.. code-block:: text\n\n", text, flags=re.MULTILINE)
    lines[:] = text.split("\n")


def is_left_out(_: Any, __: str, ___: str, member: object, skip: bool, ____: Any) -> bool:
    """Whether to skip a member: fields of named tuples are documented by their class."""
    return skip or type(member).__name__ == "_tuplegetter"


def setup(app: Any) -> None:
    app.connect("builder-inited", write_pages)
    app.connect("source-read", read_page)
    app.connect("autodoc-process-docstring", as_sphinx_reads)
    app.connect("autodoc-skip-member", is_left_out)
