"""Recordings: read back, compared with the answers, and never blocking the node."""

from __future__ import annotations

import itertools
import os
import shutil
import subprocess
import sys
import threading
import warnings
from collections import defaultdict
from pathlib import Path
from types import SimpleNamespace

import pytest

pytest.importorskip("rerun")

import rerun as rr
from recordings import DEADLINE, closed, impact, read, recorded, rerun, static, verify
from rerun.chunk import RrdReader

from collision_response import Body, Contact, ImpactModel, Vec3, resolve, resolve_scene
from collision_response.physics.tensor import Symmetric3
from collision_response.recording import BodyRecord, Gap, Record, Recorder, Refusal, SceneRecord, colours
from collision_response.recording.viewer_layout import PLOTS
from collision_response.recording.writer import Recording, Writer

FILE = SimpleNamespace(is_in_place=lambda: True, size=lambda: 0)
"""A substitute for the file of a writer."""


@pytest.fixture(autouse=True)
def strict():
    """Make rerun raise on wrong shapes instead of warning."""
    rr.set_strict_mode(True)
    yield
    rr.set_strict_mode(False)


def test_an_impact_is_drawn_where_it_was(tmp_path):
    path = recorded(tmp_path / "made" / "here", [impact(1), impact(2)])
    verify(path)
    assert path.parent == tmp_path / "made" / "here"
    stamps = [(1_000_000_001, 1), (2_000_000_001, 2)]
    for entity, component, value in (
        (r"/world/bodies/ball\/1", "Transform3D:translation", [[0.0, 0.0, 0.5]]),
        (r"/world/bodies/the\ floor", "Transform3D:translation", [[0.0, 0.0, 0.0]]),
        (r"/world/velocities/ball\/1", "Arrows3D:origins", [[0.0, 0.0, 0.5]] * 4),
        (
            r"/world/velocities/ball\/1",
            "Arrows3D:vectors",
            [[0.1, 0.0, 0.15], [0.0] * 3, [0.1, 0.0, -0.3], [0.0] * 3],
        ),
        ("/world/contact", "Points3D:positions", [[0.0, 0.0, 0.0]]),
        ("/world/contact", "Arrows3D:vectors", [[0.0, 0.0, 0.1]]),
        ("/world/impulse", "Arrows3D:vectors", [[0.0, 0.0, 0.45]]),
    ):
        rows = read(path, entity, component)
        assert [row[:2] for row in rows] == stamps, entity
        assert all(row[2] == [pytest.approx(one, rel=1e-6) for one in value] for row in rows), entity
    labels = [value for _, _, value in read(path, "/world/impulse", "Arrows3D:labels")]
    assert labels == [["9 N s"], ["9 N s"]]
    ((drawn_in,),) = read(path, r"/world/velocities/ball\/1", "Arrows3D:colors", timelines=())
    of_arrows = colours.AFTER, colours.SPIN_AFTER, colours.BEFORE, colours.SPIN_BEFORE
    assert drawn_in == [red << 24 | green << 16 | blue << 8 | 255 for red, green, blue in of_arrows]
    # a body is there from its first appearance on, not before
    for component, value in ("Points3D:positions", [[0.0, 0.0, 0.0]]), ("Ellipsoids3D:half_sizes", None):
        rows = read(path, r"/world/bodies/ball\/1", component)
        assert [row[:2] for row in rows] == (stamps[:1] if value else []), component


def test_answers_are_described_in_the_log(tmp_path):
    path = recorded(tmp_path, [impact(1), Refusal(7, 2, "INVALID_NORMAL: contact.normal: is of length 0")])
    (_, _, [refusal]), (_, _, [answer]) = read(path, "/log", "TextLog:text")
    assert refusal == "INVALID_NORMAL: contact.normal: is of length 0"
    assert answer.startswith("ball/1 on the floor: SLIDING, 9 N s along the normal, 0 N s across, 6.75 J")


def test_a_file_is_complete_without_an_impact(tmp_path):
    verify(recorded(tmp_path, []))


def test_entries_without_a_stamp_are_not_on_the_timeline_of_time(tmp_path):
    """As before the first /clock of a simulation: nothing may be put at 1970."""
    untimed = impact(1)._replace(stamp=0)
    entries = [untimed, BodyRecord(0, "ball/1", untimed.body_a), Refusal(0, 2, "no"), impact(3)]
    recorder, problems = closed(tmp_path, entries)
    verify(recorder.path)
    answer_only = {"timelines": ("answer",)}
    assert [row[0] for row in read(recorder.path, "/log", "TextLog:text", **answer_only)] == [1, 2]
    assert [row[:2] for row in read(recorder.path, "/log", "TextLog:text")] == [(3_000_000_001, 3)]
    for entity, component in (
        (r"/world/bodies/ball\/1", "Transform3D:translation"),
        (r"/world/bodies/ball\/1", "Points3D:positions"),
        (r"/world/velocities/ball\/1", "Arrows3D:vectors"),
        ("/world/contact", "Arrows3D:vectors"),
        ("/impact/impulse", "Scalars:scalars"),
    ):
        assert [row[0] for row in read(recorder.path, entity, component, **answer_only)] == [1], entity
        assert [row[:2] for row in read(recorder.path, entity, component)] == [(3_000_000_001, 3)], entity
        assert read(recorder.path, entity, component, ("ros_time",)) == []
    assert recorder.untimed == 1
    assert problems == [
        "body states without a stamp are not recorded: they have no place in time",
        f"recording {recorder.path} lacks 1 body states, which had no stamp",
    ]


@pytest.mark.parametrize(("rows", "measured"), [(1, 23_600), (200, 82_100)])
def test_chunks_are_small(tmp_path, rows, measured):
    """Bytes that a batch adds to a file, plus a fifth for other versions of rerun."""
    sizes = []
    for count in (1, 21):
        path = tmp_path / f"{count}.rrd"
        with Writer(path, Recording()) as writer:
            for batch in range(count):
                writer.write([impact(rows * batch + n + 1) for n in range(rows)])
        sizes.append(path.stat().st_size)
    assert (sizes[1] - sizes[0]) / 20 < 1.2 * measured


def test_a_closed_file_leaves_no_thread(tmp_path):
    """Threads are counted, because the streams and layouts that leaked memory each had one."""
    recording, threads = Recording(), []
    for number in range(12):
        with Writer(tmp_path / f"{number}.rrd", recording) as writer:
            writer.write([impact(number + 1)])
        threads.append(len(list(Path("/proc/self/task").iterdir())))
    assert threads[-1] - threads[1] < 10  # an ending thread may still be counted


FORK = """
import os, sys, threading
from pathlib import Path
from collision_response.recording import Recorder, recorder as policy
from recordings import DEADLINE, impact

policy.INTERVAL, files = 0.0, threading.Semaphore(0)
folder, changes = Path(sys.argv[1]), int(sys.argv[2])
recorder = Recorder(folder, print, opened=lambda _: files.release(), name="a.rrd", max_duration=1e-9)
source, sink = os.pipe()

def fork():
    if os.fork() == 0:
        os.close(sink)
        os.read(source, 1)  # until the parent ends
        os._exit(0)

assert files.acquire(timeout=DEADLINE)
fork()
count = 0
for _ in range(changes):
    while not files.acquire(timeout=0.001):
        count += 1
        assert count < 10_000, "no next file"
        recorder.add(impact(count))
    fork()
recorder.close(DEADLINE)
print(count)
"""


@pytest.mark.parametrize("changes", [0, 1, 3])
def test_forked_processes_keep_no_file_from_ending(tmp_path, changes):
    """They have a copy of the pipe to which rerun writes, so the pipe never ends."""
    command = [sys.executable, "-W", "ignore", "-c", FORK, str(tmp_path), str(changes)]
    run = subprocess.run(
        command, cwd=Path(__file__).parent, capture_output=True, text=True, timeout=100, check=False
    )
    assert (run.returncode, run.stderr) == (0, "")
    paths = sorted(tmp_path.glob("*.rrd"))
    assert len(paths) > changes
    verify(*paths)
    rows = [row for path in paths for row in read(path, "/impact/impulse", "Scalars:scalars")]
    assert [row[1] for row in rows] == [*range(1, int(run.stdout) + 1)]


def test_a_relative_directory_stays_where_it_was(tmp_path, monkeypatch):
    """Whatever directory the process changes to."""
    monkeypatch.setattr("collision_response.recording.recorder.INTERVAL", 0.0)
    files = threading.Semaphore(0)
    monkeypatch.chdir(tmp_path)
    recorder = Recorder(
        Path("here"), pytest.fail, opened=lambda _: files.release(), name="a.rrd", max_duration=1e-9
    )
    assert files.acquire(timeout=DEADLINE)
    (tmp_path / "there").mkdir()
    monkeypatch.chdir(tmp_path / "there")
    while not files.acquire(timeout=0.001):
        recorder.add(impact())
    recorder.close()
    paths = [*tmp_path.rglob("*.rrd")]
    assert len(paths) > 1
    assert {path.parent for path in paths} == {tmp_path / "here"}


def test_body_states_are_written_in_batches(tmp_path, monkeypatch):
    batches, written = [], threading.Semaphore(0)

    class Stub:
        def __init__(self, path, recording):
            pass

        def __enter__(self):
            return SimpleNamespace(write=self.write, file=FILE)

        def write(self, batch):
            batches.append([type(entry) for entry in batch])
            written.release()

        def __exit__(self, *_):
            pass

    monkeypatch.setattr("collision_response.recording.writer.Writer", Stub)
    monkeypatch.setattr("collision_response.recording.recorder.INTERVAL", 0.0)
    ball = impact().body_a
    recorder = Recorder(tmp_path, pytest.fail, capacity=8)
    for _ in range(2):
        recorder.add(BodyRecord(1, "ball", ball))
        recorder.add(impact())
        assert written.acquire(timeout=DEADLINE)
    recorder.add(BodyRecord(1, "ball", ball))
    recorder.add(BodyRecord(1, "ball", ball))
    assert written.acquire(timeout=DEADLINE)  # 4 of the 8 that may wait
    recorder.add(BodyRecord(1, "ball", ball))
    recorder.close()
    assert batches == [[Record], [Record], [BodyRecord] * 4, [BodyRecord]]


class TestRotation:
    """Recordings that are split into several files."""

    @pytest.fixture(autouse=True)
    def often(self, monkeypatch):
        monkeypatch.setattr("collision_response.recording.recorder.INTERVAL", 0.0)

    @pytest.mark.parametrize(
        "limit", [{"max_size": 0.1}, {"max_duration": 1e-6}], ids=lambda limit: next(iter(limit))
    )
    def test_each_file_is_complete_in_itself_and_nothing_is_lost_between_them(
        self, tmp_path, monkeypatch, limit
    ):
        (tmp_path / "a_002.rrd").touch()  # a file of another program
        (tmp_path / "a_003.rrd").symlink_to("nowhere")
        opened, problems, rotated, count = [], [], threading.Event(), 0
        sizes = defaultdict(list)  # before each batch

        class WatchedWriter(Writer):
            def write(self, batch):
                sizes[self.path].append(self.path.stat().st_size)
                super().write(batch)

        monkeypatch.setattr("collision_response.recording.writer.Writer", WatchedWriter)
        unlimited = {"max_size": 0.0, "max_duration": 0.0}

        def note(message):
            opened.append(tmp_path / message.removeprefix(f"recording to {tmp_path}/"))
            if len(opened) == 4:
                rotated.set()

        recorder = Recorder(tmp_path, problems.append, opened=note, name="a.rrd", **{**unlimited, **limit})
        while not rotated.wait(0.001):
            count += 1
            recorder.add(impact(count))
        recorder.close()
        assert problems == []
        assert [path.name for path in opened[:4]] == ["a.rrd", "a_001.rrd", "a_004.rrd", "a_005.rrd"]
        assert sorted(opened) == opened
        assert recorder.path == opened[-1]
        assert (tmp_path / "a_002.rrd").stat().st_size == 0
        verify(*opened)
        sequences = []
        for path in opened:
            sequences += [sequence for _, sequence, _ in read(path, "/impact/impulse", "Scalars:scalars")]
            (names,) = static(path, "/impact/impulse", "SeriesPoints:names")
            assert names == ["normal", "tangential"]
            (label,) = static(path, r"/world/bodies/ball\/1", "Points3D:labels")
            assert label == ["ball/1"]
            assert len(RrdReader(str(path)).blueprints()) == 1
            assert "make_active: false, make_default: true" in rerun("rrd", "print", path).stdout
        if "max_size" in limit:  # passed by one batch
            assert max(size for path in opened for size in sizes[path][1:]) < 0.1e6
            assert min(path.stat().st_size for path in opened[:-1]) > 0.1e6
        assert sequences == [*range(1, count + 1)]
        assert len({RrdReader(str(path)).recordings()[0].recording_id for path in opened}) == 1

    @pytest.mark.parametrize("how", ["file", "directory", "moved"])
    def test_a_removed_file_is_reported_and_followed_by_another(self, tmp_path, how):
        opened, problems = threading.Event(), []
        recorder = Recorder(tmp_path / "here", problems.append, opened=lambda _: opened.set(), name="a.rrd")
        assert opened.wait(DEADLINE)
        first = recorder.path
        if how == "file":
            first.unlink()
        elif how == "directory":
            shutil.rmtree(first.parent)
        else:
            first.rename(tmp_path / "moved.rrd")
        recorder.add(impact(1))
        recorder.close()
        assert problems == [f"recording {first} was removed; recording continues in a new file"]
        assert recorder.path == tmp_path / "here" / "a_001.rrd"
        verify(recorder.path, *tmp_path.glob("moved.rrd"))
        assert [row[1] for row in read(recorder.path, "/impact/impulse", "Scalars:scalars")] == [1]

    def test_a_file_removed_at_the_end_is_reported(self, tmp_path):
        opened, problems = threading.Event(), []
        recorder = Recorder(tmp_path, problems.append, opened=lambda _: opened.set())
        assert opened.wait(DEADLINE)
        recorder.path.unlink()
        recorder.close()
        assert problems == [f"recording {recorder.path} was removed"]
        assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    "name", ["../x.rrd", "../../x.rrd", "/x.rrd", "a/b.rrd", "a/", ".", "..", "x\0.rrd", "x\n"]
)
def test_a_name_with_a_directory_is_refused(tmp_path, name):
    with pytest.raises(ValueError, match="must be a plain file name"):
        Recorder(tmp_path / "in" / "here", pytest.fail, name=name)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", ["a", "a.rrd ", "a.RRD", "rrd", ".rrd", "a.rrd.gz"])
def test_a_name_that_the_viewer_does_not_open_is_refused(tmp_path, name):
    with pytest.raises(ValueError, match=r"must end in \.rrd; is '"):
        Recorder(tmp_path / "here", pytest.fail, name=name)
    assert list(tmp_path.iterdir()) == []


def test_a_link_in_the_directory_is_not_followed(tmp_path):
    (tmp_path / "here").mkdir()
    (tmp_path / "here" / "a.rrd").symlink_to(tmp_path / "outside.rrd")
    _, problems = closed(tmp_path / "here", name="a.rrd")
    assert "File exists" in problems[0]
    assert not (tmp_path / "outside.rrd").exists()


KILLED = """
import os, signal, sys, threading
from pathlib import Path
from collision_response.recording import Recorder, recorder as policy
from recordings import impact

policy.INTERVAL, opened = 0.01, threading.Event()
recorder = Recorder(
    Path(sys.argv[1]), print, opened=lambda _: opened.set(), name="torn.rrd", capacity=1_000_000_000
)
opened.wait()
count = size = 0
while size < 300_000:
    for _ in range(50):
        count += 1
        recorder.add(impact(count))
    written = size
    while size == written:  # a batch at a time
        os.sched_yield()
        size = recorder.path.stat().st_size
os.kill(os.getpid(), signal.SIGKILL)
"""

NO_MORE_ROOM = """
import resource, sys
from hashlib import sha256
from pathlib import Path
from collision_response.recording import Refusal
from collision_response.recording.writer import Recording, Writer

resource.setrlimit(resource.RLIMIT_FSIZE, (200_000, 200_000))
count = 0
try:
    with Writer(Path(sys.argv[1], "torn.rrd"), Recording()) as writer:
        while True:
            batch = range(count + 1, count + 51)
            writer.write([Refusal(n, n, sha256(str(n).encode()).hexdigest()) for n in batch])
            count += 50
except OSError:
    sys.exit(9)
"""


@pytest.mark.parametrize(("program", "code"), [(KILLED, -9), (NO_MORE_ROOM, 9)], ids=["SIGKILL", "full disk"])
def test_a_truncated_file_can_be_recovered(tmp_path, program, code):
    run = subprocess.run(
        [sys.executable, "-c", program, str(tmp_path)],
        cwd=Path(__file__).parent,
        timeout=DEADLINE,
        check=False,
    )
    assert run.returncode == code
    torn, recovered = tmp_path / "torn.rrd", tmp_path / "recovered.rrd"
    assert rerun("rrd", "verify", torn).returncode != 0
    command = "rerun rrd merge --continue-on-error torn.rrd -o recovered.rrd"
    assert command in Recorder.__doc__
    assert command in (Path(__file__).parent.parent / "docs" / "recordings.md").read_text()
    assert rerun(*command.split()[1:], cwd=tmp_path).returncode == 0
    verify(recovered)
    told = read(recovered, "/log", "TextLog:text")
    assert len(told) >= 50
    assert [sequence for _, sequence, _ in told] == [*range(1, len(told) + 1)]
    if program is KILLED:
        assert told[-1][2][0].startswith("ball/1 on the floor: SLIDING, 9 N s along the normal")
        rows = read(recovered, "/impact/impulse", "Scalars:scalars")
        assert [row[1] for row in rows] == [*range(1, len(rows) + 1)]
        assert {tuple(value) for _, _, value in rows} == {(9.0, 0.0)}
        assert static(recovered, "/impact/impulse", "SeriesPoints:names") == [["normal", "tangential"]]
    else:
        assert told[0][2] == ["6b86b273ff34fce19d6b804eff5a3f5747ada4eaa22f1d49c01e52ddb7875b4b"]


@pytest.fixture
def written(monkeypatch):
    """The file and the number of each answer, and a semaphore that counts them; nothing is written."""
    answers, count = [], threading.Semaphore(0)

    class Stub:
        def __init__(self, path, recording):
            self.name = path.name

        def __enter__(self):
            return SimpleNamespace(write=self.write, file=FILE)

        def write(self, batch):
            for entry in batch:
                answers.append((self.name, entry.sequence))
                count.release()

        def __exit__(self, *_):
            pass

    monkeypatch.setattr("collision_response.recording.writer.Writer", Stub)
    return answers, count


def test_a_file_begins_with_its_first_entry_and_ends_after_max_duration(tmp_path, monkeypatch, written):
    answers, count = written
    now = [0.0]
    monkeypatch.setattr("collision_response.recording.recorder.INTERVAL", 0.0)
    clock = SimpleNamespace(monotonic=lambda: now[0])
    monkeypatch.setattr("collision_response.recording.recorder.time", clock)
    recorder = Recorder(tmp_path, pytest.fail, name="a.rrd", max_size=0.0, max_duration=10.0)
    for sequence, now[0] in enumerate((100.0, 109.0, 110.0, 119.0, 120.0, 200.0), start=1):
        recorder.add(impact(sequence))
        assert count.acquire(timeout=DEADLINE)
    recorder.close()
    files = ["a.rrd", "a.rrd", "a_001.rrd", "a_001.rrd", "a_002.rrd", "a_003.rrd"]
    assert answers == list(zip(files, range(1, 7), strict=True))


def test_half_of_the_capacity_is_written_at_once(tmp_path, monkeypatch, written):
    """The first entry may or may not still wait when the others come."""
    monkeypatch.setattr("collision_response.recording.recorder.INTERVAL", 2 * DEADLINE)
    recorder = Recorder(tmp_path, pytest.fail, capacity=8)
    for sequence in range(1, 7):
        recorder.add(impact(sequence))
    assert written[1].acquire(timeout=DEADLINE)
    recorder.close()
    assert [sequence for _, sequence in written[0]] == [1, 2, 3, 4, 5, 6]


def test_entries_beyond_the_queue_are_dropped_and_counted(tmp_path, monkeypatch):
    opened, go_on, written = threading.Event(), threading.Event(), []

    class SlowWriter:
        def __init__(self, path, recording):
            opened.set()
            go_on.wait(DEADLINE)

        def __enter__(self):
            return SimpleNamespace(write=written.extend, file=FILE)

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
    assert written[5:] == [Gap(stamp=5_000_000_001, sequence=5, missing=15)]
    assert problems[1:] == [f"recording {recorder.path} lacks 15 entries, which came too fast"]


def scene_of(count, sequence=1):
    """A scene of many balls, of which two touch."""
    balls = [Body.sphere(1.0, 0.5, position=(x, 0, 0), velocity=(-x, 0, 0)) for x in range(count)]
    asked = balls, [(2, 1)], [Contact.of((1.5, 0, 0), (1, 0, 0), 0.5)], ImpactModel()
    return SceneRecord(sequence, sequence, [f"ball {x}" for x in range(count)], *asked, resolve_scene(*asked))


def test_a_scene_that_lacks_names_leaves_a_gap(tmp_path):
    path = tmp_path / "a.rrd"
    recorder = Recorder(tmp_path, lambda _: None, name=path.name)
    recorder.add(scene_of(5)._replace(names=["one"]))
    recorder.add(scene_of(5, 2)._replace(bodies=None))
    recorder.add(impact(2))
    recorder.close()
    assert (recorder.unwritable, recorder.abandoned) == (2, 0)
    assert [sequence for _, sequence, _ in read(path, "/impact/impulse", "Scalars:scalars")] == [2]


def test_of_a_scene_only_bodies_with_a_contact_are_drawn(tmp_path):
    path = recorded(tmp_path, [scene_of(5)])
    assert {
        entity for entity in RrdReader(str(path)).store().schema().entity_paths() if "/bodies/" in entity
    } == {r"/world/bodies/ball\ 1", r"/world/bodies/ball\ 2"}


def test_a_scene_of_many_bodies_counts_as_many_entries(tmp_path, monkeypatch):
    go_on, problems = threading.Event(), []

    class SlowWriter:
        def __init__(self, path, recording):
            go_on.wait(DEADLINE)

        def __enter__(self):
            return SimpleNamespace(write=lambda _: None, file=FILE)

        def __exit__(self, *_):
            pass

    monkeypatch.setattr("collision_response.recording.writer.Writer", SlowWriter)
    recorder = Recorder(tmp_path, problems.append, capacity=25)
    for sequence in range(1, 11):
        recorder.add(scene_of(20, sequence))
    go_on.set()
    recorder.close()
    assert recorder.dropped == 7
    assert problems[-1].endswith("lacks 7 entries, which came too fast")


def test_a_batch_is_written_in_parts_of_few_bodies(tmp_path, monkeypatch):
    """So that a file may end between them. All states of one body are in one part."""
    parts = []

    class Spy:
        def __init__(self, path, recording):
            pass

        def __enter__(self):
            return SimpleNamespace(write=parts.append, file=FILE)

        def __exit__(self, *_):
            pass

    monkeypatch.setattr("collision_response.recording.writer.Writer", Spy)
    monkeypatch.setattr("collision_response.recording.recorder.PART", 3)
    monkeypatch.setattr("collision_response.recording.recorder.INTERVAL", DEADLINE)
    recorder = Recorder(tmp_path, pytest.fail)
    for stamp, name in itertools.product((1, 2), "edcba"):
        recorder.add(BodyRecord(stamp, name, Body.sphere(1.0, 0.5)))
    recorder.add(scene_of(5))
    recorder.close()
    assert [[entry.name for entry in part] for part in parts[:1]] == [["a", "a", "b", "b", "c", "c"]]
    assert [type(entry) for part in parts[1:] for entry in part] == [BodyRecord] * 4 + [SceneRecord]
    assert [len(part) for part in parts[1:]] == [4, 1]


@pytest.mark.parametrize("slow", ["write", "__enter__"])
def test_entries_that_there_is_no_time_for_at_the_end_are_counted(tmp_path, monkeypatch, slow):
    """The file is complete all the same, and never empty: a short run may end before its file is open."""
    written, problems, made = [], [], threading.Event()

    class SlowWriter(Writer):
        def __enter__(self):
            return self.after("__enter__", super().__enter__())

        def write(self, batch):
            written.extend(batch)
            self.after("write", super().write(batch))

        def after(self, name, result):
            if name == slow:
                assert made.wait(DEADLINE) and recorder._closing.wait(DEADLINE)
                recorder._write_until = 0.0  # as if the time were over
            return result

    monkeypatch.setattr("collision_response.recording.writer.Writer", SlowWriter)
    monkeypatch.setattr("collision_response.recording.recorder.PART", 2)
    monkeypatch.setattr("collision_response.recording.recorder.INTERVAL", DEADLINE)
    recorder = Recorder(tmp_path, problems.append)
    made.set()
    for sequence in range(1, 6):
        recorder.add(impact(sequence)._replace(name_a=f"ball {sequence}"))
    recorder.close(DEADLINE)
    assert [entry.sequence for entry in written] == [1]
    assert recorder.late == recorder.missing() == 4
    assert problems == [f"recording {recorder.path} lacks 4 entries, for which there was no time at the end"]
    verify(recorder.path)


def test_each_gap_counts_its_own_entries(tmp_path, monkeypatch):
    written, turns = [], [(threading.Event(), threading.Event()) for _ in range(2)]
    waiting = iter(turns)

    def write(batch):
        written.extend(batch)
        for reached, go_on in itertools.islice(waiting, 1):
            reached.set()
            assert go_on.wait(DEADLINE)

    class SlowWriter:
        def __init__(self, path, recording):
            pass

        def __enter__(self):
            return SimpleNamespace(write=write, file=FILE)

        def __exit__(self, *_):
            pass

    monkeypatch.setattr("collision_response.recording.recorder.INTERVAL", 0.0)
    monkeypatch.setattr("collision_response.recording.writer.Writer", SlowWriter)
    recorder = Recorder(tmp_path, lambda _: None, capacity=5)
    recorder.add(impact(1))
    for (reached, go_on), sequences in zip(turns, (range(2, 10), range(10, 20)), strict=True):
        assert reached.wait(DEADLINE)
        for sequence in sequences:
            recorder.add(impact(sequence))
        go_on.set()
    recorder.close()
    assert recorder.dropped == 8
    assert [entry.missing for entry in written if isinstance(entry, Gap)] == [3, 5]


def test_a_gap_is_described_in_the_log(tmp_path):
    path = recorded(tmp_path, [impact(1), Gap(stamp=1_000_000_002, sequence=1, missing=15)])
    told = read(path, "/log", "TextLog:text")
    assert told[1] == (
        1_000_000_002,
        1,
        ["15 entries are missing here: they came faster than they could be written"],
    )
    assert read(path, "/log", "TextLog:level")[1][2] == ["WARN"]


def test_an_impact_with_an_effective_mass_of_0_has_no_arrow(tmp_path):
    inertia, position = Symmetric3(0.1, 0, 0, 0.1, 0, 0.1), Vec3(1e200, 0.0, 0.0)
    ball = impact().body_a._replace(inertia=inertia, position=position)
    floor, contact = Body.static(), Contact.of((0.0, 0.0, 0.0), normal=(0.0, 0.0, 1.0))
    far = impact(1)._replace(body_a=ball, impact=resolve(ball, floor, contact))
    assert far.impact.effective_mass == 0
    path = recorded(tmp_path, [far, impact(2)])
    (*_, [of_far]), (*_, [of_next]) = read(path, "/world/impulse", "Arrows3D:vectors")
    assert of_far == [0.0, 0.0, 0.0]
    assert of_next == pytest.approx([0.0, 0.0, 0.45])


def test_values_beyond_float32_are_drawn_without_a_warning(tmp_path):
    fast = impact(1)
    fast = fast._replace(body_a=fast.body_a._replace(velocity=Vec3(1e100, 0.0, -1e100)))
    fast = fast._replace(impact=resolve(fast.body_a, fast.body_b, fast.contact))
    path = tmp_path / "a.rrd"
    with Writer(path, Recording()) as writer, warnings.catch_warnings():
        warnings.simplefilter("error")
        writer.write([fast])
    ((_, _, values),) = read(path, "/impact/impulse", "Scalars:scalars")
    assert values[0] == pytest.approx(3e100)


def test_a_scene_of_bodies_without_mass_has_no_arrow(tmp_path):
    """As with articulated bodies."""
    bodies, contact = [Body.static(), Body.static()], Contact.of((0, 0, 0), normal=(0, 0, 1))
    answer = resolve_scene([Body.dynamic(1.0), Body.static()], [(0, 1)], [contact])
    scene = SceneRecord(1, 1, ["a", "b"], bodies, [(0, 1)], [contact], ImpactModel(), answer)
    path = recorded(tmp_path, [scene])
    assert read(path, "/world/impulse", "Arrows3D:vectors")[0][2] == [[0.0, 0.0, 0.0]]


def test_every_contact_of_a_scene_is_drawn_alike(tmp_path):
    """One colour for all normals and one for all impulses, however many contacts there are."""
    balls = [Body.dynamic(1.0, position=(x, 0.0, 0.0), velocity=(0.0, 0.0, -1.0)) for x in range(3)]
    contacts = [Contact.of((x, 0.0, 0.0), (0.0, 0.0, 1.0), 0.5) for x in range(3)]
    asked = [*balls, Body.static()], [(x, 3) for x in range(3)], contacts, ImpactModel()
    path = recorded(tmp_path, [SceneRecord(1, 1, ["a", "b", "c", "floor"], *asked, resolve_scene(*asked))])
    drawn = {
        entity: read(path, entity, "Arrows3D:vectors")[0][2]
        for entity in ("/world/contact", "/world/impulse")
    }
    for entity, vector in ("/world/contact", [0.0, 0.0, 0.1]), ("/world/impulse", [0.0, 0.0, 0.15]):
        assert drawn[entity] == [pytest.approx(vector, rel=1e-6)] * 3
        ((colours,),) = read(path, entity, "Arrows3D:colors", timelines=())
        assert len(colours) == 1


def test_an_entry_that_cannot_be_written_leaves_a_gap(tmp_path, monkeypatch):
    monkeypatch.setattr("collision_response.recording.recorder.INTERVAL", 0.0)
    odd = [impact(i)._replace(name_a="\ud800") for i in (2, 4)]  # a lone surrogate cannot be encoded
    unseen = BodyRecord(5, "\ud800", impact().body_a)
    recorder, problems = closed(tmp_path, [impact(1), odd[0], unseen, impact(3), odd[1], impact(5)])
    verify(recorder.path)
    assert [row[1] for row in read(recorder.path, "/impact/impulse", "Scalars:scalars")] == [1, 3, 5]
    told = {number: text for _, number, [text] in read(recorder.path, "/log", "TextLog:text")}
    assert [*told] == [1, 2, 3, 4, 5]
    assert told[2].startswith("1 entries are missing here: this cannot be written: Unicode")
    first, last = problems
    assert first.startswith("an entry cannot be written and is left out (logged once):\nTraceback")
    assert last == f"recording {recorder.path} lacks 3 entries, which cannot be written"


@pytest.mark.parametrize("stamp", [2.0, float("nan"), None, 2**63, -(2**63)])
@pytest.mark.parametrize("kind", ["stamp", "sequence", "state"])
def test_an_entry_without_a_place_in_time_is_left_out(tmp_path, kind, stamp):
    """The gap in its place had the same stamp, and ended the recording."""
    odd = BodyRecord(stamp, "a", impact().body_a) if kind == "state" else impact(2)._replace(**{kind: stamp})
    recorder, problems = closed(tmp_path, [impact(1), odd, impact(3)])
    verify(recorder.path)
    assert [row[1] for row in read(recorder.path, "/impact/impulse", "Scalars:scalars")] == [1, 3]
    assert recorder.missing() == recorder.unwritable == 1
    assert problems[0].endswith(
        "is left out (logged once): its stamp or its number is not an integer of 64 bits"
    )


@pytest.mark.parametrize(
    "odd", [impact(2)._replace(duration=None), impact(2)._replace(duration="x"), "text", 2]
)
def test_what_is_no_entry_is_left_out(tmp_path, odd):
    """A duration of None made a file that nothing could read."""
    recorder, _ = closed(tmp_path, [impact(1), odd, impact(3)])
    verify(recorder.path)
    assert [row[1] for row in read(recorder.path, "/impact/impulse", "Scalars:scalars")] == [1, 3]
    assert recorder.missing() == recorder.unwritable == 1


def test_a_directory_whose_name_is_no_text_is_reported_in_text(tmp_path):
    """Loggers cannot encode it, and their error ended the recording."""
    directory = Path(os.fsdecode(os.fsencode(tmp_path) + b"/odd\xff"))
    texts: list[str] = []
    recorder = Recorder(directory, texts.append, opened=texts.append)
    recorder.add(impact(1))
    recorder.close(DEADLINE)
    assert texts == [f"recording to {tmp_path}/odd\\udcff/{recorder.path.name}"]
    verify(recorder.path.rename(tmp_path / "a.rrd"))  # rerun's own commands cannot read such a path


def test_an_error_in_a_report_does_not_lose_the_count(tmp_path, monkeypatch):
    (tmp_path / "file").touch()
    failed = []
    monkeypatch.setattr(threading, "excepthook", failed.append)

    def fail(text: str) -> None:
        raise OSError(text)

    recorder = Recorder(tmp_path / "file", fail)
    recorder.add(impact(1))
    recorder.close(DEADLINE)
    assert recorder.abandoned == 1
    assert len(failed) == 1


FULL_TMPDIR = """
import os, tempfile
from pathlib import Path
from collision_response.recording import Recorder
from recordings import impact

tempfile.tempdir = "/dev/full"
texts = []
recorder = Recorder(Path(os.environ["WHERE"]), texts.append)
recorder.add(impact(1))
recorder.close(30.0)
print(texts)
"""


def test_no_temporary_file_is_needed(tmp_path):
    """rerun waits for ever if it cannot write one, even after the process should have ended."""
    environment = os.environ | {"WHERE": str(tmp_path), "TMPDIR": "/dev/full"}
    path = f"import sys; sys.path.insert(0, {str(Path(__file__).parent)!r})"
    program = [sys.executable, "-c", path + FULL_TMPDIR]
    result = subprocess.run(
        program, cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=DEADLINE
    )
    assert (result.stdout, result.returncode) == ("[]\n", 0), result.stderr
    verify(*tmp_path.glob("*.rrd"))


def test_close_accepts_any_timeout(tmp_path):
    recorder = Recorder(tmp_path, pytest.fail)
    recorder.close(1e10)
    verify(recorder.path)


def test_an_error_without_a_message_is_reported_by_its_type(tmp_path, monkeypatch):
    def fail():
        raise MemoryError

    monkeypatch.setattr("collision_response.recording.writer.Recording", fail)
    recorder, problems = closed(tmp_path)
    assert problems == [f"not recording to {recorder.path}: MemoryError"]


def test_an_unusable_directory_is_reported_once(tmp_path):
    (tmp_path / "file").touch()
    recorder, problems = closed(tmp_path / "file", [impact()])
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
recorder.close(100.0)
assert len(problems) == 1 and "has stopped" in problems[0], problems
"""


def test_a_full_disk_is_reported_once(tmp_path):
    script = [sys.executable, "-c", FILL_THE_DISK, str(tmp_path)]
    result = subprocess.run(script, cwd=tmp_path, capture_output=True, text=True, timeout=DEADLINE)
    assert result.returncode == 0, result.stderr


@pytest.mark.parametrize("before", [0, 3])
def test_entries_after_an_error_are_counted(tmp_path, before):
    """Whether they wait when it occurs or come later; entries after the end are not missing."""
    go_on, problems = threading.Event(), []

    def report(problem):
        problems.append(problem)
        go_on.wait(DEADLINE)

    (tmp_path / "file").touch()
    recorder = Recorder(tmp_path / "file", report)
    for sequence in range(1, before + 1):
        recorder.add(impact(sequence))
    go_on.set()
    recorder._worker.join(DEADLINE)
    assert recorder.missing() == before
    recorder.add(impact(4))
    assert recorder.missing() == before + 1
    recorder.close()
    recorder.add(impact(5))
    assert recorder.missing() == before + 1 and len(problems) == 1


@pytest.mark.parametrize("fails", ["write", "next file"])
def test_entries_that_an_error_loses_are_counted(tmp_path, monkeypatch, fails):
    """Those of the batch that was being written, and body states that were held back for a later one."""
    written, is_written = [], threading.Event()

    class FullDisk:
        def __init__(self, path, recording):
            if written:
                raise OSError("the disk is full")

        def __enter__(self):
            return SimpleNamespace(write=self.write, file=FILE)

        def write(self, batch):
            if written:
                raise OSError("the disk is full")
            written.extend(batch)
            is_written.set()

        def __exit__(self, *_):
            pass

    monkeypatch.setattr("collision_response.recording.writer.Writer", FullDisk)
    monkeypatch.setattr("collision_response.recording.recorder.INTERVAL", 0.0)
    problems = []
    recorder = Recorder(tmp_path, problems.append, max_duration=1e-9 if fails == "next file" else 0.0)
    recorder.add(impact(1))
    assert is_written.wait(DEADLINE)
    recorder.add(BodyRecord(1, "ball", impact().body_a))
    for sequence in (2, 3, 4):
        recorder.add(impact(sequence))
    recorder._worker.join(DEADLINE)
    assert problems == [problems[0]] and problems[0].endswith("the disk is full")
    assert recorder.missing() == 4
    recorder.close()


class TestNode:
    """Recordings made by the node."""

    @pytest.fixture
    def request_(self, need_ros):
        from ros_graph import balls_meet

        return balls_meet()

    def test_a_recording_holds_the_answers(self, graph, request_, tmp_path):
        graph.serve(recording__enabled=True, recording__directory=str(tmp_path))
        results = []
        for restitution in (0.25, 2.0, 0.5, 1.0):
            request_.contact.header.stamp.sec = len(results) + 1
            request_.contact.restitution = restitution
            results.append(graph.call(request_).result)
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

    def test_an_impact_without_a_stamp_is_recorded_at_the_time_of_its_answer(self, graph, request_, tmp_path):
        node = graph.serve(recording__enabled=True, recording__directory=str(tmp_path))
        before = node.get_clock().now().nanoseconds
        graph.call(request_)
        after = node.get_clock().now().nanoseconds
        graph.close()
        (path,) = tmp_path.glob("*.rrd")
        ((stamp, _, _),) = read(path, "/impact/impulse", "Scalars:scalars")
        assert before <= stamp <= after

    def test_a_bad_directory_does_not_keep_the_service_from_answering(self, graph, request_, tmp_path, capfd):
        (tmp_path / "file").touch()
        from diagnostic_msgs.msg import DiagnosticArray
        from ros_graph import wait_until

        diagnostics = graph.listen(DiagnosticArray, "/diagnostics")
        graph.serve(recording__enabled=True, recording__directory=str(tmp_path / "file"))
        assert all(graph.call(request_).success for _ in range(20))
        wait_until(lambda: any("entries not recorded: " in array.status[0].message for array in diagnostics))
        graph.close()
        assert capfd.readouterr().err.count("recording to") == 1

    def test_before_the_first_clock_there_is_no_time(self, graph, request_, tmp_path):
        graph.serve(use_sim_time=True, recording__enabled=True, recording__directory=str(tmp_path))
        graph.call(request_)
        graph.close()
        (path,) = tmp_path.glob("*.rrd")
        assert read(path, "/impact/impulse", "Scalars:scalars") == []
        ((answer, _),) = read(path, "/impact/impulse", "Scalars:scalars", ("answer",))
        assert answer == 1

    def test_it_logs_the_file_once_it_is_open(self, graph, tmp_path, capfd):
        graph.serve(recording__enabled=True, recording__directory=str(tmp_path))
        graph.close()
        (path,) = tmp_path.glob("*.rrd")
        logged = capfd.readouterr().err
        assert (
            logged.count(f"recording to {path}")
            == logged.count("recording") - logged.count("/recording")
            == 1
        )

    def test_limits_are_parameters(self, graph, request_, tmp_path, monkeypatch):
        monkeypatch.setattr("collision_response.recording.recorder.INTERVAL", 0.0)
        parameters = {"max_size": 0.0, "max_duration": 1e-9, "directory": str(tmp_path), "file": "a.rrd"}
        graph.serve(
            recording__enabled=True, **{f"recording__{name}": parameters[name] for name in parameters}
        )
        while not (tmp_path / "a_001.rrd").exists():
            assert graph.call(request_).success
        graph.close()
        verify(*tmp_path.glob("a*.rrd"))

    def test_nothing_is_recorded_by_default(self, graph, request_, tmp_path):
        graph.serve(recording__directory=str(tmp_path))
        graph.call(request_)
        graph.close()
        assert list(tmp_path.iterdir()) == []
