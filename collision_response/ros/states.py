"""The latest state of every body.

Messages are kept serialized. Until a request needs a state, only its stamp and name are read: to deserialize
the whole message takes ten times as long.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import reduce
from itertools import chain, islice
from typing import Any, NamedTuple, TypeVar

from ..msg import BodyState
from ..status import ImpactError, StatusCode
from .serialized import MalformedMessage, Serialized, SerializedState, SerializedTable

AnySerialized = TypeVar("AnySerialized", bound=Serialized)

MAX_QUOTED = 60
"""Longest name that an error message quotes in full [characters]."""

MAX_PUBLISHERS = 1000
"""Number of publishers whose messages are counted. Tables are kept of a tenth of that number."""

MAX_DELAY = 1.0
"""Longest time [s] by which a state may be late, or ahead of the node's clock. If its stamp is further back,
time was set back, or the clocks of two publishers differ; it then counts as the latest if no later one has
arrived for this time."""


def quoted(name: str) -> str:
    """Quote a name for an error message; a long one is truncated."""
    return repr(name if len(name) <= MAX_QUOTED else f"{name[:MAX_QUOTED]}...")


class _Known(NamedTuple):
    """The latest state of a body, and the publishers of the last state and of the one before it."""

    latest: SerializedState
    publisher: bytes
    earlier_publisher: bytes | None


class LatestStates:
    """The latest states of bodies by their names, from single states and tables.

    The latest state is the one with the latest stamp. A state without a stamp counts as the latest when it
    arrives. So does a state that arrives while the known state is stamped more than ``MAX_DELAY`` ahead of
    the node's clock, or one whose stamp is more than ``MAX_DELAY`` earlier, if no later one has arrived for
    that time: one wrong clock must not shut out the right ones.

    It counts the messages that were ``received``, ``lost`` on the way or ``unreadable``, the states that were
    ``outdated`` because the known one was later, and the bodies ``evicted`` because there were too many.

    Args:
        max_bodies: number of bodies to remember from single states, and as many from tables. The least
            recently updated bodies are forgotten first.
        now: returns the time of the node's clock [ns].
        warn: logs a warning, as :class:`ThrottledWarnings` does.
        take_all: called before a look-up, to receive the messages that wait on the subscriptions.
        name_of: returns what warnings call a publisher.
        clock: returns the time [s] of a clock that is never set.
    """

    def __init__(
        self,
        max_bodies: int,
        now: Callable[[], int],
        warn: Callable[[str, Callable[[], str]], object],
        take_all: Callable[[], object],
        name_of: Callable[[bytes], str],
        clock: Callable[[], float] = time.perf_counter,
    ) -> None:
        self.received = self.lost = self.unreadable = self.outdated = self.evicted = 0
        self.now = now
        self._max_bodies, self._warn, self._clock = max_bodies, warn, clock
        self._take_all, self._name_of = take_all, name_of
        self._by_name: dict[str, _Known] = {}  # ordered by the arrival of the last state
        self._tables: dict[bytes | tuple[str, ...], SerializedTable] = {}  # the same
        self._sequence_numbers: dict[bytes, int] = {}
        self._alternating: set[frozenset[bytes]] = set()  # pairs of publishers

    def __len__(self) -> int:
        """Number of bodies known."""
        return len(self._by_name) + self._number_in_tables()

    def _number_in_tables(self) -> int:
        return sum(table.size for table in self._tables.values())  # as they say: it needs no deserialization

    def add(self, message: bytes, info: Any) -> SerializedState | None:
        """Add a serialized ``BodyState``, and return it; ``None`` if it cannot be read or has no name."""
        publisher = self._count(info, "states", "publish fewer, or publish BodyStates")
        state = self._read(SerializedState, message, publisher)
        if state is None or not state.name:
            return None
        known = self._by_name.pop(state.name, None)
        if known is None:
            self._by_name[state.name] = _Known(state, publisher, None)
            if len(self._by_name) > self._max_bodies:
                del self._by_name[next(iter(self._by_name))]
                self._count_evicted(1)
            return state
        earlier_publisher = known.earlier_publisher
        if publisher != known.publisher:
            self._check_publisher(state.name, publisher, known)
            earlier_publisher = known.publisher
        latest = self._count_outdated(known.latest, state, f"a state of {quoted(state.name)}")
        self._by_name[state.name] = _Known(latest, publisher, earlier_publisher)
        return state

    def add_table(self, message: bytes, info: Any) -> None:
        """Add a serialized ``BodyStates``. It replaces the previous table of the same publisher.

        If the publisher is unknown, it replaces the previous table with the same names.
        """
        publisher = self._count(info, "tables", "large ones need reliable QoS: see docs/ros.md")
        table = self._read(SerializedTable, message, publisher)
        if table is None:
            return
        key = publisher or tuple(table.columns)
        known = self._tables.pop(key, None)
        if table.size > self._max_bodies:
            self._count_evicted(table.size)
            return
        self._tables[key] = table if known is None else self._count_outdated(known, table, "a table")
        while len(self._tables) > MAX_PUBLISHERS // 10 or self._number_in_tables() > self._max_bodies:
            self._count_evicted(self._tables.pop(next(iter(self._tables))).size)

    def note_unreadable(self, error: Exception) -> None:
        """Count a message that could not be taken from the middleware, or not read."""
        self.unreadable += 1
        self._warn("unreadable", lambda: f"a state could not be read: {error}")

    def find(self, field: str, name: str) -> BodyState:
        """Latest state of a body, after the messages that wait have been received.

        Raises:
            ImpactError: UNKNOWN_BODY, which names the ``field`` that holds the name.
        """
        self._take_all()
        candidates: list[SerializedState | SerializedTable] = [
            table for table in self._tables.values() if name in table.columns
        ]
        if name in self._by_name:
            candidates.append(self._by_name[name].latest)
        if not candidates:
            raise ImpactError(StatusCode.UNKNOWN_BODY, field, self._unknown(name))
        candidates.sort(key=lambda message: message.arrival)
        latest, last = reduce(self._later, candidates), candidates[-1]
        if latest is not last and latest.stamp - last.stamp > MAX_DELAY * 1e9:
            self._warn_of_outdated(latest, last, f"the last state of {quoted(name)}")
        try:
            return latest.state if isinstance(latest, SerializedState) else latest.state_of(name)
        except MalformedMessage as error:
            reason = f"is {quoted(name)}, whose last state cannot be read: {error}"
            raise ImpactError(StatusCode.UNKNOWN_BODY, field, reason) from None

    def forget(self) -> None:
        """Forget the states of all bodies."""
        self._by_name.clear()
        self._tables.clear()

    def _unknown(self, name: str) -> str:
        """Reason why a name is refused, with some of the known names."""
        names = chain(self._by_name, *(table.columns for table in self._tables.values()))
        some = [quoted(known)[1:-1] for known in islice(names, 10)]
        more = ", ..." if next(names, None) is not None else ""
        known_bodies = f"{', '.join(some) or 'none'}{more}"
        return (
            f"is {quoted(name)}, but no state with this name has been received; known bodies: {known_bodies}"
        )

    def _read(self, kind: Any, message: bytes, publisher: bytes) -> Any:
        try:
            serialized = kind(message)
        except MalformedMessage as error:
            self.note_unreadable(error)
            return None
        serialized.arrival, serialized.publisher = self._clock(), publisher
        return serialized

    def _later(self, old: AnySerialized, new: AnySerialized) -> AnySerialized:
        """The later of two messages, of which ``new`` arrived later."""
        if new.stamp >= old.stamp or not new.stamp:
            return new
        if old.stamp - self.now() > MAX_DELAY * 1e9:
            return new
        gap = min((old.stamp - new.stamp) / 1e9, new.arrival - old.arrival)
        return new if gap > MAX_DELAY else old

    def _count_outdated(self, old: AnySerialized, new: AnySerialized, what: str) -> AnySerialized:
        """The later of two messages; counts ``new`` as outdated if it is not. A warning calls it ``what``."""
        later = self._later(old, new)
        if later is old:
            self.outdated += 1
            self._warn_of_outdated(old, new, what)
        return later

    def _warn_of_outdated(self, old: Serialized, new: Serialized, what: str) -> None:
        def text() -> str:
            reason = "if time was set back, as when a bag starts again, use /clock and use_sim_time"
            if new.publisher != old.publisher:
                two = f"{self._name_of(old.publisher)} and {self._name_of(new.publisher)}"
                reason = f"the publishers are {two}: do their clocks agree?"
            by = (old.stamp - new.stamp) / 1e9
            return f"{what} is {by:.6g} s older than the known one and is ignored; {reason}"

        self._warn("outdated", text)

    def _count(self, info: Any, kind: str, advice: str) -> bytes:
        """Count a message, and those of its publisher lost since the last one, and return the publisher.

        Its identity is empty if rclpy does not give it, as in Jazzy: then losses are not counted.
        """
        self.received += 1
        if "publisher_gid" not in info:
            return b""
        publisher, number = bytes(info["publisher_gid"]["data"]), info["publication_sequence_number"]
        last = self._sequence_numbers.get(publisher)
        if last is None and len(self._sequence_numbers) >= MAX_PUBLISHERS:
            self._sequence_numbers.clear()
        elif last is not None and number > last + 1:
            self.lost += number - last - 1
            self._warn(
                f"lost {kind}",
                lambda: f"{kind} were published but did not arrive, {self.lost} messages in all: {advice}",
            )
        self._sequence_numbers[publisher] = number
        return publisher

    def _check_publisher(self, name: str, publisher: bytes, known: _Known) -> None:
        """Warn if two publishers alternate, once. One that replaces another for good does not."""
        if publisher != known.earlier_publisher:  # nearly always
            return
        pair = frozenset((publisher, known.publisher))
        if pair not in self._alternating and len(self._alternating) < MAX_PUBLISHERS:
            self._alternating.add(pair)
            two = f"{self._name_of(publisher)} and {self._name_of(known.publisher)}"
            self._warn(
                f"publishers {two}",
                lambda: (
                    f"two publishers send states of the same bodies, such as {quoted(name)}, {two}: "
                    "the state with the latest stamp is used"
                ),
            )

    def _count_evicted(self, bodies: int) -> None:
        self.evicted += bodies
        self._warn(
            "evicted",
            lambda: (
                f"more than {self._max_bodies} bodies: the least recently updated are forgotten; "
                "see max_bodies"
            ),
        )
