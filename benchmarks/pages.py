"""Writes generated tables into the pages, and results into JSON files."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parent.parent
DOCS = ROOT / "docs"
RESULTS = ROOT / "benchmarks" / "results"


def rewrite(page: Path, parts: dict[str, str]) -> None:
    """Replace the generated parts of a page.

    Args:
        page: the page, with ``<!-- generated: NAME -->`` and ``<!-- end -->`` around each part.
        parts: the new texts by name.

    Raises:
        ValueError: if the page has no place for a part.
    """
    text = page.read_text()
    for name, part in parts.items():
        pattern = re.compile(rf"(<!-- generated: {name} -->\n).*?(<!-- end -->)", re.DOTALL)
        if not pattern.search(text):
            raise ValueError(f"{page.name} has no place for {name!r}")
        text = pattern.sub(lambda match, part=part: f"{match[1]}\n{part}\n\n{match[2]}", text)
    page.write_text(text)


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A Markdown table."""
    return "\n".join(f"| {' | '.join(cells)} |" for cells in (head, ["---"] * len(head), *rows))


def store(results: dict[str, Any], path: Path) -> None:
    """Write results as JSON, with three digits: enough to read, and fewer changes between runs."""
    path.parent.mkdir(exist_ok=True)
    path.write_text(_compact(_rounded(results)) + "\n", encoding="utf-8")
    print(f"==> wrote {path.relative_to(ROOT)}")


def _rounded(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _rounded(part) for key, part in value.items()}
    if isinstance(value, (list, tuple)):
        return [_rounded(part) for part in value]
    return float(f"{value:.3g}") if isinstance(value, float) else value


def _compact(value: Any, indent: str = "") -> str:
    """JSON text in which every part that fits in one line is on one line."""
    line = json.dumps(value, ensure_ascii=False)
    if len(indent) + len(line) <= 200 or not isinstance(value, (dict, list)):
        return line
    inner = indent + " "
    if isinstance(value, dict):
        parts = [f"{inner}{json.dumps(key)}: {_compact(part, inner)}" for key, part in value.items()]
    else:
        parts = [inner + _compact(part, inner) for part in value]
    opening, closing = "{}" if isinstance(value, dict) else "[]"
    return f"{opening}\n" + ",\n".join(parts) + f"\n{indent}{closing}"


def significant(value: float, digits: int = 2) -> str:
    """Text of a number with some significant digits, without an exponent."""
    rounded = float(f"{value:.{digits}g}" if value < 100 else f"{value:.3g}")
    return f"{rounded:,.0f}" if rounded >= 100 or (rounded >= 10 and digits < 3) else f"{rounded:g}"


def power(error: float, least: float = 0.0) -> str:
    """Text of a number with one digit, with an exponent if that is shorter."""
    if error <= least:
        return "0"
    if error == float("inf"):
        return "∞"
    if 0.01 <= error < 1:
        return f"{error:.1g}"
    return f"{error:.0f}" if 1 <= error < 100 else f"{error:.0e}".replace("e-0", "e-").replace("e+0", "e")


def times(found: dict[str, float], in_a_second: float = 1.0, digits: int = 2) -> str:
    """Text of median, minimum and maximum."""
    least, middle, most = (significant(found[key] * in_a_second, digits) for key in ("min", "median", "max"))
    return f"**{middle}** ({least} … {most})"
