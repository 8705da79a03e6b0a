"""The latest state of every body.

Messages are kept serialized. Until a request needs a state, only its stamp and name are read: to deserialize
the whole message takes ten times as long.
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

MAX_QUOTED = 60
"""Longest name that an error message quotes in full [characters]."""

MAX_PUBLISHERS = 1000
"""Number of publishers whose messages are counted. Tables are kept of a tenth of that number."""


def quoted(name: str) -> str:
    """Quote a name for an error message; a long one is truncated."""
    return repr(name if len(name) <= MAX_QUOTED else f"{name[:MAX_QUOTED]}...")


class _Known(NamedTuple):
    """The latest state of a body, the publisher of the last state, and the publisher before that."""

    latest: SerializedState
    publisher: bytes
    earlier_publisher: bytes | None


class LatestStates:
    """The latest states of bodies by their names, from single states and tables.

    The latest state is the one with the latest stamp. A state without a stamp counts as the latest when it
    arrives. So does every state that arrives while the known state is stamped in the future: one wrong clock
    must not shut out the right ones.

    Attributes:
        received: number of messages received.
        lost: number of messages that were published but did not arrive.
        unreadable: number of messages that could not be read.
        outdated: number of states ignored because the known state was later.
        evicted: number of bodies forgotten because there were too many.
        now: returns the time of the node's clock [ns].
        take_all: called before a look-up, to receive the messages that wait on the subscriptions. To be set
            by the owner.

    Args:
        max_bodies: number of bodies to remember from single states, and as many from tables. The least
            recently updated bodies are forgotten first.
        now: returns the time of the node's clock [ns].
        warn: logs a warning: called with its subject, by which repetitions are suppressed, and its text.
    """

    def __init__(self, max_bodies: int, now: Callable[[], int], warn: Callable[[str, str], object]) -> None:
        self.received = self.lost = self.unreadable = self.outdated = self.evicted = 0
        self.take_all: Callable[[], object] = lambda: None
        self._max_bodies = max_bodies
        self.now = now
        self._warn = warn
        self._by_name: dict[str, _Known] = {}  # ordered by the arrival of the last state
        self._tables: dict[bytes | tuple[str, ...], SerializedTable] = {}  # the same
        self._sequence_numbers: dict[bytes, int] = {}
        self._shared_names: set[str] = set()

    def __len__(self) -> int:
        """Number of bodies known."""
        return len(self._by_name) + sum(len(table.columns) for table in self._tables.values())

    def add(self, message: bytes, info: Any) -> SerializedState | None:
        """Add a serialized ``BodyState``.

        Returns:
            The state; ``None`` if it cannot be read or has no name.
        """
        publisher = self._count(info, "states", "publish fewer, or publish BodyStates")
        state = self._read(SerializedState, message)
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
            self._check_publisher(state.name, publisher, earlier_publisher)
            earlier_publisher = known.publisher
        latest = self._count_outdated(known.latest, state)
        self._by_name[state.name] = _Known(latest, publisher, earlier_publisher)
        return state

    def add_table(self, message: bytes, info: Any) -> None:
        """Add a serialized ``BodyStates``. It replaces the previous table of the same publisher.

        If the publisher is unknown, it replaces the previous table with the same names.
        """
        publisher = self._count(info, "tables", "large ones need reliable QoS: see docs/ros.md")
        table = self._read(SerializedTable, message)
        if table is None:
            return
        key = publisher or tuple(table.columns)
        known = self._tables.pop(key, None)
        if table.size > self._max_bodies:
            self._count_evicted(table.size)
            return
        self._tables[key] = table if known is None else self._count_outdated(known, table)
        while (
            len(self._tables) > MAX_PUBLISHERS // 10
            or sum(known.size for known in self._tables.values()) > self._max_bodies
        ):
            self._count_evicted(self._tables.pop(next(iter(self._tables))).size)

    def note_unreadable(self, error: Exception) -> None:
        """Count a message that could not be taken from the middleware."""
        self.unreadable += 1
        self._warn("unreadable", f"a state could not be taken: {error}")

    def find(self, field: str, name: str) -> BodyState:
        """Latest state of a body, after the messages that wait have been received.

        Raises:
            ImpactError: UNKNOWN_BODY, which names the ``field`` that holds the name.
        """
        self.take_all()
        candidates: list[Serialized] = [table for table in self._tables.values() if name in table.columns]
        if name in self._by_name:
            candidates.append(self._by_name[name].latest)
        if not candidates:
            raise ImpactError(StatusCode.UNKNOWN_BODY, field, self._unknown(name))
        latest = reduce(self._later, sorted(candidates, key=lambda message: message.arrival))
        try:
            return latest.state_of(name)
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

    def _read(self, kind: Any, message: bytes) -> Any:
        try:
            serialized = kind(message)
        except MalformedMessage as error:
            self.unreadable += 1
            self._warn("unreadable", f"a state could not be read: {error}")
            return None
        serialized.arrival = self.received
        return serialized

    def _later(self, old: AnySerialized, new: AnySerialized) -> AnySerialized:
        """The later of two messages, of which ``new`` arrived later."""
        return new if new.stamp >= old.stamp or not new.stamp or old.stamp > self.now() else old

    def _count_outdated(self, old: AnySerialized, new: AnySerialized) -> AnySerialized:
        """The later of two messages; counts ``new`` as outdated if it is not."""
        later = self._later(old, new)
        if later is old:
            self.outdated += 1
            self._warn(
                "outdated",
                f"a state older than the known one is ignored, {self.outdated} in all: if time was set "
                "back, as when a bag or a simulation starts again, use /clock and use_sim_time",
            )
        return later

    def _count(self, info: Any, kind: str, advice: str) -> bytes:
        """Count a message, and those of the same publisher that were lost since its last one.

        Returns:
            Identity of the publisher. Empty if rclpy does not give it, as in Jazzy: then losses are not
            counted.
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
                f"{kind} were published but did not arrive, {self.lost} messages in all: {advice}",
            )
        self._sequence_numbers[publisher] = number
        return publisher

    def _check_publisher(self, name: str, publisher: bytes, earlier_publisher: bytes | None) -> None:
        """Warn if two publishers alternate. One that replaces another for good does not."""
        is_new = name not in self._shared_names and len(self._shared_names) < MAX_PUBLISHERS
        if publisher == earlier_publisher and is_new:
            self._shared_names.add(name)
            self._warn(
                f"publishers of {name}",
                f"two publishers send states of {quoted(name)}: the state with the latest stamp is used",
            )

    def _count_evicted(self, bodies: int) -> None:
        self.evicted += bodies
        self._warn(
            "evicted",
            f"more than {self._max_bodies} bodies: the least recently updated are forgotten; see max_bodies",
        )
