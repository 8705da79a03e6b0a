"""Python code for a program: one problem, plain floats, a branch where the formula has one.

What only one side of a branch needs is computed inside it, so a division by zero that the formula
avoids is avoided here too. The same source compiles with numba.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable
from typing import NamedTuple

from .program import Program
from .tape import Node

INFIX = {
    "add": "+",
    "sub": "-",
    "mul": "*",
    "div": "/",
    "lt": "<",
    "le": "<=",
    "eq": "==",
    "and": "and",
    "or": "or",
}
_LEAVES = ("input", "constant", "truth")
_DEEPEST = 12
"""Longer expressions are cut: Python's parser has a limit to nesting."""


class _Scope(NamedTuple):
    """A point of the code.

    Attributes:
        names: the variables of the results so far.
        known: the conditions of the branches around it, as they were decided.
    """

    names: dict[int, str]
    known: dict[int, bool]
    indent: str

    def inside(self, condition: int, holds: bool) -> _Scope:
        return _Scope(dict(self.names), {**self.known, condition: holds}, self.indent + "    ")


def emit_scalar(program: Program, name: str = "kernel", literal: Callable[[float], str] = repr) -> str:
    """``def name(<inputs>)``, which returns the outputs as a tuple, both in the order of the program.

    It wants ``inf``, ``nan`` and ``sqrt`` of :mod:`math`, and what ``literal`` writes for a number.
    """
    lines, results = emit_body(program, literal)
    inputs = ", ".join(slot.name for slot in program.inputs)
    return "\n".join([f"def {name}({inputs}):", *lines, f"    return ({', '.join(results)},)", ""])


def emit_body(program: Program, literal: Callable[[float], str] = repr) -> tuple[list[str], list[str]]:
    """The lines that compute, indented, and an expression for each output."""
    emitter = _Emitter(program, literal)
    scope = _Scope({}, {}, "    ")
    results = list(program.outputs.values())
    emitter.compute(results, scope)
    return emitter.lines, [emitter.expression(place, scope) for place in results]


class _Emitter:
    def __init__(self, program: Program, literal: Callable[[float], str]) -> None:
        self.literal = literal
        self.nodes = program.tape.nodes
        self.lines: list[str] = []
        self.open_branches = 0
        self.depends_on: dict[int, int] = {}
        """All that a result depends on, itself included, one bit a place."""
        self.named: set[int] = set()
        """The operations whose results get variables; the others are written where they are read."""
        needed = program.needed()
        readers = Counter(arg for place in needed for arg in set(self.nodes[place].args))
        readers.update(program.outputs.values())
        depth: dict[int, int] = {}
        for place in needed:
            node = self.nodes[place]
            self.depends_on[place] = _bits([place])
            for arg in node.args:
                self.depends_on[place] |= self.depends_on[arg]
            depth[place] = 1 + max((depth[arg] for arg in node.args), default=0)
            if node.op not in _LEAVES and (
                node.op == "select" or readers[place] > 1 or depth[place] > _DEEPEST
            ):
                self.named.add(place)
                depth[place] = 0

    def compute(self, results: Iterable[int], scope: _Scope) -> None:
        """Write all that is needed to express these results, unless only one side of a branch needs it."""
        region = self._unconditional(results, scope)
        for place in region:
            self._settle(place, region, scope)

    def expression(self, place: int, scope: _Scope) -> str:
        """A result as an expression of variables and inputs."""
        node = self.nodes[place]
        if place in scope.names:
            return scope.names[place]
        if node.op == "select":
            return self.expression(self._decided(node, scope), scope)
        if node.op == "input":
            return str(node.value.name)
        if node.op in _LEAVES:
            return repr(node.value) if node.op == "truth" else self.literal(node.value)
        operands = [self.expression(arg, scope) for arg in node.args]
        if node.op in INFIX:
            return f"({operands[0]} {INFIX[node.op]} {operands[1]})"
        return {"neg": "(-{})", "not": "(not {})", "sqrt": "sqrt({})"}[node.op].format(*operands)

    def _unconditional(self, results: Iterable[int], scope: _Scope) -> list[int]:
        found: set[int] = set()
        waiting = list(results)
        while waiting:
            place = waiting.pop()
            if place not in found and place not in scope.names:
                found.add(place)
                node = self.nodes[place]
                waiting.extend(node.args if node.op != "select" else self._certain(node, scope))
        return sorted(found)

    def _settle(self, place: int, region: list[int], scope: _Scope) -> None:
        if place not in self.named or place in scope.names:
            return
        node = self.nodes[place]
        if node.op == "select" and node.args[0] not in scope.known:
            self._branch(self._decided_with(place, region, scope), region, scope)
        else:
            self._assign(place, place, scope, scope)

    def _certain(self, choice: Node, scope: _Scope) -> tuple[int, ...]:
        """What a choice needs whatever its condition; all it needs, where that is known."""
        return (self._decided(choice, scope),) if choice.args[0] in scope.known else choice.args[:1]

    def _decided(self, choice: Node, scope: _Scope) -> int:
        return choice.args[1 if scope.known[choice.args[0]] else 2]

    def _decided_with(self, place: int, region: list[int], scope: _Scope) -> list[int]:
        """The choices to make in the branch of ``place``: by its condition, none dependent on another."""
        together = [place]
        condition = self.nodes[place].args[0]
        for other in region:
            node = self.nodes[other]
            is_alike = node.op == "select" and node.args[0] == condition and other not in scope.names
            if is_alike and not self.depends_on[other] & (_bits(together) | self.open_branches):
                together.append(other)
        return together

    def _branch(self, choices: list[int], region: list[int], scope: _Scope) -> None:
        was_open, self.open_branches = self.open_branches, self.open_branches | _bits(choices)
        sides = [[self.nodes[choice].args[side] for choice in choices] for side in (1, 2)]
        read = 0
        for place in sides[0] + sides[1]:
            read |= self.depends_on[place]
        for place in region:
            if read >> place & 1:
                self._settle(place, region, scope)
        self.open_branches = was_open
        condition = self.nodes[choices[0]].args[0]
        heads = f"if {self.expression(condition, scope)}:", "else:"
        for holds, head, results in zip((True, False), heads, sides, strict=True):
            inner = scope.inside(condition, holds)
            self.lines.append(scope.indent + head)
            self.compute(results, inner)
            for choice, result in zip(choices, results, strict=True):
                self._assign(choice, result, inner, scope)

    def _assign(self, place: int, result: int, inside: _Scope, outside: _Scope) -> None:
        """Give ``place`` the value of ``result``, known inside; its variable is known outside."""
        value = self.expression(result, inside)
        outside.names[place] = f"v{place}"
        self.lines.append(f"{inside.indent}v{place} = {value}")


def _bits(places: Iterable[int]) -> int:
    return sum(1 << place for place in places)
