"""The latest state of every body that has been heard of.

Messages are kept as they arrived. Of one that nobody asks for, the stamp and the names are all that is read:
the rest takes ten times as long.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import reduce
from itertools import chain, islice
from typing import Any, NamedTuple, TypeVar

from ..msg import BodyState
from ..status import ImpactError, StatusCode
from .serialized import MalformedMessage, Serialized, SerializedState, SerializedTable

AnySerialized = TypeVar("AnySerialized", bound=Serialized)

SHOWN = 60
"""Characters of a name that a message quotes."""

PUBLISHERS = 1000
"""Publishers whose messages are counted; and a tenth of that, of tables."""


def quoted(name: str) -> str:
    """A name for a message, however long it is."""
    return repr(name if len(name) <= SHOWN else f"{name[:SHOWN]}...")


class _Source(NamedTuple):
    """The state of a body by name, and whom it came from: the publisher, and the one before that."""

    latest: SerializedState
    publisher: bytes
    earlier: bytes | None


class LatestStates:
    """Body states by name: of each body the one with the latest stamp.

    A state without a stamp counts as the latest when it arrives. So does every state while the one that is
    known is stamped in the future: a wrong clock must not shut out the right ones. It is the same whether
    they come alone or in tables.

    Attributes:
        received: number of messages taken.
        lost: number of messages that publishers sent and that did not arrive.
        broken: number of messages that could not be read.
        outdated: number of states passed over as older than the one that was known.
        evicted: number of bodies forgotten because there were too many.
        take_all: takes what waits on the subscriptions; to be set.

    Args:
        most: the number of bodies to remember, and as many in tables; those that were heard of last.
        now: the time by the node's clock [ns].
        report: told what a person should know: what it is about, of which he need not add all the time, and
            the words.
    """

    def __init__(self, most: int, now: Callable[[], int], report: Callable[[str, str], object]) -> None:
        self.received = self.lost = self.unreadable = self.outdated = self.evicted = 0
        self.take_all: Callable[[], object] = lambda: None
        self._most = most
        self._now = now
        self._report = report
        self._by_name: dict[str, _Source] = {}
        self._tables: dict[bytes | tuple[str, ...], SerializedTable] = {}
        self._counts: dict[bytes, int] = {}
        self._shared_names: set[str] = set()

    def __len__(self) -> int:
        """How many bodies are known."""
        return len(self._by_name) + sum(len(table.columns) for table in self._tables.values())

    def add(self, message: bytes, info: Any) -> SerializedState | None:
        """Take note of a ``BodyState``. One without a name could not be asked for, and is passed over."""
        publisher = self._count(info, "states", "publish fewer, or as BodyStates")
        state = self._read(SerializedState, message)
        if state is None or not state.name:
            return None
        old = self._by_name.pop(
            state.name, None
        )  # the order of names is that in which they were heard of last
        if old is None:
            self._by_name[state.name] = _Source(state, publisher, None)
            self._make_room()
            return state
        earlier = old.earlier
        if publisher != old.publisher:
            self._check_publisher(state.name, publisher, earlier)
            earlier = old.publisher
        self._by_name[state.name] = _Source(self._not_overtaken(old.latest, state), publisher, earlier)
        return state

    def add_table(self, message: bytes, info: Any) -> None:
        """Take note of a ``BodyStates``; it stands for the one before it from the same publisher.

        Where publishers are unknown, it stands for the one before it of the same bodies.
        """
        publisher = self._count(info, "tables", "large ones need reliable QoS: see docs/ros.md")
        table = self._read(SerializedTable, message)
        if table is None:
            return
        whose = publisher or tuple(table.columns)
        old = self._tables.pop(whose, None)
        if table.size > self._most:
            self._tell_evicted(table.size)
            return
        self._tables[whose] = table if old is None else self._not_overtaken(old, table)
        while (
            len(self._tables) > PUBLISHERS // 10
            or sum(known.size for known in self._tables.values()) > self._most
        ):
            self._tell_evicted(self._tables.pop(next(iter(self._tables))).size)

    def note_unreadable(self, error: Exception) -> None:
        """Take note of a message that could not even be taken."""
        self.unreadable += 1
        self._report("broken", f"a state could not be taken: {error}")

    def find(self, field: str, name: str) -> BodyState:
        """The state of a body given by name only, after taking what has arrived.

        Raises:
            ImpactError: UNKNOWN_BODY, for the field that holds the name.
        """
        self.take_all()
        found: list[Serialized] = [table for table in self._tables.values() if name in table.columns]
        if name in self._by_name:
            found.append(self._by_name[name].latest)
        if not found:
            raise ImpactError(StatusCode.UNKNOWN_BODY, field, self._unknown(name))
        first, *others = sorted(found, key=lambda message: message.arrival)
        latest = reduce(self._later, others, first)
        try:
            return latest.state_of(name)
        except MalformedMessage as error:
            reason = f"is {quoted(name)}, whose last state cannot be read: {error}"
            raise ImpactError(StatusCode.UNKNOWN_BODY, field, reason) from None

    def forget(self) -> None:
        """Forget every body."""
        self._by_name.clear()
        self._tables.clear()

    def _unknown(self, name: str) -> str:
        every = chain(self._by_name, *(table.columns for table in self._tables.values()))
        some = [quoted(known)[1:-1] for known in islice(every, 10)]
        more = ", ..." if next(every, None) is not None else ""
        heard_of = f"{', '.join(some) or 'no body'}{more}"
        return f"is {quoted(name)}, of which no state has been received; heard of: {heard_of}"

    def _read(self, kind: Any, message: bytes) -> Any:
        try:
            read = kind(message)
        except MalformedMessage as error:
            self.unreadable += 1
            self._report("broken", f"a state could not be read: {error}")
            return None
        read.arrival = self.received
        return read

    def _later(self, old: AnySerialized, new: AnySerialized) -> AnySerialized:
        """Of two of which the second arrived later."""
        return new if new.stamp >= old.stamp or not new.stamp or old.stamp > self._now() else old

    def _not_overtaken(self, old: AnySerialized, new: AnySerialized) -> AnySerialized:
        later = self._later(old, new)
        self.outdated += later is old
        return later

    def _count(self, info: Any, kind: str, advice: str) -> bytes:
        """The publisher of a message; messages between this and its last one were lost, of which it tells.

        Empty, and nothing told of losses, where rclpy does not say whose it is: that of Jazzy.
        """
        self.received += 1
        if "publisher_gid" not in info:
            return b""
        publisher, number = bytes(info["publisher_gid"]["data"]), info["publication_sequence_number"]
        last = self._counts.get(publisher)
        if last is None and len(self._counts) >= PUBLISHERS:
            self._counts.clear()
        elif last is not None and number > last + 1:
            self.lost += number - last - 1
            self._report(
                f"lost {kind}", f"{kind} were sent and did not arrive, {self.lost} messages in all: {advice}"
            )
        self._counts[publisher] = number
        return publisher

    def _check_publisher(self, name: str, publisher: bytes, earlier: bytes | None) -> None:
        """Two publishers of one name take turns; one that replaces another does not."""
        if publisher == earlier and name not in self._shared_names and len(self._shared_names) < PUBLISHERS:
            self._shared_names.add(name)
            self._report(
                f"publishers of {name}",
                f"two publishers send states of {quoted(name)}: which is used, the stamps decide",
            )

    def _make_room(self) -> None:
        if len(self._by_name) > self._most:
            del self._by_name[next(iter(self._by_name))]
            self._tell_evicted(1)

    def _tell_evicted(self, bodies: int) -> None:
        self.evicted += bodies
        self._report("evicted", f"more than {self._most} bodies: the stalest are forgotten; see max_bodies")
