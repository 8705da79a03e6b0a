"""Python code for a formula from nested tuples of plain floats to nested tuples.

A call costs little more than its operations: the arguments are taken apart by one assignment each, the
numbers are local variables, and the results are put together without a call of Python code.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import count
from math import inf, nan, sqrt
from typing import Any, TypeVar

from .emit_scalar import emit_body
from .program import Program, Slot
from .tape import Symbol, Tape

T = TypeVar("T")


class Formula:
    """A formula to be written out: ask it for its arguments, compute, then for its function."""

    def __init__(self) -> None:
        self._tape = Tape()
        self._arguments: dict[str, Any] = {}

    def argument(self, name: str, like: T) -> T:
        """The next argument: nested tuples as in ``like``, with symbols for the numbers; ``None`` stays."""
        places = count()

        def symbols(part: Any) -> Any:
            if isinstance(part, tuple):
                return type(part)(*map(symbols, part))
            return None if part is None else self._tape.input(Slot(name, next(places)))

        argument: T = symbols(like)
        self._arguments[name] = argument
        return argument

    @staticmethod
    def numbers(*values: Any) -> Iterator[Symbol]:
        """The symbols in nested tuples."""
        return (leaf for value in values for leaf in _leaves(value) if isinstance(leaf, Symbol))

    def function(self, result: Any, holds: Any = True) -> Callable[..., Any]:
        """The function of the arguments that gives ``result``, or ``None`` where ``holds`` does not hold.

        Args:
            result: nested tuples of symbols and constants.
            holds: whether the result is of use.
        """
        outputs = {Slot("holds", 0): self._tape.symbol(holds).place}
        for i, leaf in enumerate(_leaves(result)):
            outputs[Slot("result", i)] = self._tape.symbol(leaf).place
        lines, (condition, *expressions) = emit_body(Program(self._tape, (), outputs))
        names: dict[str, Any] = {"inf": inf, "nan": nan, "sqrt": sqrt, "new": tuple.__new__}
        source = [
            f"def function({', '.join(self._arguments)}):",
            *(f"    {_pattern(value)} = {name}" for name, value in self._arguments.items()),
            *lines,
            f"    return {_written(result, iter(expressions), names)} if {condition} else None",
        ]
        exec(compile("\n".join(source), "<emit_nested>", "exec"), names)
        function: Callable[..., Any] = names["function"]
        return function


def _leaves(value: Any) -> Iterator[Any]:
    if isinstance(value, tuple):
        for part in value:
            yield from _leaves(part)
    else:
        yield value


def _pattern(value: Any) -> str:
    """The target of an assignment that takes an argument apart."""
    if isinstance(value, tuple):
        return f"({', '.join(map(_pattern, value))})"
    return "_" if value is None else str(value.node.value.name)


def _written(value: Any, expressions: Iterator[str], names: dict[str, Any]) -> str:
    """The expression that puts the result together."""
    if not isinstance(value, tuple):
        return next(expressions)
    parts = ", ".join(_written(part, expressions, names) for part in value)
    if type(value) is tuple:
        return f"({parts},)"
    names[type(value).__name__] = type(value)
    return f"new({type(value).__name__}, ({parts},))"
