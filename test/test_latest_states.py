"""What is kept of the states that arrive, and what of it is found."""

from __future__ import annotations

import struct

import pytest

pytest.importorskip("rclpy")

from rclpy.serialization import serialize_message
from ros_graph import assign, ball

from collision_response import ImpactError, StatusCode
from collision_response.msg import BodyState, BodyStates
from collision_response.ros.serialized import (
    MAX_STATE_SIZE,
    MalformedMessage,
    SerializedState,
    SerializedTable,
)
from collision_response.ros.states import LatestStates

NOW = 1_000 * 10**9


class Heard:
    """States with a clock that stands still, and everything that they reported."""

    def __init__(self, most=100):
        self.reports = []
        self.states = LatestStates(most, lambda: NOW, lambda _, text: self.reports.append(text))
        self._numbers = {}

    def hear(self, state, publisher=1, number=None):
        number = self._numbers[publisher] = number or self._numbers.get(publisher, 0) + 1
        info = {"publication_sequence_number": number}
        if publisher is not None:
            info["publisher_gid"] = {"data": bytes([publisher]) * 16}
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
    """Balls of 2 kg at rest but for the last."""
    message = BodyStates(names=names)
    message.header.frame_id, message.header.stamp.sec = "world", seconds
    size = len(names)
    rows = {0: 2.0, 1: 0.2, 4: 0.2, 6: 0.2, 16: 1.0}
    message.numbers = [rows.get(row, 0.0) for row in range(23) for _ in range(size)]
    message.numbers[18 * size - 1] = speed
    return message


# which state is the latest


def test_the_later_stamp_counts_whatever_arrives_last():
    heard = Heard()
    heard.hear(left(2.0, 11))
    heard.hear(left(1.0, 10))
    assert heard.speed() == 2.0
    assert heard.states.outdated == 1


def test_of_equal_stamps_and_without_one_the_last_to_arrive_counts():
    heard = Heard()
    for speed, seconds in ((1.0, 10), (2.0, 10)):
        heard.hear(left(speed, seconds))
    assert heard.speed() == 2.0
    heard.hear(left(3.0))
    assert heard.speed() == 3.0
    heard.hear(left(4.0, 10))
    assert heard.speed() == 4.0
    assert heard.states.outdated == 0


def test_a_state_from_the_future_does_not_shut_out_the_others():
    heard = Heard()
    heard.hear(left(9.0, 5000))
    heard.hear(left(1.0, 999))
    assert heard.speed() == 1.0


def test_what_was_heard_is_forgotten_when_the_clock_is_set_back():
    heard = Heard()
    heard.hear(left(1.0, 10))
    heard.states.forget()
    with pytest.raises(ImpactError, match="heard of: no body"):
        heard.speed()
    heard.hear(left(2.0, 1))
    assert heard.speed() == 2.0


def test_states_that_wait_are_taken_before_one_is_looked_for():
    heard = Heard()
    heard.states.take_all = lambda: heard.hear(left(7.0, 20))
    heard.hear(left(1.0, 10))
    assert heard.speed() == 7.0


# tables


def test_a_body_of_a_table_is_found():
    heard = Heard()
    heard.hear(table(["a", "b", "c"], 10, speed=3.0))
    state = heard.states.find("body_a.name", "c")
    assert (state.header.stamp.sec, state.header.stamp.nanosec) == (10, 0)
    assert state.header.frame_id == "world"
    expected = ball(0.0, 3.0, name="c")
    expected.header = state.header
    assert state == expected
    assert heard.speed("a") == 0.0
    assert len(heard.states) == 3


def test_of_a_table_and_a_state_the_later_counts():
    heard = Heard()
    heard.hear(left(1.0, 10))
    heard.hear(table(["left"], 11, speed=2.0), publisher=2)
    assert heard.speed() == 2.0
    heard.hear(left(3.0, 12))
    assert heard.speed() == 3.0


@pytest.mark.parametrize(
    ("known", "new"),
    [(5000, 999), (5000, 4000), (10, 0), (0, 10), (10, 10), (-10, 0)],
    ids=["future, past", "future, future", "stamp, none", "none, stamp", "equal", "before 1970, none"],
)
@pytest.mark.parametrize("kinds", ["state, table", "table, state", "table, table", "state, state"])
def test_the_one_that_arrived_last_counts_whatever_it_came_in(known, new, kinds):
    """Unless its stamp is the earlier one, and neither is a wrong one or none."""
    heard = Heard()
    for publisher, (kind, seconds) in enumerate(zip(kinds.split(", "), (known, new), strict=True), 1):
        speed = float(publisher)
        state = table(["left"], seconds, speed) if kind == "table" else left(speed, seconds)
        heard.hear(state, publisher)
    assert heard.speed() == 2.0
    assert heard.states.outdated == 0


def test_a_table_stands_for_the_one_before_of_its_publisher_and_for_no_other():
    heard = Heard()
    heard.hear(table(["a"], 10), publisher=1)
    heard.hear(table(["b"], 10), publisher=2)
    heard.hear(table(["c"], 11), publisher=1)
    assert heard.speed("b") == heard.speed("c") == 0.0
    with pytest.raises(ImpactError):
        heard.speed("a")


def test_motion_types_of_a_table():
    message = table(["a", "b"])
    message.motion_types = [BodyState.DYNAMIC, BodyState.STATIC]
    heard = Heard()
    heard.hear(message)
    assert heard.states.find("", "b").motion_type == BodyState.STATIC


@pytest.mark.parametrize("field", ["numbers", "motion_types"])
def test_a_table_of_the_wrong_size_is_said_to_be_so_when_a_body_is_asked_for(field):
    message = table(["a", "b"])
    getattr(message, field).append(1)
    heard = Heard()
    heard.hear(message)
    with pytest.raises(ImpactError, match=r"cannot be read: .* of 2 bodies") as caught:
        heard.speed("a")
    assert caught.value.code is StatusCode.UNKNOWN_BODY


# limits


def test_beyond_the_greatest_number_of_bodies_the_stalest_are_forgotten():
    heard = Heard(most=3)
    for name in ("a", "b", "c", "a", "d"):
        heard.hear(ball(name=name))
    for name in "acd":
        assert heard.speed(name) == 0.0
    with pytest.raises(ImpactError):
        heard.speed("b")
    assert heard.states.evicted == 1
    assert any("max_bodies" in report for report in heard.reports)


def test_tables_of_more_bodies_than_that_are_forgotten_the_stalest_first():
    heard = Heard(most=4)
    for publisher, names in (1, "ab"), (2, "cd"), (1, "ab"), (3, "ef"):
        heard.hear(table([*names]), publisher)
    assert [name for name in "abcdef" if heard.knows(name)] == [*"abef"]
    heard.hear(table([*"ghijk"]), publisher=3)
    assert [name for name in "abcdefghijk" if heard.knows(name)] == [*"ab"]
    assert heard.states.evicted == 2 + 5
    assert any("max_bodies" in report for report in heard.reports)


def test_messages_do_not_grow_with_the_names_they_quote():
    heard = Heard()
    for i in range(50):
        heard.hear(ball(name=f"{i:03}" * 1000))
    with pytest.raises(ImpactError) as caught:
        heard.speed("x" * 10**6)
    assert len(str(caught.value)) < 2000
    assert "000000" in str(caught.value) and str(caught.value).endswith(", ...")


def test_bodies_of_tables_are_among_those_heard_of():
    heard = Heard()
    heard.hear(table(["a", "b"]))
    with pytest.raises(ImpactError, match=r"heard of: a, b$"):
        heard.speed("c")
    heard.hear(left(0.0))
    with pytest.raises(ImpactError, match=r"heard of: left, a, b$"):
        heard.speed("c")


# losses and publishers


def test_states_lost_on_the_way_are_counted():
    heard = Heard()
    for number in (1, 2, 5, 6):
        heard.hear(left(0.0), number=number)
    heard.hear(left(0.0), publisher=2, number=70)
    heard.hear(left(0.0), publisher=2, number=71)
    assert heard.states.lost == 2
    assert len([report for report in heard.reports if "did not arrive" in report]) == 1


def test_who_loses_tables_is_told_what_helps_with_tables():
    heard = Heard()
    heard.hear(table(["a"]), number=1)
    heard.hear(table(["a"]), number=4)
    (report,) = heard.reports
    assert report.startswith(
        "tables were sent and did not arrive, 2 messages in all: large ones need reliable QoS"
    )


def test_two_publishers_of_one_name_are_reported_once():
    heard = Heard()
    for publisher in (1, 2, 1, 2, 1):
        heard.hear(left(0.0), publisher=publisher)
    assert [report for report in heard.reports if "two publishers" in report] == [
        "two publishers send states of 'left': which is used, the stamps decide"
    ]


def test_a_publisher_that_takes_over_from_another_is_not_reported():
    heard = Heard()
    for publisher in (1, 1, 2, 2, 3):
        heard.hear(left(0.0), publisher=publisher)
    assert not heard.reports


def test_where_publishers_are_unknown_tables_are_told_apart_by_their_bodies():
    """As in Jazzy, whose rclpy does not say from whom a message is."""
    heard = Heard()
    for names, speed, number in (("ab", 1.0, 1), ("c", 2.0, 9), ("ab", 3.0, 2)):
        heard.hear(table([*names], speed=speed), publisher=None, number=number)
    for speed in (4.0, 5.0, 4.0):
        heard.hear(left(speed), publisher=None)
    assert (heard.speed("b"), heard.speed("c"), heard.speed()) == (3.0, 2.0, 4.0)
    assert (len(heard.states), heard.states.lost, heard.reports) == (4, 0, [])


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
    heard = Heard()
    heard.hear(WHOLE[:size])
    if size < 33:  # up to there it has not even a name
        assert heard.states.unreadable == 1 and len(heard.states) == 0
    else:
        with pytest.raises(ImpactError, match="cannot be read"):
            heard.speed()


@pytest.mark.parametrize("offset", [12, 24])
def test_a_text_that_claims_more_than_there_is_makes_it_broken(offset):
    message = bytearray(WHOLE)
    message[offset : offset + 4] = struct.pack("<I", 2**31)
    with pytest.raises(MalformedMessage, match="a text in it ends after its end"):
        SerializedState(bytes(message))


def test_bytes_that_are_no_text_make_it_broken():
    message = bytearray(WHOLE)
    message[message.index(b"left")] = 0xFF
    with pytest.raises(MalformedMessage):
        SerializedState(bytes(message))


def test_a_state_that_is_too_long_is_passed_over():
    heard = Heard()
    heard.hear(ball(name="x" * MAX_STATE_SIZE))
    assert heard.states.unreadable == 1 and len(heard.states) == 0
    assert "4096" in heard.reports[0]


def test_a_table_that_claims_more_names_than_it_can_hold_is_broken_at_once():
    message = bytearray(serialize_message(table(["a"])))
    offset = 4 + 8 + 4 + 8
    assert struct.unpack_from("<I", message, offset) == (1,)
    message[offset : offset + 4] = struct.pack("<I", 20_000_000)
    with pytest.raises(MalformedMessage, match="its names alone need 160000000 bytes"):
        SerializedTable(bytes(message))


def test_garbage_harms_nobody():
    heard = Heard()
    heard.hear(left(1.0, 10))
    for garbage in (b"", b"\0", b"\0\1\0\0", bytes(range(256)), b"\xff" * 5000):
        heard.hear(garbage)
    assert heard.speed() == 1.0
    assert heard.states.unreadable == 5


def test_assigning_by_rows_covers_every_field_of_a_state():
    """Each of the 23 numbers of a column lands in a field of its own."""
    message = table(["a"])
    message.numbers = type(message.numbers)("d", range(1, 24))
    heard = Heard()
    heard.hear(message)
    state, expected = heard.states.find("", "a"), BodyState(name="a")
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
