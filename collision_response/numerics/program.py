"""A traced formula with its ends: which numbers it takes, and where its results go."""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from ..physics.number import choose, square_root
from .tape import Node, Tape, ordered


class Slot(NamedTuple):
    """One number of a row of an array.

    Attributes:
        array: the name of the array.
        row: which of its rows.
        lane: 0 or 1 where a row holds a number for each of two alike things, else ``None``.
    """

    array: str
    row: int
    lane: int | None = None

    @property
    def name(self) -> str:
        """As an identifier."""
        return f"{self.array}_{self.row}" + ("" if self.lane is None else "ab"[self.lane])

    def other_lane(self) -> Slot:
        """The slot of the other of the two; of what they share, the same."""
        return self if self.lane is None else self._replace(lane=1 - self.lane)


class Program(NamedTuple):
    """What a formula computes.

    Attributes:
        inputs: the slots it reads, in the order in which a scalar form takes them.
        outputs: the places on the tape of its results.
        codes: the arrays of results that are kept as small integers.
        uniform: the arrays whose rows hold one number for all problems.
    """

    tape: Tape
    inputs: tuple[Slot, ...]
    outputs: dict[Slot, int]
    codes: frozenset[str] = frozenset()
    uniform: frozenset[str] = frozenset()

    def arrays(self) -> list[str]:
        """The names of its arrays: inputs, then outputs."""
        return list(dict.fromkeys(slot.array for slot in [*self.inputs, *self.outputs]))

    def shape(self, array: str, n: int) -> tuple[int, ...]:
        """The shape of one of them for ``n`` problems."""
        slots = [slot for slot in [*self.inputs, *self.outputs] if slot.array == array]
        rows = 1 + max(slot.row for slot in slots)
        if array in self.uniform:
            return (rows, 1)
        return (rows, n) if slots[0].lane is None else (rows, 2, n)

    def needed(self) -> list[int]:
        """The places of all that the outputs depend on, operands first."""
        return self.tape.needed_for(self.outputs.values())

    def in_order_of_demand(self, unit: Callable[[int], int] = lambda place: place) -> list[int]:
        """The same, one output after the other, the deepest operand first: few results wait at a time.

        ``unit`` says which operation stands for another that is done together with it.
        """
        depth: dict[int, int] = {}
        for place in self.needed():
            depth[place] = 1 + max((depth[arg] for arg in self.tape.nodes[place].args), default=0)
        done: dict[int, None] = {}
        waiting = [unit(place) for place in reversed(self.outputs.values())]
        while waiting:
            deepest_first = sorted(self.tape.nodes[waiting[-1]].args, key=lambda arg: -depth[arg])
            first = next((unit(arg) for arg in deepest_first if unit(arg) not in done), None)
            if first is None or waiting[-1] in done:
                done[waiting.pop()] = None
            else:
                waiting.append(first)
        return list(done)

    def taking(self, given: Mapping[Slot, int]) -> Program:
        """The same program, with these results given, not computed. Its inputs are what is still read."""
        tape, slots = Tape(), {place: slot for slot, place in given.items()}
        nodes, moved_to = self.tape.nodes, dict[int, int]()

        def move(place: int) -> int:
            if place not in moved_to:
                node = nodes[place]
                if place in slots:
                    node = Node("input", (), slots[place])
                moved = node._replace(args=ordered(node.op, map(move, node.args)))
                moved_to[place] = tape.write(moved).place
            return moved_to[place]

        outputs = {slot: move(place) for slot, place in self.outputs.items()}
        read = [node.value for node in tape.nodes if node.op == "input"]
        inputs = tuple(slot for slot in [*self.inputs, *given] if slot in read)
        return self._replace(tape=tape, inputs=inputs, outputs=outputs)

    def with_constants(self, values: Mapping[float, float]) -> Program:
        """The same program with other values for some constants."""
        tape, moved_to = Tape(), dict[int, int]()
        for place in self.needed():
            node = self.tape.nodes[place]
            args = tuple(moved_to[arg] for arg in node.args)
            value = values.get(node.value, node.value) if node.op == "constant" else node.value
            moved_to[place] = tape.write(Node(node.op, ordered(node.op, args), value)).place
        return self._replace(
            tape=tape, outputs={slot: moved_to[place] for slot, place in self.outputs.items()}
        )

    def run(self, numbers: Mapping[Slot, Any], constant: Callable[[float], Any] = float) -> dict[Slot, Any]:
        """The results for numbers of any make, of which ``constant`` makes one from a float."""
        values: dict[int, Any] = {}

        def value(place: int) -> Any:
            if place not in values:
                node = self.tape.nodes[place]
                is_number = node.op == "constant" and math.isfinite(node.value)
                values[place] = constant(node.value) if is_number else _perform(node, value, numbers)
            return values[place]

        return {slot: value(place) for slot, place in self.outputs.items()}


def partners(program: Program) -> dict[int, int]:
    """For every operation needed that is also done with the lanes exchanged: where that is done.

    An operation that both lanes share is its own partner, and so is one that has none.
    """
    nodes, needed = program.tape.nodes, program.needed()
    there, partner = set(needed), dict[int, int]()
    for place in needed:
        node = nodes[place]
        value = node.value.other_lane() if node.op == "input" else node.value
        other = program.tape.find(node.op, (partner[arg] for arg in node.args), value)
        partner[place] = other if other in there else place
    return partner


def _perform(node: Node, value: Callable[[int], Any], numbers: Mapping[Slot, Any]) -> Any:
    if node.op == "input":
        return numbers[node.value]
    if node.op in ("constant", "truth"):
        return node.value
    if node.op == "select":
        condition, if_true, if_false = node.args
        return choose(value(condition), lambda: value(if_true), lambda: value(if_false))
    return _OPERATIONS[node.op](*(value(arg) for arg in node.args))


_OPERATIONS: dict[str, Callable[..., Any]] = {
    "add": operator.add,
    "sub": operator.sub,
    "mul": operator.mul,
    "div": operator.truediv,
    "neg": operator.neg,
    "sqrt": square_root,
    "lt": operator.lt,
    "le": operator.le,
    "eq": operator.eq,
    "and": operator.and_,
    "or": operator.or_,
    "not": operator.not_,
}
