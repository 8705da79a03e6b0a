"""``collision_response identify``: tables and recordings of impacts, its options and its errors."""

from __future__ import annotations

import os
import sys
from pathlib import Path

import pytest

pytest.importorskip("scipy")
import numpy as np
from measured import KHARAZ

from collision_response import Body, Contact, ImpactModel, resolve
from collision_response.identify.__main__ import main
from collision_response.identify.from_table import impacts_from_rows, read_rows
from collision_response.identify.measurements import BODY, CONTACT
from collision_response.physics.vector import Vec3
from collision_response.recording import BodyRecord, Record, Recorder

TABLE = "vx,vz,vx_after,vz_after,note\n1,-1,.85,.5,a\n2,-1,1.85,.5,b\n1,-2,.7,1,\n2,-2,1.7,1,\n"


def test_the_command_reads_a_table_and_plots(tmp_path: Path, capsys):
    """A point mass that slides: e = 0.5, mu (1 + e) = 0.15."""
    table, picture = tmp_path / "impacts.csv", tmp_path / "fit.png"
    table.write_text(TABLE)
    assert main([str(table), "--set", "m=2", "nz=1", "--resamples", "20", "--plot", str(picture)]) == 0
    out = capsys.readouterr().out
    assert "restitution = 0.5 " in out and "friction = 0.1 " in out
    assert picture.read_bytes().startswith(b"\x89PNG")
    assert main([str(table), "--set", "m=2", "nz=1", "--resamples", "2", "--compare"]) == 0
    assert "cannot tell" in capsys.readouterr().out


def test_the_command_reads_tables_as_papers_print_them(tmp_path: Path, capsys):
    table = tmp_path / "sphere.csv"
    table.write_text("incidence,ratio\n" + "".join(f"{a},{r}\n" for a, r in KHARAZ["ratio"]))
    options = ["--speed", "3.9", "--radius", ".0025", "--errors", "ratio=.008", "--resamples", "2"]
    assert main([str(table), *options]) == 0
    assert "friction (1 + restitution) = 0.18" in capsys.readouterr().out
    assert main([str(table)]) == 2
    assert "--speed" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("vz,vz_after\n-1,x\n", "rows[0].vz_after: must be a number, is 'x' (INVALID_TABLE)"),
        ("vz,vz_after\n", "rows: there are none"),
        ("vz,vz_after\n-1,1\n", "columns: must have m; nx or ny or nz"),
        ("m,nz,vz,vz_after\n1,1,,1\n", "impacts[0].body_a.velocity: must be finite"),
        ("m,nz,vz,vz_after\n1,1,-1,inf\n", "impacts[0].after_a.linear: must be finite"),
        ("m,nz,vz,vz,vz_after\n1,1,-1,-9,1\n", "columns: vz is there 2 times"),
        ("m,nz, vz,vz ,vz_after\n1,1,-1,-9,1\n", "columns: vz is there 2 times"),
        (
            "m,nz,vz,vz_after\n1,1,-1,0.5\n1,1,-1,0,5\n",
            "rows[1]: must have 4 cells, as there are columns; has 5",
        ),
        ("m,nz,vz,vz_after\n1,1,-1,0.5\n1,1,-1\n", "rows[1]: must have 4 cells, as there are columns; has 3"),
        ("\nm,nz,vz,vz_after\n1,1,-1,1\n", "file: must have the names of the columns in its first line"),
        ("m,nz,vz,vz_after\n1,1,-1,1_0\n", "rows[0].vz_after: must be a number, is '1_0' (INVALID_TABLE)"),
        ("m,nz,vz,vz_after\n1,1,-1,\u0661\n", "rows[0].vz_after: must be a number, is '\u0661'"),
        ("m,nz,vz,vz_after,note\n1,1,-1,1," + "x" * 200_000, "line 1: field larger than field limit"),
        ("m;nz;vz;vz_after\n1;1;-1;0,5\n", "file: must have commas between cells, has ';' (INVALID_TABLE)"),
        ("m\tnz\tvz\tvz_after\n1\t1\t-1\t0.5\n", "file: must have commas between cells, has '\\t'"),
        ("incidence,ratio\n0,1\n", "readings of a sphere need --speed"),
    ],
)
def test_a_bad_table_is_refused_in_one_line(tmp_path: Path, capsys, text, told):
    table = tmp_path / "impacts.csv"
    table.write_text(text, encoding="utf-8")
    assert main([str(table)]) == 2
    err = capsys.readouterr().err
    assert told in err and err.count("\n") == 1


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (["--given", "restitution=abc"], "argument --given: restitution must be a number, is 'abc'"),
        (["--errors", "ratio"], "argument --errors: must be NAME=VALUE, is 'ratio'"),
        (["--compare", "--plot", "fit.png"], "not with --plot or --law, which are for one"),
        (["--compare", "--law", "moreau"], "not with --plot or --law, which are for one"),
    ],
)
def test_invalid_arguments_are_refused_by_the_parser(capsys, options, told):
    with pytest.raises(SystemExit):
        main(["impacts.csv", *options])
    assert told in capsys.readouterr().err


@pytest.mark.parametrize(
    ("option", "told"),
    [
        (["--set", "nz=1", "nz=2"], "--set: a name is there twice: nz, nz"),
        (
            ["--given", "friction=1", "restitution=1", "friction=1"],
            "--given: a name is there twice: friction, ",
        ),
        (["--within", "0.1"], "--within: for a recording, not for a table"),
        (["--set", "m=2", "nz=1", "--speed", "1"], "--speed: for readings of a sphere: there is no"),
        (["--set", "m=2", "vz=-1"], "columns: vz is in the file: it cannot be set (INVALID_TABLE)"),
        (["--within", "-1"], "within: must be at least 0; is -1.0 (INVALID_MODEL)"),
        (["--within", "nan"], "within: must be finite; is nan (NOT_FINITE)"),
    ],
)
def test_options_that_make_no_sense_are_refused_by_name(tmp_path: Path, capsys, option, told):
    path = tmp_path / "impacts.csv"
    path.write_text(TABLE)
    if "--within" in option and not told.startswith("--"):
        path = recording(tmp_path / "a.rrd", [(1.0, 0.9)] * 3, [])
    assert main([str(path), *option]) == 2
    err = capsys.readouterr().err
    assert err.startswith(f"collision_response identify: {path}: {told}") and err.count("\n") == 1


@pytest.mark.parametrize("kind", ["missing", "folder", "binary", "empty"])
@pytest.mark.parametrize("suffix", [".csv", ".rrd"])
def test_a_file_that_cannot_be_read_is_named_once(tmp_path: Path, capsys, kind, suffix):
    path = tmp_path / f"impacts{suffix}"
    if kind == "folder":
        path.mkdir()
    elif kind != "missing":
        path.write_bytes(b"\xff\xfe\0" * 100 if kind == "binary" else b"")
    assert main([str(path)]) == 2
    err = capsys.readouterr().err
    assert err.count(str(path)) == 1 and err.count("\n") == 1


@pytest.mark.parametrize("name", ["fit.xyz", "no such folder/fit.png", "", "fit"])
def test_a_picture_that_cannot_be_written_is_named(tmp_path: Path, capsys, name):
    table, picture = tmp_path / "impacts.csv", tmp_path / name
    table.write_text(TABLE)
    options = ["--set", "m=2", "nz=1", "--resamples", "2"]
    assert main([str(table), *options, "--plot", str(picture)]) == 2
    said = capsys.readouterr()
    assert "friction = 0.1 " in said.out
    *_, last = said.err.splitlines()
    assert last.startswith(f"collision_response identify: {picture}: ")


@pytest.mark.parametrize(
    "options",
    [
        {"--set": ["m=2", "nz=1"]},
        {"--set": ["m=2", "nz=1"], "--fit": ["restitution", "friction"]},
        {"--set": ["m=2", "nz=1"], "--given": ["restitution=0.5", "tangential_restitution=0.1"]},
        {"--speed": ["3.9"], "--radius": [".0025"], "--errors": ["ratio=.008", "angle=.84"]},
    ],
)
def test_an_option_may_be_repeated_for_each_value(tmp_path: Path, capsys, options):
    """The last one must not replace the others."""
    table = tmp_path / "impacts.csv"
    readings = "incidence,ratio,angle\n30,.69,21.8\n39,.77,32.5\n50,.85,45.1\n60,.90,57.4\n"
    table.write_text(readings if "--errors" in options else TABLE)
    together = [word for name, values in options.items() for word in (name, *values)]
    repeated = [word for name, values in options.items() for value in values for word in (name, value)]
    told = []
    for words in (together, repeated):
        assert main([str(table), *words, "--resamples", "2"]) == 0
        told.append(capsys.readouterr().out)
    assert told[0] == told[1]


def test_without_scipy_it_says_what_to_install(tmp_path: Path, capsys, monkeypatch):
    table = tmp_path / "impacts.csv"
    table.write_text(TABLE)
    monkeypatch.setitem(sys.modules, "scipy.optimize", None)
    assert main([str(table), "--set", "m=2", "nz=1"]) == os.EX_UNAVAILABLE
    *_, last = capsys.readouterr().err.splitlines()
    assert last == "collision_response needs SciPy for this: pip install scipy"


def test_a_misspelt_column_is_refused(tmp_path: Path, capsys):
    table = tmp_path / "impacts.csv"
    table.write_text(TABLE)
    assert main([str(table), "--set", "m=2", "nz=1", "vy_afte=0"]) == 2
    assert "columns: vy_afte is unknown" in capsys.readouterr().err


def test_the_command_does_not_fit_what_is_given(tmp_path: Path, capsys):
    table = tmp_path / "impacts.csv"
    table.write_text(TABLE)
    options = [str(table), "--set", "m=2", "nz=1", "--resamples", "2"]
    assert main([*options, "--given", "restitution=0.5"]) == 0
    out = capsys.readouterr().out
    assert "friction = 0.1 " in out and "restitution" not in out
    assert main([*options, "--fit", "restitution", "restitution"]) == 2
    assert "fit: has restitution twice" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("names", "unused"),
    [
        ("vx,vz,vx_after,vz_after", ""),
        ("Vx,vz,vx_after,vz_after", "Vx"),
        ("vx_before,vz,vx_after,vz_after,note, b_mass ,", "vx_before, note, b_mass"),
        ("speed,vz,vx_after,vz_after", ""),
        ("\N{BYTE ORDER MARK}vx,vz,vx_after,vz_after,n", "n"),
    ],
)
def test_the_command_names_the_columns_that_it_leaves_out(tmp_path: Path, capsys, names, unused):
    """A misspelt column would count as 0."""
    table = tmp_path / "impacts.csv"
    rest = "," * (names.count(",") - 3)
    rows = (f"{row}{rest}\n" for row in ("1,-1,.85,.5", "2,-1,1.85,.5", "1,-2,.7,1"))
    table.write_text(f"{names}\n{''.join(rows)}", encoding="utf-8")
    assert main([str(table), "--set", "m=2", "nz=1", "wx=speed" if "speed" in names else "wx=0"]) == 0
    told = f"{table}: columns that are left out: {unused}\n" if unused else ""
    assert capsys.readouterr().err == told


@pytest.mark.parametrize(
    ("text", "options", "unused"),
    [
        (
            "incidence,ratio,m,vz_after\n30,.69,1,1\n39,.77,1,1\n50,.85,1,1\n",
            ["--speed", "3.9", "--radius", ".0025", "--errors", "ratio=.008"],
            "m, vz_after",
        ),
        (
            "vx,vz,vx_after,vz_after,rx\n1,-1,.85,.5,1\n2,-1,1.85,.5,1\n1,-2,.7,1,1\n",
            ["--set", "m=2", "nz=1", "cx=0"],
            "rx",
        ),
        (
            "vx,vz,vx_after,vz_after,b_vz_after\n1,-1,.85,.5,0\n2,-1,1.85,.5,0\n1,-2,.7,1,0\n",
            ["--set", "m=2", "nz=1"],
            "b_vz_after",
        ),
    ],
    ids=["readings", "arm", "immovable"],
)
def test_so_it_does_if_other_columns_take_their_place(tmp_path: Path, capsys, text, options, unused):
    table = tmp_path / "impacts.csv"
    table.write_text(text)
    assert main([str(table), *options, "--resamples", "2"]) == 0
    assert capsys.readouterr().err == f"{table}: columns that are left out: {unused}\n"


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig"])
def test_a_byte_order_mark_is_not_part_of_a_name(tmp_path: Path, encoding):
    table = tmp_path / "impacts.csv"
    table.write_text("vz,note,note\n-1,a,b\n", encoding=encoding)
    assert read_rows(table, {}) == ([{"vz": -1.0}], ["note", "note"])


@pytest.mark.parametrize(
    "text",
    ["vz,vx\n-1,\n", " vz, vx\n-1,\n", "vz ,vx \r\n -1 , \r\n", "vz\t,\tvx\n\t-1,\t\n", "vz,vx\n-1,,\n"],
)
def test_blanks_are_not_part_of_a_name_or_a_number(tmp_path: Path, text):
    """A name with blanks would be unknown, and its numbers would count as 0."""
    table = tmp_path / "impacts.csv"
    table.write_bytes(text.encode())
    assert [[name, str(x)] for row in read_rows(table, {})[0] for name, x in row.items()] == [
        ["vz", "-1.0"],
        ["vx", "nan"],
    ]


@pytest.mark.parametrize("there", ["x", "y", "z", "xy", "yz", "xyz", ""])
def test_missing_components_of_a_contact_position_are_0(there):
    """If all are missing, the contact is at the lever arm from the origin of body_a."""
    row = {"m": 1.0, "nz": 1.0, "vz": -1.0, "vz_after": 0.5, "x": 7.0, "ry": 8.0}
    measured = impacts_from_rows([row | {f"c{axis}": 3.0 for axis in there}])
    expected = [3.0 * (axis in there) for axis in "xyz"] if there else [7.0, 8.0, 0.0]
    assert measured.contacts[CONTACT.position, 0].tolist() == expected


@pytest.mark.parametrize("there", ["x", "y", "z", "w", "xw", "yz", "xyzw", ""])
def test_missing_components_of_a_quaternion_are_those_of_the_identity(there):
    row = {"m": 1.0, "nz": 1.0, "vz": -1.0, "vz_after": 0.5} | {f"q{axis}": 0.5 for axis in there}
    turned = impacts_from_rows([row]).bodies[BODY.orientation, 0, 0]
    expected = np.array([0.5 if axis in there else float(axis == "w") for axis in "xyzw"])
    assert turned == pytest.approx(expected)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    ("left", "says"),
    [
        (0, "Failed to read RRD file at {path}"),
        (4, "Failed to read RRD file at {path}"),
        (100, "{path} is not complete, "),
        (0.5, "{path} is not complete, "),
        (-1, "{path} is not complete, "),
    ],
)
def test_a_truncated_recording_is_refused_in_one_line(tmp_path: Path, capsys, left, says):
    whole = recording(tmp_path / "a.rrd", [(1.0, 0.9)] * 3, []).read_bytes()
    path = tmp_path / "b.rrd"
    path.write_bytes(whole[: left if isinstance(left, int) else int(left * len(whole))])
    assert main([str(path)]) == 2
    err = capsys.readouterr().err
    assert err.startswith("collision_response identify: " + says.format(path=path)) and err.count("\n") == 1


def test_a_table_named_like_a_recording_is_refused_in_one_line(tmp_path: Path, capsys):
    pytest.importorskip("rerun")
    path = tmp_path / "a.rrd"
    path.write_text(TABLE)
    assert main([str(path)]) == 2
    err = capsys.readouterr().err
    assert "Not an RRD file" in err and err.count("\n") == 1


ARM = Body.articulated(np.eye(6).tolist())
OF_ARM = 0.125


def recording(path, answers, received, floor=None, name="ball"):
    """A recording of balls that strike a floor at whole seconds, and of received states of the ball.

    With the restitution ``OF_ARM`` it is an arm that strikes.

    Args:
        path: the file.
        answers: speed and restitution of each impact, and its stamp [ns] if it is not at a whole second.
        received: stamp [ns] and vertical velocity of each state.
        floor: the floor; static by default.
        name: the name of the ball.
    """
    pytest.importorskip("rerun")
    recorder = Recorder(path.parent, pytest.fail, name=path.name)
    ball = Body.dynamic(2.0, (0.2, 0, 0, 0.2, 0, 0.2), (0.0, 0.0, 0.25))
    for i, (speed, e, *stamp) in enumerate(answers, start=1):
        falling = (ARM if e == OF_ARM else ball)._replace(velocity=Vec3(0.0, 0.0, -speed))
        request = falling, floor or Body.static(), Contact.of((0, 0, 0), (0, 0, 1), e), ImpactModel()
        recorder.add(Record(*(stamp or [i * 10**9]), i, name, "floor", *request, resolve(*request)))
    for stamp, velocity in received:
        recorder.add(BodyRecord(stamp, name, ball._replace(velocity=Vec3(0.0, 0.0, velocity))))
    recorder.close()
    return path


def test_the_command_uses_the_states_received_after_an_impact(tmp_path: Path, capsys):
    """The node was given e = 0.9, but the balls bounce with 0.5. One state comes too late, and one before its
    impact.
    """
    received = [(10**9 - 1, -1.0), (10**9 + 10**7, 0.5), (10**9 + 2 * 10**7, 9.0)]
    received += [(2 * 10**9 + 10**7, 1.0), (3 * 10**9 + 10**7, 1.5), (4 * 10**9 + 10**8, 9.0)]
    path = recording(tmp_path / "a.rrd", [(1.0, 0.9), (2.0, 0.9), (3.0, 0.9), (4.0, 0.9)], received)
    options = [str(path), "--law", "frictionless", "--resamples", "2"]
    assert main(options) == 0
    assert "restitution = 0.5 " in capsys.readouterr().out
    assert main([*options, "--within", "0"]) == 0
    assert "restitution = 0.9 " in capsys.readouterr().out


@pytest.mark.parametrize("pause", [0, 1, 5 * 10**6])
def test_a_state_after_a_second_impact_is_no_measurement_of_the_first(tmp_path: Path, capsys, pause):
    """Each two impacts are at one time or soon after each other; after the second one e is 0.5."""
    answers, received = [], []
    for i in (1, 2, 3):
        answers += [(4.0 * i, 0.9, i * 10**9), (1.0 * i, 0.9, i * 10**9 + pause)]
        received.append((i * 10**9 + 10**7, 0.5 * i))
    path = recording(tmp_path / "a.rrd", answers, received)
    assert main([str(path), "--law", "frictionless", "--resamples", "2"]) == 0
    said = capsys.readouterr().out
    assert "FRICTIONLESS, 3 impacts" in said and "restitution = 0.5 " in said


@pytest.mark.parametrize(
    "name", ["robot1/base link", "ball ", " ", "**", "- /world/**", "\\/", "a\nb", "Kugel ü 🙂"]
)
def test_the_states_of_a_body_are_found_under_any_name(tmp_path: Path, capsys, name):
    received = [(i * 10**9 + 10**7, 0.5 * i) for i in (1, 2, 3)]
    path = recording(tmp_path / "a.rrd", [(1.0, 0.9), (2.0, 0.9), (3.0, 0.9)], received, name=name)
    assert main([str(path), "--law", "frictionless", "--resamples", "2"]) == 0
    assert "restitution = 0.5 " in capsys.readouterr().out


def test_impacts_of_arms_in_a_recording_are_left_out(tmp_path: Path, capsys):
    received = [(i * 10**9 + 10**7, 0.5 * i) for i in (1, 2, 3, 4)]
    path = recording(tmp_path / "a.rrd", [(1.0, 0.9), (2.0, 0.9), (3.0, OF_ARM), (4.0, 0.9)], received)
    assert main([str(path), "--law", "frictionless", "--resamples", "2"]) == 0
    said = capsys.readouterr()
    assert "FRICTIONLESS, 3 impacts" in said.out and "restitution = 0.5 " in said.out
    assert said.err == f"{path}: left out: 1 impacts of mechanisms\n"


def test_a_recording_without_body_states_is_refused(tmp_path: Path, capsys):
    path = recording(tmp_path / "a.rrd", [(1.0, 0.9)] * 3, [])
    assert main([str(path)]) == 2
    assert "no state of a body was received within 0.05 s" in capsys.readouterr().err


def test_a_recording_of_articulated_bodies_is_refused(tmp_path: Path, capsys):
    """Its infinite mass must not be taken for an immovable body."""
    link = Body.articulated(np.eye(6).tolist())
    path = recording(tmp_path / "a.rrd", [(1.0, 0.9)] * 3, [], link)
    assert main([str(path), "--within", "0"]) == 2
    assert "impacts[0].body_b.inverse_inertia" in capsys.readouterr().err


@pytest.mark.parametrize(
    "columns", [{}, {"request_a": [1.0]}, {"regime": ["STICKING"], "twist_a_after": [1.0]}]
)
def test_a_recording_of_another_program_is_refused_in_one_line(tmp_path: Path, capsys, columns):
    rr = pytest.importorskip("rerun")
    stream = rr.RecordingStream("test")
    stream.save(tmp_path / "a.rrd")
    if columns:
        rows = rr.DynamicArchetype.columns(archetype="Impact", components=columns)
        stream.send_columns("/impacts", [rr.TimeColumn("answer", sequence=[1])], rows)
    stream.disconnect()
    assert main([str(tmp_path / "a.rrd")]) == 2
    err = capsys.readouterr().err
    assert "is not a recording of this node" in err and err.count("\n") == 1


def test_a_recording_without_impacts_is_refused(tmp_path: Path, capsys):
    assert main([str(recording(tmp_path / "a.rrd", [], [(10**9, 1.0)]))]) == 2
    assert "/impacts: there are none in" in capsys.readouterr().err


@pytest.mark.parametrize("name", ["m", "be", "columns"])
def test_an_error_names_the_file_whatever_its_name(tmp_path: Path, monkeypatch, capsys, name):
    (tmp_path / name).write_text("vz,vz_after\n-1,1\n")
    monkeypatch.chdir(tmp_path)
    assert main([name]) == 2
    assert capsys.readouterr().err.startswith(f"collision_response identify: {name}: columns: must have m;")
