"""NumPy's calls for the operations of a tape, and choices as NumPy is quick to make them.

``numpy.where`` allocates, and branches on every element. Here a condition becomes a mask of all bits or
none, once, and each choice by it a few operations on bits: the cost is the same whatever is chosen.
Four operations are added to those of the tape for it:

    mask    all bits where a condition holds, else none
    keep    (mask, a)       a, or 0
    blend   (mask, a, b)    a, or b
    code    a small integer, one of two, by a condition
"""

from __future__ import annotations

from .program import Program
from .tape import CONDITIONS, Node, Tape

_UFUNCS = {
    "add": "add",
    "sub": "subtract",
    "mul": "multiply",
    "div": "divide",
    "neg": "negative",
    "sqrt": "sqrt",
    "lt": "less",
    "le": "less_equal",
    "eq": "equal",
    "and": "logical_and",
    "or": "logical_or",
    "not": "logical_not",
}

NUMPY_NAMES = (*_UFUNCS.values(), "copyto", "bitwise_and", "bitwise_xor", "uint8")
"""What the code takes from NumPy; it also wants ``BITS``, the type of integers as wide as its numbers."""


def with_masks(program: Program) -> Program:
    """The program with every ``select`` in terms of masks; on truth values, in terms of logic."""
    tape, moved_to = Tape(), dict[int, int]()
    nodes = program.tape.nodes
    codes = {place for slot, place in program.outputs.items() if slot.array in program.codes}
    for place in program.needed():
        node = nodes[place]
        moved = node._replace(args=tuple(moved_to[arg] for arg in node.args))
        values = [nodes[arg].value for arg in node.args[1:] if nodes[arg].op == "constant"]
        if place in codes and node.op == "select" and len(values) == 2:
            moved_to[place] = tape.write(Node("code", moved.args[:1], tuple(map(int, values)))).place
        elif node.op == "select":
            is_truth = tape.nodes[moved.args[1]].op in CONDITIONS
            moved_to[place] = (_choose_truth if is_truth else _choose_number)(tape, *moved.args)
        else:
            moved_to[place] = tape.write(moved).place
    return program._replace(
        tape=tape, outputs={slot: moved_to[place] for slot, place in program.outputs.items()}
    )


def _choose_number(tape: Tape, condition: int, if_true: int, if_false: int) -> int:
    mask = tape.write(Node("mask", (condition,))).place
    if tape.nodes[if_false] == Node("constant", (), 0.0):
        return tape.write(Node("keep", (mask, if_true))).place
    return tape.write(Node("blend", (mask, if_true, if_false))).place


def _choose_truth(tape: Tape, condition: int, if_true: int, if_false: int) -> int:
    c, t, f = (tape.at(place) for place in (condition, if_true, if_false))
    return ((c & t) | (~c & f)).place


def statements(node: Node, operands: list[str], target: str) -> list[str]:
    """The calls that write the result of an operation to ``target``."""
    op = node.op
    if op == "code":
        return _code(operands[0], node.value, target)
    if op in _UFUNCS:
        return [f"{_UFUNCS[op]}({', '.join(operands)}, {target})"]
    bits = _as_bits(target)
    if op == "mask":
        return [f"copyto({bits}, {operands[0]})", f"negative({bits}, {bits})"]
    mask, *values = map(_as_bits, operands)
    if op == "keep":
        return [f"bitwise_and({values[0]}, {mask}, {bits})"]
    return [
        f"bitwise_xor({values[0]}, {values[1]}, {bits})",
        f"bitwise_and({bits}, {mask}, {bits})",
        f"bitwise_xor({bits}, {values[1]}, {bits})",
    ]


def _code(condition: str, values: tuple[int, int], target: str) -> list[str]:
    """A choice between two small integers, made in integers: for them the truth is 0 or 1."""
    if_true, if_false = values
    return [
        f"multiply({condition}.view(uint8), {(if_true - if_false) % 256}, {target})",
        f"add({target}, {if_false}, {target})",
    ]


def _as_bits(name: str) -> str:
    """The integers that share the memory of the numbers."""
    base, bracket, index = name.partition("[")
    if base[0] in "psk" and base[1:].isdigit():
        return f"{base}i{bracket}{index}"
    return f"{name}.view(BITS)"
