"""Vectorise a tape over the two bodies: numbers of body_a and body_b share the two lanes of a SIMD vector.

An operation, and the one that it becomes when the bodies are exchanged, are written as one operation on pairs
of numbers. The results stay the same to the bit. The C++ side is ``simd_pairs.hpp``.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

from .symbol import Loop, Node, Symbol, Tape

PAIR = "pair"
"""The value of a node whose result is a pair."""

_ON_PAIRS = frozenset(
    {"input", "add", "sub", "mul", "div", "neg", "sqrt", "lt", "le", "eq", "and", "or", "not", "select"}
)


def pair_bodies(results: Iterable[Iterable[Symbol]]) -> list[list[Symbol]]:
    """Return the same results on a new tape, on which as much as possible is computed on pairs.

    The new tape has further operations. ``join`` (two numbers), ``both`` (one number, twice) and ``swapped``
    (a pair) give a pair. ``first`` and ``second`` (of a pair) give a single number.
    """
    groups = [list(group) for group in results]
    old, new = groups[0][0].tape, Tape()
    partners = _partners(old, old.needed_for(x.index for group in groups for x in group))
    translated: dict[int, int] = {}

    def add(op: str, *args: int, value: object = None) -> int:
        return new.add(Node(op, args, value)).index

    def is_paired(index: int) -> bool:
        node, partner = old.nodes[index], old.nodes[partners.get(index, index)]
        is_symmetric = partner.args == tuple(partners.get(arg, arg) for arg in node.args)
        return index in partners and is_symmetric and node.op in _ON_PAIRS

    def single(index: int) -> int:
        if not is_paired(index):
            return translate(index)
        return add("first" if index < partners[index] else "second", translate(index))

    def pair(index: int) -> int:
        if index not in partners:
            return add("both", translate(index), value=PAIR)
        if not is_paired(index):
            return add("join", translate(index), translate(partners[index]), value=PAIR)
        result = translate(index)
        return result if index < partners[index] else add("swapped", result, value=PAIR)

    def translate(index: int) -> int:
        if is_paired(index):
            index = min(index, partners[index])
        if index not in translated:
            node = old.nodes[index]
            if not is_paired(index):
                value = _translated_loop(node.value, new, single) if node.op == "loop" else node.value
                translated[index] = add(node.op, *map(single, node.args), value=value)
            elif node.op == "input":
                inputs = (add("input", value=old.nodes[one].value) for one in (index, partners[index]))
                translated[index] = add("join", *inputs, value=PAIR)
            else:
                translated[index] = add(node.op, *map(pair, node.args), value=PAIR)
        return translated[index]

    return [[Symbol(new, single(x.index)) for x in group] for group in groups]


def _translated_loop(loop: Loop, parent: Tape, index_of: Callable[[int], int]) -> Loop:
    """The loop on another parent tape, where ``index_of`` says which index a number has."""
    body = Tape(parent=parent)
    for node in loop.tape.nodes:
        body.add(node._replace(value=index_of(node.value)) if node.op == "outer" else node)
    return loop._replace(tape=body)


def _partners(tape: Tape, needed: set[int]) -> dict[int, int]:
    """For each operation: the other one that it becomes when the bodies are exchanged, if that is needed."""
    partners: dict[int, int] = {}
    for index in sorted(needed):
        node = tape.nodes[index]
        value = node.value
        if node.op == "input":
            owner, _, name = str(value).partition(".")
            value = f"{_OTHER_BODY.get(owner, owner)}.{name}"
        partner = tape.index_of(node.op, [partners.get(arg, arg) for arg in node.args], value)
        if partner in needed and partner != index:
            partners[index] = partner
    return {index: partner for index, partner in partners.items() if partners.get(partner) == index}


_OTHER_BODY = {"body_a": "body_b", "body_b": "body_a"}
