"""The table of impacts in a recording: reading it, reporting it and replaying it."""

from __future__ import annotations

import csv
import math
import os
import re
import shlex
import shutil
import subprocess
import sys
import tracemalloc
from fractions import Fraction
from html.parser import HTMLParser
from pathlib import Path

import pytest

pytest.importorskip("rerun")

import pyarrow as pa
import rerun as rr
from recordings import closed, impact, recorded, rerun

from collision_response import (
    Body,
    Contact,
    Geometry,
    ImpactModel,
    Law,
    Precision,
    Regime,
    resolve,
    resolve_scene,
)
from collision_response.cli import main
from collision_response.recording import Record, Refusal, SceneRecord, table
from collision_response.recording import scenes as scenes_table
from collision_response.recording.table import (
    ALWAYS_PRESENT,
    ANSWER,
    NUMBER_LIST,
    VECTOR,
    WORD,
    WORD_LIST,
    read,
    rows_of,
)
from collision_response.recording.writer import Recording, Writer

FLOOR = Body.static((0.0, 0.0, -1.0))
HALF = math.sqrt(0.5)


def requests():
    """One request of every kind that changes how it is answered."""
    ball = Body.sphere(
        2.0, 0.1, position=(0.0, 0.0, 0.1), velocity=(1.0, 0.5, -3.0), angular_velocity=(1.0, 2.0, 3.0)
    )
    rod = Body.rod(
        1.0, 1.0, position=(0.0, 0.0, 0.3), orientation=(0.0, HALF, 0.0, HALF), velocity=(0.1, 0.0, -1.0)
    )
    off = Body.dynamic(1.0, (0.1, 0.01, 0.0, 0.2, 0.0, 0.2), velocity=(0.0, 0.0, -1.0), com=(0.1, 0.0, 0.2))
    moving = Body.kinematic(velocity=(0.0, 0.0, 1.0))
    touch = Contact.of((0.05, 0.0, 0.0), (0.0, 0.0, 2.0), 0.5, 0.3)
    yield from ((ball, FLOOR, touch, ImpactModel(law)) for law in Law)
    yield rod, FLOOR, touch, ImpactModel(Law.ROUTH_STRONGE, tolerance=1e-12)
    yield rod, ball, touch, ImpactModel(precision=Precision.EXTENDED)
    yield off, moving, touch, ImpactModel(restitution_threshold=3.0, tangential_restitution=0.5)
    yield ball, FLOOR, touch._replace(tangential_restitution=0.25), ImpactModel(geometry=Geometry.POINT)
    yield ball, FLOOR, touch._replace(restitution=lambda speed: 1 / (1 + speed)), ImpactModel()
    yield ball._replace(velocity=-ball.velocity), FLOOR, touch, ImpactModel()
    turning = Body.dynamic(
        1.0, velocity=(0.0, 0.0, -1.0), angular_velocity=(1.0, 0.0, 0.0), orientation=(0, 0, 2, 0)
    )
    yield turning, FLOOR, touch, ImpactModel()
    link = [[1.0 + (i == j) if i < 3 > j else 0.5 * (i == j) for j in range(6)] for i in range(6)]
    yield Body.articulated(link, velocity=(0.3, 0.0, -1.0)), ball, touch, ImpactModel()


def record(number, request, **changes):
    row = Record(10**18 + number, number, f"a{number}", "floor", *request, resolve(*request), 2e-6 * number)
    return row._replace(**changes)


@pytest.fixture
def recording(tmp_path):
    """Write entries into a file."""

    def write(entries, name="some.rrd"):
        recorder, problems = closed(tmp_path, entries, name=name)
        assert problems == []
        return recorder.path

    return write


@pytest.fixture
def all_kinds(recording):
    rows = [record(number, request) for number, request in enumerate(requests(), start=1)]
    return recording(
        [*rows, Refusal(10**18, 100, "INVALID_MASS: body_a.inertia.m: must be <positive>; is 0")]
    )


def test_every_field_of_an_answer_is_a_column(all_kinds):
    rows = [*rows_of(read([all_kinds]))]
    asked = [*requests()]
    assert [row["answer"] for row in rows] == [*range(1, len(asked) + 1), 100]
    for row, request in zip(rows, asked, strict=False):
        body_a, body_b, contact, _ = request
        impact = resolve(*request)
        for word, value in (
            ("status", impact.status),
            ("regime", impact.regime),
            ("adjustments", impact.adjustments),
        ):
            assert row[word] == str(value)
        for word in ("law", "geometry", "precision"):
            assert row[word] == getattr(impact.model, word).name
        assert row["impulse"] == [*impact.impulse]
        assert row["twist_a_before"] == [*body_a.velocity, *body_a.angular_velocity]
        assert row["twist_b_after"] == [*impact.twist_b.linear, *impact.twist_b.angular]
        assert row["kinetic_energy_after"] == impact.kinetic_energy_after
        assert (row["restitution"], row["friction"]) == impact.contact[2:4]
        assert row["request_b"][0] == body_b.mass
        assert row["position"] == [*contact.position]
    refusal = rows[-1]
    assert (refusal["status"], refusal["message"]) == (
        "INVALID_MASS",
        "body_a.inertia.m: must be <positive>; is 0",
    )
    assert all(
        value is None for name, value in refusal.items() if name not in ("answer", "status", "message")
    )


def test_files_of_one_recording_are_one_table_and_an_empty_one_is_no_error(recording):
    request = next(requests())
    later, earlier = recording([record(2, request)], "b.rrd"), recording([record(1, request)], "a.rrd")
    assert read([later, earlier])["answer"].to_pylist() == [1, 2]
    assert read([recording([], "empty.rrd")]).num_rows == 0


def test_the_query_in_the_docs_reads_all_files(tmp_path, monkeypatch, capfd):
    """Files of one start of the node, and of another."""
    pytest.importorskip("datafusion")
    page = (Path(__file__).parent.parent / "docs" / "recordings.md").read_text()
    (code,) = [code for code in re.findall(r"```python\n(.*?)```", page, re.DOTALL) if "datafusion" in code]
    impact = resolve(*next(requests()))._replace(regime=Regime.REVERSED)
    (tmp_path / "recordings").mkdir()
    one, other = Recording(), Recording()
    for run, name, number in ((one, "a", 1), (one, "a_001", 2), (other, "b", 1)):
        with Writer(tmp_path / "recordings" / f"{name}.rrd", run) as writer:
            writer.write([record(number, next(requests()), impact=impact), record(9, next(requests()))])
    monkeypatch.chdir(tmp_path)
    exec(code, {})
    assert sorted(re.findall(r"^\| (\d+) ", capfd.readouterr().out, re.MULTILINE)) == ["1", "1", "2"]


class TestReplay:
    def test_nothing_differs_where_nothing_changed(self, all_kinds, capsys):
        assert main(["replay", str(all_kinds)]) == 0
        count = len([*requests()])
        assert (
            capsys.readouterr().out == f"{count} impacts computed again, 0 of them with different answers\n"
        )

    def test_every_difference_is_reported(self, recording, capsys):
        request = next(requests())
        right = record(1, request)
        wrong = right.impact._replace(kinetic_energy_after=1.0, regime=right.impact.regime.__class__.JAMMED)
        path = str(recording([right, record(2, request, impact=wrong)]))
        assert main(["replay", path]) == 1
        lines = capsys.readouterr().out.splitlines()
        assert [re.sub(r"is .*", "is", line) for line in lines[:-1]] == [
            "answer 2, a2 on floor: regime was JAMMED, is",
            "answer 2, a2 on floor: kinetic_energy_after was 1.0, is",
        ]
        assert lines[-1] == "2 impacts computed again, 1 of them with different answers"

    def test_names_do_nothing_to_a_terminal(self, recording, capsys):
        """They may come from any publisher."""
        one, several = record(1, next(requests())), scene(2)
        wrong = [entry.impact._replace(energy_lost_friction=1.0) for entry in (one, several)]
        one = one._replace(name_a="\x1b[2J", impact=wrong[0])
        several = several._replace(names=["a\n", *several.names[1:]], impact=wrong[1])
        assert main(["replay", str(recording([one, several]))]) == 1
        of_one, of_several, _ = capsys.readouterr().out.splitlines()
        assert of_one.startswith(r"answer 1, \x1b[2J on floor: energy_lost_friction was 1.0, is ")
        assert of_several.startswith(r"answer 2, scene of a\n, ")

    def test_a_tolerance_applies_to_numbers_only(self, recording, capsys):
        right = record(1, next(requests()))
        near = right.impact._replace(kinetic_energy_after=right.impact.kinetic_energy_after * (1 + 1e-9))
        path = str(recording([right._replace(impact=near)]))
        assert main(["replay", path]) == 1
        assert main(["replay", path, "--tolerance", "1e-8"]) == 0
        other = right.impact._replace(status=right.impact.status.TOLERANCE_NOT_MET)
        assert (
            main(["replay", str(recording([right._replace(impact=other)], "b.rrd")), "--tolerance", "1"]) == 1
        )

    @pytest.mark.parametrize(
        ("before", "tolerance", "is_reported"),
        [
            (lambda now: 2 * now, "0.6", False),
            (lambda now: 2 * now, "0.4", True),
            (lambda now: 0.0, "1e300", True),
            (lambda now: math.inf, "1e300", True),
        ],
    )
    def test_a_difference_is_relative_to_the_recorded_number(self, recording, before, tolerance, is_reported):
        right = record(1, next(requests()))
        wrong = right.impact._replace(kinetic_energy_after=before(right.impact.kinetic_energy_after))
        path = str(recording([right._replace(impact=wrong)]))
        assert main(["replay", path, "--tolerance", tolerance]) == is_reported

    @pytest.mark.parametrize(("tolerance", "is_reported"), [("0.46", False), ("0.44", True)])
    def test_a_difference_of_vectors_is_relative_to_the_whole_vector(self, recording, tolerance, is_reported):
        """The impulse is along z and was recorded as (0.5, 0, 1) times that: 0.447 of this is wrong."""
        contact = Contact.of((0, 0, 0), (0, 0, 1), 0.5)
        right = record(1, (Body.dynamic(1.0, velocity=(0, 0, -1)), FLOOR, contact, ImpactModel()))
        P = right.impact.impulse
        wrong = right.impact._replace(impulse=P._replace(x=0.5 * P.z))
        path = str(recording([right._replace(impact=wrong)]))
        assert main(["replay", path, "--tolerance", tolerance]) == is_reported

    def test_without_a_tolerance_the_least_float_is_a_difference(self, recording):
        """The impulse is along z: relative to it, the least float across it is 0."""
        contact = Contact.of((0, 0, 0), (0, 0, 1), 0.5)
        right = record(1, (Body.dynamic(4.0, velocity=(0, 0, -1)), FLOOR, contact, ImpactModel()))
        P = right.impact.impulse
        assert P.x == 0 and P.z == 6
        path = str(recording([right._replace(impact=right.impact._replace(impulse=P._replace(x=5e-324)))]))
        assert main(["replay", path]) == 1
        assert main(["replay", path, "--tolerance", "5e-324"]) == 0

    def test_a_request_that_is_refused_now_differs(self, recording, capsys):
        body, floor, contact, model = next(requests())
        impact = resolve(body, floor, contact, model)
        row = Record(1, 1, "a", "b", body, floor, contact._replace(friction=-1.0), model, impact)
        assert main(["replay", str(recording([row]))]) == 1
        assert "status was OK, is INVALID_COEFFICIENT" in capsys.readouterr().out

    @pytest.mark.parametrize(
        "model", [(99.0, *ImpactModel()[1:]), (*ImpactModel(), 0.5)], ids=["another law", "one number more"]
    )
    def test_a_request_of_a_newer_version_is_reported(self, recording, model, capsys):
        row, several = record(1, next(requests())), scene(2)
        for entry in (row, several):
            path = recording([entry._replace(model=model)], f"{entry.sequence}.rrd")
            assert main(["replay", str(path)]) == 2
            said = capsys.readouterr()
            prefix = f"collision_response replay: answer {entry.sequence}: request_model is not known to this"
            assert (said.out, said.err.startswith(prefix), said.err.count("\n")) == ("", True, 1)

    @pytest.mark.parametrize("name", [".", "", "/"])
    def test_a_directory_is_no_recording(self, tmp_path, monkeypatch, name, capsys):
        monkeypatch.chdir(tmp_path)
        for command in ("replay", "report"):
            assert main([command, name]) == 2
            assert capsys.readouterr().err.count("\n") == 1

    def test_a_file_that_is_not_a_recording_is_reported(self, tmp_path, capsys):
        (tmp_path / "no.rrd").write_bytes(b"something else")
        for name in ("no.rrd", "missing.rrd"):
            for command in ("replay", "report"):
                assert main([command, str(tmp_path / name)]) == 2
                assert capsys.readouterr().err.startswith(f"collision_response {command}: ")


@pytest.mark.parametrize("command", ["replay", "report"])
def test_a_file_that_is_given_twice_is_refused(all_kinds, capsys, command):
    same = all_kinds.with_name("link.rrd")
    same.symlink_to(all_kinds)
    assert main([command, str(all_kinds), str(same)]) == 2
    assert capsys.readouterr() == ("", f"collision_response {command}: {same} is given twice\n")


@pytest.mark.filterwarnings("error")
def test_a_truncated_recording_is_refused_with_the_command_that_repairs_it(all_kinds, capsys):
    """Truncated within a chunk, and between two, where rerun reads what there is."""
    whole = all_kinds.read_bytes()
    torn = all_kinds.with_name("torn one.rrd")
    for size in (12, len(whole) // 20, len(whole) // 2, len(whole) - 1):
        torn.write_bytes(whole[:size])
        for command in ("replay", "report"):
            assert main([command, str(torn)]) == 2
            said = capsys.readouterr()
            assert said.out == ""
            (line,) = said.err.splitlines()
            assert line.startswith(f"collision_response {command}: {torn} is not complete, ")
    repair = shlex.split(line.partition(": rerun ")[2])
    subprocess.run([sys.executable, "-m", "rerun", *repair], check=True)
    assert main(["replay", repair[-1]]) == 0


IMPACT = {
    "status": pa.array(["OK"]),
    "body_a": pa.array(["a"]),
    "request_a": pa.FixedSizeListArray.from_arrays(pa.array([1.0] * 5), 5),
}


def _assert_refused_as_foreign(path, capsys):
    for command in ("replay", "report"):
        assert main([command, str(path)]) == 2
        said = capsys.readouterr()
        assert said.out == ""
        assert said.err.startswith(f"collision_response {command}: {path} is not a recording of this node: ")
        assert said.err.count("\n") == 1
    assert not path.with_suffix(".html").exists()


@pytest.mark.parametrize("entity", ["/impacts", "/scenes", "/elsewhere"])
@pytest.mark.parametrize(
    "content",
    [
        rr.Points3D([[0.0, 0.0, 0.0]]),
        rr.DynamicArchetype("Impact", components=IMPACT),
        rr.DynamicArchetype("Impact", components={"status": pa.array(["OK"])}),
        rr.DynamicArchetype("Impact", components={"status": pa.array([1]), "message": pa.array(["no"])}),
    ],
    ids=["points", "some columns", "status alone", "a number for a word"],
)
@pytest.mark.parametrize("timeline", ["answer", "frame", None])
def test_a_recording_of_something_else_is_refused_in_one_line(tmp_path, capsys, entity, content, timeline):
    path = tmp_path / "other.rrd"
    with rr.RecordingStream("other") as stream:
        stream.save(path)
        if timeline:
            stream.set_time(timeline, sequence=1)
        stream.log(entity, content, static=not timeline)
        stream.disconnect()
    _assert_refused_as_foreign(path, capsys)


TABLES = {"/impacts": ANSWER, "/scenes": scenes_table.COLUMNS}


def columns_of(recording, entity):
    """Columns of a recorded answer, as rerun takes them."""
    entry, module = (record(1, next(requests())), table) if entity == "/impacts" else (scene(1), scenes_table)
    row = module.read([recording([entry], "answer.rrd")])
    columns = {name: row[name].combine_chunks() for name in TABLES[entity] if name != "answer"}
    several = [name for name in columns if TABLES[entity][name] in (WORD_LIST, NUMBER_LIST)]
    return columns | {name: columns[name].flatten() for name in several}


def edited(path, entity, columns):
    """A recording with one answer that was made by hand; columns of ``None`` are left out."""
    with rr.RecordingStream("other") as stream:
        stream.save(path)
        stream.log(ALWAYS_PRESENT, rr.SeriesPoints(markers="circle"), static=True)
        stream.set_time("answer", sequence=1)
        known = {name: column for name, column in columns.items() if column is not None}
        stream.log(entity, rr.DynamicArchetype("Impact", components=known))
        stream.disconnect()
    return path


@pytest.mark.parametrize(
    ("entity", "name"),
    [(entity, name) for entity, columns in TABLES.items() for name in columns if name != "answer"],
)
def test_each_column_of_an_answer_is_required(recording, tmp_path, capsys, entity, name):
    columns, kind = columns_of(recording, entity), TABLES[entity][name]
    wrong = [None, pa.array([True]), pa.array([1.0, None]), _vectors(2)]
    wrong += [pa.array([1.0])] if kind in (WORD, WORD_LIST) else [pa.array(["1.0"])]
    for column in wrong:
        if kind != VECTOR or column != _vectors(2):
            path = edited(tmp_path / "edited.rrd", entity, columns | {name: column})
            _assert_refused_as_foreign(path, capsys)


@pytest.mark.parametrize(
    ("entity", "name", "numbers"),
    [
        ("/scenes", "request_bodies", [1.0] * 45),
        ("/scenes", "request_contacts", [1.0] * 35),
        ("/scenes", "request_pairs", [0.0]),
        *(("/scenes", "request_pairs", [0.0, x] * 4) for x in (0.5, math.nan, math.inf)),
        *((one, "request_model", [x] * n) for one in TABLES for n, x in ((2, 1.0), (9, math.inf), (9, 0.5))),
        *((one, "request_model", [2.5, *map(float, ImpactModel()[1:])]) for one in TABLES),
    ],
)
def test_an_incomplete_request_is_refused_in_one_line(recording, tmp_path, capsys, entity, name, numbers):
    values = pa.array(numbers) if entity == "/scenes" else _vectors(*numbers)
    path = edited(tmp_path / "edited.rrd", entity, columns_of(recording, entity) | {name: values})
    assert main(["replay", str(path)]) == 2
    said = capsys.readouterr()
    assert said.err.startswith(f"collision_response replay: answer 1: {name} ")
    assert (said.out, said.err.count("\n")) == ("", 1)


@pytest.mark.parametrize("names", [["box"], ["a", "b", "c"]])
def test_a_scene_must_name_each_of_its_bodies(recording, tmp_path, capsys, names):
    columns = columns_of(recording, "/scenes") | {"bodies": pa.array(names)}
    assert main(["replay", str(edited(tmp_path / "edited.rrd", "/scenes", columns))]) == 2
    said = f"collision_response replay: answer 1: bodies must have 2 names, has {len(names)}\n"
    assert capsys.readouterr().err == said


@pytest.mark.parametrize("entity", TABLES)
def test_a_recording_without_a_known_bound_is_reported(recording, tmp_path, capsys, entity):
    columns = columns_of(recording, entity) | {"error_bound": pa.array([math.nan])}
    assert main(["report", str(edited(tmp_path / "edited.rrd", entity, columns))]) == 0
    said = capsys.readouterr().out
    assert "energy" in said or "1 scenes" in said
    assert "error bound" not in said


def _vectors(*numbers):
    return pa.FixedSizeListArray.from_arrays(pa.array(map(float, numbers)), len(numbers))


@pytest.mark.parametrize("command", ["merge", "optimize"])
def test_a_recording_whose_pieces_were_joined_is_the_same(all_kinds, recording, command):
    """rerun then puts answers and refusals into one piece."""
    rows = [record(number, request) for number, request in enumerate(requests(), start=1)]
    mixed = [entry for row in rows for entry in (row, Refusal(row.stamp, 100 + row.sequence, "NO: why"))]
    path = recording([*mixed, scene(50), scene(51)], "pieces.rrd")
    joined = path.with_name("joined.rrd")
    subprocess.run([sys.executable, "-m", "rerun", "rrd", command, path, "-o", joined], check=True)
    before, after = ([sorted(row.items()) for row in rows_of(read([one]))] for one in (path, joined))
    assert str(before) == str(after)  # as text, where NaN is NaN
    assert main(["replay", str(joined)]) == 0


def test_all_runs_in_a_merged_file_are_read(recording, capsys):
    """rerun alone reads the first. What bodies did next would mix the runs, so ``identify`` refuses."""
    request = next(requests())
    runs = recording([record(1, request)], "a.rrd"), recording([record(2, request)], "b.rrd")
    merged = runs[0].with_name("merged.rrd")
    subprocess.run([sys.executable, "-m", "rerun", "rrd", "merge", *runs, "-o", merged], check=True)
    assert read([merged])["answer"].to_pylist() == [1, 2]
    assert main(["replay", str(merged)]) == 0
    assert main(["identify", str(merged)]) == 2
    assert "must be those of one run of the node" in capsys.readouterr().err


@pytest.mark.parametrize("tolerance", ["nan", "inf", "-inf", "-1", "-1e-300", "none", ""])
def test_an_invalid_replay_tolerance_is_refused(all_kinds, capsys, tolerance):
    with pytest.raises(SystemExit) as ended:
        main(["replay", str(all_kinds), f"--tolerance={tolerance}"])
    assert ended.value.code == 2
    assert "argument --tolerance: " in capsys.readouterr().err


class Page(HTMLParser):
    """Count the tags of a page and note what it fetches; every opened tag must be closed."""

    def __init__(self, text):
        super().__init__()
        self.tags, self.fetched, self.open, self.text = [], [], [], ""
        self.feed(text)
        assert self.open == []

    def handle_starttag(self, tag, attributes):
        self.tags.append(tag)
        self.fetched += [value for name, value in attributes if name in ("src", "href")]
        if tag != "meta":
            self.open.append(tag)

    def handle_startendtag(self, tag, attributes):
        self.tags.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text += data


class Plot:
    """What an SVG plot shows.

    Attributes:
        key: the colour of each name.
        curves: of each curve the colour and the places.
        dots: of each dot the colour, the place and the title.
    """

    def __init__(self, svg):
        self.key = {
            name: colour
            for colour, name in re.findall(r'<rect [^>]*fill="(\S+)"/><text [^>]*>([^<]*)</text>', svg)
        }
        self.curves = [
            (colour, [tuple(map(float, place.split(","))) for place in places.split()])
            for places, colour in re.findall(r'<polyline points="([^"]*)" stroke="(\S+)"', svg)
        ]
        self.dots = [
            (colour, float(x), float(y), title)
            for x, y, colour, title in re.findall(
                r'<circle cx="(\S+)" cy="(\S+)" r="2.5" fill="(\S+)"><title>([^<]*)', svg
            )
        ]


def is_straight(places):
    """Whether three places at equal distances are on one line, to the rounding of a decimal."""
    (_, first), (_, second), (_, third) = places
    return abs(first + third - 2 * second) < 0.21


class TestReport:
    def test_it_summarises_the_impacts(self, all_kinds, tmp_path, capsys):
        assert main(["report", str(all_kinds)]) == 0
        text = capsys.readouterr().out
        count = len([*requests()])
        assert text.startswith(f"{count} impacts, 1 refusals\n")
        assert "refused 1 times: INVALID_MASS body_a.inertia.m\n" in text
        assert f"slowest: {2.0 * count:.1f} us (answer {count})" in text
        lost = sum(resolve(*request).energy_lost_friction for request in requests())
        assert f"{lost:.6g} J by friction" in text
        (gap,) = re.findall(r"unaccounted for: at most (\S+) of", text)
        assert float(gap) < 1e-10, (
            "what Routh's paths are integrated to; the floor that moves does work, and is left out"
        )

    def test_energies_that_are_lost_add_up_upwards(self, recording):
        request = Body.dynamic(2.0, velocity=(0, 0, -3)), Body.static(), Contact.of((0, 0, 0), (0, 0, 1), 0.5)
        one = ImpactModel()
        path = recording([Record(2, i, "a", "b", *request, one, resolve(*request, one)) for i in range(1, 4)])
        assert main(["report", str(path)]) == 0
        first, second, third = re.search(
            r'<polyline points="\S+,(\S+) \S+,(\S+) \S+,(\S+)"', path.with_suffix(".html").read_text()
        ).groups()
        assert float(first) - float(second) == pytest.approx(float(second) - float(third), abs=0.2)
        assert float(second) > float(third)

    def test_the_page_needs_no_other_file_and_shows_every_impact(self, all_kinds):
        assert main(["report", str(all_kinds)]) == 0
        text = all_kinds.with_suffix(".html").read_text(encoding="utf-8")
        page = Page(text)
        assert (page.fetched, "url(" in text, "script" in page.tags) == ([], False, False)
        assert page.tags.count("svg") == 4
        count = len([*requests()])
        assert page.tags.count("circle") >= 3 * count
        assert "must be <positive>; is 0" in page.text
        assert not re.search(r'(nan|inf)[^<>"]*"', text), "no place of a plot is infinite"

    def test_colours_mean_what_the_key_of_a_plot_says(self, recording):
        """Answers are exact but for the error bound that is given; the friction of the last is 0."""
        body, contact = Body.dynamic(1.0, velocity=(3.0, 0.0, -1.0)), Contact.of((0, 0, 0), (0, 0, 1), 0.5)
        rows = []
        for number, friction in enumerate((0.25, 2.5, 0.0), start=1):
            row = record(number, (body, FLOOR, contact._replace(friction=friction), ImpactModel()))
            rows.append(row._replace(impact=row.impact._replace(error_bound=1e-3)))
        path = recording(rows)
        assert main(["report", str(path)]) == 0
        energy, residual, time, cone = map(Plot, path.with_suffix(".html").read_text().split("<svg")[1:])
        assert energy.key.keys() == {"restitution", "friction"}
        # Restitution takes the same of each impact, so its curve is straight.
        (straight,) = (colour for colour, places in energy.curves if is_straight(places))
        assert straight == energy.key["restitution"] != energy.key["friction"]
        assert [y for colour, _, y, _ in residual.dots if colour == residual.key["found"]] == [280.0] * 3
        bound = residual.key["error bound of the answer"]
        assert [y for colour, _, y, _ in residual.dots if colour == bound] == [83.3] * 3  # 15 of 18 powers
        for plot, count in (time, 3), (cone, 2):
            assert len(plot.dots) == count
            for colour, _, _, title in plot.dots:
                (regime,) = (name for name in ("SLIDING", "STICKING") if name in title)
                assert colour == plot.key[regime]
        assert time.key["SLIDING"] != time.key["STICKING"]

    @pytest.mark.parametrize("slopes", [(0.25, 0.5), (0.25, 0.125), (0.25, 1.0)])
    def test_impulses_are_drawn_in_their_cones_or_beside_them(self, recording, slopes):
        """Both axes begin at 0 and end a twentieth beyond the greatest slope or friction. The first impact
        slides, the second was recorded with another slope.
        """
        body, contact = Body.dynamic(1.0, velocity=(3.0, 0.0, -1.0)), Contact.of((0, 0, 0), (0, 0, 1), 0.5)
        frictions, rows = (0.25, 0.5), []
        for number, (friction, slope) in enumerate(zip(frictions, slopes, strict=True), start=1):
            row = record(number, (body, FLOOR, contact._replace(friction=friction), ImpactModel()))
            impact = row.impact._replace(tangential_impulse=slope * row.impact.normal_impulse)
            rows.append(row._replace(impact=impact))
        path = recording(rows)
        assert main(["report", str(path)]) == 0
        cone = Plot(path.with_suffix(".html").read_text().split("<svg")[4])
        left, right, top, bottom = 64, 548, 44, 280
        assert cone.curves == [(cone.key["edge of the cone"], [(left, bottom), (right, top)])]
        most = 1.05 * max(*frictions, *slopes)
        for (_, x, y, _), friction, slope in zip(cone.dots, frictions, slopes, strict=True):
            # Places have one decimal.
            assert x == pytest.approx(left + friction / most * (right - left), abs=0.06)
            assert y == pytest.approx(bottom - slope / most * (bottom - top), abs=0.06)

    @pytest.mark.filterwarnings("error")
    @pytest.mark.parametrize("count", [1, 2, 60])
    @pytest.mark.parametrize(
        ("mass", "speed", "slip", "friction"),
        [
            (1e307, 1.0, 0.0, 0.3),  # 60 such energies have no finite sum
            (1e-300, 1e-12, 0.1, 0.3),  # one energy is the smallest float, or 0
            (1e-300, 1e-11, 0.1, 0.3),
            (1.0, 1.0, 1e5, 1.75e308),  # 1.05 times this friction is infinite
            (1.0, 1e-300, 1e5, 1e308),
            (1e300, 1e-300, 1e-300, 1e-320),
        ],
    )
    def test_numbers_at_the_ends_of_float64_are_drawn(self, recording, mass, speed, slip, friction, count):
        touch = Contact.of((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 0.5, friction)
        request = Body.dynamic(mass, velocity=(slip, 0.0, -speed)), FLOOR, touch, ImpactModel()
        path = recording([record(number, request) for number in range(1, count + 1)])
        assert main(["report", str(path)]) == 0
        text = path.with_suffix(".html").read_text(encoding="utf-8")
        assert Page(text).tags.count("svg") == 4
        assert not re.search(r'(nan|inf)[^<>"]*"', text), "no place of a plot is infinite"

    @pytest.mark.parametrize("entries", [[], [Refusal(1, 1, "INVALID_MASS: body_a.mass: no")]])
    def test_a_recording_without_an_answer(self, recording, entries, capsys):
        path = recording(entries)
        assert main(["report", str(path)]) == 0
        assert capsys.readouterr().out.startswith(f"0 impacts, {len(entries)} refusals\n")
        Page(path.with_suffix(".html").read_text(encoding="utf-8"))

    def test_refusals_do_nothing_to_a_terminal(self, recording, capsys):
        path = recording([Refusal(1, 1, "INVALID_MASS: \x1b[2J\x00: is 0")])
        assert main(["report", str(path)]) == 0
        line = next(line for line in capsys.readouterr().out.splitlines() if line.startswith("refused"))
        assert line == r"refused 1 times: INVALID_MASS \x1b[2J\x00"

    def test_one_impact_of_bodies_at_rest_has_no_energy_to_relate_to(self, recording, capsys):
        touch = Contact.of((0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 0.5)
        request = Body.dynamic(1.0), FLOOR, touch, ImpactModel()
        row = record(1, request, duration=math.nan)
        path = recording([row])
        assert main(["report", str(path)]) == 0
        assert "unaccounted for: at most 0 of that" in capsys.readouterr().out
        Page(path.with_suffix(".html").read_text(encoding="utf-8"))

    @pytest.mark.parametrize("option", ["--csv", "--html"])
    @pytest.mark.parametrize("again", [True, False])
    def test_a_recording_is_not_overwritten(self, recording, all_kinds, option, again, capsys):
        """Neither the reported one nor another, as with ``--csv *.rrd``."""
        path = recording([], "another.rrd")
        files = [str(path), str(all_kinds)] if again else [str(all_kinds)]
        before = path.read_bytes()
        assert main(["report", option, str(path), *files]) == 2
        said = capsys.readouterr()
        assert said.out == ""
        assert said.err == f"collision_response report: {path} is a recording and is not overwritten\n"
        assert path.read_bytes() == before

    @pytest.mark.parametrize("option", ["--csv", "--html"])
    def test_a_full_disk_is_reported(self, all_kinds, option, capsys):
        assert main(["report", str(all_kinds), option, "/dev/full"]) == 2
        error = capsys.readouterr().err
        assert error.startswith("collision_response report: cannot write /dev/full: ")
        assert error.endswith("No space left on device\n")

    @pytest.mark.parametrize("name", ["some.html", "folder/../some.html", "link.html"])
    def test_page_and_table_must_be_different_files(self, all_kinds, tmp_path, name, capsys):
        """With the name of the page given or default."""
        (tmp_path / "folder").mkdir()
        (tmp_path / "link.html").symlink_to("some.html")
        for page in ([], ["--html", str(tmp_path / "some.html")]):
            with pytest.raises(SystemExit) as ended:
                main(["report", str(all_kinds), *page, "--csv", str(tmp_path / name)])
            assert ended.value.code == 2
            said = capsys.readouterr()
            assert said.out == ""
            assert said.err.endswith(f"--csv {tmp_path / name} would overwrite the page\n")
            assert not (tmp_path / "some.html").exists()

    def test_the_csv_table_has_every_number(self, all_kinds, tmp_path, capsys):
        target = tmp_path / "table.csv"
        assert main(["report", str(all_kinds), "--csv", str(target)]) == 0
        with target.open() as file:
            rows = [*csv.DictReader(file)]
        for row, request in zip(rows, requests(), strict=False):
            impact = resolve(*request)
            assert [float(row[f"impulse.{i}"]) for i in range(3)] == [*impact.impulse]
            assert Fraction(row["kinetic_energy_after"]) == pytest.approx(
                Fraction(impact.kinetic_energy_after)
            )

    def test_names_of_files_that_are_no_text(self, all_kinds, tmp_path, capsys):
        """The page and the table may have one; rerun reads no such recording."""
        odd = tmp_path / os.fsdecode(b"odd\xff")
        page, table, copy = (odd.with_suffix(suffix) for suffix in (".html", ".csv", ".rrd"))
        assert main(["report", str(all_kinds), "--html", str(page), "--csv", str(table)]) == 0
        assert page.exists() and len(table.read_text().splitlines()) > 1
        copy.write_bytes(all_kinds.read_bytes())
        for command in ("report", "replay"):
            assert main([command, str(copy)]) == 2
            said = capsys.readouterr().err
            assert said.endswith("odd\\udcff.rrd: rerun reads no file whose name is not UTF-8\n")

    @pytest.mark.parametrize("sizes", [(7, 6), (6, 7), (6, 6), (1, 8)])
    def test_the_csv_table_has_rows_of_several_versions(self, recording, tmp_path, sizes):
        """Whose models have more or fewer numbers: where one has none, nothing is written."""
        paths = []
        for number, size in enumerate(sizes, start=1):
            model = [float(i) for i in range(size)]
            row = record(number, next(requests()))._replace(model=model)
            paths.append(str(recording([row], f"{number}.rrd")))
        target = tmp_path / "table.csv"
        assert main(["report", *paths, "--csv", str(target)]) == 0
        with target.open() as file:
            rows = [*csv.DictReader(file)]
        for row, size in zip(rows, sizes, strict=True):
            written = [row[f"request_model.{i}"] for i in range(max(sizes))]
            assert written == [str(i) if i < size else "" for i in range(max(sizes))]


def scene(number, law=Law.AUTO, e=0.5):
    box = Body.dynamic(1.0, (1 / 6, 0, 0, 1 / 6, 0, 1 / 6), (0.0, 0.0, 0.5), None, (0.25, 0.1, -1.0))
    contacts = [Contact.of((x, y, 0.0), (0.0, 0.0, 1.0), e, 0.3) for x in (-0.5, 0.5) for y in (-0.5, 0.5)]
    asked = [box, FLOOR], [(0, 1)] * 4, contacts, ImpactModel(law)
    return SceneRecord(10**18 + number, number, ["box", "the floor"], *asked, resolve_scene(*asked))


@pytest.mark.parametrize("command", ["report", "replay"])
@pytest.mark.parametrize("kind", ["impacts", "scenes"])
def test_memory_does_not_grow_by_python_numbers(recording, kind, command, capsys):
    """A recorded impact or scene is some 100 numbers, of which lists of Python take 4 kB, a table 1 kB."""
    one = scene(1) if kind == "scenes" else record(1, next(requests()))
    peaks = []
    for count in (3000, 6000):  # plots show at most 3000
        path = recording([one._replace(sequence=number) for number in range(1, count + 1)], f"{count}.rrd")
        tracemalloc.start()
        assert main([command, str(path)]) == 0
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] - peaks[0] < 3000 * 1000


def test_scenes_are_read_and_replayed(recording, capsys):
    ball = Body.sphere(2.0, 0.1, position=(0.0, 0.0, 0.1), velocity=(1.0, 0.5, -3.0))
    single = record(1, (ball, FLOOR, Contact.of((0, 0, 0), (0, 0, 1), 0.5, 0.3), ImpactModel()))
    scenes = [scene(2), scene(3, Law.FRICTIONLESS), scene(4, Law.MOREAU, e=lambda speed: 1 / (1 + speed))]
    path = recording([single, *scenes])
    rows = [*rows_of(scenes_table.read([path]))]
    assert [row["answer"] for row in rows] == [2, 3, 4]
    assert [row["law"] for row in rows] == ["COULOMB", "FRICTIONLESS", "MOREAU"]
    for row, entry in zip(rows, scenes, strict=True):
        assert row["bodies"] == ["box", "the floor"]
        assert row["impulses"] == [x for impulse in entry.impact.impulses for x in impulse]
        assert row["twists"][:3] == [*entry.impact.twists[0].linear]
        assert row["error_bound"] == entry.impact.error_bound
        used = entry.impact.contacts
        assert row["restitution"] == [contact.restitution for contact in used]
        assert row["friction"] == [contact.friction for contact in used]
        assert row["normal_velocities_before"] == [*entry.impact.normal_velocities_before]
        assert row["normal_velocities_after"] == [*entry.impact.normal_velocities_after]
        assert row["regimes"] == [*map(str, entry.impact.regimes)]
    assert main(["replay", str(path)]) == 0
    assert (
        capsys.readouterr().out == "1 impacts and 3 scenes computed again, 0 of them with different answers\n"
    )


def slower_bounces_more(speed):
    return 0.75 / (1 + speed)


@pytest.mark.parametrize("law", [Law.AUTO, Law.FRICTIONLESS, Law.MOREAU])
@pytest.mark.parametrize("restitution_threshold", [0.0, 0.9, 2.0])
def test_coefficients_that_are_functions_are_recorded_with_their_values(
    recording, law, restitution_threshold, capsys
):
    """Their values, not what was used: the restitution of a cluster, or 0 below the threshold."""
    model = ImpactModel(law, restitution_threshold=restitution_threshold)
    spinning = (1 / 6, 0, 0, 1 / 6, 0, 1 / 6), (0.0, 0.0, 0.5), None, (0.25, 0.1, -1.0), (0.125, 0.25, 0.0)
    box, rising = Body.dynamic(1.0, *spinning), Body.dynamic(1.0, velocity=(0.0, 0.0, 1.0))
    given = [slower_bounces_more, 0.25, slower_bounces_more, 0.5]
    frictions = [0.25, lambda slip: slip / (1 + slip), 0.25, 0.0]
    corners = [(x, y, 0.0) for x in (-0.5, 0.5) for y in (-0.5, 0.5)]
    touches = list(zip(corners, given, frictions, strict=True))
    contacts = [Contact.of(corner, (0.0, 0.0, 0.7), e, mu) for corner, e, mu in touches]
    apart = contacts[0]._replace(position=rising.position)
    asked = [box, rising, FLOOR], [*[(0, 2)] * 4, (1, 2), (0, 2)], [*contacts, apart, contacts[0]], model
    scene = SceneRecord(1, 1, ["box", "ball", "floor"], *asked, resolve_scene(*asked))
    smooth_at_rest = contacts[0]._replace(friction=lambda slip: min(slip, 0.5))
    falling = Body.dynamic(1.0, velocity=(0.0, 0.0, -1.0))
    point = smooth_at_rest._replace(position=falling.position)
    alone = [falling, FLOOR], [(0, 1)], [point], model
    path = recording(
        [
            scene,
            SceneRecord(2, 2, ["ball", "floor"], *alone, resolve_scene(*alone)),
            record(3, (box, FLOOR, contacts[0], model)),
            record(4, (falling, FLOOR, point, model)),
            record(5, (rising, FLOOR, apart, model)),
        ]
    )
    assert main(["replay", str(path)]) == 0
    assert (
        capsys.readouterr().out == "3 impacts and 2 scenes computed again, 0 of them with different answers\n"
    )


def test_scenes_are_reported(recording, capsys):
    path = recording([scene(1), scene(2, Law.FRICTIONLESS)])
    assert main(["report", str(path)]) == 0
    head, scenes, bound, *_ = capsys.readouterr().out.splitlines()
    assert head == "0 impacts, 0 refusals"
    assert scenes == "2 scenes of 8 contacts in all, by 1 COULOMB, 1 FRICTIONLESS"
    assert re.fullmatch(r"error bound of scenes: at most \S+e-\d+ \(answer 1\)", bound)
    page = Page(path.with_suffix(".html").read_text(encoding="utf-8"))
    assert page.tags.count("tr") == 3
    assert page.text.count("box, the floor") == 2


@pytest.mark.parametrize("size", [0, 1])
@pytest.mark.parametrize("before", [[], [4]])
@pytest.mark.parametrize("after", [[], [5]])
def test_a_scene_without_contacts_is_read_reported_and_replayed(
    recording, monkeypatch, capsys, before, size, after
):
    """An empty request is answered, and recorded in a batch with others or of its own."""
    monkeypatch.setattr("collision_response.recording.recorder.INTERVAL", 0.0)
    asked = [Body.dynamic(1.0)] * size, [], [], ImpactModel()
    empty = SceneRecord(2, 2, ["alone"] * size, *asked, resolve_scene(*asked))
    path = recording([*map(scene, before), empty, *map(scene, after)])
    assert main(["report", str(path)]) == 0
    count = 1 + len(before) + len(after)
    assert f"{count} scenes of {4 * (count - 1)} contacts in all" in capsys.readouterr().out
    Page(path.with_suffix(".html").read_text(encoding="utf-8"))
    assert main(["replay", str(path)]) == 0


@pytest.mark.parametrize(
    ("field", "value"),
    [("regimes", ()), ("normal_velocities_after", (1.0,)), ("normal_velocities_before", (1.0,) * 5)],
)
def test_a_scene_with_another_number_of_answers_differs(recording, field, value, capsys):
    row = scene(1)
    path = recording([row._replace(impact=row.impact._replace(**{field: value}))])
    assert main(["replay", str(path), "--tolerance", "1"]) == 1
    assert f"scene of box, the floor: {field} was [" in capsys.readouterr().out


def test_a_scene_whose_answer_is_empty_now_differs(recording, tmp_path, capsys):
    """As when its request was edited."""
    none = pa.array([], pa.float64())
    columns = columns_of(recording, "/scenes") | {"request_contacts": none, "request_pairs": none}
    path = edited(tmp_path / "edited.rrd", "/scenes", columns)
    assert main(["replay", str(path)]) == 1
    lines = capsys.readouterr().out.splitlines()
    for name in ("regimes", "impulses", "normal_velocities_after"):
        assert any(f": {name} was [" in line and line.endswith("], is []") for line in lines), name


def test_a_scene_that_is_answered_differently_is_reported(recording, capsys):
    was = scene(1)
    changed = was.impact._replace(
        impulses=(was.impact.impulses[0] * 2, *was.impact.impulses[1:]), regimes=(Regime.REVERSED,) * 4
    )
    path = recording([was._replace(impact=changed)])
    assert main(["replay", str(path)]) == 1
    first, second, last = capsys.readouterr().out.splitlines()
    assert first.startswith("answer 1, scene of box, the floor: impulses was [")
    assert second.startswith("answer 1, scene of box, the floor: regimes was ['REVERSED', ")
    assert last == "0 impacts and 1 scenes computed again, 1 of them with different answers"
    assert main(["replay", "--tolerance", "2", str(path)]) == 1  # the tolerance does not apply to words


def test_of_many_values_only_the_one_that_differs_most_is_printed(recording, capsys):
    """Of texts the first. Most is what is a number on one side only."""
    balls = [Body.sphere(1.0, 0.5, position=(2.0 * i, 0, 0), velocity=(0, 0, -1)) for i in range(30)]
    touching = [Contact.of((2.0 * i, 0, -0.5), (0, 0, 1), 0.5) for i in range(30)]
    request = [*balls, Body.static()], [(i, 30) for i in range(30)], touching, ImpactModel()
    names, answer = [f"ball {i}" for i in range(31)], resolve_scene(*request)
    regimes = [Regime.JAMMED if i in (3, 17) else regime for i, regime in enumerate(answer.regimes)]
    speeds = list(answer.normal_velocities_after)
    speeds[4:6] = 0.25, 0.5 + 1e-6
    for count, (worst, speed) in enumerate([(20, -3.0), (21, math.nan)], start=3):
        speeds[worst] = speed
        wrong = answer._replace(normal_velocities_after=tuple(speeds), regimes=tuple(regimes))
        path = recording([SceneRecord(1, 1, names, *request, wrong)], f"{worst}.rrd")
        assert main(["replay", str(path)]) == 1
        of = f"answer 1, scene of {', '.join(names[:8])} and 23 others: "
        assert sorted(capsys.readouterr().out.splitlines()[:-1]) == [
            f"{of}normal_velocities_after[{worst}] was {speed}, is 0.5; {count} of 30 values differ",
            f"{of}regimes[3] was JAMMED, is SLIDING; 2 of 30 values differ",
        ]


def test_one_path_is_one_file(tmp_path):
    path = recorded(tmp_path, [impact(1)])
    assert read(str(path)).num_rows == read(path).num_rows == read([path]).num_rows == 1
    with pytest.raises(TypeError, match=r"^paths: must be a sequence, is None"):
        read(None)


@pytest.mark.parametrize("command", ["replay", "report"])
def test_a_file_and_a_copy_of_it_are_refused(all_kinds, capsys, command):
    copy = all_kinds.with_name("copy.rrd")
    shutil.copy(all_kinds, copy)
    assert main([command, str(all_kinds), str(copy)]) == 2
    err = capsys.readouterr().err
    assert (
        err == f"collision_response {command}: {copy} holds answer 1 of a run, as does another of the files\n"
    )


@pytest.mark.parametrize("command", ["replay", "report"])
def test_a_part_and_the_whole_are_refused(recording, capsys, command):
    parts = [recording([impact(number)], f"{number}.rrd") for number in (1, 2)]
    whole = parts[0].with_name("whole.rrd")
    assert rerun("rrd", "merge", *parts, "-o", whole).returncode == 0
    assert main([command, *map(str, parts)]) == 0
    capsys.readouterr()
    assert main([command, str(whole), str(parts[1])]) == 2
    assert f"{parts[1]} holds answer 2 of a run" in capsys.readouterr().err
