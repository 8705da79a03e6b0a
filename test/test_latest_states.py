"""The store of received body states: which states it keeps, and which one a lookup returns."""

from __future__ import annotations

import re
import struct
from itertools import product

import pytest

pytest.importorskip("rclpy")

from rclpy.serialization import serialize_message
from refusals import refused
from ros_graph import assign, ball

from collision_response import ImpactError, StatusCode
from collision_response.msg import BodyState, BodyStates
from collision_response.ros import serialized, states
from collision_response.ros.serialized import (
    MAX_STATE_SIZE,
    MalformedMessage,
    SerializedState,
    SerializedTable,
)
from collision_response.ros.states import MAX_DELAY, LatestStates

NOW = 1_000 * 10**9


class StateStore:
    """Latest states with a clock that stands still, and everything that they report.

    Messages arrive every millisecond; ``seconds`` is when the last one did.
    """

    def __init__(self, most=100):
        self.reports = []
        self.seconds = 0.0
        self.states = LatestStates(
            most,
            now=lambda: NOW,
            warn=lambda _, text: self.reports.append(text()),
            take_all=lambda: self.arrive(),
            name_of="number {0[0]}".format,
            clock=lambda: self.seconds,
        )
        self.arrive = lambda: None
        self._numbers = {}

    def hear(self, state, publisher=1, number=None):
        number = self._numbers[publisher] = number or self._numbers.get(publisher, 0) + 1
        info = {"publication_sequence_number": number}
        if publisher is not None:
            info["publisher_gid"] = {"data": bytes([publisher]) * 16}
        self.seconds += 0.001
        message = state if isinstance(state, bytes) else serialize_message(state)
        if isinstance(state, BodyStates):
            self.states.add_table(message, info)
        else:
            self.states.add(message, info)

    def knows(self, name):
        try:
            return self.states.find("body_a.name", name) is not None
        except ImpactError:
            return False

    def speed(self, name="left"):
        return self.states.find("body_a.name", name).twist.linear.x


def left(speed, seconds=0.0):
    state = ball(-0.5, speed, name="left")
    state.header.stamp.sec, state.header.stamp.nanosec = int(seconds), int(seconds % 1 * 1e9)
    return state


def table(names, seconds=0, speed=0.0):
    """Balls of 2 kg, at rest except the last."""
    message = BodyStates(names=names)
    message.header.frame_id, message.header.stamp.sec = "world", seconds
    size = len(names)
    rows = {0: 2.0, 1: 0.2, 4: 0.2, 6: 0.2, 16: 1.0}
    message.numbers = [rows.get(row, 0.0) for row in range(23) for _ in range(size)]
    message.numbers[18 * size - 1] = speed
    return message


def state(seconds, speed):
    return left(speed, seconds)


def table_of_left(seconds, speed):
    return table(["left"], seconds, speed)


KINDS = pytest.mark.parametrize(
    "kinds",
    [*product([state, table_of_left], repeat=2)],
    ids=lambda kinds: ", ".join(kind.__name__ for kind in kinds),
)
"""Two functions that make a message with a state of ``left``."""

# which state is the latest


def test_the_state_with_the_later_stamp_is_used_whatever_arrives_last():
    store = StateStore()
    store.hear(left(2.0, 11))
    store.hear(left(1.0, 10))
    assert store.speed() == 2.0
    assert store.states.outdated == 1
    assert store.reports == [
        "a state of 'left' is 1 s older than the known one and is ignored; "
        "if time was set back, as when a bag starts again, use /clock and use_sim_time"
    ]


def test_with_equal_or_missing_stamps_the_last_to_arrive_is_used():
    store = StateStore()
    for speed, seconds in ((1.0, 10), (2.0, 10)):
        store.hear(left(speed, seconds))
    assert store.speed() == 2.0
    store.hear(left(3.0))
    assert store.speed() == 3.0
    store.hear(left(4.0, 10))
    assert store.speed() == 4.0
    assert store.states.outdated == 0


def test_a_state_from_the_future_does_not_shut_out_the_others():
    store = StateStore()
    store.hear(left(9.0, 5000))
    store.hear(left(1.0, 999))
    assert store.speed() == 1.0


def test_a_state_slightly_ahead_of_the_clock_is_later_than_one_before_it():
    """As in a simulation, where states may be a step ahead of ``/clock``."""
    store = StateStore()
    store.hear(left(9.0, 1001))
    store.hear(left(1.0, 1000))
    assert (store.speed(), store.states.outdated) == (9.0, 1)


@pytest.mark.parametrize(("ahead", "is_wrong"), [(0.9, False), (1.1, True)])
def test_a_clock_more_than_a_second_ahead_is_wrong(ahead, is_wrong):
    store = StateStore()
    store.hear(left(9.0, 1000 + ahead))
    store.hear(left(1.0, 1000))
    assert store.speed() == (1.0 if is_wrong else 9.0)


@KINDS
@pytest.mark.parametrize(("late", "pause"), [(1.5, 0.9), (0.9, 1.5), (1.1, 1.1)])
def test_time_was_set_back_if_stamp_and_arrival_say_so_by_more_than_a_second(kinds, late, pause):
    """A message may say an earlier time because it is late, or because other publishers were faster."""
    store, (first, second) = StateStore(), kinds
    store.hear(first(900, 1.0), 1)
    store.seconds += pause
    message = second(0, 2.0)
    stamp = message.header.stamp
    stamp.sec, stamp.nanosec = divmod(900 * 10**9 - int(late * 1e9), 10**9)
    store.hear(message, 2)
    assert store.speed() == (2.0 if late == pause else 1.0)


@pytest.mark.parametrize("kinds", [(state, table_of_left), (table_of_left, state)])
@pytest.mark.parametrize(("late", "is_warned"), [(1, False), (2, True)])
def test_a_look_up_warns_of_a_state_more_than_a_second_late(kinds, late, is_warned):
    store, (first, second) = StateStore(), kinds
    store.hear(first(900, 1.0), 1)
    store.hear(second(900 - late, 2.0), 2)
    assert store.speed() == 1.0
    assert [report.partition(" and")[0] for report in store.reports] == [
        "the last state of 'left' is 2 s older than the known one"
    ] * is_warned


def test_forget_drops_all_states():
    store = StateStore()
    store.hear(left(1.0, 10))
    store.states.forget()
    with pytest.raises(ImpactError, match="known bodies: none"):
        store.speed()
    store.hear(left(2.0, 1))
    assert store.speed() == 2.0


def test_queued_states_are_taken_before_a_lookup():
    store = StateStore()
    store.arrive = lambda: store.hear(left(7.0, 20))
    store.hear(left(1.0, 10))
    assert store.speed() == 7.0


# tables


def test_a_body_of_a_table_is_found():
    store = StateStore()
    store.hear(table(["a", "b", "c"], 10, speed=3.0))
    state = store.states.find("body_a.name", "c")
    assert (state.header.stamp.sec, state.header.stamp.nanosec) == (10, 0)
    assert state.header.frame_id == "world"
    expected = ball(0.0, 3.0, name="c")
    expected.header = state.header
    assert state == expected
    assert store.speed("a") == 0.0
    assert len(store.states) == 3


def test_of_a_table_and_a_state_the_later_is_used():
    store = StateStore()
    store.hear(left(1.0, 10))
    store.hear(table(["left"], 11, speed=2.0), publisher=2)
    assert store.speed() == 2.0
    store.hear(left(3.0, 12))
    assert store.speed() == 3.0


@pytest.mark.parametrize(
    ("known", "new"),
    [(5000, 999), (5000, 4000), (10, 0), (0, 10), (10, 10), (-10, 0)],
    ids=["future, past", "future, future", "stamp, none", "none, stamp", "equal", "before 1970, none"],
)
@KINDS
def test_the_last_to_arrive_is_used_whatever_message_it_came_in(known, new, kinds):
    """Unless its stamp is earlier, and both stamps are present and plausible."""
    store, (first, second) = StateStore(), kinds
    store.hear(first(known, 1.0), 1)
    store.hear(second(new, 2.0), 2)
    assert store.speed() == 2.0
    assert store.states.outdated == 0


@KINDS
@pytest.mark.parametrize("publisher", [1, 2])
def test_time_that_was_set_back_shuts_nothing_out_for_long(kinds, publisher):
    """As when a simulation starts again, but the node uses the time of the system."""
    store, (first, second) = StateStore(), kinds
    store.hear(first(900, 1.0), 1)
    store.hear(second(1, 2.0), publisher)
    assert store.speed() == 1.0
    advice = "if time was set back, as when a bag starts again, use /clock and use_sim_time"
    if publisher == 2:
        advice = "the publishers are number 1 and number 2: do their clocks agree?"
    assert store.reports[-1].endswith(f"is 899 s older than the known one and is ignored; {advice}")
    store.seconds += MAX_DELAY
    store.hear(second(2, 3.0), publisher)
    assert store.speed() == 3.0


@KINDS
def test_a_state_that_is_a_second_late_is_ignored_whenever_it_arrives(kinds):
    store, (first, second) = StateStore(), kinds
    store.hear(first(900, 1.0), 1)
    store.seconds += 10 * MAX_DELAY
    store.hear(second(899, 2.0), 2)
    assert store.speed() == 1.0


@KINDS
def test_a_publisher_whose_clock_is_late_does_not_interrupt_another(kinds):
    store, (first, second) = StateStore(), kinds
    for seconds in range(1, 10):
        store.hear(first(500 + seconds, 1.0), 1)
        store.hear(second(seconds, 2.0), 2)
        store.seconds += MAX_DELAY / 2
        assert store.speed() == 1.0


def test_a_table_replaces_the_previous_table_of_its_publisher_only():
    store = StateStore()
    store.hear(table(["a"], 10), publisher=1)
    store.hear(table(["b"], 10), publisher=2)
    store.hear(table(["c"], 11), publisher=1)
    assert store.speed("b") == store.speed("c") == 0.0
    with pytest.raises(ImpactError):
        store.speed("a")


def test_counting_the_bodies_deserializes_no_table(monkeypatch):
    """The diagnostics count them every second: 60,000 bodies held up requests for 30 ms."""
    monkeypatch.setattr(serialized, "deserialize_message", lambda *_: pytest.fail("deserialized"))
    store = StateStore()
    store.hear(table(["a", "b"]))
    assert len(store.states) == 2


def test_motion_types_of_a_table():
    message = table(["a", "b"])
    message.motion_types = [BodyState.DYNAMIC, BodyState.STATIC]
    store = StateStore()
    store.hear(message)
    assert store.states.find("", "b").motion_type == BodyState.STATIC


@pytest.mark.parametrize("field", ["numbers", "motion_types"])
def test_a_table_of_the_wrong_size_is_reported_at_lookup(field):
    message = table(["a", "b"])
    getattr(message, field).append(1)
    store = StateStore()
    store.hear(message)
    with refused(StatusCode.UNKNOWN_BODY, match=r"cannot be read: .* for 2 bodies"):
        store.speed("a")


def test_a_name_that_a_table_has_twice_is_reported_at_lookup():
    store = StateStore()
    store.hear(table(["a", "b", "a"], speed=1.0))
    with refused(
        StatusCode.UNKNOWN_BODY, match="'a', whose last state cannot be read: it has this name more"
    ):
        store.speed("a")
    assert store.speed("b") == 0.0


# limits


def test_beyond_max_bodies_the_stalest_states_are_dropped():
    store = StateStore(most=3)
    for name in ("a", "b", "c", "a", "d"):
        store.hear(ball(name=name))
    for name in "acd":
        assert store.speed(name) == 0.0
    with pytest.raises(ImpactError):
        store.speed("b")
    assert store.states.evicted == 1
    assert any("max_bodies" in report for report in store.reports)


def test_beyond_max_bodies_the_stalest_tables_are_dropped():
    store = StateStore(most=4)
    for publisher, names in (1, "ab"), (2, "cd"), (1, "ab"), (3, "ef"):
        store.hear(table([*names]), publisher)
    assert [name for name in "abcdef" if store.knows(name)] == [*"abef"]
    store.hear(table([*"ghijk"]), publisher=3)
    assert [name for name in "abcdefghijk" if store.knows(name)] == [*"ab"]
    assert store.states.evicted == 2 + 5
    assert any("max_bodies" in report for report in store.reports)


def test_a_table_of_all_bodies_is_kept():
    store = StateStore(most=4)
    store.hear(table([*"abcd"]))
    assert store.knows("d") and not store.states.evicted


def test_tables_of_a_hundred_publishers_are_kept():
    store = StateStore(most=10_000)
    for publisher in range(101):
        store.hear(table([f"body {publisher}"]), publisher)
    assert [i for i in range(101) if not store.knows(f"body {i}")] == [0]
    assert store.states.evicted == 1


@pytest.mark.parametrize(("size", "shown"), [(60, "n" * 60), (61, "n" * 60 + "...")])
def test_a_name_is_quoted_up_to_60_characters(size, shown):
    with refused(StatusCode.UNKNOWN_BODY, match=f"is '{re.escape(shown)}', but no state with this name"):
        StateStore().speed("n" * size)


@pytest.mark.parametrize("more", [0, 1])
def test_ten_known_names_are_listed(more):
    store = StateStore()
    for name in "abcdefghij" + "k" * more:
        store.hear(ball(name=name))
    with pytest.raises(ImpactError) as caught:
        store.speed("x")
    assert str(caught.value).endswith("known bodies: a, b, c, d, e, f, g, h, i, j" + ", ..." * more)


def test_messages_do_not_grow_with_the_names_they_quote():
    store = StateStore()
    for i in range(50):
        store.hear(ball(name=f"{i:03}" * 1000))
    with pytest.raises(ImpactError) as caught:
        store.speed("x" * 10**6)
    assert len(str(caught.value)) < 2000
    assert "000000" in str(caught.value) and str(caught.value).endswith(", ...")


def test_bodies_of_tables_are_listed_as_known():
    store = StateStore()
    store.hear(table(["a", "b"]))
    with pytest.raises(ImpactError, match=r"known bodies: a, b$"):
        store.speed("c")
    store.hear(left(0.0))
    with pytest.raises(ImpactError, match=r"known bodies: left, a, b$"):
        store.speed("c")


# losses and publishers


def test_states_lost_on_the_way_are_counted():
    store = StateStore()
    for number in (1, 2, 5, 6):
        store.hear(left(0.0), number=number)
    store.hear(left(0.0), publisher=2, number=70)
    store.hear(left(0.0), publisher=2, number=71)
    assert store.states.lost == 2
    assert len([report for report in store.reports if "did not arrive" in report]) == 1


def test_losses_are_counted_of_a_limited_number_of_publishers(monkeypatch):
    monkeypatch.setattr(states, "MAX_PUBLISHERS", 3)
    store = StateStore()
    for publisher in (1, 2, 3):
        store.hear(left(0.0), publisher, number=1)
    store.hear(left(0.0), 1, number=4)
    assert store.states.lost == 2
    store.hear(left(0.0), 4, number=1)
    store.hear(left(0.0), 1, number=9)
    assert store.states.lost == 2


def test_two_publishers_of_many_bodies_are_reported_once_and_a_limited_number_of_pairs(monkeypatch):
    monkeypatch.setattr(states, "MAX_PUBLISHERS", 2)
    store = StateStore()
    for first, names in ((1, "abc"), (3, "d"), (5, "e")):
        for name in names:
            for publisher in (first, first + 1, first):
                store.hear(ball(name=name), publisher)
    told = [report.partition(", number")[0] for report in store.reports]
    assert told == [f"two publishers send states of the same bodies, such as '{name}'" for name in "ad"]


def test_lost_tables_have_a_warning_of_their_own():
    store = StateStore()
    store.hear(table(["a"]), number=1)
    store.hear(table(["a"]), number=4)
    (report,) = store.reports
    assert report.startswith(
        "tables were published but did not arrive, 2 messages in all: large ones need reliable QoS"
    )


def test_two_publishers_of_one_name_are_reported_once():
    store = StateStore()
    for publisher in (1, 2, 1, 2, 1):
        store.hear(left(0.0), publisher=publisher)
    assert [report for report in store.reports if "two publishers" in report] == [
        "two publishers send states of the same bodies, such as 'left', number 1 and number 2: "
        "the state with the latest stamp is used"
    ]


def test_a_publisher_that_takes_over_from_another_is_not_reported():
    store = StateStore()
    for publisher in (1, 1, 2, 2, 3):
        store.hear(left(0.0), publisher=publisher)
    assert not store.reports


def test_without_publisher_ids_tables_are_told_apart_by_their_bodies():
    """As in Jazzy, where rclpy does not report the publisher of a message."""
    store = StateStore()
    for names, speed, number in (("ab", 1.0, 1), ("c", 2.0, 9), ("ab", 3.0, 2)):
        store.hear(table([*names], speed=speed), publisher=None, number=number)
    for speed in (4.0, 5.0, 4.0):
        store.hear(left(speed), publisher=None)
    assert (store.speed("b"), store.speed("c"), store.speed()) == (3.0, 2.0, 4.0)
    assert (len(store.states), store.states.lost, store.reports) == (4, 0, [])


# bytes


@pytest.mark.parametrize("frame", ["", "w", "wo", "wor", "world", "Übergröße"])
@pytest.mark.parametrize("name", ["", "a", "ab", "abc", "abcd", "Ω mega"])
def test_stamp_and_name_are_read_as_they_were_written(frame, name):
    state = ball(name=name, frame=frame)
    state.header.stamp.sec, state.header.stamp.nanosec = -3, 999_999_999
    read = SerializedState(serialize_message(state))
    assert (read.name, read.stamp) == (name, -3 * 10**9 + 999_999_999)
    assert read.state == state


def test_the_other_byte_order_is_read_too():
    frame, name = b"world\0\0\0", b"ball\0\0\0\0"
    message = b"\0\0\0\0" + struct.pack(">iII", 5, 6, 6) + frame + struct.pack(">I", 5) + name
    read = SerializedState(message)
    assert (read.name, read.stamp) == ("ball", 5 * 10**9 + 6)


WHOLE = serialize_message(ball(name="left"))


@pytest.mark.parametrize("size", range(40))
def test_a_message_that_ends_early_is_broken(size):
    store = StateStore()
    store.hear(WHOLE[:size])
    if size < 33:  # up to there it has not even a name
        assert store.states.unreadable == 1 and len(store.states) == 0
    else:
        with pytest.raises(ImpactError, match="cannot be read"):
            store.speed()


@pytest.mark.parametrize("offset", [12, 24])
def test_a_string_longer_than_the_message_is_broken(offset):
    message = bytearray(WHOLE)
    message[offset : offset + 4] = struct.pack("<I", 2**31)
    with pytest.raises(MalformedMessage, match="a string in it reaches beyond its end"):
        SerializedState(bytes(message))


def test_a_name_that_is_not_utf8_is_broken():
    message = bytearray(WHOLE)
    message[message.index(b"left")] = 0xFF
    with pytest.raises(MalformedMessage):
        SerializedState(bytes(message))


def test_a_state_that_is_too_long_is_dropped():
    store = StateStore()
    store.hear(ball(name="x" * MAX_STATE_SIZE))
    assert store.states.unreadable == 1 and len(store.states) == 0
    assert "4096" in store.reports[0]


def test_a_table_that_claims_more_names_than_it_can_hold_is_broken_at_once():
    message = bytearray(serialize_message(table(["a"])))
    offset = 4 + 8 + 4 + 8
    assert struct.unpack_from("<I", message, offset) == (1,)
    message[offset : offset + 4] = struct.pack("<I", 20_000_000)
    with pytest.raises(MalformedMessage, match="its names alone need 160000000 bytes"):
        SerializedTable(bytes(message))


def test_garbage_is_counted_and_harmless():
    store = StateStore()
    store.hear(left(1.0, 10))
    for garbage in (b"", b"\0", b"\0\1\0\0", bytes(range(256)), b"\xff" * 5000):
        store.hear(garbage)
    assert store.speed() == 1.0
    assert store.states.unreadable == 5


def test_assigning_by_rows_covers_every_field_of_a_state():
    """Each of the 23 numbers of a column goes into its own field."""
    message = table(["a"])
    message.numbers = type(message.numbers)("d", range(1, 24))
    store = StateStore()
    store.hear(message)
    state, expected = store.states.find("", "a"), BodyState(name="a")
    expected.header = state.header
    fields = [
        *(f"inertia.{field}" for field in ("m", "ixx", "ixy", "ixz", "iyy", "iyz", "izz")),
        *(f"inertia.com.{axis}" for axis in "xyz"),
        *(f"pose.position.{axis}" for axis in "xyz"),
        *(f"pose.orientation.{axis}" for axis in "xyzw"),
        *(f"twist.linear.{axis}" for axis in "xyz"),
        *(f"twist.angular.{axis}" for axis in "xyz"),
    ]
    for number, field in enumerate(fields, 1):
        assign(expected, field, float(number))
    assert state == expected
