"""A tape as a C++ function template: one line an operation, the arithmetic is that of its number type.

Not every result needs all that a number type carries. Each operation is written in one of three forms:

    bounded   ``N``: the number type, with the error it carries
    value     ``Value<N>``: the same number without its error
    report    ``Report<N>``: in double precision at most

Nor does every request need all operations: what only one branch of a choice takes is computed where that
branch may be taken, by any lane. The results are the same to the bit.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from enum import IntEnum
from itertools import groupby
from typing import TypeAlias

from .pairs import PAIR
from .symbol import CONDITIONS, Symbol, Tape


class Form(IntEnum):
    """How much of a number is carried."""

    REPORT = 0
    VALUE = 1
    BOUNDED = 2


CONSTANTS = ("constant", "truth", "given_roundoff")
_TYPES = {Form.REPORT: "Report<N>", Form.VALUE: "Value<N>", Form.BOUNDED: "N"}
_CASTS = {Form.REPORT: "report", Form.VALUE: "value"}
_INFIX = {"add": "+", "sub": "-", "mul": "*", "div": "/", "and": "&", "or": "|"}
_PREFIX = {"sqrt": "root", "lt": "less", "le": "less_equal", "eq": "equal", "not": "negation"}
_PREFIX |= {"varying_as": "varying_as", "first": "at<0>", "second": "at<1>", "swapped": "swapped"}
_OF_EITHER = ("select", "join", "both", "first", "second", "swapped")
"""Operations on numbers and on conditions."""


def emit(
    name: str,
    inputs: list[object],
    bounded: Iterable[Symbol],
    reported: Iterable[Symbol],
    flags: Iterable[Symbol],
    certainties: Iterable[Symbol] = (),
    *,
    branches: bool = False,
) -> str:
    """A function template ``name<N>(in, bounded, reported, flags)``.

    Args:
        name: of the function.
        inputs: the names of what it reads, in the order of ``in``.
        bounded: what it writes with its error.
        reported: what it writes without.
        flags: truth values, taken as they are.
        certainties: truth values that follow those: of them, one that is undecided counts as false.
        branches: whether to skip what no lane needs.
    """
    bounded, reported, flags, certainties = map(list, (bounded, reported, flags, certainties))
    tape = (bounded + reported + flags)[0].tape
    wanted = [(x.place, Form.BOUNDED) for x in [*bounded, *certainties]]
    wanted += [(x.place, Form.REPORT) for x in [*reported, *flags]]
    forms = _forms(tape, wanted)
    guards = _guards(tape, forms, {place for place, _ in wanted}) if branches else {}
    scope = _Scope(tape, forms, "t", {name: i for i, name in enumerate(inputs)}, None, guards)
    lines = list(scope.lines())
    lines += [f"bounded[{i}] = {scope.use(x.place, Form.BOUNDED)};" for i, x in enumerate(bounded)]
    lines += [f"reported[{i}] = {scope.use(x.place, Form.REPORT)};" for i, x in enumerate(reported)]
    lines += [f"flags[{i}] = {scope.use(x.place, Form.REPORT)};" for i, x in enumerate(flags)]
    for i, x in enumerate(certainties, len(flags)):
        lines.append(f"flags[{i}] = certainly({scope.use(x.place, Form.BOUNDED)});")
    body = "\n".join("  " + line for line in lines)
    return (
        f"template <class N>\n"
        f"INLINE void {name}(const N* in, N* bounded, Report<N>* reported, Mask<Base<N>>* flags) {{\n"
        f"  (void)in; (void)bounded; (void)reported; (void)flags;\n{body}\n}}\n"
    )


def _forms(tape: Tape, wanted: Iterable[tuple[int, Form]]) -> dict[int, Form]:
    """The form that each operation needed must have."""
    forms: dict[int, Form] = {}

    def need(place: int, form: Form) -> None:
        forms[place] = max(forms.get(place, Form.REPORT), form)

    for place, form in wanted:
        need(place, form)
    for place in range(len(tape.nodes) - 1, -1, -1):
        if place not in forms:
            continue
        node, form = tape.nodes[place], forms[place]
        if node.op == "certain":
            need(node.args[0], min(form, Form.VALUE))
        elif node.op == "error_of":
            need(node.args[0], Form.BOUNDED)
        elif node.op == "widened":
            need(node.args[0], form)
            if form is Form.BOUNDED:
                need(node.args[1], Form.VALUE)
        elif node.op == "loop":
            for operand in node.operands():
                need(operand, Form.VALUE)
        else:
            for arg in node.args:
                need(arg, form)
    return forms


Guard: TypeAlias = frozenset[tuple[int, bool]]
"""Places of conditions, and what each must be, perhaps: only then is an operation needed."""

ALWAYS: Guard = frozenset()

WORTH = 12
"""Additions that must be saved for a branch to pay."""


def _guards(tape: Tape, forms: dict[int, Form], results: Iterable[int]) -> dict[int, Guard]:
    """When each operation is needed."""
    guards: dict[int, Guard] = dict.fromkeys(results, ALWAYS)

    def need(place: int, guard: Guard) -> None:
        guards[place] = guards[place] & guard if place in guards else guard

    for place in sorted(forms, reverse=True):
        node, own = tape.nodes[place], guards[place]
        if node.op == "select":
            condition, is_not = _positive(tape, node.args[0])
            need(node.args[0], own)
            need(node.args[1], own | {(condition, not is_not)})
            need(node.args[2], own | {(condition, is_not)})
        else:
            for operand in node.operands():
                need(operand, own)
    saved: dict[tuple[int, bool], int] = {}
    for place, guard in guards.items():
        for literal in guard:
            saved[literal] = saved.get(literal, 0) + _WEIGHTS.get(tape.nodes[place].op, 1)
    return {place: frozenset(x for x in guard if saved[x] >= WORTH) for place, guard in guards.items()}


_WEIGHTS = {"div": 6, "sqrt": 6, "loop": 100} | dict.fromkeys(("input", *CONSTANTS, "part", "neg"), 0)


def _positive(tape: Tape, condition: int) -> tuple[int, bool]:
    """A condition without its negation, and whether it had one."""
    node = tape.nodes[condition]
    return (node.args[0], True) if node.op == "not" else (condition, False)


def _turn_forms(turn: Tape, going: int, after: Iterable[int]) -> dict[int, Form]:
    return _forms(turn, [(place, Form.VALUE) for place in (going, *after)])


class _Scope:
    """The lines of one tape."""

    def __init__(
        self,
        tape: Tape,
        forms: dict[int, Form],
        prefix: str,
        inputs: dict[object, int],
        outside: _Scope | None,
        guards: dict[int, Guard],
    ) -> None:
        self.tape = tape
        self.forms = forms
        self.prefix = prefix
        self.inputs = inputs
        self.outside = outside
        self.guards = guards

    def use(self, place: int, form: Form) -> str:
        """The number at a place, in a form that it has or less."""
        node, own = self.tape.nodes[place], self.forms[place]
        if node.op == "constant":
            return f"constant<{_TYPES[form]}>({_literal(node.value)})"
        if node.op == "given_roundoff":
            return f"constant<{_TYPES[form]}>(GIVEN_ROUNDOFF)"
        if node.op == "truth":
            return f"truth<{_TYPES[form]}>({'true' if node.value else 'false'})"
        name = f"{self.prefix}{place}"
        if node.op == "part":
            own, name = Form.VALUE, f"{self.prefix}{node.args[0]}_{node.value}"
        if own is form:
            return name
        if own < form:
            return f"lifted<{self._type(place, form)}>({name})"
        return f"{_CASTS[form]}({name})" if not self._is_condition(place) else f"decided({name})"

    def lines(self) -> Iterable[str]:
        """One or more for each operation needed."""
        branched = {place for guard in self.guards.values() for place, _ in guard}
        nodes = self.tape.nodes

        def choice(place: int) -> int | None:
            """The condition of a choice that may be made for all lanes at once."""
            by = nodes[place].args[0] if nodes[place].op == "select" else None
            return None if by is None or _positive(self.tape, by)[0] not in branched else by

        places = [place for place in self._order() if nodes[place].op not in (*CONSTANTS, "part")]
        for guard, block in groupby(places, lambda place: self.guards.get(place, ALWAYS)):
            together = list(block)
            if guard:
                yield from map(self._declaration, together)
                yield f"if ({' && '.join(self._may_be(*one) for one in sorted(guard))}) {{"
            for by, some in groupby(together, choice):
                alike = list(some)
                if by is not None:
                    yield from self._choices(by, alike, declared=bool(guard))
                    continue
                for place in alike:
                    yield from self._operation(place, declared=bool(guard))
            if guard:
                yield "}"

    def _order(self) -> list[int]:
        """The places needed, each after the conditions that it is needed under, as early as these allow."""
        keys: dict[int, tuple[int, int]] = {}

        def key(place: int) -> tuple[int, int]:
            if place not in keys:
                after = [key(condition) for condition, _ in self.guards.get(place, ALWAYS)]
                before = [key(operand) for operand in self.tape.nodes[place].operands()]
                keys[place] = max([(place, 0), *before, *((at, hops + 1) for at, hops in after)])
            return keys[place]

        return sorted(self.forms, key=lambda place: (key(place), place))

    def _may_be(self, condition: int, value: bool) -> str:
        name = f"{self.prefix}{condition}"
        return f"may_hold({name if value else f'negation({name})'})"

    def _declaration(self, place: int) -> str:
        node, form = self.tape.nodes[place], self.forms[place]
        if node.op == "loop":
            return f"Value<N> {', '.join(f'{self.prefix}{place}_{i}' for i in range(len(node.args)))};"
        kind = self._type(place, form)
        return f"{f'Condition<{kind}>' if self._is_condition(place) else kind} {self.prefix}{place};"

    def _type(self, place: int, form: Form) -> str:
        return f"Pair<{_TYPES[form]}>" if self.tape.nodes[place].value == PAIR else _TYPES[form]

    def _is_condition(self, place: int) -> bool:
        node = self.tape.nodes[place]
        return self._is_condition(node.args[-1]) if node.op in _OF_EITHER else node.op in CONDITIONS

    def _operation(self, place: int, *, declared: bool) -> Iterable[str]:
        if self.tape.nodes[place].op == "loop":
            if not declared:
                yield self._declaration(place)
            yield from self._loop(place)
        else:
            kind = "" if declared else "const auto "
            yield f"{kind}{self.prefix}{place} = {self._expression(place, self.forms[place])};"

    def _choices(self, by: int, places: list[int], *, declared: bool) -> Iterable[str]:
        """Choices by one condition, which may be the same for all lanes."""
        if not declared:
            yield from map(self._declaration, places)
        name = f"{self.prefix}{by}"
        never, always = f"if (!may_hold({name}))", f"if (!may_hold(negation({name})))"
        for test, arm in ((always, 1), (f"else {never}", 2), ("else", 0)):
            yield f"{test} {{"
            for place in places:
                form, args = self.forms[place], self.tape.nodes[place].args
                taken = self.use(args[arm], form) if arm else self._expression(place, form)
                yield f"  {self.prefix}{place} = {taken};"
            yield "}"

    def _expression(self, place: int, form: Form) -> str:
        node = self.tape.nodes[place]
        if node.op == "input":
            read = f"in[{self.inputs[node.value]}]"
            return read if form is Form.BOUNDED else f"{_CASTS[form]}({read})"
        if node.op == "state":
            return f"state_{self.prefix}{node.value}" if form is Form.VALUE else "?"
        if node.op == "outer":
            assert self.outside is not None
            return self.outside.use(node.value, Form.VALUE)
        if node.op == "certain":
            inner = min(form, Form.VALUE)
            value = self.use(node.args[0], Form(inner))
            return f"lifted<N>({value})" if form is Form.BOUNDED else value
        if node.op == "error_of":
            error = f"error_of({self.use(node.args[0], Form.BOUNDED)})"
            return f"lifted<{_TYPES[form]}>({error})"
        if node.op == "widened":
            if form is not Form.BOUNDED:
                return self.use(node.args[0], form)
            return f"widened({self.use(node.args[0], form)}, {self.use(node.args[1], Form.VALUE)})"
        args = [self.use(arg, form) for arg in node.args]
        if node.op in _INFIX:
            return f"{args[0]} {_INFIX[node.op]} {args[1]}"
        if node.op == "neg":
            return f"-{args[0]}"
        if node.op in ("join", "both"):
            name = f"join_truths<{_TYPES[form]}>" if self._is_condition(place) else "join"
            return f"{name}({args[0]}, {args[-1]})"
        if node.op == "select":
            return f"choose({', '.join(args)})"
        return f"{_PREFIX[node.op]}({', '.join(args)})"

    def _loop(self, place: int) -> Iterable[str]:
        node = self.tape.nodes[place]
        loop, name = node.value, f"{self.prefix}{place}"
        turn = _Scope(
            loop.tape, _turn_forms(loop.tape, loop.going, loop.after), f"{name}_turn", self.inputs, self, {}
        )
        count = len(node.args)
        for i, arg in enumerate(node.args):
            yield f"{name}_{i} = {self.use(arg, Form.VALUE)};"
        if self.tape.of_derivatives:
            yield f"Turns {name}_turns;"
        yield f"for (int turn = 0; turn < {loop.budget}; ++turn) {{"
        for i in range(count):
            yield f"  const Value<N> state_{turn.prefix}{i} = {name}_{i}; (void)state_{turn.prefix}{i};"
        # The condition first: most of a turn is needless after the last one.
        first = _turn_forms(loop.tape, loop.going, ())
        written = set()
        for line, at in turn.numbered_lines(first):
            written.add(at)
            yield "  " + line
        yield f"  const auto {name}_going = {turn.use(loop.going, Form.VALUE)};"
        yield f"  if (!any({name}_going)) break;"
        for line, at in turn.numbered_lines(turn.forms):
            if at not in written:
                yield "  " + line
        for i, after in enumerate(loop.after):
            yield f"  {name}_{i} = choose({name}_going, {turn.use(after, Form.VALUE)}, {name}_{i});"
        if self.tape.of_derivatives:
            yield f"  {name}_turns.keep({', '.join(f'{name}_{i}' for i in range(count))});"
        yield "}"

    def numbered_lines(self, places: Iterable[int]) -> Iterable[tuple[str, int]]:
        """The lines of some operations, each with its place."""
        for place in sorted(places):
            node, form = self.tape.nodes[place], self.forms[place]
            if node.op not in CONSTANTS:
                yield f"const auto {self.prefix}{place} = {self._expression(place, form)};", place


def _literal(value: float) -> str:
    if math.isnan(value):
        return '__builtin_nan("")'
    if math.isinf(value):
        return ("-" if value < 0 else "") + "__builtin_inf()"
    return value.hex()
