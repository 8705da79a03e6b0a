"""Which operations of a tape stand in an ``if``.

What only one branch of a choice needs may stand in an ``if``, which is entered if any lane of the vectors may
take that branch. The results are the same to the bit.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import TypeAlias

from .symbol import CONSTANTS, Tape

Guard: TypeAlias = frozenset[tuple[int, bool]]
"""When an operation is needed: only if each of these conditions may have this value."""

ALWAYS: Guard = frozenset()

LEAST_SAVING = 12
"""How many additions an ``if`` must save to be worth it."""

LEAST_SAVING_IN_VECTORS = 80
"""The same for kernels that run on vectors of plain numbers only: additions are cheap there, and the lanes of
a vector rarely all take the same branch."""


def compute_guards(
    tape: Tape, needed: Iterable[int], results: Iterable[int], least_saving: int = LEAST_SAVING
) -> dict[int, Guard]:
    """Find when each operation is needed, by conditions that save at least ``least_saving`` additions.

    Args:
        tape: the tape.
        needed: the operations.
        results: those of them that are always needed.
        least_saving: how many additions an ``if`` must save to be written.
    """
    guards: dict[int, Guard] = dict.fromkeys(results, ALWAYS)

    def need(index: int, guard: Guard) -> None:
        guards[index] = guards[index] & guard if index in guards else guard

    for index in sorted(needed, reverse=True):
        node, guard = tape.nodes[index], guards[index]
        if node.op == "select":
            condition, is_negated = without_negation(tape, node.args[0])
            need(node.args[0], guard)
            need(node.args[1], guard | {(condition, not is_negated)})
            need(node.args[2], guard | {(condition, is_negated)})
        else:
            for operand in node.operands():
                need(operand, guard)
    saved: dict[tuple[int, bool], int] = {}
    for index, guard in guards.items():
        for literal in guard:
            saved[literal] = saved.get(literal, 0) + _WEIGHTS.get(tape.nodes[index].op, 1)
    return {index: frozenset(x for x in guard if saved[x] >= least_saving) for index, guard in guards.items()}


_WEIGHTS = {"div": 6, "sqrt": 6, "loop": 100, "call": 100}
_WEIGHTS |= dict.fromkeys(("input", *CONSTANTS, "part", "result", "neg"), 0)


def without_negation(tape: Tape, condition: int) -> tuple[int, bool]:
    """A condition without its negation, and whether it was negated."""
    node = tape.nodes[condition]
    return (node.args[0], True) if node.op == "not" else (condition, False)
