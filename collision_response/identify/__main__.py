"""``python -m collision_response.identify FILE``: fit coefficients to a table or a recording."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ..status import ImpactError
from . import from_table
from .compare import Comparison, compare
from .identification import FITTED_LAWS, Identification, identify
from .least_squares import LOSSES, SEARCH_RANGES
from .measurements import Measurements
from .plot import draw

LAWS_BY_NAME = {law.name.lower(): law for law in FITTED_LAWS}

OF_READINGS = "speed", "radius", "errors"
"""The options for readings of a sphere."""

WITHIN = 0.05
"""Default of ``--within`` [s]."""

EXPECTED_ERRORS = ImpactError, ImportError, OSError, ValueError


def make_parser() -> argparse.ArgumentParser:
    """Return the parser of the command line."""
    parser = argparse.ArgumentParser(
        prog="collision_response identify",
        usage="collision_response identify FILE [OPTION ...]",
        description="Restitution and friction from measured impacts.",
        epilog=(from_table.__doc__ or "").replace("``", ""),
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    add = parser.add_argument
    several: dict[str, Any] = {"nargs": "+", "action": "extend", "default": []}
    pairs: dict[str, Any] = {**several, "metavar": "NAME=VALUE"}
    add("file", type=Path, help="CSV, its columns explained below; or a recording, .rrd")
    add("--law", choices=LAWS_BY_NAME, help="default: coulomb")
    add("--compare", action="store_true", help="fit all laws, and say which the impacts distinguish")
    usual = "default: restitution, and friction if the law has it"
    add("--fit", metavar="NAME", help=f"coefficients: {', '.join(SEARCH_RANGES)}; {usual}", **several)
    add("--given", help="coefficients that are known: they are not fitted", type=_number, **pairs)
    columns = "columns that the file lacks: a number, or another column: nz=1 vx_after=vx2"
    add("--set", help=columns, type=_pair, **pairs)
    add(
        "--residuals",
        default="",
        help="kinetic, contact or linear; for readings: all, or one; default: the first",
    )
    add("--loss", default="soft_l1", help=f"{', '.join(LOSSES)}; default: soft_l1")
    add("--resamples", type=int, default=200, help="fits of the bootstrap; default: 200")
    add("--plot", type=Path, metavar="FILE", help="write a picture: .png, .svg or .pdf")
    add(
        "--within",
        type=float,
        metavar="SECONDS",
        help="for a recording: a state received within this time after an impact is the measurement; "
        f"0: the node's answer is; default: {WITHIN}",
    )
    add = parser.add_argument_group("readings of a sphere").add_argument
    add("--speed", type=float, help="speed before the impact [m/s]")
    add("--radius", type=float, help="radius of the sphere [m]")
    errors = "errors of the readings: ratio=0.01 angle=1 (degrees) spin=40 (rad/s)"
    add("--errors", help=errors, type=_number, **pairs)
    return parser


def main(argv: Sequence[str] | None = None) -> int:
    """Fit the coefficients, print and draw the result, and return the exit status."""
    parser = make_parser()
    arguments = parser.parse_args(argv)
    if arguments.compare and (arguments.plot or arguments.law):
        parser.error("--compare is for all laws: not with --plot or --law, which are for one")
    law = LAWS_BY_NAME[arguments.law or "coulomb"]
    options = {"kind": arguments.residuals, "loss": arguments.loss, "resamples": arguments.resamples}
    try:
        given = _by_name("--given", arguments.given)
        measured = read(arguments)
        found: Comparison | Identification = (
            compare(measured, given=given, fit=arguments.fit, **options)
            if arguments.compare
            else identify(measured, law, arguments.fit, given, **options)
        )
    except EXPECTED_ERRORS as error:
        return _failed(arguments.file, error)
    print(found)
    if arguments.plot and isinstance(found, Identification):
        try:
            draw(found, measured, arguments.plot)
        except EXPECTED_ERRORS as error:
            return _failed(arguments.plot, error)
    return 0


def _failed(file: object, error: Exception) -> int:
    if isinstance(error, ImportError):  # it says what to install
        print(error, file=sys.stderr)
        return os.EX_UNAVAILABLE
    if isinstance(error, ImpactError):
        options = {name: f"--{name}" for name in ("fit", "given", "loss", "resamples")}
        error = error.renamed({"kind": "--residuals", **options})
    code = f" ({error.code.name})" if isinstance(error, ImpactError) else ""
    reason = getattr(error, "strerror", None) or " ".join(str(error).split())  # strerror names no file
    is_word = str(file) == Path(str(file)).stem  # which may be in the reason by chance
    where = "" if str(file) in reason and not is_word else f"{file}: "
    print(f"collision_response identify: {where}{reason}{code}", file=sys.stderr)
    return 2


def read(arguments: argparse.Namespace) -> Measurements:
    """Read the file of impacts that the command line names. Raises ``EXPECTED_ERRORS``."""
    if arguments.file.suffix == ".rrd":
        from .from_recording import read_impacts

        _refuse_options("a table, not for a recording", arguments, "set", *OF_READINGS)
        within = WITHIN if arguments.within is None else arguments.within
        measured, of_mechanisms = read_impacts(arguments.file, within)
        if of_mechanisms:
            print(f"{arguments.file}: left out: {of_mechanisms} impacts of mechanisms", file=sys.stderr)
        return measured
    _refuse_options("a recording, not for a table", arguments, "within")
    rows, unused = from_table.read_rows(arguments.file, _by_name("--set", arguments.set))
    if "incidence" not in rows[0]:
        _refuse_options("readings of a sphere: there is no column incidence", arguments, *OF_READINGS)
    unused += from_table.unused_columns(rows[0])
    if unused:
        print(f"{arguments.file}: columns that are left out: {', '.join(unused)}", file=sys.stderr)
    if "incidence" not in rows[0]:
        return from_table.impacts_from_rows(rows)
    if arguments.speed is None or arguments.radius is None:
        raise ValueError("readings of a sphere need --speed, --radius and --errors")
    errors = _by_name("--errors", arguments.errors)
    return from_table.readings_from_rows(rows, arguments.speed, arguments.radius, errors)


def _refuse_options(what_for: str, arguments: argparse.Namespace, *names: str) -> None:
    given = [name for name in names if getattr(arguments, name) not in (None, [])]
    if given:
        raise ValueError(f"--{', --'.join(given)}: for {what_for}")


def _by_name(option: str, pairs: Sequence[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) < len(pairs):
        raise ValueError(f"{option}: a name is there twice: {', '.join(name for name, _ in pairs)}")
    return found


def _pair(text: str) -> tuple[str, str]:
    name, equals, value = text.partition("=")
    if not equals:
        raise argparse.ArgumentTypeError(f"must be NAME=VALUE, is {text!r}")
    return name, value


def _number(text: str) -> tuple[str, float]:
    name, value = _pair(text)
    try:
        return name, float(value)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{name} must be a number, is {value!r}") from None


if __name__ == "__main__":
    raise SystemExit(main())
