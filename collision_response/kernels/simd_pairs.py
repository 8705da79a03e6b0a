"""Both bodies of a contact in the two lanes of a vector: what is done to one is done to the other.

An operation and the one that it becomes when the bodies change places are written as one, on pairs of
numbers. The numbers stay the same to the bit.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

from .symbol import Loop, Node, Symbol, Tape

PAIR = "pair"
"""The value of a node whose result is a pair."""

_ON_PAIRS = frozenset(
    {"input", "add", "sub", "mul", "div", "neg", "sqrt", "lt", "le", "eq", "and", "or", "not", "select"}
)


def pair_bodies(results: Iterable[Iterable[Symbol]]) -> list[list[Symbol]]:
    """The same results on a new tape, on which as much as possible is computed in pairs.

    It has further operations: ``join`` (of two numbers), ``both`` (of one), ``swapped`` (of a pair) and, back
    to single numbers, ``first`` and ``second``.
    """
    lists = [list(some) for some in results]
    tape, to = lists[0][0].tape, Tape()
    partners = _partners(tape, tape.needed_for(x.place for some in lists for x in some))
    places: dict[int, int] = {}

    def write(op: str, *args: int, value: object = None) -> int:
        return to.write(Node(op, args, value)).place

    def is_paired(place: int) -> bool:
        node, other = tape.nodes[place], tape.nodes[partners.get(place, place)]
        alike = other.args == tuple(partners.get(arg, arg) for arg in node.args)
        return place in partners and alike and node.op in _ON_PAIRS

    def single(place: int) -> int:
        if not is_paired(place):
            return written(place)
        return write("first" if place < partners[place] else "second", written(place))

    def pair(place: int) -> int:
        if place not in partners:
            return write("both", written(place), value=PAIR)
        if not is_paired(place):
            return write("join", written(place), written(partners[place]), value=PAIR)
        at = written(place)
        return at if place < partners[place] else write("swapped", at, value=PAIR)

    def written(place: int) -> int:
        if is_paired(place):
            place = min(place, partners[place])
        if place not in places:
            node = tape.nodes[place]
            if not is_paired(place):
                value = _moved(node.value, to, single) if node.op == "loop" else node.value
                places[place] = write(node.op, *map(single, node.args), value=value)
            elif node.op == "input":
                both = (write("input", value=tape.nodes[one].value) for one in (place, partners[place]))
                places[place] = write("join", *both, value=PAIR)
            else:
                places[place] = write(node.op, *map(pair, node.args), value=PAIR)
        return places[place]

    return [[to.at(single(x.place)) for x in some] for some in lists]


def _moved(loop: Loop, to: Tape, place_of: Callable[[int], int]) -> Loop:
    """A loop on another tape."""
    turn = Tape(outside=to)
    for node in loop.tape.nodes:
        turn.write(node._replace(value=place_of(node.value)) if node.op == "outer" else node)
    return loop._replace(tape=turn)


def _partners(tape: Tape, needed: set[int]) -> dict[int, int]:
    """What operations become when the bodies change places, if something else that is needed."""
    partners: dict[int, int] = {}
    for place in sorted(needed):
        node, value = tape.nodes[place], tape.nodes[place].value
        if node.op == "input":
            owner, _, name = str(value).partition(".")
            value = f"{_OTHER.get(owner, owner)}.{name}"
        found = tape.find(node.op, [partners.get(arg, arg) for arg in node.args], value)
        if found in needed and found != place:
            partners[place] = found
    return {place: partner for place, partner in partners.items() if partners.get(partner) == place}


_OTHER = {"body_a": "body_b", "body_b": "body_a"}
