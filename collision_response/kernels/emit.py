"""Write a tape as a C++ function template. The second step of compiling a formula: see ``symbol.py``.

Each operation becomes one statement. The template's parameter, the number type ``N``, does the arithmetic.

Not every result needs all that ``N`` carries, so each number has one of three C++ types:

    BOUNDED   ``N``           the number with its error bound
    VALUE     ``Value<N>``    the same number without its error bound
    REPORT    ``Report<N>``   the number rounded to its base, float or double

Not every request needs every operation either. What only one branch of a choice needs may stand in an ``if``,
which is entered if any lane of the vectors may take that branch. The results are the same to the bit.

Where numbers carry derivatives, the body of a loop is written twice: first for the values, then for the
derivatives of those parts of the state that a result needs.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from enum import IntEnum
from itertools import groupby
from typing import NamedTuple, TypeAlias

from .simd_pairs import PAIR
from .symbol import CONDITIONS, Loop, Node, Symbol, Tape


class CppType(IntEnum):
    """The C++ type of a number. A greater member carries more, and can be cast to a lesser one."""

    REPORT = 0
    VALUE = 1
    BOUNDED = 2


CONSTANTS = ("constant", "truth", "given_roundoff")
_SPELLING = {CppType.REPORT: "Report<N>", CppType.VALUE: "Value<N>", CppType.BOUNDED: "N"}
_CASTS = {CppType.REPORT: "report", CppType.VALUE: "value"}
_INFIX = {"add": "+", "sub": "-", "mul": "*", "div": "/", "and": "&", "or": "|"}
_FUNCTIONS = {"sqrt": "root", "lt": "less", "le": "less_equal", "eq": "equal", "not": "negation"}
_FUNCTIONS |= {"select": "choose", "first": "at<0>", "second": "at<1>"}
"""Those C++ functions that have another name than the operation."""
_ON_BOTH = ("select", "join", "both", "first", "second", "swapped")
"""Operations on numbers and on conditions alike."""


def emit(
    name: str,
    inputs: Iterable[object],
    bounded: Iterable[Symbol],
    reported: Iterable[Symbol],
    flags: Iterable[Symbol],
    certainties: Iterable[Symbol] = (),
    *,
    branches: int | None = None,
) -> str:
    """Return the C++ function template ``name<N>(in, bounded, reported, flags)``.

    If the tape has a ``law``, that is a fifth argument: a function object.

    Args:
        name: the name of the function.
        inputs: the names of the inputs, in the order of ``in``.
        bounded: the results to write with their error bounds.
        reported: the results to write without.
        flags: the conditions to write, as the values decide them, whatever their errors.
        certainties: conditions to write after the flags, as true only if their errors leave no doubt.
        branches: how many additions an ``if`` must save to be written. By default no ``if`` is written.
    """
    bounded, reported, flags, certainties = map(list, (bounded, reported, flags, certainties))
    tape = (bounded + reported + flags)[0].tape
    wanted = [(x.index, CppType.BOUNDED) for x in [*bounded, *certainties]]
    wanted += [(x.index, CppType.REPORT) for x in [*reported, *flags]]
    types = _needed_types(tape, wanted)
    guards = (
        {} if branches is None else _compute_guards(tape, types, {index for index, _ in wanted}, branches)
    )
    writer = _TapeWriter(tape, types, "t", {name: i for i, name in enumerate(inputs)}, None, guards)
    lines = list(writer.lines())
    lines += [f"bounded[{i}] = {writer.use(x.index, CppType.BOUNDED)};" for i, x in enumerate(bounded)]
    lines += [f"reported[{i}] = {writer.use(x.index, CppType.REPORT)};" for i, x in enumerate(reported)]
    lines += [f"flags[{i}] = {writer.use(x.index, CppType.REPORT)};" for i, x in enumerate(flags)]
    for i, x in enumerate(certainties, len(flags)):
        lines.append(f"flags[{i}] = certainly_true({writer.use(x.index, CppType.BOUNDED)});")
    body = "\n".join("  " + line for line in lines)
    has_law = any(tape.nodes[index].op == "law" for index in types)
    parameters = "const N* in, N* bounded, Report<N>* reported, Mask<Base<N>>* flags"
    return (
        f"template <class N{', class F' if has_law else ''}>\n"
        f"INLINE void {name}({parameters}{', const F& law' if has_law else ''}) {{\n"
        f"  (void)in; (void)bounded; (void)reported; (void)flags;\n{body}\n}}\n"
    )


def _needed_types(tape: Tape, wanted: Iterable[tuple[int, CppType]]) -> dict[int, CppType]:
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
            differentiated = _differentiated(tape, types, index)
            for part in _parts(tape, types, index):
                types[part] = differentiated.type_of_state(tape.nodes[part].value)
            for i, arg in enumerate(node.args):
                need(arg, differentiated.type_of_state(i))
            loop: Loop = node.value
            for inner in loop.tape.needed_for([loop.condition, *loop.state_after]):
                if loop.tape.nodes[inner].op == "outer":
                    need(loop.tape.nodes[inner].value, differentiated.type_of(inner))
        else:
            for arg in node.args:
                need(arg, cpp_type)
    return types


def _parts(tape: Tape, indices: Iterable[int], loop: int) -> list[int]:
    """Return those of ``indices`` that are parts of the result of ``loop``."""
    nodes = tape.nodes
    return [index for index in indices if nodes[index].op == "part" and nodes[index].args[0] == loop]


class _Differentiated(NamedTuple):
    """What carries derivatives in the body of a loop.

    Attributes:
        indices: the operations; ``None`` if the numbers of the tape carry no derivatives.
        states: indices of the parts of the state.
    """

    indices: frozenset[int] | None = None
    states: frozenset[int] = frozenset()

    def type_of(self, index: int) -> CppType:
        """Type of the result of an operation."""
        return CppType.VALUE if self.indices is None or index in self.indices else CppType.REPORT

    def type_of_state(self, i: int) -> CppType:
        """Type of a part of the state."""
        return CppType.VALUE if self.indices is None or i in self.states else CppType.REPORT


def _differentiated(tape: Tape, types: dict[int, CppType], index: int) -> _Differentiated:
    """Find what must carry derivatives in a loop so that those parts of its result that need them have them.

    Operations that only decide, or whose results are fixed, need none.
    """
    if not tape.of_derivatives:
        return _Differentiated()
    parts, node = _parts(tape, types, index), tape.nodes[index]
    wanted = {tape.nodes[part].value for part in parts if types[part] > CppType.REPORT}
    loop: Loop = node.value
    varying_states = {i for i, initial in enumerate(node.args) if _varies(tape, initial)}
    while True:
        varying: set[int] = set()
        for index, inner in enumerate(loop.tape.nodes):
            is_source = inner.op == "outer" or (inner.op == "state" and inner.value in varying_states)
            if is_source or varying.intersection(_sources(inner)):
                varying.add(index)
        added = {i for i, after in enumerate(loop.state_after) if after in varying} - varying_states
        if not added:
            break
        varying_states |= added
    indices: set[int] = set()
    states = wanted & varying_states
    pending = [loop.state_after[i] for i in states]
    while pending:
        index = pending.pop()
        if index in indices or index not in varying:
            continue
        indices.add(index)
        inner = loop.tape.nodes[index]
        if inner.op == "state" and inner.value not in states:
            states.add(inner.value)
            pending.append(loop.state_after[inner.value])
        pending += _sources(inner)
    return _Differentiated(frozenset(indices), frozenset(states))


def _varies(tape: Tape, index: int) -> bool:
    """Whether a number may have derivatives other than 0."""
    node = tape.nodes[index]
    return node.op not in CONSTANTS and not (node.op == "varying_as" and not _varies(tape, node.args[1]))


def _sources(node: Node) -> tuple[int, ...]:
    """The operands on which the derivatives of a result depend."""
    if node.op in CONDITIONS:
        return ()
    return node.args[1:] if node.op in ("select", "varying_as") else node.args


Guard: TypeAlias = frozenset[tuple[int, bool]]
"""When an operation is needed: only if each of these conditions may have this value."""

ALWAYS: Guard = frozenset()

BRANCHES = 12
"""How many additions an ``if`` must save to be worth it."""

BRANCHES_OF_PLAIN_NUMBERS = 80
"""The same for kernels that run on vectors of plain numbers only: additions are cheap there, and the lanes of
a vector rarely all take the same branch."""


def _compute_guards(
    tape: Tape, types: dict[int, CppType], results: Iterable[int], branches: int = BRANCHES
) -> dict[int, Guard]:
    """Find when each operation is needed, by conditions that save at least ``branches`` additions."""
    guards: dict[int, Guard] = dict.fromkeys(results, ALWAYS)

    def need(index: int, guard: Guard) -> None:
        guards[index] = guards[index] & guard if index in guards else guard

    for index in sorted(types, reverse=True):
        node, guard = tape.nodes[index], guards[index]
        if node.op == "select":
            condition, is_negated = _without_negation(tape, node.args[0])
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
    return {index: frozenset(x for x in guard if saved[x] >= branches) for index, guard in guards.items()}


_WEIGHTS = {"div": 6, "sqrt": 6, "loop": 100, "call": 100}
_WEIGHTS |= dict.fromkeys(("input", *CONSTANTS, "part", "result", "neg"), 0)


def _without_negation(tape: Tape, condition: int) -> tuple[int, bool]:
    """A condition without its negation, and whether it was negated."""
    node = tape.nodes[condition]
    return (node.args[0], True) if node.op == "not" else (condition, False)


@dataclass(frozen=True)
class _TapeWriter:
    """Writes the statements of one tape.

    Attributes:
        tape: the tape.
        types: the operations to write, each with the type of its result.
        prefix: what the names of the C++ variables begin with.
        inputs: the index of each input in ``in``.
        parent: the writer of the parent tape, for the body of a loop.
        guards: when each operation is needed. Those that are not listed always are.
    """

    tape: Tape
    types: dict[int, CppType]
    prefix: str
    inputs: dict[object, int]
    parent: _TapeWriter | None
    guards: dict[int, Guard]

    def use(self, index: int, cpp_type: CppType) -> str:
        """C++ expression for the result of an operation that has been written, cast to a type."""
        node = self.tape.nodes[index]
        if node.op == "constant":
            return f"constant<{_SPELLING[cpp_type]}>({_literal(node.value)})"
        if node.op == "given_roundoff":
            return f"constant<{_SPELLING[cpp_type]}>(GIVEN_ROUNDOFF)"
        if node.op == "truth":
            return f"truth<{_SPELLING[cpp_type]}>({'true' if node.value else 'false'})"
        own, name = self.types[index], self._name(index)
        if own is cpp_type:
            return name
        if own < cpp_type:
            return f"lifted<{self._type(index, cpp_type)}>({name})"
        return f"{_CASTS[cpp_type]}({name})" if not self._is_condition(index) else f"plain_truth({name})"

    def lines(self) -> Iterable[str]:
        """The statements, in an order in which each operand precedes what needs it."""
        branched = {index for guard in self.guards.values() for index, _ in guard}
        nodes = self.tape.nodes

        def choice(index: int) -> int | None:
            """The condition of a choice, if there are branches by it."""
            condition = nodes[index].args[0] if nodes[index].op == "select" else None
            if condition is None or _without_negation(self.tape, condition)[0] not in branched:
                return None
            return condition

        indices = [index for index in self._order() if nodes[index].op not in (*CONSTANTS, "part", "result")]
        position = {index: i for i, index in enumerate(indices)}
        for guard, run in groupby(indices, lambda index: self.guards.get(index, ALWAYS)):
            guarded = list(run)
            if guard:
                yield from map(self._declaration, guarded)
                # In the order of computation: a condition may be known only if those before it hold.
                tests = sorted(guard, key=lambda literal: position.get(literal[0], -1))
                yield f"if ({' && '.join(self._may_be(*literal) for literal in tests)}) {{"
            for condition, adjacent in groupby(guarded, choice):
                if condition is not None:
                    yield from self._choices(condition, list(adjacent), declared=bool(guard))
                    continue
                for index in adjacent:
                    yield from self._operation(index, declared=bool(guard))
            if guard:
                yield "}"

    def _order(self) -> list[int]:
        """The operations, each after the conditions of its guard, and as early as these allow."""
        keys: dict[int, tuple[int, int]] = {}

        def key(index: int) -> tuple[int, int]:
            if index not in self.types:
                return -1, 0
            if index not in keys:
                conditions = [key(condition) for condition, _ in self.guards.get(index, ALWAYS)]
                operands = [key(operand) for operand in self.tape.nodes[index].operands()]
                keys[index] = max([(index, 0), *operands, *((key, hops + 1) for key, hops in conditions)])
            return keys[index]

        return sorted(self.types, key=lambda index: (key(index), index))

    def _may_be(self, condition: int, value: bool) -> str:
        name = self._name(condition)
        return f"may_be_true({name if value else f'negation({name})'})"

    def _name(self, index: int) -> str:
        node = self.tape.nodes[index]
        if node.op == "result":
            return f"{self.prefix}{node.args[0]}[{node.value}]"
        return f"{self.prefix}{index}" if node.op != "part" else f"{self.prefix}{node.args[0]}_{node.value}"

    def _declaration(self, index: int) -> str:
        node, cpp_type = self.tape.nodes[index], self.types[index]
        if node.op == "loop":
            differentiated = _differentiated(self.tape, self.types, index)
            names: dict[CppType, list[str]] = {CppType.VALUE: [], CppType.REPORT: []}
            for i in range(len(node.args)):
                names[differentiated.type_of_state(i)].append(f"{self.prefix}{index}_{i}")
            return " ".join(f"{_SPELLING[type_]} {', '.join(some)};" for type_, some in names.items() if some)
        if node.op == "call":
            return f"N {self.prefix}{index}[{self.tape.count_results(index)}];"
        number = self._type(index, cpp_type)
        return f"{f'Condition<{number}>' if self._is_condition(index) else number} {self.prefix}{index};"

    def _type(self, index: int, cpp_type: CppType) -> str:
        return f"Pair<{_SPELLING[cpp_type]}>" if self.tape.nodes[index].value == PAIR else _SPELLING[cpp_type]

    def _is_condition(self, index: int) -> bool:
        node = self.tape.nodes[index]
        if node.op == "outer" and self.parent is not None:
            return self.parent._is_condition(node.value)
        return self._is_condition(node.args[-1]) if node.op in _ON_BOTH else node.op in CONDITIONS

    def _operation(self, index: int, *, declared: bool) -> Iterable[str]:
        node, name = self.tape.nodes[index], f"{self.prefix}{index}"
        if node.op in ("loop", "call") and not declared:
            yield self._declaration(index)
        if node.op == "loop":
            yield from self._loop(index)
        elif node.op in ("call", "law"):
            arguments = ", ".join(self.use(arg, CppType.BOUNDED) for arg in node.args)
            yield f"const N {name}_in[] = {{{arguments}}};"
            if node.op == "call":
                yield f"call_{node.value}({name}_in, {name});"
            else:
                yield f"const auto [{name}_0, {name}_1, {name}_2] = law({name}_in);"
        else:
            declaration = "" if declared else "const auto "
            yield f"{declaration}{name} = {self._expression(index, self.types[index])};"

    def _choices(self, condition: int, indices: list[int], *, declared: bool) -> Iterable[str]:
        """Choices by one condition. If all lanes agree on it, only the branch that they take is read."""
        if not declared:
            yield from map(self._declaration, indices)
        name = self._name(condition)
        never, always = f"if (!may_be_true({name}))", f"if (!may_be_true(negation({name})))"
        for test, branch in ((always, 1), (f"else {never}", 2), ("else", None)):
            yield f"{test} {{"
            for index in indices:
                cpp_type, args = self.types[index], self.tape.nodes[index].args
                result = self.use(args[branch], cpp_type) if branch else self._expression(index, cpp_type)
                yield f"  {self.prefix}{index} = {result};"
            yield "}"

    def _expression(self, index: int, cpp_type: CppType) -> str:
        node = self.tape.nodes[index]
        if node.op == "input":
            read = f"in[{self.inputs[node.value]}]"
            return read if cpp_type is CppType.BOUNDED else f"{_CASTS[cpp_type]}({read})"
        if node.op == "state":
            return f"state_{self.prefix}{node.value}"
        if node.op == "outer":
            assert self.parent is not None
            return self.parent.use(node.value, cpp_type)
        if node.op == "certain":
            value = self.use(node.args[0], min(cpp_type, CppType.VALUE))
            return f"lifted<N>({value})" if cpp_type is CppType.BOUNDED else value
        if node.op == "error_of":
            return f"lifted<{_SPELLING[cpp_type]}>(error_of({self.use(node.args[0], CppType.BOUNDED)}))"
        if node.op == "widened":
            if cpp_type is not CppType.BOUNDED:
                return self.use(node.args[0], cpp_type)
            return f"widened({self.use(node.args[0], cpp_type)}, {self.use(node.args[1], CppType.VALUE)})"
        if node.op == "varying_as" and cpp_type is CppType.REPORT:
            return self.use(node.args[0], cpp_type)
        mixes = node.op in _INFIX and self.tape.of_derivatives and cpp_type > CppType.REPORT
        args = [self._operand(arg, cpp_type) if mixes else self.use(arg, cpp_type) for arg in node.args]
        if node.op in _INFIX:
            return f"{args[0]} {_INFIX[node.op]} {args[1]}"
        if node.op == "neg":
            return f"-{args[0]}"
        if node.op in ("join", "both"):
            name = f"join_truths<{_SPELLING[cpp_type]}>" if self._is_condition(index) else "join"
            return f"{name}({args[0]}, {args[-1]})"
        return f"{_FUNCTIONS.get(node.op, node.op)}({', '.join(args)})"

    def _operand(self, index: int, cpp_type: CppType) -> str:
        """As :meth:`use`, but a constant stays a number without derivatives."""
        node = self.tape.nodes[index]
        if node.op == "constant":
            return f"constant<Number<{_SPELLING[cpp_type]}>>({_literal(node.value)})"
        return self.use(index, cpp_type)

    def _loop(self, index: int) -> Iterable[str]:
        """A loop: its values, and the derivatives of those parts of the state that need them."""
        node, name = self.tape.nodes[index], f"{self.prefix}{index}"
        differentiated = _differentiated(self.tape, self.types, index)
        loop: Loop = node.value
        value_type = CppType.REPORT if self.tape.of_derivatives else CppType.VALUE
        condition_types = _needed_types(loop.tape, [(loop.condition, value_type)])
        results = (loop.condition, *loop.state_after)
        types = _needed_types(loop.tape, [(result, value_type) for result in results])
        body = _TapeWriter(loop.tape, types, f"{name}_body", self.inputs, self, {})
        for i, arg in enumerate(node.args):
            yield f"{name}_{i} = {self.use(arg, differentiated.type_of_state(i))};"
        yield f"for (int iteration = 0; iteration < {loop.budget}; ++iteration) {{"
        for i in range(len(node.args)):
            read = f"report({name}_{i})" if value_type is CppType.REPORT else f"{name}_{i}"
            state = f"state_{body.prefix}{i}"
            yield f"  const {_SPELLING[value_type]} {state} = {read}; (void){state};"
        # The condition first: after the last iteration the rest of the body is not needed.
        yield from body.unguarded_lines(condition_types)
        yield f"  const auto {name}_continues = {body.use(loop.condition, value_type)};"
        yield f"  if (!any({name}_continues)) break;"
        yield from body.unguarded_lines(types.keys() - condition_types)
        if differentiated.indices is not None:
            nodes = (loop.tape.nodes[index] for index in sorted(differentiated.indices))
            outer = [x.value for x in nodes if x.op == "outer" and self.types[x.value] > CppType.REPORT]
            states = ", ".join(f"{name}_{i}" for i in sorted(differentiated.states))
            yield f"  if (iteration == 0) share_edges({', '.join(map(self._name, outer))})({states});"
            yield from _DerivativeWriter(name, self, body, loop, differentiated).blocks()
        for i, after in enumerate(loop.state_after):
            new = body.use(after, value_type)
            if value_type is CppType.REPORT:
                part = ".value" if i in differentiated.states else ""
                yield f"  {name}_{i}{part} = {new};"
            else:
                yield f"  {name}_{i} = choose({name}_continues, {new}, {name}_{i});"
        yield "}"

    def unguarded_lines(self, indices: Iterable[int]) -> Iterable[str]:
        """Statements of some operations of the body of a loop."""
        for index in sorted(indices):
            if self.tape.nodes[index].op not in CONSTANTS:
                yield f"  const auto {self.prefix}{index} = {self._expression(index, self.types[index])};"


class _DerivativeWriter(_TapeWriter):
    """Writes the derivatives in the body of a loop, whose values are known: four directions at a time."""

    def __init__(
        self, name: str, parent: _TapeWriter, values: _TapeWriter, loop: Loop, differentiated: _Differentiated
    ) -> None:
        types = dict.fromkeys(sorted(differentiated.indices or ()), CppType.VALUE)
        guards = _compute_guards(loop.tape, types, [index for index in loop.state_after if index in types])
        super().__init__(loop.tape, types, f"{values.prefix}_d", {}, parent, guards)
        self.name = name
        self.values = values
        self.loop = loop
        self.states = sorted(differentiated.states)

    def blocks(self) -> Iterable[str]:
        """An inner loop over the blocks of directions."""
        yield "  for (int block = 0; block < N::Derivatives::BLOCKS; ++block) {"
        yield from ("    " + line for line in self.lines())
        for i in self.states:
            derivative = self.use(self.loop.state_after[i], CppType.VALUE)
            yield f"    {self.name}_{i}.d.d[block] = {derivative};"
        yield "  }"

    def use(self, index: int, cpp_type: CppType) -> str:
        """C++ expression for the derivatives of a number."""
        return f"{self.prefix}{index}" if index in self.types else "Block{}"

    def _name(self, index: int) -> str:
        return self.values._name(index)

    def _declaration(self, index: int) -> str:
        return f"Block {self.prefix}{index};"

    def _expression(self, index: int, cpp_type: CppType) -> str:
        node, value_of = self.tape.nodes[index], self.values.use
        if node.op == "state":
            return f"{self.name}_{node.value}.d.d[block]"
        if node.op == "outer":
            assert self.parent is not None
            is_fixed = self.parent.types[node.value] is CppType.REPORT
            return "Block{}" if is_fixed else f"{self.parent._name(node.value)}.d.d[block]"
        if node.op == "varying_as":
            return self.use(node.args[1], cpp_type)
        d = [self.use(arg, cpp_type) for arg in node.args]
        if node.op == "select":
            return f"{value_of(node.args[0], CppType.REPORT)} ? {d[1]} : {d[2]}"
        values = [value_of(arg, CppType.REPORT) for arg in node.args]
        varies = [arg in self.types for arg in node.args]
        if node.op == "mul":
            return " + ".join(f"{d[i]} * {values[1 - i]}" for i in (0, 1) if varies[i])
        if node.op == "div":
            quotient_db = f"{value_of(index, CppType.REPORT)} * {d[1]}"
            numerator = (
                d[0] if not varies[1] else f"({d[0]} - {quotient_db})" if varies[0] else f"-({quotient_db})"
            )
            return f"{numerator} * (1 / {values[1]})"
        if node.op == "sqrt":
            return f"{d[0]} * slope_of_root({value_of(index, CppType.REPORT)})"
        if node.op == "neg":
            return f"-{d[0]}"
        assert node.op in ("add", "sub"), node.op
        if all(varies):
            return f"{d[0]} {_INFIX[node.op]} {d[1]}"
        return d[0] if varies[0] else f"-{d[1]}" if node.op == "sub" else d[1]


def _literal(value: float) -> str:
    """An exact C++ literal."""
    if math.isnan(value):
        return '__builtin_nan("")'
    if math.isinf(value):
        return ("-" if value < 0 else "") + "__builtin_inf()"
    return value.hex()
