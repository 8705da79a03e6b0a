"""The demo: times of impact, the scenes it builds, and whether its energy balance would show a fault."""

from __future__ import annotations

import math
import subprocess
import sys
from types import SimpleNamespace

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from collision_response.demo import simultaneous
from collision_response.demo.simulation import EnergyBalance
from collision_response.demo.time_of_impact import TOUCH_GAP, until_spheres_touch, until_touch
from collision_response.physics.body import Body
from collision_response.physics.laws import Law
from collision_response.physics.vector import Vec3

vectors = st.builds(Vec3, *[st.floats(-3, 3)] * 3)


@given(vectors, vectors, st.floats(0.1, 1.0))
def test_spheres_touch_when_their_distance_is_the_sum_of_their_radii(offset, velocity, reach):
    assume(offset.norm() > 1.1 * reach and velocity.norm() > 0.1)
    time = until_spheres_touch(offset, velocity, reach)
    nearest = max(0.0, -offset.dot(velocity) / velocity.dot(velocity))
    closest = (offset + velocity * nearest).norm()
    if math.isinf(time):
        assert closest >= reach * (1 - 1e-12)
    else:
        assert 0 < time <= nearest
        # rounding of lengths up to 6 m, more where the path only just touches
        assert (offset + velocity * time).norm() == pytest.approx(reach, abs=1e-12)


@given(st.floats(0.01, 5.0), st.floats(-3.0, 3.0))
def test_a_falling_point_reaches_the_floor_when_gravity_says(height, speed):
    g = 9.81

    def gap(t: float) -> tuple[float, float]:
        return height + speed * t - g * t * t / 2, speed - g * t

    expected = (speed + math.sqrt(speed * speed + 2 * g * height)) / g
    # within the gap that counts as none, at the speed of arrival
    assert until_touch(gap, g, 10.0) == pytest.approx(expected, abs=2 * TOUCH_GAP / 0.4 + 1e-12)


def test_a_gap_that_does_not_close_is_not_found():
    assert until_touch(lambda t: (1.0 + t * t, 2 * t), 2.0, 5.0) == math.inf


def test_an_energy_balance_shows_missing_and_rising_energy():
    balance = EnergyBalance(10.0)
    balance.add_impact(8.0, SimpleNamespace(energy_lost_restitution=1.5, energy_lost_friction=0.5))
    assert (balance.error(), balance.relative_rise()) == (0.0, 0.0)
    balance.add_impact(9.0, SimpleNamespace(energy_lost_restitution=0.0, energy_lost_friction=0.0))
    assert (balance.error(), balance.relative_rise()) == (pytest.approx(0.1), pytest.approx(0.1))


def test_the_balls_of_a_rack_touch_where_the_contacts_say():
    bodies, _, pairs, contacts, _ = simultaneous.tight_rack(Vec3(0.5, -1.0, 0.2))
    balls = [*bodies.values()]
    assert len(contacts) == 1 + 3 * 10, "the cue ball's, and the sides of ten small triangles"
    for (a, b), contact in zip(pairs, contacts, strict=True):
        p, q = balls[a].position, balls[b].position
        assert math.dist(p, contact.position) == pytest.approx(simultaneous.RADIUS)
        assert math.dist(q, contact.position) == pytest.approx(simultaneous.RADIUS)
        assert contact.normal.dot(p - q) == pytest.approx(contact.normal.norm() * 2 * simultaneous.RADIUS)


def test_every_ball_of_the_triangle_has_its_mirror_image():
    balls = [*simultaneous.tight_rack(Vec3(0.0, 0.0, 0.0)).bodies.values()]
    images = dict(simultaneous.mirror_pairs())
    assert sorted(images) == sorted(images.values()) == list(range(1, 16))
    for i, k in images.items():
        assert balls[k].position == pytest.approx(balls[i].position._replace(y=-balls[i].position.y))


def test_a_box_stands_on_its_corners():
    bodies, _, _, contacts, _ = simultaneous.flat_box("box", "floor", Vec3(1.0, 2.0, 3.0))
    sizes = simultaneous.SIDE / 2, simultaneous.SIDE / 2, simultaneous.HEIGHT / 2
    offsets = {
        tuple(round(x / size, 9) for x, size in zip(c.position - bodies["box"].position, sizes, strict=True))
        for c in contacts
    }
    assert offsets == {(x, y, -1.0) for x in (-1.0, 1.0) for y in (-1.0, 1.0)}


@pytest.mark.parametrize("place", ["recordings", "recordings/demo.rrd"])
def test_a_recording_that_cannot_be_replaced_or_read_is_a_problem_like_others(
    place, tmp_path, monkeypatch, capsys
):
    """A file stands where its directory should be, or is no recording."""
    pytest.importorskip("rclpy"), pytest.importorskip("rerun")
    from collision_response.demo import __main__ as demo

    def demonstrate():
        yield "another problem"
        demo.recording_parameters()
        (tmp_path / place).touch()
        yield from demo.check_recording(1)

    monkeypatch.chdir(tmp_path)
    (tmp_path / place).parent.mkdir(exist_ok=True)
    if place == "recordings":
        (tmp_path / place).touch()
    monkeypatch.setattr(demo, "demonstrate", demonstrate)
    monkeypatch.setattr(demo.signal, "signal", lambda *_: None)
    for variable in "ROS_DOMAIN_ID", "ROS_AUTOMATIC_DISCOVERY_RANGE":
        monkeypatch.setenv(variable, "")  # restored at the end
    assert demo.main([]) == 1
    first, second = (line for line in capsys.readouterr().out.splitlines() if line.startswith("FAILED: "))
    assert first == "FAILED: another problem"
    assert "recordings/demo.rrd" in second


def test_it_finds_no_problem_and_records_no_refusal(tmp_path):
    """A state that a request needs is there before the request: nobody takes an answer for a fault."""
    pytest.importorskip("rclpy"), pytest.importorskip("rerun")
    from collision_response.recording import scenes, table

    command = [sys.executable, "-m", "collision_response.demo"]
    run = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=300, check=False)
    assert (run.returncode, run.stderr) == (0, ""), run.stdout
    path = tmp_path / "recordings" / "demo.rrd"
    impacts, refusals = table.divide(table.read([path]))
    assert len(impacts) > 100 and len(scenes.read([path])) == 5
    assert len(refusals) == 0


@pytest.mark.parametrize("law", [Law.FRICTIONLESS, Law.MOREAU, Law.ROUTH_STRONGE])
def test_expected_cradle_speeds_conserve_momentum_and_energy(law):
    pytest.importorskip("rclpy")
    from collision_response.demo.chapters import CRADLES

    _, speeds, _ = CRADLES[law]
    assert sum(speeds) == pytest.approx(1.0, abs=1e-11)  # the digits that are given
    assert sum(v * v for v in speeds) == pytest.approx(1.0, abs=1e-11)


def test_drifting_bodies_translate_and_rotate():
    body = Body.dynamic(
        1.0, (1.0, 0, 0, 1.0, 0, 1.0), (1.0, 0.0, 0.0), None, (0.0, 2.0, 0.0), (0.0, 0.0, 3.0)
    )
    (moved,) = simultaneous.moved_freely({"it": body}, math.pi / 6).values()  # a quarter of a turn
    assert moved.position == pytest.approx((1.0, math.pi / 3, 0.0))
    assert moved.to_world(Vec3(1.0, 0.0, 0.0)) == pytest.approx((0.0, 1.0, 0.0), abs=1e-15)
    (back,) = simultaneous.moved_freely({"it": body}, -math.pi / 6).values()
    assert back.to_world(Vec3(1.0, 0.0, 0.0)) == pytest.approx((0.0, -1.0, 0.0), abs=1e-15)
