"""A tape as a C++ function template: one line an operation, the arithmetic is that of its number type.

Not every result needs all that a number type carries. Each operation is written in one of three forms:

    bounded   ``N``: the number type, with the error it carries
    value     ``Value<N>``: the same number without its error
    report    ``Report<N>``: in double precision at most

Nor does every request need all operations: what only one branch of a choice takes is computed where that
branch may be taken, by any lane. The results are the same to the bit.

Where numbers carry derivatives, each turn of a loop is written twice: first the values, then the derivatives
of the states that a result needs.
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
_PREFIX |= {"log1p_over": "log1p_over", "expm1_over": "expm1_over"}
_PREFIX |= {"varying_as": "varying_as", "first": "at<0>", "second": "at<1>", "swapped": "swapped"}
_OF_EITHER = ("select", "join", "both", "first", "second", "swapped")
"""Operations on numbers and on conditions."""


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
    """A function template ``name<N>(in, bounded, reported, flags)``, and ``law`` if it leaves that open.

    Args:
        name: of the function.
        inputs: the names of what it reads, in the order of ``in``.
        bounded: what it writes with its error.
        reported: what it writes without.
        flags: truth values, taken as they are.
        certainties: truth values that follow those: of them, one that is undecided counts as false.
        branches: how many additions must be saved for it to pay to skip what no lane needs. Left out, nothing
            is skipped.
    """
    bounded, reported, flags, certainties = map(list, (bounded, reported, flags, certainties))
    tape = (bounded + reported + flags)[0].tape
    wanted = [(x.place, Form.BOUNDED) for x in [*bounded, *certainties]]
    wanted += [(x.place, Form.REPORT) for x in [*reported, *flags]]
    forms = _forms(tape, wanted)
    guards = {} if branches is None else _guards(tape, forms, {place for place, _ in wanted}, branches)
    scope = _Scope(tape, forms, "t", {name: i for i, name in enumerate(inputs)}, None, guards)
    lines = list(scope.lines())
    lines += [f"bounded[{i}] = {scope.use(x.place, Form.BOUNDED)};" for i, x in enumerate(bounded)]
    lines += [f"reported[{i}] = {scope.use(x.place, Form.REPORT)};" for i, x in enumerate(reported)]
    lines += [f"flags[{i}] = {scope.use(x.place, Form.REPORT)};" for i, x in enumerate(flags)]
    for i, x in enumerate(certainties, len(flags)):
        lines.append(f"flags[{i}] = certainly_true({scope.use(x.place, Form.BOUNDED)});")
    body = "\n".join("  " + line for line in lines)
    calls = any(tape.nodes[place].op == "law" for place in forms)
    parameters = "const N* in, N* bounded, Report<N>* reported, Mask<Base<N>>* flags"
    return (
        f"template <class N{', class F' if calls else ''}>\n"
        f"INLINE void {name}({parameters}{', const F& law' if calls else ''}) {{\n"
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
        elif node.op in ("call", "result"):
            forms[place] = Form.BOUNDED
            for arg in node.args:
                need(arg, Form.BOUNDED)
        elif node.op == "widened":
            need(node.args[0], form)
            if form is Form.BOUNDED:
                need(node.args[1], Form.VALUE)
        elif node.op == "loop":
            varying = _varying(tape, forms, place)
            for part in _parts(tape, forms, place):
                forms[part] = varying.form_of_state(tape.nodes[part].value)
            for i, arg in enumerate(node.args):
                need(arg, varying.form_of_state(i))
            for at in node.value.tape.needed_for([node.value.going, *node.value.after]):
                if node.value.tape.nodes[at].op == "outer":
                    need(node.value.tape.nodes[at].value, varying.form_of(at))
        else:
            for arg in node.args:
                need(arg, form)
    return forms


def _parts(tape: Tape, places: Iterable[int], loop: int) -> list[int]:
    """Those of the result of a loop."""
    nodes = tape.nodes
    return [place for place in places if nodes[place].op == "part" and nodes[place].args[0] == loop]


class _Varying(NamedTuple):
    """What of a turn of a loop carries derivatives: all, or some operations and parts of the state."""

    places: frozenset[int] | None = None
    states: frozenset[int] = frozenset()

    def form_of(self, place: int) -> Form:
        """Of an operation."""
        return Form.VALUE if self.places is None or place in self.places else Form.REPORT

    def form_of_state(self, i: int) -> Form:
        """Of a part of the state."""
        return Form.VALUE if self.places is None or i in self.states else Form.REPORT


def _varying(tape: Tape, forms: dict[int, Form], place: int) -> _Varying:
    """What of a turn of a loop carries derivatives, for the parts of its result that have them.

    What decides, and what is fixed, does without.
    """
    if not tape.of_derivatives:
        return _Varying()
    parts, node = _parts(tape, forms, place), tape.nodes[place]
    wanted = {tape.nodes[part].value for part in parts if forms[part] > Form.REPORT}
    loop: Loop = node.value
    turn = loop.tape
    varying_states = {i for i, start in enumerate(node.args) if _varies(tape, start)}
    while True:
        varying: set[int] = set()
        for place, one in enumerate(turn.nodes):
            begins = one.op == "outer" or (one.op == "state" and one.value in varying_states)
            if begins or varying.intersection(_sources(one)):
                varying.add(place)
        more = {i for i, after in enumerate(loop.after) if after in varying} - varying_states
        if not more:
            break
        varying_states |= more
    places: set[int] = set()
    states = wanted & varying_states
    left = [loop.after[i] for i in states]
    while left:
        place = left.pop()
        if place in places or place not in varying:
            continue
        places.add(place)
        one = turn.nodes[place]
        if one.op == "state" and one.value not in states:
            states.add(one.value)
            left.append(loop.after[one.value])
        left += _sources(one)
    return _Varying(frozenset(places), frozenset(states))


def _varies(tape: Tape, place: int) -> bool:
    """Whether a number may have derivatives."""
    node = tape.nodes[place]
    return node.op not in CONSTANTS and not (node.op == "varying_as" and not _varies(tape, node.args[1]))


def _sources(node: Node) -> tuple[int, ...]:
    """The operands that the derivatives of a result come from."""
    if node.op in CONDITIONS:
        return ()
    return node.args[1:] if node.op in ("select", "varying_as") else node.args


Guard: TypeAlias = frozenset[tuple[int, bool]]
"""Places of conditions, and what each must be, perhaps: only then is an operation needed."""

ALWAYS: Guard = frozenset()

BRANCHES = 12
"""How many additions must be saved for a branch to pay."""

BRANCHES_OF_PLAIN_NUMBERS = 80
"""The same on vectors of plain numbers alone: they take little to add, and seldom agree."""


def _guards(
    tape: Tape, forms: dict[int, Form], results: Iterable[int], worth: int = BRANCHES
) -> dict[int, Guard]:
    """When each operation is needed, by branches that save so much."""
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
    return {place: frozenset(x for x in guard if saved[x] >= worth) for place, guard in guards.items()}


_WEIGHTS = {"div": 6, "sqrt": 6, "loop": 100, "call": 100}
_WEIGHTS |= dict.fromkeys(("input", *CONSTANTS, "part", "result", "neg"), 0)


def _positive(tape: Tape, condition: int) -> tuple[int, bool]:
    """A condition without its negation, and whether it had one."""
    node = tape.nodes[condition]
    return (node.args[0], True) if node.op == "not" else (condition, False)


def _turn_forms(turn: Tape, form: Form, *places: int) -> dict[int, Form]:
    return _forms(turn, [(place, form) for place in places])


@dataclass(frozen=True)
class _Scope:
    """The lines of one tape.

    Attributes:
        tape: which.
        forms: of the operations that are written.
        prefix: of their names.
        inputs: the places of the inputs.
        outside: the scope around a turn of a loop.
        guards: when each operation is needed.
    """

    tape: Tape
    forms: dict[int, Form]
    prefix: str
    inputs: dict[object, int]
    outside: _Scope | None
    guards: dict[int, Guard]

    def use(self, place: int, form: Form) -> str:
        """The number at a place, in a form that it has or less."""
        node = self.tape.nodes[place]
        if node.op == "constant":
            return f"constant<{_TYPES[form]}>({_literal(node.value)})"
        if node.op == "given_roundoff":
            return f"constant<{_TYPES[form]}>(GIVEN_ROUNDOFF)"
        if node.op == "truth":
            return f"truth<{_TYPES[form]}>({'true' if node.value else 'false'})"
        own, name = self.forms[place], self._name(place)
        if own is form:
            return name
        if own < form:
            return f"lifted<{self._type(place, form)}>({name})"
        return f"{_CASTS[form]}({name})" if not self._is_condition(place) else f"plain_truth({name})"

    def lines(self) -> Iterable[str]:
        """One or more for each operation needed."""
        branched = {place for guard in self.guards.values() for place, _ in guard}
        nodes = self.tape.nodes

        def choice(place: int) -> int | None:
            """The condition of a choice that may be made for all lanes at once."""
            by = nodes[place].args[0] if nodes[place].op == "select" else None
            return None if by is None or _positive(self.tape, by)[0] not in branched else by

        places = [place for place in self._order() if nodes[place].op not in (*CONSTANTS, "part", "result")]
        written = {place: i for i, place in enumerate(places)}
        for guard, block in groupby(places, lambda place: self.guards.get(place, ALWAYS)):
            together = list(block)
            if guard:
                yield from map(self._declaration, together)
                # As they were written: one may be there only if those before it hold.
                tests = sorted(guard, key=lambda one: written.get(one[0], -1))
                yield f"if ({' && '.join(self._may_be(*one) for one in tests)}) {{"
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
            if place not in self.forms:
                return -1, 0
            if place not in keys:
                after = [key(condition) for condition, _ in self.guards.get(place, ALWAYS)]
                before = [key(operand) for operand in self.tape.nodes[place].operands()]
                keys[place] = max([(place, 0), *before, *((at, hops + 1) for at, hops in after)])
            return keys[place]

        return sorted(self.forms, key=lambda place: (key(place), place))

    def _may_be(self, condition: int, value: bool) -> str:
        name = self._name(condition)
        return f"may_be_true({name if value else f'negation({name})'})"

    def _name(self, place: int) -> str:
        node = self.tape.nodes[place]
        if node.op == "result":
            return f"{self.prefix}{node.args[0]}[{node.value}]"
        return f"{self.prefix}{place}" if node.op != "part" else f"{self.prefix}{node.args[0]}_{node.value}"

    def _declaration(self, place: int) -> str:
        node, form = self.tape.nodes[place], self.forms[place]
        if node.op == "loop":
            varying = _varying(self.tape, self.forms, place)
            names: dict[Form, list[str]] = {Form.VALUE: [], Form.REPORT: []}
            for i in range(len(node.args)):
                names[varying.form_of_state(i)].append(f"{self.prefix}{place}_{i}")
            return " ".join(f"{_TYPES[form]} {', '.join(some)};" for form, some in names.items() if some)
        if node.op == "call":
            return f"N {self.prefix}{place}[{self.tape.results_of(place)}];"
        kind = self._type(place, form)
        return f"{f'Condition<{kind}>' if self._is_condition(place) else kind} {self.prefix}{place};"

    def _type(self, place: int, form: Form) -> str:
        return f"Pair<{_TYPES[form]}>" if self.tape.nodes[place].value == PAIR else _TYPES[form]

    def _is_condition(self, place: int) -> bool:
        node = self.tape.nodes[place]
        if node.op == "outer" and self.outside is not None:
            return self.outside._is_condition(node.value)
        return self._is_condition(node.args[-1]) if node.op in _OF_EITHER else node.op in CONDITIONS

    def _operation(self, place: int, *, declared: bool) -> Iterable[str]:
        node, name = self.tape.nodes[place], f"{self.prefix}{place}"
        if node.op in ("loop", "call") and not declared:
            yield self._declaration(place)
        if node.op == "loop":
            yield from self._loop(place)
        elif node.op in ("call", "law"):
            given = ", ".join(self.use(arg, Form.BOUNDED) for arg in node.args)
            yield f"const N {name}_in[] = {{{given}}};"
            if node.op == "call":
                yield f"call_{node.value}({name}_in, {name});"
            else:
                yield f"const auto [{name}_0, {name}_1, {name}_2] = law({name}_in);"
        else:
            kind = "" if declared else "const auto "
            yield f"{kind}{name} = {self._expression(place, self.forms[place])};"

    def _choices(self, by: int, places: list[int], *, declared: bool) -> Iterable[str]:
        """Choices by one condition, which may be the same for all lanes."""
        if not declared:
            yield from map(self._declaration, places)
        name = self._name(by)
        never, always = f"if (!may_be_true({name}))", f"if (!may_be_true(negation({name})))"
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
            return f"state_{self.prefix}{node.value}"
        if node.op == "outer":
            assert self.outside is not None
            return self.outside.use(node.value, form)
        if node.op == "certain":
            value = self.use(node.args[0], min(form, Form.VALUE))
            return f"lifted<N>({value})" if form is Form.BOUNDED else value
        if node.op == "error_of":
            return f"lifted<{_TYPES[form]}>(error_of({self.use(node.args[0], Form.BOUNDED)}))"
        if node.op == "widened":
            if form is not Form.BOUNDED:
                return self.use(node.args[0], form)
            return f"widened({self.use(node.args[0], form)}, {self.use(node.args[1], Form.VALUE)})"
        if node.op == "varying_as" and form is Form.REPORT:
            return self.use(node.args[0], form)
        plain = node.op in _INFIX and self.tape.of_derivatives and form > Form.REPORT
        args = [self._factor(arg, form) if plain else self.use(arg, form) for arg in node.args]
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

    def _factor(self, place: int, form: Form) -> str:
        """As :meth:`use`, but a number without derivatives as one."""
        node = self.tape.nodes[place]
        if node.op == "constant":
            return f"constant<Number<{_TYPES[form]}>>({_literal(node.value)})"
        return self.use(place, form)

    def _loop(self, place: int) -> Iterable[str]:
        """The value of a turn, and what of it carries derivatives: as far as the values need it."""
        node, name = self.tape.nodes[place], f"{self.prefix}{place}"
        varying = _varying(self.tape, self.forms, place)
        loop: Loop = node.value
        of_values = Form.REPORT if self.tape.of_derivatives else Form.VALUE
        known = _turn_forms(loop.tape, of_values, loop.going, *loop.after)
        turn = _Scope(loop.tape, known, f"{name}_turn", self.inputs, self, {})
        count = len(node.args)
        for i, arg in enumerate(node.args):
            yield f"{name}_{i} = {self.use(arg, varying.form_of_state(i))};"
        yield f"for (int turn = 0; turn < {loop.budget}; ++turn) {{"
        for i in range(count):
            read = f"report({name}_{i})" if of_values is Form.REPORT else f"{name}_{i}"
            state = f"state_{turn.prefix}{i}"
            yield f"  const {_TYPES[of_values]} {state} = {read}; (void){state};"
        # The condition first: most of a turn is needless after the last one.
        first = _turn_forms(loop.tape, of_values, loop.going)
        yield from turn.plain_lines(first)
        yield f"  const auto {name}_going = {turn.use(loop.going, of_values)};"
        yield f"  if (!any({name}_going)) break;"
        yield from turn.plain_lines(known.keys() - first)
        if varying.places is not None:
            nodes = (loop.tape.nodes[place] for place in sorted(varying.places))
            outer = [one.value for one in nodes if one.op == "outer" and self.forms[one.value] > Form.REPORT]
            states = ", ".join(f"{name}_{i}" for i in sorted(varying.states))
            yield f"  if (turn == 0) share_edges({', '.join(map(self._name, outer))})({states});"
            yield from _Tangents(loop, name, self, turn, varying.places).blocks(varying.states)
        for i, after in enumerate(loop.after):
            if of_values is Form.REPORT:
                part = ".value" if i in varying.states else ""
                yield f"  {name}_{i}{part} = {turn.use(after, Form.REPORT)};"
            else:
                yield f"  {name}_{i} = choose({name}_going, {turn.use(after, Form.VALUE)}, {name}_{i});"
        yield "}"

    def plain_lines(self, places: Iterable[int]) -> Iterable[str]:
        """One for each of some operations of a turn."""
        for place in sorted(places):
            if self.tape.nodes[place].op not in CONSTANTS:
                yield f"  const auto {self.prefix}{place} = {self._expression(place, self.forms[place])};"


class _Tangents(_Scope):
    """The lines of a turn for derivatives, in four directions at a time, where the values are known."""

    def __init__(self, loop: Loop, name: str, outside: _Scope, values: _Scope, places: Iterable[int]) -> None:
        forms = dict.fromkeys(sorted(places), Form.VALUE)
        guards = _guards(loop.tape, forms, [place for place in loop.after if place in forms])
        super().__init__(loop.tape, forms, f"{values.prefix}_d", {}, outside, guards)
        self.name = name
        self.after = loop.after
        self.values = values

    def blocks(self, states: Iterable[int]) -> Iterable[str]:
        """The turn of some parts of the state."""
        yield "  for (int block = 0; block < N::Derivatives::BLOCKS; ++block) {"
        yield from ("    " + line for line in self.lines())
        for i in sorted(states):
            yield f"    {self.name}_{i}.d.d[block] = {self.use(self.after[i], Form.VALUE)};"
        yield "  }"

    def use(self, place: int, form: Form) -> str:
        """The derivatives of a number."""
        return f"{self.prefix}{place}" if place in self.forms else "Block{}"

    def _name(self, place: int) -> str:
        return self.values._name(place)

    def _declaration(self, place: int) -> str:
        return f"Block {self.prefix}{place};"

    def _expression(self, place: int, form: Form) -> str:
        node, known = self.tape.nodes[place], self.values.use
        if node.op == "state":
            return f"{self.name}_{node.value}.d.d[block]"
        if node.op == "outer":
            assert self.outside is not None
            known_only = self.outside.forms[node.value] is Form.REPORT
            return "Block{}" if known_only else f"{self.outside._name(node.value)}.d.d[block]"
        if node.op == "varying_as":
            return self.use(node.args[1], form)
        d = [self.use(arg, form) for arg in node.args]
        if node.op == "select":
            return f"{known(node.args[0], Form.REPORT)} ? {d[1]} : {d[2]}"
        value = [known(arg, Form.REPORT) for arg in node.args]
        varies = [arg in self.forms for arg in node.args]
        if node.op == "mul":
            return " + ".join(f"{d[i]} * {value[1 - i]}" for i in (0, 1) if varies[i])
        if node.op == "div":
            change = f"{known(place, Form.REPORT)} * {d[1]}"
            top = f"({d[0]} - {change})" if all(varies) else d[0] if varies[0] else f"-({change})"
            return f"{top} * (1 / {value[1]})"
        if node.op == "sqrt":
            return f"{d[0]} * slope_of_root({known(place, Form.REPORT)})"
        if node.op == "neg":
            return f"-{d[0]}"
        assert node.op in ("add", "sub"), node.op
        if all(varies):
            return f"{d[0]} {_INFIX[node.op]} {d[1]}"
        return d[0] if varies[0] else f"-{d[1]}" if node.op == "sub" else d[1]


def _literal(value: float) -> str:
    if math.isnan(value):
        return '__builtin_nan("")'
    if math.isinf(value):
        return ("-" if value < 0 else "") + "__builtin_inf()"
    return value.hex()
