"""Write a tape as a C++ function template.

Each operation becomes one statement. The template's parameter, the number type ``N``, does the arithmetic.
``cpp_types.py`` says how much of ``N`` each number needs, and ``branches.py`` which operations stand in an
``if``.

Where numbers carry derivatives, the body of a loop is written twice: first for the values, then for the
derivatives of those parts of the state that a result needs.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import groupby

from .branches import ALWAYS, Guard, compute_guards, without_negation
from .cpp_types import CppType, least_type_in_loop, needed_types, types_in_loop
from .simd_pairs import PAIR
from .symbol import CONDITIONS, CONSTANTS, Loop, Node, Symbol, Tape

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
    reported: Iterable[Symbol] = (),
    flags: Iterable[Symbol] = (),
    certainties: Iterable[Symbol] = (),
    *,
    rounded_last: int = 0,
    least_saving: int | None = None,
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
        rounded_last: how many reported results, from the first on, are rounded only at the end. The others
            are computed from rounded numbers, which takes less time.
        least_saving: how many additions an ``if`` must save to be written. By default no ``if`` is written.
    """
    bounded, reported, flags, certainties = map(list, (bounded, reported, flags, certainties))
    tape = (bounded + reported + flags)[0].tape
    wanted = [(x.index, CppType.BOUNDED) for x in [*bounded, *certainties]]
    wanted += [(x.index, CppType.VALUE) for x in reported[:rounded_last]]
    wanted += [(x.index, CppType.REPORT) for x in [*reported[rounded_last:], *flags]]
    types = needed_types(tape, wanted)
    results = {index for index, _ in wanted}
    guards = {} if least_saving is None else compute_guards(tape, types, results, least_saving)
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
            if condition is None or without_negation(self.tape, condition)[0] not in branched:
                return None
            return condition

        indices = [index for index in self._order() if nodes[index].op not in {*CONSTANTS, "part", "result"}]
        position = {index: i for i, index in enumerate(indices)}
        blocks = [
            (guard, list(block))
            for guard, block in groupby(indices, lambda index: self.guards.get(index, ALWAYS))
        ]
        hoisted = self._hoisted([block for guard, block in blocks])
        for guard, block in blocks:
            declared = hoisted.intersection(block) if guard else set()
            if guard:
                yield from map(self._declaration, sorted(declared))
                # In the order of computation: a condition may be known only if those before it hold.
                tests = sorted(guard, key=lambda literal: position.get(literal[0], -1))
                yield f"if ({' && '.join(self._may_be(*literal) for literal in tests)}) {{"
            for condition, adjacent in groupby(block, choice):
                if condition is not None:
                    yield from self._choices(condition, list(adjacent), declared)
                    continue
                for index in adjacent:
                    yield from self._operation(index, is_declared=index in declared)
            if guard:
                yield "}"

    def _hoisted(self, blocks: list[list[int]]) -> set[int]:
        """The operations that are read outside of their block: an ``if`` would hide them."""
        nodes = self.tape.nodes
        block_of = {index: i for i, block in enumerate(blocks) for index in block}
        hoisted = {condition for guard in self.guards.values() for condition, _ in guard}
        for reader, block in block_of.items():
            for read in nodes[reader].operands():
                source = nodes[read].args[0] if nodes[read].op in ("part", "result") else read
                if block_of.get(source, block) != block:
                    hoisted.add(source)
        return hoisted

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
            names: dict[CppType, list[str]] = {CppType.VALUE: [], CppType.REPORT: []}
            for i, state_type in enumerate(types_in_loop(self.tape, self.types, index)[1]):
                names[state_type].append(f"{self.prefix}{index}_{i}")
            return " ".join(f"{_SPELLING[type_]} {', '.join(some)};" for type_, some in names.items() if some)
        if node.op == "call":
            return f"N {self.prefix}{index}[{self.tape.count_results(index)}];"
        number = self._type(index, cpp_type)
        if self._is_condition(index):  # it has a value where nobody computes it: others are combined with it
            return f"Condition<{number}> {self.prefix}{index}{{}};"
        return f"{number} {self.prefix}{index};"

    def _type(self, index: int, cpp_type: CppType) -> str:
        return f"Pair<{_SPELLING[cpp_type]}>" if self.tape.nodes[index].value == PAIR else _SPELLING[cpp_type]

    def _is_condition(self, index: int) -> bool:
        node = self.tape.nodes[index]
        if node.op == "outer" and self.parent is not None:
            return self.parent._is_condition(node.value)
        return self._is_condition(node.args[-1]) if node.op in _ON_BOTH else node.op in CONDITIONS

    def _operation(self, index: int, *, is_declared: bool) -> Iterable[str]:
        node, name = self.tape.nodes[index], f"{self.prefix}{index}"
        if node.op in ("loop", "call") and not is_declared:
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
            declaration = "" if is_declared else "const auto "
            yield f"{declaration}{name} = {self._expression(index, self.types[index])};"

    def _choices(self, condition: int, indices: list[int], declared: set[int]) -> Iterable[str]:
        """Choices by one condition. If all lanes agree on it, only the branch that they take is read."""
        yield from (self._declaration(index) for index in indices if index not in declared)
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
        loop: Loop = node.value
        body_types, state_types = types_in_loop(self.tape, self.types, index)
        least = least_type_in_loop(self.tape, loop)
        condition_types = needed_types(loop.tape, [(loop.condition, least)])
        types = dict.fromkeys(body_types, least) if self.tape.of_derivatives else body_types
        body = _TapeWriter(loop.tape, types, f"{name}_body", self.inputs, self, {})
        for i, arg in enumerate(node.args):
            yield f"{name}_{i} = {self.use(arg, state_types[i])};"
        yield f"for (int iteration = 0; iteration < {loop.budget}; ++iteration) {{"
        for i in range(len(node.args)):
            read = f"report({name}_{i})" if least is CppType.REPORT else f"{name}_{i}"
            state = f"state_{body.prefix}{i}"
            yield f"  const {_SPELLING[least]} {state} = {read}; (void){state};"
        # The condition first: after the last iteration the rest of the body is not needed.
        yield from body.unguarded_lines(condition_types)
        yield f"  const auto {name}_continues = {body.use(loop.condition, least)};"
        yield f"  if (!any({name}_continues)) break;"
        yield from body.unguarded_lines(body_types.keys() - condition_types)
        if self.tape.of_derivatives:
            duals = {i: cpp_type for i, cpp_type in sorted(body_types.items()) if cpp_type > least}
            new_state = {i: after for i, after in enumerate(loop.state_after) if state_types[i] > least}
            yield from _DualWriter.of(loop, name, duals, body).blocks(new_state)
        for i, after in enumerate(loop.state_after):
            new = body.use(after, least)
            if self.tape.of_derivatives:
                yield f"  {name}_{i}{'.value' if state_types[i] > least else ''} = {new};"
            else:
                lifted = f"lifted<{_SPELLING[state_types[i]]}>({new})" if loop.rounded else new
                yield f"  {name}_{i} = choose({name}_continues, {lifted}, {name}_{i});"
        yield "}"

    def unguarded_lines(self, indices: Iterable[int]) -> Iterable[str]:
        """Statements of some operations of the body of a loop."""
        for index in sorted(indices):
            if self.tape.nodes[index].op not in CONSTANTS:
                yield f"  const auto {self.prefix}{index} = {self._expression(index, self.types[index])};"


@dataclass(frozen=True)
class _DualWriter(_TapeWriter):
    """Writes the derivatives in the body of a loop, whose values are known: by operations on ``Dual4``.

    Attributes:
        values: the writer of the values.
        state: what the names of the parts of the state begin with.
    """

    values: _TapeWriter
    state: str

    @classmethod
    def of(cls, loop: Loop, name: str, types: dict[int, CppType], values: _TapeWriter) -> _DualWriter:
        """The writer for those operations of the body of a loop that carry derivatives."""
        guards = compute_guards(loop.tape, types, [index for index in loop.state_after if index in types])
        return cls(loop.tape, types, f"{values.prefix}_d", {}, values.parent, guards, values, f"{name}_")

    def blocks(self, new_state: dict[int, int]) -> Iterable[str]:
        """Statements that give parts of the state new derivatives, in four directions at a time."""
        nodes = (self.tape.nodes[index] for index in self.types)
        outer = [self._dual(node) for node in nodes if node.op == "outer"]
        states = [f"{self.state}{i}" for i in new_state]
        yield f"  if (iteration == 0) share_edges({', '.join(outer)})({', '.join(states)});"
        yield "  for (int block = 0; block < N::Derivatives::BLOCKS; ++block) {"
        yield from ("    " + line for line in self.lines())
        for state, new in zip(states, new_state.values(), strict=True):
            yield f"    {state}.d.d[block] = derivatives_of({self.use(new, CppType.VALUE)});"
        yield "  }"

    def use(self, index: int, cpp_type: CppType) -> str:
        """C++ expression for a number: a double if it carries no derivatives."""
        value = self.values.use(index, CppType.REPORT)
        return f"Dual4{{{value}, {self.prefix}{index}}}" if index in self.types else value

    def _dual(self, node: Node) -> str:
        """The C++ variable that has the derivatives of a number which comes from before the iteration."""
        if node.op == "state":
            return f"{self.state}{node.value}"
        assert self.parent is not None
        return self.parent._name(node.value)

    def _name(self, index: int) -> str:
        return self.values._name(index)

    def _declaration(self, index: int) -> str:
        return f"Block {self.prefix}{index};"

    def _choices(self, condition: int, indices: list[int], declared: set[int]) -> Iterable[str]:
        for index in indices:  # one by one: each reads only the branch that is taken
            yield from self._operation(index, is_declared=index in declared)

    def _expression(self, index: int, cpp_type: CppType) -> str:
        node = self.tape.nodes[index]
        if node.op in ("state", "outer"):
            return f"{self._dual(node)}.d.d[block]"
        if node.op == "select":
            condition, if_true, if_false = (self.use(arg, cpp_type) for arg in node.args)
            return f"{condition} ? derivatives_of({if_true}) : derivatives_of({if_false})"
        return super()._expression(index, cpp_type)


def _literal(value: float) -> str:
    """An exact C++ literal."""
    if math.isnan(value):
        return '__builtin_nan("")'
    if math.isinf(value):
        return ("-" if value < 0 else "") + "__builtin_inf()"
    return value.hex()
