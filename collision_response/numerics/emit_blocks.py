"""NumPy code for a program: a block of problems at a time, in place, in few buffers.

What is done alike in both lanes is one call, on arrays of shape ``(2, n)``. A buffer goes to the next
operation as soon as its last reader is through, so that a block stays in the cache. A choice is made
by masks on the bits: it costs the same whatever is chosen, and a NaN that is not chosen does no harm.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from .choices import statements, with_masks
from .program import Program, Slot, partners
from .tape import CONDITIONS, Node


class Kind(NamedTuple):
    """What a buffer holds: numbers or truth values, of both lanes or of one."""

    paired: bool
    truth: bool

    @property
    def letter(self) -> str:
        """How the names of such buffers begin."""
        return "psqt"[self.truth * 2 + (not self.paired)]


class Blocks(NamedTuple):
    """A function over blocks, and what it needs.

    Attributes:
        source: of ``def block(<arrays>, buffers, constants)``.
        arrays: the names of the arrays it takes, of shape ``(rows, n)`` or ``(rows, 2, n)``.
        buffers: the name and kind of each buffer it takes.
        constants: the numbers it takes.
    """

    source: str
    arrays: tuple[str, ...]
    buffers: dict[str, Kind]
    constants: dict[str, float]

    def allocate(self, n: int, dtype: Any) -> list[np.ndarray[Any, Any]]:
        """Buffers for ``n`` problems; each buffer of numbers is followed by a view of its bits."""
        made: list[np.ndarray[Any, Any]] = []
        for kind in self.buffers.values():
            buffer = np.empty((2, n) if kind.paired else n, bool if kind.truth else dtype)
            made += [buffer] if kind.truth else [buffer, buffer.view(_bits(dtype))]
        return made

    def make_constants(self, dtype: Any) -> list[np.ndarray[Any, Any]]:
        """The constants, each followed by its bits."""
        numbers = [np.array(value, dtype) for value in self.constants.values()]
        return [made for number in numbers for made in (number, number.view(_bits(dtype)))]


def emit_blocks(program: Program) -> Blocks:
    """The function that computes the outputs of a program for all columns of its arrays."""
    return _Emitter(with_masks(program)).emit()


def _bits(dtype: Any) -> np.dtype[Any]:
    return np.dtype(f"i{np.dtype(dtype).itemsize}")


class _Emitter:
    """Writes one unit after the other: an operation, or one and its partner, known by its first place."""

    def __init__(self, program: Program) -> None:
        self.program = program
        self.nodes = program.tape.nodes
        self.partner = partners(program)
        self.order = program.in_order_of_demand(self._unit)
        self.last_read = {self._unit(arg): unit for unit in self.order for arg in self.nodes[unit].args}
        self.arrays: dict[str, None] = {}
        self.rows: dict[str, str] = {}
        self.buffers: dict[str, Kind] = {}
        self.constants: dict[str, float] = {}
        self.free: list[str] = []
        self.where: dict[int, str] = {}
        self.lines: list[str] = []

    def emit(self) -> Blocks:
        ends: dict[int, list[Slot]] = {}
        for slot, place in self.program.outputs.items():
            ends.setdefault(self._unit(place), []).append(slot)
        for unit in self.order:
            self._emit(unit, self._direct(unit, ends.get(unit, [])))
            for slot in ends.get(unit, []):
                self._store(slot)
            if self._is_last_reader(unit, unit):
                self._release({unit})
        return Blocks(self._source(), tuple(self.arrays), self.buffers, self.constants)

    def _unit(self, place: int) -> int:
        return min(place, self.partner[place])

    def _is_paired(self, unit: int) -> bool:
        return self.partner[unit] != unit

    def _emit(self, unit: int, target: str | None) -> None:
        node = self.nodes[unit]
        if node.op == "input":
            self.where[unit] = self._row(node.value) if self._is_paired(unit) else self._element(node.value)
        elif node.op == "constant":
            name = self.where[unit] = f"k{len(self.constants)}"
            self.constants[name] = node.value
        else:
            self._operate(unit, node, target)

    def _operate(self, unit: int, node: Node, target: str | None) -> None:
        paired = self._is_paired(unit)
        operands = [self._operand(arg, paired) for arg in node.args]
        read = [self._unit(arg) for arg in node.args]
        # A blend reads its first and last operand once more after it has written to its target.
        kept = {read[0], read[2]} if node.op == "blend" else set()
        through = {other for other in read if self._is_last_reader(unit, other)}
        self._release(through - kept)
        self.where[unit] = target or self._buffer(Kind(paired, node.op in CONDITIONS))
        self.lines += statements(node, operands, self.where[unit])
        self._release(through & kept)

    def _operand(self, place: int, paired: bool) -> str:
        """An operand as it is read by an operation on both lanes, or on one."""
        unit = self._unit(place)
        name, lane = self.where[unit], int(place != unit)
        if not self._is_paired(unit):
            return name
        if paired:
            return f"{name}[::-1]" if lane else name
        return f"{name}[{lane}]"

    def _buffer(self, kind: Kind) -> str:
        for name in reversed(self.free):
            if self.buffers[name] == kind:
                self.free.remove(name)
                return name
        name = f"{kind.letter}{sum(other == kind for other in self.buffers.values())}"
        self.buffers[name] = kind
        return name

    def _is_last_reader(self, reader: int, unit: int) -> bool:
        return self.last_read.get(unit, unit) == reader

    def _release(self, units: set[int]) -> None:
        self.free += [self.where[unit] for unit in sorted(units) if self.where[unit] in self.buffers]

    def _row(self, slot: Slot) -> str:
        name = f"{slot.array}_{slot.row}"
        self.arrays[slot.array] = None
        self.rows[name] = f"{slot.array}[{slot.row}]"
        return name

    def _element(self, slot: Slot) -> str:
        return self._row(slot) if slot.lane is None else f"{self._row(slot)}[{slot.lane}]"

    def _direct(self, unit: int, ends: list[Slot]) -> str | None:
        """Where the results of a unit can be written at once, if they go to one place alone."""
        if any(slot.array in self.program.codes for slot in ends) and self.nodes[unit].op != "code":
            return None
        if not self._is_paired(unit):
            return self._element(ends[0]) if len(ends) == 1 else None
        whole = len(ends) == 2 and {ends[0], ends[0].other_lane()} == set(ends)
        first = ends[0]._replace(lane=0) if whole else None
        return self._row(first) if first and self.program.outputs[first] == unit else None

    def _store(self, slot: Slot) -> None:
        place = self.program.outputs[slot]
        result, target = self._operand(place, paired=False), self._element(slot)
        if result != target and self.where[self._unit(place)] != self._row(slot):
            self.lines.append(f"copyto({target}, {result}, casting='unsafe')")

    def _source(self) -> str:
        lines = [f"def block({', '.join([*self.arrays, 'buffers', 'constants'])}):"]
        buffers = [name if kind.truth else f"{name}, {name}i" for name, kind in self.buffers.items()]
        if buffers:
            lines.append(f"    {', '.join(buffers)}, = buffers")
        if self.constants:
            lines.append(f"    {', '.join(f'{name}, {name}i' for name in self.constants)}, = constants")
        lines += [f"    {name} = {expression}" for name, expression in self.rows.items()]
        return "\n".join([*lines, *(f"    {line}" for line in self.lines), ""])
