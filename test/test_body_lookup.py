"""Looking up the bodies that a request gives by name: how often, and in how much memory."""

from __future__ import annotations

import tracemalloc
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("rclpy")

from builtin_interfaces.msg import Time
from rclpy.serialization import serialize_message
from refusals import refused
from ros_graph import ball
from std_msgs.msg import Header

from collision_response import StatusCode
from collision_response.ros import body_lookup
from collision_response.ros.batches import bodies_of
from collision_response.ros.body_lookup import MAX_TEXT, StateFinder, check_names
from collision_response.ros.states import LatestStates
from collision_response.ros.tables import LAYOUTS, Request

PARAMETERS = SimpleNamespace(world_frame="", max_state_age=0.0, max_state_wait=5.0)


class Lookup:
    """A request that waits for states: the clock stands still unless it is set."""

    def __init__(self, monkeypatch, names, not_before=0):
        self.seconds, self.times = 0.0, 0
        monkeypatch.setattr(body_lookup.time, "perf_counter", lambda: self.seconds)
        self.states = LatestStates(
            100, now=lambda: 0, warn=lambda *_: None, take_all=lambda: None, name_of=str, clock=lambda: 0.0
        )
        self.finder = StateFinder("header", Header(), Time(sec=not_before), self.states, PARAMETERS)
        self.names = names
        self.steps = self.finder.wait(self.look_up)

    def look_up(self):
        self.times += 1
        yield from ()
        return [self.finder.find("body_a", "body_a.name", name)[0].name for name in self.names]

    def hear(self, name, seconds):
        state = ball(name=name)
        state.header.frame_id, state.header.stamp.sec = "", seconds
        self.states.add(serialize_message(state), {"publication_sequence_number": self.states.received + 1})

    def go_on(self):
        """The names that were found, or ``None`` if the request waits."""
        try:
            assert next(self.steps) == PARAMETERS.max_state_wait
        except StopIteration as stop:
            return stop.value
        return None


def test_bodies_are_looked_up_again_only_when_the_state_that_is_missing_has_arrived(monkeypatch):
    """Not for each state of any body: a look-up of the most names takes a second."""
    lookup = Lookup(monkeypatch, ["ball", "cup"], not_before=10)
    lookup.hear("cup", 3)
    assert lookup.go_on() is None
    for seconds in range(20):
        lookup.hear("dish", seconds)
        lookup.hear("cup", seconds)
        assert lookup.go_on() is None
    assert lookup.times == 1
    lookup.hear("ball", 9)
    assert lookup.go_on() is None
    lookup.hear("ball", 10)
    assert lookup.go_on() == ["ball", "cup"]
    assert lookup.times == 2


def test_a_body_that_is_missing_after_another_one_is_waited_for_too(monkeypatch):
    lookup = Lookup(monkeypatch, ["ball", "cup"], not_before=10)
    assert lookup.go_on() is None
    lookup.hear("ball", 10)
    assert lookup.go_on() is None
    lookup.hear("cup", 10)
    assert lookup.go_on() == ["ball", "cup"]


@pytest.mark.parametrize("heard", [[], [("cup", 20)], [("ball", 9)]])
def test_a_state_that_does_not_come_in_time_is_named(monkeypatch, heard):
    lookup = Lookup(monkeypatch, ["ball", "cup"], not_before=10)
    assert lookup.go_on() is None
    for name, seconds in heard:
        lookup.hear(name, seconds)
    lookup.seconds = PARAMETERS.max_state_wait
    with refused(StatusCode.STALE_STATE, match=r"'ball'.*; waited 5 s \(max_state_wait\)"):
        lookup.go_on()


def test_unknown_bodies_take_hardly_more_memory_than_their_names(monkeypatch):
    """The error of each, with its traceback, took 1,800 bytes: 700 MB for the most names of a request."""
    names, layout = [f"body {i}" for i in range(20_000)], LAYOUTS[Request.POINT]
    finder = Lookup(monkeypatch, names).finder
    tracemalloc.start()
    try:
        for _ in bodies_of(names, np.zeros((layout.bodies.height, 0)), layout, finder):
            pass
        _, most = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert most < 300 * len(names)  # bytes


@pytest.mark.parametrize(
    ("names", "code", "message"),
    [
        (["a", "b", "a", "b"], StatusCode.SAME_BODY, "names[2]: is 'a', the same as names[0]: names must be"),
        (["a", "x" * (MAX_TEXT + 1), "a"], StatusCode.BUDGET_EXCEEDED, "names[1]: has 257 characters; may"),
        (["a", "a", "x" * (MAX_TEXT + 1)], StatusCode.SAME_BODY, "names[1]: is 'a', the same as names[0]"),
    ],
)
def test_the_first_name_that_is_too_long_or_appears_twice_is_refused(names, code, message):
    with refused(code) as caught:
        check_names(names)
    assert str(caught.value).startswith(message)


@pytest.mark.parametrize("names", [[], ["a"], ["a", "b", "x" * MAX_TEXT]])
def test_other_names_are_not_refused(names):
    check_names(names)
