"""A tape as a C++ function template: one line an operation, the arithmetic is that of its number type.

Not every result needs all that a number type carries. Each operation is written in one of three forms:

    bounded   ``N``: the number type, with the error it carries
    value     ``Value<N>``: the same number without its error
    report    ``Report<N>``: in double precision at most
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from enum import IntEnum

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


def emit(
    name: str,
    inputs: list[object],
    bounded: Iterable[Symbol],
    reported: Iterable[Symbol],
    flags: Iterable[Symbol],
    certainties: Iterable[Symbol] = (),
) -> str:
    """A function template ``name<N>(in, bounded, reported, flags)``.

    Args:
        name: of the function.
        inputs: the names of what it reads, in the order of ``in``.
        bounded: what it writes with its error.
        reported: what it writes without.
        flags: truth values, taken as they are.
        certainties: truth values that follow those: of them, one that is undecided counts as false.
    """
    bounded, reported, flags, certainties = map(list, (bounded, reported, flags, certainties))
    tape = (bounded + reported + flags)[0].tape
    wanted = [(x.place, Form.BOUNDED) for x in [*bounded, *certainties]]
    wanted += [(x.place, Form.REPORT) for x in [*reported, *flags]]
    scope = _Scope(tape, dict(_forms(tape, wanted)), "t", {name: i for i, name in enumerate(inputs)}, None)
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
            for outer in _outer_places(node.value):
                need(outer, Form.VALUE)
            for arg in node.args:
                need(arg, Form.VALUE)
        else:
            for arg in node.args:
                need(arg, form)
    return forms


def _turn_forms(turn: Tape, going: int, after: Iterable[int]) -> dict[int, Form]:
    return _forms(turn, [(place, Form.VALUE) for place in (going, *after)])


def _outer_places(loop: object) -> Iterable[int]:
    forms = _turn_forms(loop.tape, loop.going, loop.after)  # type: ignore[attr-defined]
    nodes = loop.tape.nodes  # type: ignore[attr-defined]
    return [nodes[place].value for place in forms if nodes[place].op == "outer"]


class _Scope:
    """The lines of one tape."""

    def __init__(
        self,
        tape: Tape,
        forms: dict[int, Form],
        prefix: str,
        inputs: dict[object, int],
        outside: _Scope | None,
    ) -> None:
        self.tape = tape
        self.forms = forms
        self.prefix = prefix
        self.inputs = inputs
        self.outside = outside

    def use(self, place: int, form: Form) -> str:
        """The number at a place, in a form that it has or less."""
        node, own = self.tape.nodes[place], self.forms[place]
        if node.op == "constant":
            return f"constant<{_TYPES[form]}>({_literal(node.value)})"
        if node.op == "given_roundoff":
            return f"constant<{_TYPES[form]}>(GIVEN_ROUNDOFF)"
        if node.op == "truth":
            return f"truth<{_TYPES[form]}>({'true' if node.value else 'false'})"
        if node.op in ("loop", "part"):
            own = Form.VALUE
        name = f"{self.prefix}{place}"
        if own is form:
            return name
        if own < form:
            return f"lifted<{_TYPES[form]}>({name})"
        return f"{_CASTS[form]}({name})" if node.op not in CONDITIONS else f"decided({name})"

    def lines(self) -> Iterable[str]:
        """One or more for each operation needed."""
        for place in sorted(self.forms):
            node, form = self.tape.nodes[place], self.forms[place]
            if node.op in CONSTANTS:
                continue
            if node.op == "loop":
                yield from self._loop(place)
            elif node.op == "part":
                yield f"const Value<N> {self.prefix}{place} = {self.prefix}{node.args[0]}_{node.value};"
            else:
                yield f"const auto {self.prefix}{place} = {self._expression(place, form)};"

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
        if node.op == "select":
            return f"choose({', '.join(args)})"
        return f"{_PREFIX[node.op]}({', '.join(args)})"

    def _loop(self, place: int) -> Iterable[str]:
        node = self.tape.nodes[place]
        loop, name = node.value, f"{self.prefix}{place}"
        turn = _Scope(
            loop.tape, _turn_forms(loop.tape, loop.going, loop.after), f"{name}_turn", self.inputs, self
        )
        count = len(node.args)
        for i, arg in enumerate(node.args):
            yield f"Value<N> {name}_{i} = {self.use(arg, Form.VALUE)};"
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
