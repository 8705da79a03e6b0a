"""The command line: arguments, output, exit codes and error messages."""

from __future__ import annotations

import io
import os
import re
import signal
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest
from programs import run_python

import collision_response
from collision_response.cli import COMMANDS, main

BOUNCE = """
body_a: {name: ball, inertia: {m: 2}, twist: {linear: {z: -3}}}
body_b: {name: floor, motion_type: static}
contact: {normal: {z: 1e0}, restitution: 0.5, friction: 3e-1}
model: {law: ROUTH_STRONGE, tolerance: 1e-12}"""
BOUNCED = [
    "STICKING  0.5  0.3  -3              1.5            (0, 0, 9)",
    "body   velocity [m/s]  angular velocity [rad/s]",
    "ball   (0, 0, 1.5)     (0, 0, 0)",
    "floor  (0, 0, 0)       (0, 0, 0)",
    "energy 9 -> 2.25 J; lost: 6.75 restitution, 0 friction",
]


NO_TEXT = [r"\uD800", r"a \udfff", r"\ud83d\ude00"]
"""Halves of surrogate pairs, which cannot be sent."""

EXECUTABLE = Path(__file__).resolve().parent.parent / "scripts" / "collision_response"


@pytest.mark.parametrize("script", sorted(EXECUTABLE.parent.iterdir()), ids=lambda script: script.name)
def test_ctrl_c_during_the_import_is_quiet(tmp_path, script):
    (tmp_path / "collision_response.py").write_text("raise KeyboardInterrupt")
    run = subprocess.run(
        [sys.executable, str(script)],
        env={**os.environ, "PYTHONPATH": str(tmp_path)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert (run.returncode, run.stdout, run.stderr) == (128 + signal.SIGINT, "", "")


def ended(sink, *words, unbuffered):
    """Run the command with its output in a sink; return the exit code and the standard error."""
    run = subprocess.run(
        [sys.executable, str(EXECUTABLE), *words],
        env={**os.environ, "PYTHONUNBUFFERED": unbuffered},
        stdout=sink,
        stderr=subprocess.PIPE,
        text=True,
        timeout=100,
        check=False,
    )
    return run.returncode, run.stderr


@pytest.fixture
def closed_pipe():
    """The sink of a pipe that nobody reads."""
    source, sink = os.pipe()
    os.close(source)
    yield sink
    os.close(sink)


IMPACTS = (
    f"{EXECUTABLE.parent.parent}/docs/kharaz-2001.csv --speed 3.9 --radius 0.0025 "
    "--errors ratio=0.008 angle=0.84 spin=44 --resamples 2"
)


def test_help_names_every_command(capsys):
    with pytest.raises(SystemExit) as end:
        main([])
    assert end.value.code == 0
    text = capsys.readouterr().out
    assert re.findall(
        r"^  (\w+) +\w", text.partition("commands:")[2].partition("options:")[0], re.MULTILINE
    ) == [*COMMANDS]


def test_an_unknown_command_is_refused(capsys):
    with pytest.raises(SystemExit) as end:
        main(["nodes"])
    assert end.value.code == 2
    assert "invalid choice: 'nodes'" in capsys.readouterr().err


def test_version_prints_the_version_of_the_package(capsys):
    with pytest.raises(SystemExit):
        main(["--version"])
    assert capsys.readouterr().out.strip() == collision_response.__version__


def test_a_command_names_the_package_that_it_lacks(capsys, monkeypatch):
    monkeypatch.setitem(COMMANDS, "plan", collision_response.cli.Command("no_such_package.plan", ""))
    assert main(["plan"]) == os.EX_UNAVAILABLE  # 1 means something else to most commands
    assert (
        capsys.readouterr().err == "collision_response plan needs no_such_package, which is not installed\n"
    )


def test_a_command_without_ros_says_what_to_install(capsys, monkeypatch):
    def without_ros(*_):
        raise ImportError("collision_response needs ROS for this: pip install 'ros-rclpy==9.1.*'")

    monkeypatch.setattr(collision_response.cli, "import_module", without_ros)
    assert main(["node"]) == os.EX_UNAVAILABLE
    assert (
        capsys.readouterr().err == "collision_response needs ROS for this: pip install 'ros-rclpy==9.1.*'\n"
    )


@pytest.mark.parametrize("command", ["demo", "node", "call", "states", "markers"])
def test_a_command_looks_for_the_wheels_of_ros_before_it_imports_ros(command):
    """The search says what to install; a failed import only names one package."""
    program = (
        "import sys; sys.modules.update(dict.fromkeys(['builtin_interfaces', 'geometry_msgs', 'rclpy']));"
        f"from collision_response.cli import main; main(['{command}']);"
        "print('collision_response.ros.wheels' in sys.modules)"
    )
    done = run_python("-c", program)
    done.check_returncode()
    assert done.stdout == "True\n"


def test_importing_the_source_tree_says_what_to_do(tmp_path):
    """As when Python finds the source directory ``collision_response`` before the installed package."""
    source = str(Path(__file__).resolve().parents[1] / "collision_response" / "__init__.py")
    program = f"""
import importlib.util, sys
spec = importlib.util.spec_from_file_location("collision_response", {source!r})
module = importlib.util.module_from_spec(spec)
sys.modules["collision_response"] = module
spec.loader.exec_module(module)
"""
    run = subprocess.run(
        [sys.executable, "-c", program], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert re.search(r"is not compiled\. .* run \.venv/bin/python -I", run.stderr)


@pytest.mark.parametrize(
    ("words", "unbuffered"),
    [
        ("--version", ""),  # argparse ignores write errors
        ("report FILE", ""),
        ("report FILE", "1"),
        ("replay FILE", ""),
        ("replay FILE", "1"),
        (f"identify {IMPACTS}", ""),
        (f"identify {IMPACTS}", "1"),
    ],
)
class TestOutput:
    """Output that cannot be written, buffered or unbuffered."""

    @pytest.fixture
    def run(self, words, unbuffered, tmp_path):
        """Run the command with its output in a sink; return the exit code and the standard error."""
        file = tmp_path / "empty.rrd"
        if "FILE" in words:
            pytest.importorskip("rerun")
            from collision_response.recording import Recorder

            Recorder(tmp_path, print, name=file.name).close()

        return lambda sink: ended(sink, *words.replace("FILE", str(file)).split(), unbuffered=unbuffered)

    def test_a_closed_pipe_ends_it_quietly(self, run, closed_pipe):
        assert run(closed_pipe) == (128 + signal.SIGPIPE, "")

    def test_a_full_disk_is_reported(self, run):
        with open("/dev/full", "w") as full:
            assert run(full) == (
                os.EX_IOERR,
                "collision_response: standard output: No space left on device\n",
            )


@pytest.mark.usefixtures("need_ros")
class TestCall:
    @pytest.fixture
    def call(self, shared_node, capsys):
        """Call the node; return the exit code, standard output and standard error."""

        def call(request, kind="ResolveCollision", suffix="collision"):
            service = shared_node.service.replace("resolve_collision", f"resolve_{suffix}")
            code = main(["call", request, "--type", kind, "--service", service, "--timeout", "20"])
            said = capsys.readouterr()
            return code, said.out, said.err

        return call

    def test_the_answer_is_a_table(self, call):
        code, said, wrong = call(BOUNCE)
        assert (code, wrong) == (0, "")
        assert said.startswith("OK by ROUTH_STRONGE (")
        assert said.splitlines()[2:] == BOUNCED

    def test_a_node_of_another_name_is_found(self, shared_node, capsys):
        """As one that was started in a namespace. It may take some time until it is discovered."""
        from ros_graph import wait_until

        found = f"give one of these by --service: {shared_node.service}\n"
        wait_until(lambda: main(["call", "{}", "--timeout", "0.5"]) == 3 and found in capsys.readouterr().err)

    def test_a_service_of_another_type_is_not_proposed(self, shared_node, capsys):
        from ros_graph import wait_until

        scene = shared_node.service.replace("resolve_collision", "resolve_scene")
        found = f"give one of these by --service: {scene}\n"
        words = ["call", "{}", "--type", "ResolveScene", "--service", shared_node.service, "--timeout", "0.5"]
        wait_until(lambda: main(words) == 3 and found in capsys.readouterr().err)

    def test_a_request_may_come_from_standard_input(self, call, monkeypatch):
        monkeypatch.setattr(sys, "stdin", io.StringIO(BOUNCE))
        assert call("-")[1].splitlines()[2:] == BOUNCED

    @pytest.mark.parametrize(
        ("stdin", "says"),
        [
            (None, "standard input is closed"),
            (io.TextIOWrapper(io.BytesIO(b"\xff"), "utf-8"), "standard input: 'utf-8' codec can't decode"),
        ],
    )
    def test_unreadable_standard_input_is_reported(self, call, monkeypatch, stdin, says):
        monkeypatch.setattr(sys, "stdin", stdin)
        code, said, wrong = call("-")
        assert (code, said) == (2, "")
        assert wrong.startswith(f"collision_response call: {says}")

    def test_characters_outside_the_locale_are_escaped(self, call, monkeypatch):
        written = io.BytesIO()
        monkeypatch.setattr(sys, "stdout", io.TextIOWrapper(written, "ascii"))
        assert call(BOUNCE.replace("name: ball", "name: b\u00e4ll"))[::2] == (0, "")
        assert rb"b\xe4ll " in written.getvalue()

    def test_a_name_cannot_colour_the_terminal_or_break_the_table(self, call):
        code, said, _ = call(BOUNCE.replace("name: ball", r'name: "\e[31mb\na"'))
        assert (code, len(said.splitlines())) == (0, 2 + len(BOUNCED))
        assert r"\x1b[31mb\na" in said and "\x1b" not in said

    @pytest.mark.parametrize("unbuffered", ["", "1"])
    def test_a_closed_pipe_ends_it_quietly(self, shared_node, unbuffered, closed_pipe):
        words = "call", BOUNCE, "--service", shared_node.service
        assert ended(closed_pipe, *words, unbuffered=unbuffered) == (128 + signal.SIGPIPE, "")

    @pytest.mark.parametrize(
        ("number", "code"), [(signal.SIGINT, 128 + signal.SIGINT), (signal.SIGTERM, -signal.SIGTERM)]
    )
    def test_a_signal_ends_it_quietly(self, graph, number, code):
        from ros_graph import DEADLINE, wait_until

        command = [sys.executable, str(EXECUTABLE), "call", "{}", "--service", "/nobody", "--timeout", "1000"]
        with subprocess.Popen(command, stderr=subprocess.PIPE, text=True) as run:
            wait_until(lambda: "collision_response_call" in graph.user.get_node_names())
            run.send_signal(number)
            _, wrong = run.communicate(timeout=DEADLINE)
        assert (run.returncode, wrong) == (code, "")

    def test_ctrl_c_while_ros_starts_ends_it_quietly(self, ros_domain, monkeypatch, capsys):
        """The signal handler of rclpy shuts ROS down before Python raises KeyboardInterrupt."""
        import rclpy

        from collision_response.ros.take_all import RCLError

        def interrupted(_):
            rclpy.shutdown()
            raise RCLError("the context is not valid")

        monkeypatch.setattr(rclpy, "create_node", interrupted)
        assert main(["call", "{}"]) == 128 + signal.SIGINT
        assert capsys.readouterr().err == ""

    def test_a_failed_start_of_ros_is_reported(self, monkeypatch, capsys):
        monkeypatch.setenv("ROS_DOMAIN_ID", "one")
        assert main(["call", "{}"]) == 2
        (line,) = capsys.readouterr().err.splitlines()
        assert "ROS_DOMAIN_ID is not an integral number" in line

    def test_a_refusal_names_the_field_and_ends_with_1(self, call):
        code, said, wrong = call("body_a: {}")
        assert (code, said) == (1, "")
        assert wrong.startswith("INVALID_MASS: body_a.inertia.m: must be positive")

    def test_a_scene(self, call):
        """Two separate balls fall on the floor, which is the third body."""
        columns = [
            [1.0, 0.4, 0, 0, 0.4, 0, 0.4, 0, 0, 0, x, 0, 1, 0, 0, 0, 1, 0, 0, -1, 0, 0, 0] for x in (0, 5)
        ]
        columns.append([0.0] * 16 + [1.0] + [0.0] * 6)
        touches = [[x, 0, 0, 0, 0, 1, 0.5, 0] for x in (0, 5)]
        table = [number for row in zip(*columns, strict=True) for number in row]
        contacts = [number for row in zip(*touches, strict=True) for number in row]
        request = f"{{bodies: {table}, immovable: [2], pairs: [0, 1, 2, 2], contacts: {contacts}}}"
        code, said, wrong = call(request, "ResolveScene", "scene")
        assert (code, wrong) == (0, "")
        assert re.search(r"^1 +1 +SLIDING +0\.5 +0 +-1 +0\.5 +\(0, 0, 1\.5\)$", said, re.MULTILINE)
        assert re.search(r"^1 +\(0, 0, 0\.5\) +\(0, 0, 0\)$", said, re.MULTILINE)

    def test_a_batch(self, call):
        request = """
layout: POINT
bodies: [2, 0,  0, 0,  0, 0,  -3, 0]
immovable: [1]
pairs: [0, 1, 1, 1]
contacts: [0, 0,  0, 0,  1, 1,  0.5, 0.5]"""
        code, said, wrong = call(request, "ResolveCollisionBatch", "collision_batch")
        assert (code, wrong) == (0, "")
        assert said.splitlines()[1].split(None, 2) == [
            "0",
            "OK",
            "(0, 0, 1.5)       (0, 0, 0)         (0, 0, 9)",
        ]
        assert said.splitlines()[2].split()[:2] == ["1", "SAME_BODY"]

    def test_a_batch_says_what_is_wrong_with_bodies_given_by_name(self, call):
        request = '{layout: POINT, names: "nobody\\nbox", pairs: [0, 1], contacts: [0, 0, 1, 0.5]}'
        code, said, wrong = call(request, "ResolveCollisionBatch", "collision_batch")
        assert (code, wrong) == (0, "")
        assert said.splitlines()[1].split()[:2] == ["0", "UNKNOWN_BODY"]
        assert "'nobody'" in said.splitlines()[2]

    @pytest.mark.parametrize(
        "request_, says",
        [
            ("body_c: {}", "body_c: there is no such field; did you mean body_b?"),
            ("body_a: {inertia: 3}", "body_a.inertia: must have some of the fields m, com, ixx, "),
            ("body_a: {inertia: {m: heavy}}", "body_a.inertia.m: must be a number, is 'heavy'"),
            ("body_a: {inertia: {m: 1e1_0}}", "body_a.inertia.m: must be a number, is '1e1_0'"),
            ("body_a: {inertia: {m: '1_0'}}", "body_a.inertia.m: must be a number, is '1_0'"),
            ("body_a: {motion_type: 300}", "body_a.motion_type: must be a uint8, is 300"),
            ("body_a: {motion_type: 1.5}", "body_a.motion_type: must be a uint8, is 1.5"),
            ("not_before: {sec: 3000000000}", "not_before.sec: must be an int32, is 3000000000"),
            ("body_a: {motion_type: fixed}", "must be one of DYNAMIC, KINEMATIC, STATIC; is fixed"),
            ("model: {law: POINT}", "model.law: must be one of AUTO, FRICTIONLESS, COULOMB, "),
            ("[1, 2]", "the request: must have some of the fields body_a, body_b, "),
            ("body_a: {", "while parsing a flow"),
            ("[]", "the request: must have some of the fields body_a, body_b, "),
            ("0", "the request: must have some of the fields body_a, body_b, "),
            ("[" * 3000, "collision_response call: the document is nested too deeply"),
            ("2001-02-30", "the request: must have some of the fields body_a, body_b, "),
            ("body_a: {inertia: {m: 1, m: 2}}", "'m' appears twice"),
            ("body_a: {inertia: {m: !!bool x}}", "cannot be read as bool"),
            ("body_a: {inertia: {m: !!int ''}}", "cannot be read as int"),
            ("body_a: {inertia: {m: !!timestamp x}}", "body_a.inertia.m: must be a number, is 'x'"),
            (f"body_a: {{motion_type: 1{'0' * 5000}}}", "cannot be read as int"),
            *(
                (request % f"0x{'f' * 5000}", says)
                for request, says in (
                    ("body_a: %s", "body_a: must have some of the fields "),
                    ("body_a: {motion_type: %s}", "body_a.motion_type: must be a uint8, is of more digits"),
                    ("body_a: {name: %s}", "body_a.name: must be text, is of more digits"),
                    ("body_a: {inertia: {m: %s}}", "body_a.inertia.m: must be a number, is of more digits"),
                    ("body_a: {inverse_inertia: %s}", "body_a.inverse_inertia: must be a list in brackets, "),
                )
            ),
            ("body_a: {motion_type: .inf}", "body_a.motion_type: must be a uint8, is inf"),
            (f"body_a: {{inertia: {{m: 1{'0' * 400}}}}}", "body_a.inertia.m: must be a number, is 1000"),
            ("body_a: {inertia: {m: true}}", "body_a.inertia.m: must be a number, is True"),
            ("body_a: {name: null}", "body_a.name: must be text, is None: write it in quotes"),
            ("body_a: {name: [a]}", "body_a.name: must be text, is ['a']: write it in quotes"),
            *((f'body_a: {{name: "{odd}"}}', "cannot be read as str") for odd in NO_TEXT),
            (r'body_a: {name: "a\0b"}', "body_a.name: must have no NUL character"),
            (
                f"body_a: {{inverse_inertia: {[1.0] * 37}}}",
                "body_a.inverse_inertia: must have 36 entries at most, has 37",
            ),
        ],
    )
    def test_an_invalid_request_names_the_field(self, call, request_, says):
        code, said, wrong = call(request_)
        assert (code, said) == (2, "")
        assert says in wrong

    def test_lists_must_hold_numbers(self, call):
        code, _, wrong = call("bodies: [1, two]", "ResolveScene", "scene")
        assert (code, wrong) == (2, "collision_response call: bodies[1]: must be a number, is 'two'\n")
        code, _, wrong = call("pairs: 3", "ResolveScene", "scene")
        assert (code, wrong) == (2, "collision_response call: pairs: must be a list in brackets, is 3\n")

    def test_an_articulated_body(self, call):
        """Unit mass and unit moments."""
        request = f"""
body_a: {{inverse_inertia: {[float(i % 7 == 0) for i in range(36)]}, twist: {{linear: {{z: -3}}}}}}
body_b: {{motion_type: 2.0}}
contact: {{normal: {{z: 1}}, restitution: 0.5}}"""
        code, said, wrong = call(request)
        assert (code, wrong) == (0, "")
        assert "(0, 0, 4.5)" in said

    def test_booleans(self, call):
        request = "{layout: POINT, report: %s}"
        assert call(request % "true", "ResolveCollisionBatch", "collision_batch")[::2] == (0, "")
        code, _, wrong = call(request % "1", "ResolveCollisionBatch", "collision_batch")
        assert (code, wrong) == (2, "collision_response call: report: must be true or false, is 1\n")

    @pytest.mark.parametrize("timeout", ["nan", "inf", "1e30", "-1", "soon"])
    def test_an_invalid_timeout_is_refused(self, capsys, timeout):
        with pytest.raises(SystemExit) as end:
            main(["call", "{}", "--timeout", timeout])
        assert end.value.code == 2
        assert "argument --timeout: " in capsys.readouterr().err

    def test_a_service_name_that_is_not_text_is_refused(self, capsys):
        with pytest.raises(SystemExit) as end:
            main(["call", "{}", "--service", "/\udcff"])
        assert end.value.code == 2
        assert "argument --service: invalid service_name value" in capsys.readouterr().err

    @pytest.mark.parametrize(
        ("name", "message"),
        [("a b", "Invalid service name"), ("{x}", "topic name '{x}' is invalid: unknown substitution: {x}")],
    )
    def test_an_invalid_service_name_is_refused(self, ros_domain, capsys, name, message):
        assert main(["call", "{}", "--service", name]) == 2
        (line,) = capsys.readouterr().err.splitlines()
        assert line.startswith(f"collision_response call: --service: {message}")

    def test_without_a_node_it_says_how_to_start_one(self, ros_domain, capsys):
        assert main(["call", "{}", "--service", "/nobody", "--timeout", "0.1"]) == 3
        assert "start the node with: collision_response node" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("command", "room"), [("node", "parameters"), ("states", "sources"), ("markers", "markers")]
)
def test_a_node_lists_its_parameters(capsys, command, room):
    pytest.importorskip("rclpy")
    declarations = import_module(f"collision_response.ros.{room}").DECLARATIONS
    assert main([command, "--help"]) == 0
    text = capsys.readouterr().out
    assert f"usage: collision_response {command} " in text
    assert all(
        re.search(rf"^  {re.escape(d.name)} +{re.escape(repr(d.default))}: ", text, re.MULTILINE)
        for d in declarations
    )
    assert command != "node" or " One of auto, frictionless, coulomb, " in text
