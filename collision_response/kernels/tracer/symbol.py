"""Formulas as data: a formula that runs on symbols leaves its operations on a tape.

The tape simplifies a formula where that changes no rounding. It holds equal operations once, carries out
operations on constants, replaces ``x + 0`` and ``x * 1`` by ``x`` and ``x * 0`` by 0, and moves minus signs
out of products and quotients. For finite numbers the results are those of the formula; only the sign of a
zero may differ. A number that is not finite may get lost in ``x * 0``: a formula that has to notice it must
look at the inputs.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Hashable, Iterable
from itertools import count
from typing import Any, NamedTuple

from ...numbers.operations import numbers_in, rebuilt

CONDITIONS = frozenset({"truth", "lt", "le", "eq", "and", "or", "not"})
"""The operations whose result is a truth value."""

CONSTANTS = frozenset({"constant", "truth", "given_roundoff"})
"""The operations whose result does not depend on any input."""

_COMMUTATIVE = frozenset({"add", "mul", "eq", "and", "or"})
_ON_CONSTANTS: dict[str, Callable[..., Any]] = {
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
    """One operation on a tape.

    Attributes:
        op: the kind of operation, one of these; in parentheses are the operands that need a word:

            * ``input``, ``constant``, ``truth`` (a constant condition), ``given_roundoff``
            * ``add``, ``sub``, ``mul``, ``div``, ``neg``, ``sqrt``
            * ``log1p_over``, ``expm1_over``: values without derivatives
            * ``lt``, ``le``, ``eq``, ``and``, ``or``, ``not``, ``select`` (condition, if true, if false)
            * ``certain``, ``error_of``, ``widened`` (number, by)
            * ``varying_as`` (number, number whose derivatives it has)
            * ``law`` (the numbers that a law gets): the law itself is a parameter of the emitted code
            * ``loop`` (the initial state); within its tape ``state``, and ``outer`` for a number from outside
            * ``part`` (law or loop): one number of its result
            * ``call`` (arguments) of a function that is compiled once; ``result`` (call): one of its numbers
        args: the operands, by their indices on the tape. All of them are less than the node's own.
        value: the name of an input or function, the value of a constant, the :class:`Loop` of a loop, which
            part, result or state it is, or the index of an ``outer`` number on the parent tape.
    """

    op: str
    args: tuple[int, ...] = ()
    value: Any = None

    def operands(self) -> list[int]:
        """Indices of all nodes that the result depends on, those that a loop reads from outside included."""
        return [*self.args, *(self.value.outer() if self.op == "loop" else ())]


class Loop(NamedTuple):
    """The body of a loop.

    Attributes:
        tape: one iteration: a function of the ``state`` nodes.
        condition: index on that tape of the condition under which there is another iteration.
        state_after: indices on that tape of the state after the iteration.
        budget: the largest number of iterations.
        rounded: whether its numbers are rounded to floats.
    """

    tape: Tape
    condition: int
    state_after: tuple[int, ...]
    budget: int
    rounded: bool

    def outer(self) -> list[int]:
        """Indices on the parent tape of the numbers that the loop reads from there."""
        needed = self.tape.needed_for([self.condition, *self.state_after])
        nodes = (self.tape.nodes[index] for index in sorted(needed))
        return [node.value for node in nodes if node.op == "outer"]


class Tape:
    """The operations of a formula: each once, operands before results.

    Args:
        parent: for the tape of a loop, the tape that has the loop.
        of_derivatives: whether its numbers carry derivatives instead of errors: see
            :mod:`~collision_response.numbers.operations`.
    """

    def __init__(self, parent: Tape | None = None, *, of_derivatives: bool = False) -> None:
        self.nodes: list[Node] = []
        self.parent = parent
        self.of_derivatives: bool = of_derivatives if parent is None else parent.of_derivatives
        self.depth: int = 0 if parent is None else parent.depth + 1
        self._index_of: dict[Node, int] = {}

    def input(self, name: Hashable) -> Symbol:
        """Add an input of this name."""
        return self.add(Node("input", (), name))

    def symbol(self, operand: Any) -> Symbol:
        """Return a symbol of this tape for a number, a truth value, or a symbol of this tape or its parents.

        Raises:
            ValueError: if the symbol belongs to another tape.
        """
        if isinstance(operand, Symbol):
            if operand.tape is self:
                return operand
            if self.parent is None:
                raise ValueError("symbols of two tapes do not mix")
            outer = self.parent.symbol(operand)
            if outer.is_constant:
                return self.add(outer.node)
            return self.add(Node("outer", (), outer.index))
        if isinstance(operand, bool):
            return self.add(Node("truth", (), operand))
        number = float(operand)
        return self.add(Node("constant", (), math.nan if math.isnan(number) else number + 0.0))

    def symbols(self, value: Any) -> list[Symbol]:
        """Return :meth:`symbol` of every number of nested named tuples."""
        return [self.symbol(number) for number in numbers_in(value)]

    def index_of(self, op: str, args: Iterable[int], value: Any = None) -> int | None:
        """Return the index of an operation, ``None`` if it is not on the tape."""
        return self._index_of.get(Node(op, _ordered(op, args), value))

    def count_results(self, call: int) -> int:
        """Return how many numbers of the result of a call are on the tape."""
        return sum(node.op == "result" and node.args[0] == call for node in self.nodes)

    def needed_for(self, indices: Iterable[int]) -> set[int]:
        """Return the indices of all nodes that some nodes depend on, their own included."""
        needed: set[int] = set()
        pending = list(indices)
        while pending:
            index = pending.pop()
            if index not in needed:
                needed.add(index)
                pending += self.nodes[index].operands()
        return needed

    def add(self, node: Node) -> Symbol:
        """Return the symbol of an operation; add it, unsimplified, if it is not on the tape yet.

        Operands that commute keep their order when the node is new: the rounding of the error depends on it.
        """
        key = node._replace(args=_ordered(node.op, node.args))
        if key not in self._index_of:
            self._index_of[key] = len(self.nodes)
            self.nodes.append(node)
        return Symbol(self, self._index_of[key])


def apply(op: str, *operands: Any) -> Symbol:
    """Apply an operation: simplify it, or add it to the innermost tape of its operands."""
    tape = _innermost_tape(operands)
    args = [tape.symbol(operand) for operand in operands]
    if op in _ON_CONSTANTS and all(arg.is_constant for arg in args):
        return tape.symbol(_ON_CONSTANTS[op](*(arg.node.value for arg in args)))
    simpler = _SIMPLIFY[op](*args) if op in _SIMPLIFY else None
    if simpler is not None:
        return tape.symbol(simpler)
    return tape.add(Node(op, tuple(arg.index for arg in args)))


def _innermost_tape(operands: Iterable[Any]) -> Tape:
    return max((x.tape for x in operands if isinstance(x, Symbol)), key=lambda tape: tape.depth)


def _binary(op: str) -> Callable[[Symbol, Any], Symbol]:
    """Operator with the symbol on the left."""
    return lambda self, other: apply(op, self, other)


def _reflected(op: str) -> Callable[[Symbol, Any], Symbol]:
    """Operator with the symbol on the right."""
    return lambda self, other: apply(op, other, self)


class Symbol:
    """A number or truth value that stands for a node on a tape."""

    __slots__ = ("index", "tape")
    __hash__ = None  # type: ignore[assignment]

    def __init__(self, tape: Tape, index: int) -> None:
        self.tape = tape
        self.index = index

    @property
    def node(self) -> Node:
        """The operation whose result this is."""
        return self.tape.nodes[self.index]

    @property
    def is_constant(self) -> bool:
        """Whether the value is known."""
        return self.node.op in ("constant", "truth")

    def is_value(self, value: float) -> bool:
        """Whether this is the constant ``value``."""
        return self.node.op == "constant" and bool(self.node.value == value)

    def without_sign(self) -> Symbol | None:
        """``y`` if this is ``-y`` or ``not y``, else ``None``."""
        return Symbol(self.tape, self.node.args[0]) if self.node.op in ("neg", "not") else None

    def sqrt(self) -> Symbol:
        """The square root."""
        return apply("sqrt", self)

    def certain(self) -> Symbol:
        """See :func:`~collision_response.numbers.operations.certain`."""
        return self if self.tape.of_derivatives else apply("certain", self)

    def error_of(self) -> Symbol:
        """See :func:`~collision_response.numbers.operations.error_of`."""
        return self.tape.symbol(0.0) if self.tape.of_derivatives else apply("error_of", self)

    def widened(self, by: Any) -> Symbol:
        """See :func:`~collision_response.numbers.operations.widened`."""
        return self if self.tape.of_derivatives else apply("widened", self, by)

    def varying_as(self, other: Callable[[], Any]) -> Symbol:
        """See :func:`~collision_response.numbers.operations.varying_as`."""
        return apply("varying_as", self, other()) if self.tape.of_derivatives else self

    def for_derivatives(self, other: Callable[[], Any]) -> Any:
        """See :func:`~collision_response.numbers.operations.for_derivatives`."""
        return other() if self.tape.of_derivatives else self

    def value_of(self, function: str) -> Symbol:
        """Apply ``log1p_over`` or ``expm1_over``. The result has no derivatives."""
        return apply(function, self)

    def called(self, formula: Callable[..., Any], arguments: tuple[Any, ...]) -> Any:
        """See :func:`~collision_response.numbers.operations.called`."""
        if self.tape.of_derivatives:
            return formula(*arguments)
        tape = self.tape
        numbers = tape.symbols(arguments)
        inputs = map(Tape().input, range(len(numbers)))
        result = formula(*(rebuilt(argument, inputs) for argument in arguments))
        call = tape.add(Node("call", tuple(x.index for x in numbers), formula.__name__)).index
        return rebuilt(result, (tape.add(Node("result", (call,), i)) for i in count()))

    def given_roundoff(self) -> Symbol:
        """See :func:`~collision_response.numbers.operations.given_roundoff`."""
        return self.tape.add(Node("given_roundoff"))

    @staticmethod
    def pick(condition: Symbol, if_true: Any, if_false: Any) -> Any:
        """``if_true`` where the condition holds, else ``if_false``."""
        return apply("select", condition, if_true, if_false)

    def loop(
        self, state: Any, going: Callable[[Any], Any], step: Callable[[Any], Any], budget: int, rounded: bool
    ) -> Any:
        """The state after a loop that starts with ``state``. This symbol is ``going(state)``."""
        if self.is_constant and not self.node.value:
            return state
        initial: list[Any] = list(numbers_in(state))
        tape = _innermost_tape([self, *initial])
        body = Tape(parent=tape)
        inside = rebuilt(state, (body.add(Node("state", (), i)) for i in range(len(initial))))
        condition = body.symbol(going(inside)).index
        state_after = tuple(x.index for x in body.symbols(step(inside)))
        args = tuple(tape.symbol(x).index for x in initial)
        loop = tape.add(Node("loop", args, Loop(body, condition, state_after, budget, rounded))).index
        return rebuilt(state, (tape.add(Node("part", (loop,), i)) for i in range(len(initial))))

    __add__, __radd__ = _binary("add"), _reflected("add")
    __sub__, __rsub__ = _binary("sub"), _reflected("sub")
    __rmul__ = _reflected("mul")
    __truediv__, __rtruediv__ = _binary("div"), _reflected("div")
    __lt__, __gt__ = _binary("lt"), _reflected("lt")
    __le__, __ge__ = _binary("le"), _reflected("le")
    __eq__ = _binary("eq")  # type: ignore[assignment]
    __and__, __rand__ = _binary("and"), _reflected("and")
    __or__, __ror__ = _binary("or"), _reflected("or")

    def __mul__(self, other: Any) -> Symbol:
        return apply("mul", self, other) if not isinstance(other, tuple) else NotImplemented

    def __ne__(self, other: Any) -> Symbol:  # type: ignore[override]
        return ~(self == other)

    def __neg__(self) -> Symbol:
        return apply("neg", self)

    def __abs__(self) -> Symbol:
        return apply("select", self < 0, -self, self)

    def __invert__(self) -> Symbol:
        return apply("not", self)

    def __bool__(self) -> bool:
        raise TypeError("a symbol has no truth value yet: branch with choose()")


def _ordered(op: str, args: Iterable[int]) -> tuple[int, ...]:
    """The operands; in ascending order if they commute, so that equal operations compare equal."""
    return tuple(sorted(args)) if op in _COMMUTATIVE else tuple(args)


# Rules: each returns what an operation is simplified to, None if it stays. No rule changes a rounding.


def _simplify_add(x: Symbol, y: Symbol) -> Any:
    if x.is_value(0):
        return y
    if y.is_value(0):
        return x
    minus_x, minus_y = x.without_sign(), y.without_sign()
    if minus_y is not None:
        return x - minus_y
    return None if minus_x is None else y - minus_x


def _simplify_sub(x: Symbol, y: Symbol) -> Any:
    if y.is_value(0):
        return x
    if x.is_value(0):
        return -y
    minus_x, minus_y = x.without_sign(), y.without_sign()
    if minus_y is not None:
        return x + minus_y
    if minus_x is not None:
        return -(minus_x + y)
    opposite = x.tape.index_of("sub", (y.index, x.index))
    return None if opposite is None or x.index == y.index else -Symbol(x.tape, opposite)


def _simplify_mul(x: Symbol, y: Symbol) -> Any:
    for factor, other in ((x, y), (y, x)):
        if factor.is_value(0):
            return 0.0
        if factor.is_value(1):
            return other
        if factor.is_value(-1):
            return -other
    minus_x, minus_y = x.without_sign(), y.without_sign()
    if minus_x is not None:
        return -(minus_x * y)
    return None if minus_y is None else -(x * minus_y)


def _simplify_div(x: Symbol, y: Symbol) -> Any:
    if x.is_value(0) or y.is_value(1):
        return x
    if y.node.op == "constant" and abs(math.frexp(y.node.value)[0]) == 0.5:
        return x * (1 / y.node.value)  # exact for a power of two, and cheaper
    minus_x, minus_y = x.without_sign(), y.without_sign()
    if minus_x is not None:
        return -(minus_x / y)
    return None if minus_y is None else -(x / minus_y)


def _simplify_logical(neutral: bool) -> Callable[[Symbol, Symbol], Any]:
    """Rule for ``and`` and ``or``. If one operand is ``neutral``, the result is the other operand."""

    def simpler(x: Symbol, y: Symbol) -> Any:
        for operand, other in ((x, y), (y, x)):
            if operand.node.op == "truth":
                return other if operand.node.value is neutral else operand
        return x if x.index == y.index else None

    return simpler


def _simplify_select(condition: Symbol, x: Symbol, y: Symbol) -> Any:
    if condition.node.op == "truth":
        return x if condition.node.value else y
    return x if x.index == y.index else None


def _simplify_certain(x: Symbol) -> Any:
    return x if x.node.op in ("certain", "state", "part", "error_of") else None


def _simplify_error_of(x: Symbol) -> Any:
    return 0.0 if x.node.op in ("constant", "certain", "state", "part", "error_of") else None


def _simplify_widened(x: Symbol, by: Symbol) -> Any:
    return x if by.is_value(0) else None


_SIMPLIFY: dict[str, Callable[..., Any]] = {
    "add": _simplify_add,
    "sub": _simplify_sub,
    "mul": _simplify_mul,
    "div": _simplify_div,
    "neg": Symbol.without_sign,
    "not": Symbol.without_sign,
    "and": _simplify_logical(neutral=True),
    "or": _simplify_logical(neutral=False),
    "select": _simplify_select,
    "certain": _simplify_certain,
    "error_of": _simplify_error_of,
    "widened": _simplify_widened,
}
