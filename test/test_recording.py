"""Recordings: read back, compared with the answers, and never in the way."""

from __future__ import annotations

import subprocess
import sys
import threading
from types import SimpleNamespace

import pytest

pytest.importorskip("rerun")

import rerun as rr
from rerun.chunk import RrdReader

from collision_response import Body, Contact, resolve
from collision_response.recording import Gap, Record, Recorder, Refusal, Sighting
from collision_response.recording.layout import PLOTS

DEADLINE = 20.0


@pytest.fixture(autouse=True)
def strict():
    """Wrong shapes raise, rather than warn."""
    rr.set_strict_mode(True)
    yield
    rr.set_strict_mode(False)


def verify(path):
    command = [sys.executable, "-m", "rerun", "rrd", "verify", str(path)]
    check = subprocess.run(command, capture_output=True, text=True, timeout=DEADLINE)
    assert check.returncode == 0, check.stderr


def read(path, entity, component):
    """Rows of an entity: stamp [ns], number of the answer, value."""
    rows = []
    for chunk in RrdReader(str(path)).stream().filter(content=entity, components=component).to_chunks():
        batch = chunk.to_record_batch()
        if "answer" in batch.schema.names:  # else it is static
            times = [batch.column(name).cast("int64").to_pylist() for name in ("ros_time", "answer")]
            rows += zip(*times, batch.column(component).to_pylist(), strict=True)
    return sorted(rows)


def impact(sequence=1):
    """A ball of 2 kg falls on the floor with 3 m/s; e = 0.5."""
    ball = Body.dynamic(2.0, position=(0.0, 0.0, 0.5), velocity=(1.0, 0.0, -3.0))
    floor = Body.static()
    contact = Contact.of((0.0, 0.0, 0.0), normal=(0.0, 0.0, 2.0), restitution=0.5)
    answer = resolve(ball, floor, contact)
    return Record(1_000_000_000 * sequence + 1, sequence, "ball/1", "the floor", ball, floor, answer)


def recorded(directory, entries):
    """The file of a recorder that was given these entries."""
    problems = []
    recorder = Recorder(directory, problems.append)
    for entry in entries:
        recorder.add(entry)
    recorder.close()
    assert problems == []
    return recorder.path


def test_a_scene_is_where_it_was(tmp_path):
    path = recorded(tmp_path / "made" / "here", [impact(1), impact(2)])
    verify(path)
    assert path.parent == tmp_path / "made" / "here"
    stamps = [(1_000_000_001, 1), (2_000_000_001, 2)]
    for entity, component, value in (
        (r"/world/bodies/ball\/1", "Transform3D:translation", [[0.0, 0.0, 0.5]]),
        (r"/world/bodies/the\ floor", "Transform3D:translation", [[0.0, 0.0, 0.0]]),
        (r"/world/velocities/ball\/1", "Arrows3D:origins", [[0.0, 0.0, 0.5]] * 2),
        (r"/world/velocities/ball\/1", "Arrows3D:vectors", [[0.1, 0.0, 0.15], [0.1, 0.0, -0.3]]),
        ("/world/contact", "Points3D:positions", [[0.0, 0.0, 0.0]]),
        ("/world/contact", "Arrows3D:vectors", [[0.0, 0.0, 0.1], [0.0, 0.0, 0.45]]),
    ):
        rows = read(path, entity, component)
        assert [row[:2] for row in rows] == stamps, entity
        assert all(row[2] == [pytest.approx(one, rel=1e-6) for one in value] for row in rows), entity
    labels = [value for _, _, value in read(path, "/world/contact", "Points3D:labels")]
    assert labels == [["9 N s"], ["9 N s"]]
    # a body is there from its first appearance on, not before
    for component, value in ("Points3D:positions", [[0.0, 0.0, 0.0]]), ("Ellipsoids3D:half_sizes", None):
        rows = read(path, r"/world/bodies/ball\/1", component)
        assert [row[:2] for row in rows] == (stamps[:1] if value else []), component


def test_answers_are_told_in_words(tmp_path):
    path = recorded(tmp_path, [impact(1), Refusal(7, 2, "INVALID_NORMAL: contact.normal: is of length 0")])
    (_, _, [refusal]), (_, _, [answer]) = read(path, "/log", "TextLog:text")
    assert refusal == "INVALID_NORMAL: contact.normal: is of length 0"
    assert answer.startswith("ball/1 on the floor: SLIDING, 9 N s along the normal, 0 N s across, 6.75 J")


def test_a_file_is_complete_without_an_impact(tmp_path):
    verify(recorded(tmp_path, []))


def test_what_does_not_fit_the_queue_is_dropped_and_counted(tmp_path, monkeypatch):
    opened, go_on, written = threading.Event(), threading.Event(), []

    class SlowWriter:
        def __init__(self, path, recording):
            opened.set()
            go_on.wait(DEADLINE)

        def __enter__(self):
            return SimpleNamespace(write=written.extend, is_in_place=lambda: True)

        def __exit__(self, *_):
            pass

    monkeypatch.setattr("collision_response.recording.writer.Writer", SlowWriter)
    problems = []
    recorder = Recorder(tmp_path, problems.append, capacity=5)
    assert opened.wait(DEADLINE)
    for sequence in range(1, 21):
        recorder.add(impact(sequence))
    assert len(problems) == 1
    assert "cannot keep up" in problems[0]
    go_on.set()
    recorder.close()
    assert recorder.dropped == 15
    assert [entry.sequence for entry in written[:5]] == [1, 2, 3, 4, 5]
    assert written[5:] == [Gap(stamp=5_000_000_001, sequence=5, count=15)]
    assert problems[1:] == [f"recording {recorder.path} lacks 15 entries, which came too fast"]


def test_a_directory_that_cannot_be_is_reported_once(tmp_path):
    (tmp_path / "file").touch()
    problems = []
    recorder = Recorder(tmp_path / "file", problems.append)
    recorder.add(impact())
    recorder.close()
    recorder.add(impact())
    assert len(problems) == 1
    assert problems[0].startswith(f"not recording to {recorder.path}: ")


FILL_THE_DISK = """
import resource, sys
from pathlib import Path
from collision_response.recording import Recorder, Refusal

resource.setrlimit(resource.RLIMIT_FSIZE, (50_000, 50_000))
problems = []
recorder = Recorder(Path(sys.argv[1]), problems.append)
for sequence in range(1, 5000):
    recorder.add(Refusal(sequence, sequence, f"{hash(str(sequence)):x}" * 4))
recorder.close()
assert len(problems) == 1 and "has stopped" in problems[0], problems
"""


def test_a_full_disk_is_reported_once(tmp_path):
    script = [sys.executable, "-c", FILL_THE_DISK, str(tmp_path)]
    result = subprocess.run(script, cwd=tmp_path, capture_output=True, text=True, timeout=DEADLINE)
    assert result.returncode == 0, result.stderr


class TestNode:
    """The recording of a node."""

    @pytest.fixture(autouse=True)
    def need_ros(self):
        pytest.importorskip("rclpy")

    def test_a_recording_holds_the_answers(self, graph, tmp_path):
        from ros_graph import balls_meet

        graph.serve(recording__enabled=True, recording__directory=str(tmp_path))
        results = []
        for restitution in (0.25, 2.0, 0.5, 1.0):
            request = balls_meet()
            request.contact.header.stamp.sec = len(results) + 1
            request.contact.restitution = restitution
            results.append(graph.call(request).result)
        graph.close()

        (path,) = tmp_path.glob("*.rrd")
        verify(path)
        answers = [result for result in results if result.status.code == 1]
        assert len(answers) == 3
        for entity, plot in PLOTS.items():
            assert read(path, entity, "Scalars:scalars") == [
                (
                    answer.header.stamp.sec * 10**9,
                    answer.sequence,
                    [getattr(answer, field) for field in plot.fields],
                )
                for answer in answers
            ]
        told = read(path, "/log", "TextLog:text")
        assert [sequence for _, sequence, _ in told] == [1, 2, 3, 4]
        assert told[1][2] == [f"INVALID_COEFFICIENT: {results[1].status.message}"]

    def test_an_impact_without_a_stamp_is_recorded_at_the_time_of_its_answer(self, graph, tmp_path):
        from ros_graph import balls_meet

        node = graph.serve(recording__enabled=True, recording__directory=str(tmp_path))
        before = node.get_clock().now().nanoseconds
        graph.call(balls_meet())
        after = node.get_clock().now().nanoseconds
        graph.close()
        (path,) = tmp_path.glob("*.rrd")
        ((stamp, _, _),) = read(path, "/impact/impulse", "Scalars:scalars")
        assert before <= stamp <= after

    def test_a_bad_directory_does_not_keep_the_service_from_answering(self, graph, tmp_path, capfd):
        from ros_graph import balls_meet

        (tmp_path / "file").touch()
        graph.serve(recording__enabled=True, recording__directory=str(tmp_path / "file"))
        assert all(graph.call(balls_meet()).success for _ in range(20))
        graph.close()
        assert capfd.readouterr().err.count("recording to") == 1

    def test_nothing_is_recorded_unless_asked(self, graph, tmp_path):
        from ros_graph import balls_meet

        graph.serve(recording__directory=str(tmp_path))
        graph.call(balls_meet())
        graph.close()
        assert list(tmp_path.iterdir()) == []
