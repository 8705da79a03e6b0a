"""Formulas as data: run a formula on symbols once, and get the list of its operations.

A :class:`Symbol` is a number that computes nothing: it writes every operation on its :class:`Tape`. What a
tape holds is what the formula says, no arithmetic is expanded.

The tape simplifies what changes no rounding: equal operations are written once, operations on constants
are carried out, ``x + 0``, ``x * 1`` and ``x * 0`` vanish, and minus signs leave products and quotients.
For finite numbers the results are those of the formula; only the sign of a zero may differ. A number that
is not finite may get lost in ``x * 0``: look for those first.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Hashable, Iterable, Iterator
from itertools import count
from typing import Any, NamedTuple

from ..numbers.operations import numbers_in

CONDITIONS = frozenset({"truth", "lt", "le", "eq", "and", "or", "not"})
"""The operations whose result is a truth value."""

_COMMUTATIVE = frozenset({"add", "mul", "eq", "and", "or"})
_FOLD: dict[str, Callable[..., Any]] = {
    "add": operator.add,
    "sub": operator.sub,
    "mul": operator.mul,
    "neg": operator.neg,
    "sqrt": math.sqrt,
    "lt": operator.lt,
    "le": operator.le,
    "eq": operator.eq,
    "not": operator.not_,
    "certain": float,
}


class Node(NamedTuple):
    """One operation.

    Attributes:
        op: ``input``, ``constant``, ``truth``, ``given_roundoff``;
            ``add``, ``sub``, ``mul``, ``div``, ``neg``, ``sqrt``;
            ``log1p_over``, ``expm1_over`` (values);
            ``lt``, ``le``, ``eq``, ``and``, ``or``, ``not``, ``select`` (condition, if true, if false);
            ``certain``, ``error_of``, ``widened`` (number, by); ``varying_as`` (number, number with its
            derivatives); ``law``, of what it sees, left open; ``loop`` (of the first state); ``part`` of the
            result of either; ``call`` of a function, ``result`` of it; within a loop ``state``, and ``outer``
            for what lies outside it.
        args: the operands, as places on the tape; all of them earlier.
        value: the name of an input or a function, the value of a constant, a :class:`Loop`, the index of a
            part, result or state, the place of what lies outside.
    """

    op: str
    args: tuple[int, ...] = ()
    value: Any = None

    def operands(self) -> list[int]:
        """The places that the result takes; of a loop those outside too."""
        return [*self.args, *(self.value.outer() if self.op == "loop" else ())]


class Loop(NamedTuple):
    """What is repeated.

    Attributes:
        tape: of one turn, from the ``state`` nodes on.
        going: the place of the condition under which there is one more turn.
        after: the places of the state after the turn.
        budget: turns at most.
    """

    tape: Tape
    going: int
    after: tuple[int, ...]
    budget: int

    def outer(self) -> list[int]:
        """What the turns take of the tape outside."""
        nodes = (self.tape.nodes[place] for place in sorted(self.tape.needed_for([self.going, *self.after])))
        return [node.value for node in nodes if node.op == "outer"]


class Tape:
    """The operations of a formula, each once, operands before results.

    Args:
        outside: the tape around a loop, if this is the tape of one turn of it.
        of_derivatives: whether its numbers carry derivatives, not errors: see
            :mod:`~collision_response.numbers.operations`.
    """

    def __init__(self, outside: Tape | None = None, *, of_derivatives: bool = False) -> None:
        self.nodes: list[Node] = []
        self.outside = outside
        self.of_derivatives: bool = of_derivatives if outside is None else outside.of_derivatives
        self.depth: int = 0 if outside is None else outside.depth + 1
        self._places: dict[Node, int] = {}

    def input(self, name: Hashable) -> Symbol:
        """The number that will be called ``name``."""
        return self.write(Node("input", (), name))

    def symbol(self, operand: Any) -> Symbol:
        """A symbol of this tape for a plain number or truth value, or a symbol of this tape or outside it."""
        if isinstance(operand, Symbol):
            if operand.tape is self:
                return operand
            if self.outside is None:
                raise ValueError("symbols of two tapes do not mix")
            outer = self.outside.symbol(operand)
            if outer.is_constant:
                return self.write(outer.node)
            return self.write(Node("outer", (), outer.place))
        if isinstance(operand, bool):
            return self.write(Node("truth", (), operand))
        number = float(operand)
        return self.write(Node("constant", (), math.nan if math.isnan(number) else number + 0.0))

    def at(self, place: int) -> Symbol:
        """The number at a place."""
        return Symbol(self, place)

    def find(self, op: str, args: Iterable[int], value: Any = None) -> int | None:
        """The place of this operation, if it is on the tape."""
        return self._places.get(Node(op, _ordered(op, args), value))

    def results_of(self, call: int) -> int:
        """How many there are."""
        return sum(node.op == "result" and node.args[0] == call for node in self.nodes)

    def needed_for(self, places: Iterable[int]) -> set[int]:
        """The places of all operations that some results take."""
        needed: set[int] = set()
        left = list(places)
        while left:
            place = left.pop()
            if place not in needed:
                needed.add(place)
                left += self.nodes[place].operands()
        return needed

    def write(self, node: Node) -> Symbol:
        """The result of an operation, as it is: its error may be rounded by the order of operands."""
        same = node._replace(args=_ordered(node.op, node.args))
        if same not in self._places:
            self._places[same] = len(self.nodes)
            self.nodes.append(node)
        return self.at(self._places[same])


def record(op: str, *operands: Any) -> Symbol:
    """The result of an operation, simplified, on the innermost tape of its operands."""
    tape = max((x.tape for x in operands if isinstance(x, Symbol)), key=lambda tape: tape.depth)
    args = [tape.symbol(operand) for operand in operands]
    if op in _FOLD and all(arg.is_constant for arg in args):
        return tape.symbol(_FOLD[op](*(arg.node.value for arg in args)))
    simpler = _SIMPLER[op](*args) if op in _SIMPLER else None
    if simpler is not None:
        return tape.symbol(simpler)
    return tape.write(Node(op, tuple(arg.place for arg in args)))


def _operator(op: str) -> Callable[[Symbol, Any], Symbol]:
    """Of a symbol and what follows it."""
    return lambda self, other: record(op, self, other)


def _turned(op: str) -> Callable[[Symbol, Any], Symbol]:
    """Of a symbol and what comes before it."""
    return lambda self, other: record(op, other, self)


class Symbol:
    """A number, or a truth value, that stands for a place on a tape."""

    __slots__ = ("place", "tape")
    __hash__ = None  # type: ignore[assignment]

    def __init__(self, tape: Tape, place: int) -> None:
        self.tape = tape
        self.place = place

    @property
    def node(self) -> Node:
        """The operation that gives this number."""
        return self.tape.nodes[self.place]

    @property
    def is_constant(self) -> bool:
        """Whether the value is known."""
        return self.node.op in ("constant", "truth")

    def is_value(self, value: float) -> bool:
        """Whether this is known to be ``value``."""
        return self.node.op == "constant" and bool(self.node.value == value)

    def operands(self) -> list[Symbol]:
        """What the operation takes."""
        return [self.tape.at(place) for place in self.node.args]

    def negated(self) -> Symbol | None:
        """``y`` if this is ``-y``, or ``not y``."""
        return self.operands()[0] if self.node.op in ("neg", "not") else None

    def sqrt(self) -> Symbol:
        """The square root."""
        return record("sqrt", self)

    def certain(self) -> Symbol:
        """See :func:`~collision_response.numbers.operations.certain`."""
        return self if self.tape.of_derivatives else record("certain", self)

    def error_of(self) -> Symbol:
        """See :func:`~collision_response.numbers.operations.error_of`."""
        return self.tape.symbol(0.0) if self.tape.of_derivatives else record("error_of", self)

    def widened(self, by: Any) -> Symbol:
        """See :func:`~collision_response.numbers.operations.widened`."""
        return self if self.tape.of_derivatives else record("widened", self, by)

    def varying_as(self, other: Callable[[], Any]) -> Symbol:
        """See :func:`~collision_response.numbers.operations.varying_as`."""
        return record("varying_as", self, other()) if self.tape.of_derivatives else self

    def for_derivatives(self, other: Callable[[], Any]) -> Any:
        """See :func:`~collision_response.numbers.operations.for_derivatives`."""
        return other() if self.tape.of_derivatives else self

    def value_of(self, function: str) -> Symbol:
        """A function of it, as a number that does not vary."""
        return record(function, self)

    def called(self, formula: Callable[..., Any], arguments: tuple[Any, ...]) -> Any:
        """See :func:`~collision_response.numbers.operations.called`."""
        if self.tape.of_derivatives:
            return formula(*arguments)
        tape, numbers = self.tape, list(numbers_in(arguments))
        inputs = map(Tape().input, range(len(numbers)))
        result = formula(*(rebuilt(argument, inputs) for argument in arguments))
        call = tape.write(Node("call", tuple(tape.symbol(x).place for x in numbers), formula.__name__)).place
        return rebuilt(result, (tape.write(Node("result", (call,), i)) for i in count()))

    def given_roundoff(self) -> Symbol:
        """See :func:`~collision_response.numbers.operations.given_roundoff`."""
        return self.tape.write(Node("given_roundoff"))

    @staticmethod
    def pick(condition: Symbol, if_true: Any, if_false: Any) -> Any:
        """``if_true`` where the condition holds, else ``if_false``."""
        return record("select", condition, if_true, if_false)

    def loop(self, state: Any, going: Callable[[Any], Any], step: Callable[[Any], Any], budget: int) -> Any:
        """The state after a loop that starts with ``state``, of which this is the first ``going``."""
        if self.is_constant and not self.node.value:
            return state
        first: list[Any] = list(numbers_in(state))
        tape = max((x.tape for x in [self, *first] if isinstance(x, Symbol)), key=lambda tape: tape.depth)
        turn = Tape(outside=tape)
        inside = rebuilt(state, (turn.write(Node("state", (), i)) for i in range(len(first))))
        go_on = turn.symbol(going(inside)).place
        after = tuple(turn.symbol(x).place for x in numbers_in(step(inside)))
        starts = tuple(tape.symbol(x).place for x in first)
        loop = tape.write(Node("loop", starts, Loop(turn, go_on, after, budget))).place
        return rebuilt(state, (tape.write(Node("part", (loop,), i)) for i in range(len(first))))

    __add__, __radd__ = _operator("add"), _turned("add")
    __sub__, __rsub__ = _operator("sub"), _turned("sub")
    __rmul__ = _turned("mul")
    __truediv__, __rtruediv__ = _operator("div"), _turned("div")
    __lt__, __gt__ = _operator("lt"), _turned("lt")
    __le__, __ge__ = _operator("le"), _turned("le")
    __eq__ = _operator("eq")  # type: ignore[assignment]
    __and__, __rand__ = _operator("and"), _turned("and")
    __or__, __ror__ = _operator("or"), _turned("or")

    def __mul__(self, other: Any) -> Symbol:
        return record("mul", self, other) if not isinstance(other, tuple) else NotImplemented

    def __ne__(self, other: Any) -> Symbol:  # type: ignore[override]
        return ~(self == other)

    def __neg__(self) -> Symbol:
        return record("neg", self)

    def __abs__(self) -> Symbol:
        return record("select", self < 0, -self, self)

    def __invert__(self) -> Symbol:
        return record("not", self)

    def __bool__(self) -> bool:
        raise TypeError("a symbol has no truth value yet: branch with choose()")


def rebuilt(value: Any, numbers: Iterator[Any]) -> Any:
    """Nested named tuples like ``value``, of other numbers."""
    if isinstance(value, tuple):
        return type(value)(*[rebuilt(part, numbers) for part in value])
    return next(numbers)


def _ordered(op: str, args: Iterable[int]) -> tuple[int, ...]:
    """The operands, in one order."""
    return tuple(sorted(args)) if op in _COMMUTATIVE else tuple(args)


# What an operation is simplified to; None: nothing. No rule changes a rounding.


def _add(x: Symbol, y: Symbol) -> Any:
    if x.is_value(0):
        return y
    if y.is_value(0):
        return x
    minus_x, minus_y = x.negated(), y.negated()
    if minus_y is not None:
        return x - minus_y
    return None if minus_x is None else y - minus_x


def _sub(x: Symbol, y: Symbol) -> Any:
    if y.is_value(0):
        return x
    if x.is_value(0):
        return -y
    minus_x, minus_y = x.negated(), y.negated()
    if minus_y is not None:
        return x + minus_y
    if minus_x is not None:
        return -(minus_x + y)
    opposite = x.tape.find("sub", (y.place, x.place))
    return None if opposite is None or x.place == y.place else -x.tape.at(opposite)


def _mul(x: Symbol, y: Symbol) -> Any:
    for factor, other in ((x, y), (y, x)):
        if factor.is_value(0):
            return 0.0
        if factor.is_value(1):
            return other
        if factor.is_value(-1):
            return -other
    minus_x, minus_y = x.negated(), y.negated()
    if minus_x is not None:
        return -(minus_x * y)
    return None if minus_y is None else -(x * minus_y)


def _div(x: Symbol, y: Symbol) -> Any:
    if x.is_value(0) or y.is_value(1):
        return x
    if y.node.op == "constant" and abs(math.frexp(y.node.value)[0]) == 0.5:
        return x * (1 / y.node.value)  # a power of two: the same number, and cheaper
    minus_x, minus_y = x.negated(), y.negated()
    if minus_x is not None:
        return -(minus_x / y)
    return None if minus_y is None else -(x / minus_y)


def _joined(neutral: bool) -> Callable[[Symbol, Symbol], Any]:
    """Of ``and`` and ``or``, which leave the other operand as it is if one is ``neutral``."""

    def simpler(x: Symbol, y: Symbol) -> Any:
        for one, other in ((x, y), (y, x)):
            if one.node.op == "truth":
                return other if one.node.value is neutral else one
        return x if x.place == y.place else None

    return simpler


def _select(condition: Symbol, x: Symbol, y: Symbol) -> Any:
    if condition.node.op == "truth":
        return x if condition.node.value else y
    return x if x.place == y.place else None


def _certain(x: Symbol) -> Any:
    return x if x.node.op in ("certain", "state", "part", "error_of") else None


def _error_of(x: Symbol) -> Any:
    return 0.0 if x.node.op in ("constant", "certain", "state", "part", "error_of") else None


def _widened(x: Symbol, by: Symbol) -> Any:
    return x if by.is_value(0) else None


_SIMPLER: dict[str, Callable[..., Any]] = {
    "add": _add,
    "sub": _sub,
    "mul": _mul,
    "div": _div,
    "neg": Symbol.negated,
    "not": Symbol.negated,
    "and": _joined(neutral=True),
    "or": _joined(neutral=False),
    "select": _select,
    "certain": _certain,
    "error_of": _error_of,
    "widened": _widened,
}
