"""Which C++ type each number of a tape has.

Not every result needs all that a number of type ``N`` carries, so each number has one of three types:

    BOUNDED   ``N``           the number with its error bound
    VALUE     ``Value<N>``    the same number without its error bound
    REPORT    ``Report<N>``   the number rounded to its base, float or double
"""

from __future__ import annotations

from collections.abc import Iterable
from enum import IntEnum

from .symbol import CONDITIONS, Loop, Node, Tape


class CppType(IntEnum):
    """The C++ type of a number. A greater member carries more, and can be cast to a lesser one."""

    REPORT = 0
    VALUE = 1
    BOUNDED = 2


def needed_types(tape: Tape, wanted: Iterable[tuple[int, CppType]]) -> dict[int, CppType]:
    """For each operation that the wanted results depend on: the type that its result must have."""
    types: dict[int, CppType] = {}

    def need(index: int, cpp_type: CppType) -> None:
        types[index] = max(types.get(index, CppType.REPORT), cpp_type)

    for index, cpp_type in wanted:
        need(index, cpp_type)
    for index in range(len(tape.nodes) - 1, -1, -1):
        if index not in types:
            continue
        node, cpp_type = tape.nodes[index], types[index]
        if node.op == "certain":
            need(node.args[0], min(cpp_type, CppType.VALUE))
        elif node.op == "error_of":
            need(node.args[0], CppType.BOUNDED)
        elif node.op in ("call", "result"):
            types[index] = CppType.BOUNDED
            for arg in node.args:
                need(arg, CppType.BOUNDED)
        elif node.op == "widened":
            need(node.args[0], cpp_type)
            if cpp_type is CppType.BOUNDED:
                need(node.args[1], CppType.VALUE)
        elif node.op == "loop":
            body_types, state_types = types_in_loop(tape, types, index)
            loop: Loop = node.value
            for part in _parts(tape, types, index):
                types[part] = state_types[tape.nodes[part].value]
            for arg, state_type in zip(node.args, state_types, strict=True):
                need(arg, state_type)
            for inner, inner_type in body_types.items():
                if loop.tape.nodes[inner].op == "outer":
                    need(loop.tape.nodes[inner].value, inner_type)
        else:
            in_differentiated_loop = tape.of_derivatives and tape.parent is not None
            sources = _sources(node) if in_differentiated_loop else node.args
            for arg in node.args:
                need(arg, cpp_type if arg in sources else CppType.REPORT)
    return types


def _parts(tape: Tape, indices: Iterable[int], loop: int) -> list[int]:
    """Return those of ``indices`` that are parts of the result of ``loop``."""
    nodes = tape.nodes
    return [index for index in indices if nodes[index].op == "part" and nodes[index].args[0] == loop]


def types_in_loop(
    tape: Tape, types: dict[int, CppType], index: int
) -> tuple[dict[int, CppType], list[CppType]]:
    """Return the types of the operations in the body of a loop, and of the parts of its state.

    Where numbers carry derivatives, one in a loop has the type VALUE if the result needs its derivatives,
    else REPORT.
    """
    loop: Loop = tape.nodes[index].value
    nodes, least = loop.tape.nodes, least_type_in_loop(tape, loop)
    state_types = [least for _ in loop.state_after]
    for part in _parts(tape, types, index):
        state_types[tape.nodes[part].value] = max(least, min(types[part], CppType.VALUE))
    if loop.rounded and not tape.of_derivatives:  # all numbers have the type REPORT
        return needed_types(loop.tape, [(i, least) for i in (loop.condition, *loop.state_after)]), state_types
    while True:
        wanted = zip(loop.state_after, state_types, strict=True)
        body_types = needed_types(loop.tape, [(loop.condition, least), *wanted])
        before = list(state_types)
        for inner, inner_type in body_types.items():
            if nodes[inner].op == "state":
                state_types[nodes[inner].value] = max(state_types[nodes[inner].value], inner_type)
        if state_types == before:
            break
    for inner in sorted(body_types) if tape.of_derivatives else ():
        may_vary = nodes[inner].op in ("state", "outer")
        if not may_vary and all(body_types[arg] is least for arg in _sources(nodes[inner])):
            body_types[inner] = least
    return body_types, state_types


def least_type_in_loop(tape: Tape, loop: Loop) -> CppType:
    """Return the type of a number in a loop whose derivatives are not needed."""
    return CppType.REPORT if tape.of_derivatives or loop.rounded else CppType.VALUE


def _sources(node: Node) -> tuple[int, ...]:
    """The operands on whose derivatives those of the result depend, in the body of a loop."""
    if node.op in CONDITIONS:
        return ()
    return node.args[1:] if node.op in ("select", "varying_as") else node.args
