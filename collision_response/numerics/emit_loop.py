"""The source of a module for numba: a loop over problems, vectorized where they are ordinary.

The loop over an ordinary program has no branch, so that LLVM makes vectors of it. It reads rows that
it can index without a check, and writes to a small array at fixed distances, where nothing can
overlap; else the vectorizer would have to compare more pointers than it is willing to. What is not
ordinary is computed again, one problem at a time, by the general program.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from .emit_scalar import INFIX, emit_scalar
from .program import Program, Slot

CHUNK = 1024
_PITCH = CHUNK + 8
"""Distance of rows in the small array: not a power of two, or they compete for the same cache lines."""

_INDENT = " " * 12


def emit_loop(ordinary: Program, general: Program, number: str) -> str:
    """A module with ``batch(<arrays>)``; ``number`` is ``float64`` or ``float32``.

    The last output of ``ordinary`` says whether the others hold; they are those of ``general``.
    """
    constants: dict[str, str] = {}

    def literal(value: float) -> str:
        if number == "float64":
            return repr(value)
        if math.isnan(value):
            return "nan_32"
        return constants.setdefault(repr(value), f"k{len(constants)}")

    scalar = emit_scalar(general, "general", literal)
    loop = _loop(ordinary, general, number, literal)
    return "\n".join(
        [
            "# Written by collision_response.numerics.emit_loop.",
            "from math import inf, nan, sqrt",
            "",
            "import numpy as np",
            "from numba import njit, types",
            "",
            "nan_32 = np.float32(nan)",
            *(f"{name} = np.float32({value})" for value, name in constants.items()),
            "",
            "",
            '@njit(error_model="numpy", cache=True, no_cpython_wrapper=True, no_cfunc_wrapper=True)',
            scalar,
            "",
            f'@njit([types.void({", ".join(types_of(general, number))})], error_model="numpy", cache=True)',
            loop,
        ]
    )


def types_of(program: Program, number: str) -> list[str]:
    """The types of the arrays, in the order of :meth:`Program.arrays`; inputs may be read-only."""
    read = {slot.array for slot in program.inputs}
    dimensions = {slot.array: 2 if slot.lane is None else 3 for slot in [*program.inputs, *program.outputs]}
    return [
        f"types.Array(types.{'uint8' if name in program.codes else number}, {dimensions[name]}, 'C'"
        + (", readonly=True)" if name in read else ")")
        for name in program.arrays()
    ]


def _loop(ordinary: Program, general: Program, number: str, literal: Callable[[float], str]) -> str:
    flag, results = list(ordinary.outputs)[-1], list(ordinary.outputs)[:-1]
    uniform = [slot for slot in general.inputs if slot.array in ordinary.uniform]
    rows = [slot for slot in [*general.inputs, *results] if slot.array not in ordinary.uniform]
    places = [ordinary.outputs[slot] for slot in results]
    targets = [f"{slot.name}[t]" for slot in results]
    arguments = [
        slot.name if slot.array in ordinary.uniform else f"{slot.name}[t]" for slot in general.inputs
    ]
    return "\n".join(
        [
            f"def batch({', '.join(general.arrays())}):",
            f"    n = {results[-1].array}.shape[-1]",
            f"    work = np.empty({len(results) * _PITCH}, np.{number})",
            f"    ordinary = np.empty({CHUNK}, np.bool_)",
            *(f"    {slot.name} = {slot.array}[{slot.row}, 0]" for slot in uniform),
            f"    for start in range(0, n, {CHUNK}):",
            f"        stop = min(start + {CHUNK}, n)",
            *(f"        {slot.name} = {_row(slot)}" for slot in rows),
            "        all_ordinary = True",
            "        for t in range(stop - start):",
            *_straight(ordinary, literal),
            f"{_INDENT}ordinary[t] = {_name(ordinary, ordinary.outputs[flag], literal)}",
            f"{_INDENT}all_ordinary &= ordinary[t]",
            *(
                f"{_INDENT}work[{i * _PITCH} + t] = {_name(ordinary, place, literal)}"
                for i, place in enumerate(places)
            ),
            *(line for i, slot in enumerate(results) for line in _copied(i, slot)),
            "        if not all_ordinary:",
            "            for t in range(stop - start):",
            "                if not ordinary[t]:",
            f"                    {', '.join(targets)} = general({', '.join(arguments)})",
            "",
        ]
    )


def _row(slot: Slot) -> str:
    lane = "" if slot.lane is None else f", {slot.lane}"
    return f"{slot.array}[{slot.row}{lane}, start:stop]"


def _copied(i: int, slot: Slot) -> list[str]:
    return ["        for t in range(stop - start):", f"{_INDENT}{slot.name}[t] = work[{i * _PITCH} + t]"]


def _straight(program: Program, literal: Callable[[float], str]) -> list[str]:
    """One line an operation, both sides of every choice."""
    lines = []
    for place in program.in_order_of_demand():
        node = program.tape.nodes[place]
        operands = [_name(program, arg, literal) for arg in node.args]
        if node.op == "input" and node.value.array not in program.uniform:
            lines.append(f"{_INDENT}v{place} = {node.value.name}[t]")
        elif node.args:
            lines.append(f"{_INDENT}v{place} = {_FORMS[node.op].format(*operands)}")
    return lines


def _name(program: Program, place: int, literal: Callable[[float], str]) -> str:
    node = program.tape.nodes[place]
    if node.op == "input" and node.value.array in program.uniform:
        return str(node.value.name)
    if node.op == "truth":
        return repr(node.value)
    return literal(node.value) if node.op == "constant" else f"v{place}"


_FORMS = {
    **{op: f"{{0}} {sign} {{1}}" for op, sign in INFIX.items()},
    "and": "{0} & {1}",
    "or": "{0} | {1}",
    "not": "not {0}",
    "neg": "-{0}",
    "sqrt": "sqrt({0})",
    "select": "{1} if {0} else {2}",
}
