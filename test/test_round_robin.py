"""Whose request is served next, with a clock that is set by hand."""

from __future__ import annotations

from concurrent.futures import Future

import pytest

pytest.importorskip("rclpy")

from collision_response import ImpactError, StatusCode
from collision_response.ros.round_robin import TIME_SLICE, Job, RoundRobin

ERROR = ImpactError(StatusCode.SHUTTING_DOWN, "node", "is shutting down")


class Bench:
    """A round robin, a clock, and what was done in which order."""

    def __init__(self, over_budget=lambda spent: None):
        self.now = 0.0
        self.done = []
        self.wakes = 0
        self.turns = RoundRobin(over_budget, self.wake, lambda: self.now)

    def wake(self):
        self.wakes += 1

    def computed(self, name, *futures):
        """A job that needs what other threads compute."""

        def work():
            yield from futures
            self.done.append(name)

        return Job(work(), lambda error: self.done.append(f"{name}: {error.code.name}"))

    def job(self, name, steps=1, takes=0.0, until=None):
        """A job of ``steps`` steps of ``takes`` seconds; before the last it waits until ``until``."""

        def work():
            for step in range(steps):
                if until is not None and step == steps - 1:
                    yield until
                self.now += takes
                self.done.append(name if steps == 1 else f"{name}{step}")
                if step < steps - 1:
                    yield

        return Job(work(), lambda error: self.done.append(f"{name}: {error.code.name}"))

    def run(self):
        while self.turns.is_ready:
            self.turns.run_slice()
        return self.done


def test_a_step_lets_jobs_that_wait_go_on_after_its_slice():
    bench = Bench()

    def take_state():
        bench.turns.resume_after_slice()
        bench.done.append("taken")
        yield
        bench.done.append("answered")

    bench.turns.add("A", bench.job("waits", steps=2, until=1e9))
    bench.turns.run_slice()
    assert bench.done == ["waits0"]
    bench.turns.add("A", Job(take_state(), lambda error: None))
    assert bench.run() == ["waits0", "taken", "answered", "waits1"]
    assert not bench.turns.is_waiting


def test_requests_of_one_client_are_answered_in_order():
    bench = Bench()
    for name in "abc":
        bench.turns.add("client", bench.job(name))
    assert bench.run() == ["a", "b", "c"]
    assert len(bench.turns) == 0


def test_clients_take_turns_of_one_slice():
    bench = Bench()
    for i in range(3):
        bench.turns.add("burst", bench.job(f"burst {i}", takes=TIME_SLICE))
    bench.turns.add("other", bench.job("other", takes=TIME_SLICE))
    assert bench.run() == ["burst 0", "other", "burst 1", "burst 2"]


def test_short_requests_share_a_slice():
    bench = Bench()
    for i in range(3):
        bench.turns.add("burst", bench.job(i, takes=TIME_SLICE / 2))
    bench.turns.add("other", bench.job("other"))
    assert bench.run() == [0, 1, "other", 2]


def test_a_long_request_lets_others_go_first_between_its_parts():
    bench = Bench()
    bench.turns.add("long", bench.job("step ", steps=3, takes=TIME_SLICE))
    for name in "ab":
        bench.turns.add(name, bench.job(name))
    assert bench.run() == ["step 0", "a", "b", "step 1", "step 2"]


def test_a_waiting_request_blocks_no_other_and_continues_when_woken():
    bench = Bench()
    bench.turns.add("client", bench.job("waits", until=10.0))
    bench.turns.add("client", bench.job("next"))
    assert bench.run() == ["next"]
    assert bench.turns.is_waiting and len(bench.turns) == 1
    bench.turns.resume(overdue_only=True)
    assert bench.run() == ["next"]
    bench.turns.resume()
    assert bench.run() == ["next", "waits"]


def test_a_waiting_request_continues_when_its_time_is_up():
    bench = Bench()
    bench.turns.add("client", bench.job("waits", until=10.0))
    bench.run()
    bench.now = 10.0
    bench.turns.resume(overdue_only=True)
    assert bench.run() == ["waits"]
    assert not bench.turns.is_waiting


def test_waiting_requests_of_one_client_continue_in_order():
    bench = Bench()
    for name in "ab":
        bench.turns.add("client", bench.job(name, steps=2, until=10.0))
    bench.run()
    bench.turns.add("client", bench.job("next"))
    bench.turns.resume()
    assert bench.run() == ["a0", "b0", "a1", "b1", "next"]


def test_requests_that_wait_again_and_again_let_all_others_have_their_turn():
    """As when states arrive at a high rate, and none is the one they wait for."""
    bench = Bench()

    def looks_again(name):
        while True:
            bench.done.append(name)
            bench.now += TIME_SLICE
            yield 1e9

    for name in "abc":
        bench.turns.add("client", Job(looks_again(name), lambda error: None))
    bench.turns.add("client", bench.job("next"))
    for _ in range(10):
        bench.turns.run_slice()
        bench.turns.resume()
    assert bench.done == ["a", "a", "b", "b", "c", "c", "next", "a", "b", "c", "a"]


def test_a_client_whose_request_is_computed_elsewhere_holds_up_no_other():
    bench, answers = Bench(), [Future(), Future()]
    for client, future in zip("ab", answers, strict=True):
        bench.turns.add(client, bench.computed(f"{client}1", future))
        bench.turns.add(client, bench.job(f"{client}2"))
    bench.turns.add("c", bench.job("c"))
    assert bench.run() == ["c"]
    assert not bench.turns.is_ready and not bench.turns.is_waiting and len(bench.turns) == 4
    answers[1].set_result(None)
    assert bench.wakes == 1 and bench.turns.is_ready
    assert bench.run() == ["c", "b1", "b2"]
    answers[0].set_result(None)
    assert bench.wakes == 2
    assert bench.run() == ["c", "b1", "b2", "a1", "a2"]
    assert len(bench.turns) == 0


def test_a_request_may_be_computed_elsewhere_again_and_one_that_is_resumed_waits_for_it():
    bench, first, second = Bench(), Future(), Future()
    bench.turns.add("client", bench.job("waits", until=10.0))
    bench.turns.add("client", bench.computed("computed", first, second))
    bench.run()
    bench.turns.resume()
    assert bench.run() == []
    first.set_result(None)
    assert bench.run() == ["waits"]
    second.set_result(None)
    assert bench.run() == ["waits", "computed"]


def test_a_client_whose_request_was_computed_elsewhere_is_served_for_a_whole_slice_again():
    bench, future = Bench(), Future()
    bench.turns.add("client", bench.computed("computed", future))
    bench.run()
    for client, name in (("client", "next"), ("other", "other")):
        bench.turns.add(client, bench.job(name))
    future.set_result(None)
    assert bench.run() == ["computed", "next", "other"]


def test_what_is_computed_for_a_client_that_left_is_cancelled_if_it_has_not_begun():
    bench, future = Bench(), Future()
    bench.turns.add("gone", bench.computed("computed", future))
    bench.run()
    assert bench.turns.drop("gone") == 1
    assert future.cancelled()
    bench.turns.add("gone", bench.job("is back"))
    assert bench.run() == ["is back"]


def test_a_request_over_its_budget_is_ended_before_its_next_part():
    over = ImpactError(StatusCode.BUDGET_EXCEEDED, "request", "took too long")
    bench = Bench(lambda spent: over if spent > 2.5 else None)
    bench.turns.add("client", bench.job("step ", steps=9, takes=1.0))
    bench.turns.add("client", bench.job("next", takes=2.5))
    assert bench.run() == ["step 0", "step 1", "step 2", "step : BUDGET_EXCEEDED", "next"]


def test_requests_of_a_client_that_left_are_dropped_wherever_they_are():
    bench = Bench()
    bench.turns.add("gone", bench.job("waits", until=10.0))
    bench.run()
    bench.turns.add("gone", bench.job("queued"))
    bench.turns.add("other", bench.job("other"))
    assert bench.turns.drop("gone") == 2
    assert bench.turns.drop("gone") == 0
    bench.turns.resume()
    assert bench.run() == ["other"]


def test_ctrl_c_loses_no_request_that_still_waits_for_its_turn():
    """As in a program that catches it and goes on."""
    bench = Bench()

    def interrupted():
        yield
        raise KeyboardInterrupt

    bench.turns.add("client", bench.job("a"))
    bench.turns.add("client", Job(interrupted(), pytest.fail))
    bench.turns.add("client", bench.job("b"))
    with pytest.raises(KeyboardInterrupt):
        bench.run()
    assert bench.run() == ["a", "b"]


def test_at_the_end_every_request_gets_an_error():
    bench = Bench()
    bench.turns.add("a", bench.job("begun ", steps=2, takes=TIME_SLICE))
    bench.turns.add("a", bench.job("queued"))
    bench.turns.add("b", bench.job("waits", until=99.0))
    bench.turns.add("c", bench.computed("computed", Future()))
    for _ in range(3):
        bench.turns.run_slice()
    bench.turns.refuse_all(ERROR, until=50.0)
    names = ("begun ", "queued", "waits", "computed")
    assert bench.done[0] == "begun 0"
    assert sorted(bench.done[1:]) == sorted(f"{name}: SHUTTING_DOWN" for name in names)
    assert len(bench.turns) == 0


def test_at_the_end_requests_beyond_the_deadline_are_counted():
    bench = Bench()
    for name in "abc":
        bench.turns.add("client", bench.job(name))
    bench.turns.refuse_all(ERROR, until=0.0)
    assert len(bench.turns) == 3
