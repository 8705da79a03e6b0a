"""Formulas as data: run a generic formula on symbols once, get the list of its operations.

The physics is written once, over any kind of number. A :class:`Symbol` is such a number: it computes
nothing, it writes every operation on its :class:`Tape`. The emitters beside this module turn a tape
into straight-line code. So a formula has one source, and all its forms round alike.

The tape simplifies what changes no rounding: equal operations are recorded once, constants are
folded, ``x + 0``, ``x * 1`` and ``x * 0`` vanish, and minus signs leave products, quotients and sums.
For finite numbers the results are those of the formula; only the sign of a zero may differ. A number
that is not finite may get lost in ``x * 0``: look for those first.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Hashable, Iterable, Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple

from .simplify import SIMPLER

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
}


class Node(NamedTuple):
    """One operation.

    Attributes:
        op: ``input``, ``constant``, ``truth``, ``add``, ``sub``, ``mul``, ``div``, ``neg``, ``sqrt``,
            ``fma`` (of ``a b + c``), ``lt``, ``le``, ``eq``, ``and``, ``or``, ``not`` or ``select``
            (condition, if true, if false).
        args: the operands, as places on the tape; all of them earlier.
        value: the name of an input (anything hashable), or the value of a constant.
    """

    op: str
    args: tuple[int, ...] = ()
    value: Any = None


class Tape:
    """The operations of a formula, each once, operands before results.

    Args:
        assumes: of a name of an input, whether a condition on such inputs alone is taken to hold. No
            choice by it is recorded; the condition is added to ``assumed`` instead.
        fused: whether what the formula is for can add to a product before it is rounded.
    """

    def __init__(self, assumes: Callable[[Any], bool] | None = None, *, fused: bool = False) -> None:
        self.nodes: list[Node] = []
        self.assumed: list[Symbol] = []
        self.fused = fused
        self._assumes = assumes
        self._places: dict[Node, int] = {}

    def input(self, name: Hashable) -> Symbol:
        """The number that will be called ``name``."""
        return self.write(Node("input", (), name))

    def symbol(self, operand: Any) -> Symbol:
        """A symbol for a plain number or truth value; a symbol of this tape as it is."""
        if isinstance(operand, Symbol):
            if operand.tape is not self:
                raise ValueError("symbols of two tapes do not mix")
            return operand
        if isinstance(operand, bool):
            return self.write(Node("truth", (), operand))
        number = float(operand)
        return self.write(Node("constant", (), math.nan if math.isnan(number) else number + 0.0))

    def record(self, op: str, *operands: Any) -> Symbol:
        """The result of an operation, simplified."""
        args = [self.symbol(operand) for operand in operands]
        if op in _FOLD and all(arg.is_constant for arg in args):
            return self.symbol(_FOLD[op](*(arg.node.value for arg in args)))
        if op == "select" and self._is_assumed(args[0]):
            return args[1]
        simpler = SIMPLER[op](*args) if op in SIMPLER else None
        if simpler is not None:
            return self.symbol(simpler)
        return self.write(Node(op, ordered(op, [arg.place for arg in args])))

    def at(self, place: int) -> Symbol:
        """The number at a place."""
        return Symbol(self, place)

    def find(self, op: str, args: Iterable[int], value: Any = None) -> int | None:
        """The place of this operation, if it is on the tape."""
        return self._places.get(Node(op, ordered(op, args), value))

    def needed_for(self, places: Iterable[int]) -> list[int]:
        """The places of all that these results depend on, themselves included, operands first."""
        needed: set[int] = set()
        waiting = list(places)
        while waiting:
            place = waiting.pop()
            if place not in needed:
                needed.add(place)
                waiting.extend(self.nodes[place].args)
        return sorted(needed)

    def _is_assumed(self, condition: Symbol) -> bool:
        if self._assumes is None or condition.is_constant:
            return False
        nodes = (self.nodes[place] for place in self.needed_for([condition.place]))
        if not all(self._assumes(node.value) for node in nodes if node.op == "input"):
            return False
        self.assumed.append(condition)
        return True

    @contextmanager
    def assuming_nothing(self) -> Iterator[None]:
        """For a part of the formula: every choice is recorded."""
        assumes, self._assumes = self._assumes, None
        yield
        self._assumes = assumes

    def write(self, node: Node) -> Symbol:
        """The result of an operation, as it is."""
        if node not in self._places:
            self._places[node] = len(self.nodes)
            self.nodes.append(node)
        return self.at(self._places[node])


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
        return self.node.op == "constant" and self.node.value == value

    def product_error(self, other: Any, product: Symbol) -> Symbol | None:
        """What rounding left out of the product, if that is one operation."""
        return self.tape.record("fma", self, other, -product) if self.tape.fused else None

    def operands(self) -> list[Symbol]:
        """What the operation takes."""
        return [self.tape.at(place) for place in self.node.args]

    def sqrt(self) -> Symbol:
        """The square root."""
        return self.tape.record("sqrt", self)

    def __add__(self, other: Any) -> Symbol:
        return self.tape.record("add", self, other)

    def __radd__(self, other: Any) -> Symbol:
        return self.tape.record("add", other, self)

    def __sub__(self, other: Any) -> Symbol:
        return self.tape.record("sub", self, other)

    def __rsub__(self, other: Any) -> Symbol:
        return self.tape.record("sub", other, self)

    def __mul__(self, other: Any) -> Symbol:
        return self.tape.record("mul", self, other)

    def __rmul__(self, other: Any) -> Symbol:
        return self.tape.record("mul", other, self)

    def __truediv__(self, other: Any) -> Symbol:
        return self.tape.record("div", self, other)

    def __rtruediv__(self, other: Any) -> Symbol:
        return self.tape.record("div", other, self)

    def __neg__(self) -> Symbol:
        return self.tape.record("neg", self)

    def __abs__(self) -> Symbol:
        return self.tape.record("select", self < 0, -self, self)

    def __lt__(self, other: Any) -> Symbol:
        return self.tape.record("lt", self, other)

    def __gt__(self, other: Any) -> Symbol:
        return self.tape.record("lt", other, self)

    def __le__(self, other: Any) -> Symbol:
        return self.tape.record("le", self, other)

    def __ge__(self, other: Any) -> Symbol:
        return self.tape.record("le", other, self)

    def __eq__(self, other: Any) -> Symbol:  # type: ignore[override]
        return self.tape.record("eq", self, other)

    def __ne__(self, other: Any) -> Symbol:  # type: ignore[override]
        return ~(self == other)

    def __and__(self, other: Any) -> Symbol:
        return self.tape.record("and", self, other)

    def __rand__(self, other: Any) -> Symbol:
        return self.tape.record("and", other, self)

    def __or__(self, other: Any) -> Symbol:
        return self.tape.record("or", self, other)

    def __ror__(self, other: Any) -> Symbol:
        return self.tape.record("or", other, self)

    def __invert__(self) -> Symbol:
        return self.tape.record("not", self)

    def __bool__(self) -> bool:
        raise TypeError("a traced number has no truth value yet: branch with choose()")

    def __array_namespace__(self) -> type[_Namespace]:
        return _Namespace


class _Namespace:
    """As much of an array namespace as ``physics.number.choose`` asks for."""

    @staticmethod
    def asarray(number: float) -> float:
        return number

    @staticmethod
    def where(condition: Symbol, if_true: Any, if_false: Any) -> Symbol:
        return condition.tape.record("select", condition, if_true, if_false)


def ordered(op: str, args: Iterable[int]) -> tuple[int, ...]:
    """The operands, in the one order in which the tape keeps them."""
    return tuple(sorted(args)) if op in _COMMUTATIVE else tuple(args)
