"""The command under hostile arguments, in this process: an exit code, one line, never a traceback."""

import subprocess
import sys
from importlib.metadata import version
from pathlib import Path
from unittest.mock import patch

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from spheretwin import cli
from spheretwin import scenario as scenarios
from spheretwin.cli import simulate
from spheretwin.scenario import reading
from spheretwin.scenario.reading import shipped
from tests.twin.cli.calls import call, refusal


def test_version_is_printed():
    assert call("--version") == (0, f"spheretwin {version('spheretwin')}\n", "")


# Linux alone has this device. Elsewhere only a disk that is really full would fail so, and no test fills one.
@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device that is always full")
def test_a_full_disk_behind_stdout_is_a_failure_and_no_bad_input():
    with Path("/dev/full").open("w") as full:
        command = [sys.executable, "-m", "spheretwin", "explain", "plant.step_s"]
        done = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, check=False)
    assert done.returncode == cli.FAILED
    (line,) = done.stderr.splitlines()
    assert line.startswith("spheretwin: output: ")


LONG = "x" * 20_000


@pytest.mark.parametrize(
    ("arguments", "part"),
    [
        (["hold", "--seed", "9" * 5000], "seed: expected a whole number, received '99"),
        (["hold", "--seed", "9" * 5000], "…"),
        (["hold", "--seed", "9" * 100_000], "seed: expected a whole number"),
        ([f"{LONG}.toml"], "expected a readable TOML file, File name too long"),
        ([LONG], "…"),
        (["hold", "--record", LONG], "File name too long"),
        (["hold", "--telemetry", f"/{'d/' * 20_000}x"], "File name too long"),
        (["hold", "--plant.mjcf", LONG], "expected an MJCF file"),
        (["hold", "--plant.mjcf", "broken.xml"], "model broken.xml: expected valid MJCF"),
        (["hold", "--plant.torque-curve", LONG], "expected a readable text file"),
        (["hold", "--name", "\x1b[2J"], r"'\x1b[2J'"),
        (["hold", "--\x1b[2J", "1"], r"\x1b[2J"),
        (["hold", "--record", "a\x1bb.rrd"], r"'a\x1bb.rrd'"),
        (["hold", "--record", "a\udcff.rrd"], r"'a\udcff.rrd'"),
        (["a\0b.toml"], r"'a\x00b.toml'"),
        (["hold", "--plant", "[" * 100_000], "plant"),
        (["hold", f"--{'a.' * 5000}a", "1"], "scenario hold"),
    ],
)
def test_hostile_arguments_are_refused_on_one_line(arguments, part, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("broken.xml").write_text("<mujoco><worldbody>")
    assert part in refusal("simulate", *arguments)


NAMES = [flag for flag, *_ in reading.field_descriptions(scenarios.load("nutation"))]
VALUES = ["0", "-1", "1e999", "nan", "9" * 5000, "true", "null", "[1,2,3]", '{"a": 1}', "pd", "", LONG]

flag = st.sampled_from(NAMES) | st.sampled_from(["--", "-", "--=", "---", "--a..b", "--live", "--json", "-x"])
flag |= st.text(max_size=8).map(lambda text: f"--{text}")
value = st.sampled_from(VALUES) | st.text(st.characters(), max_size=12) | st.floats().map(repr)
valid = st.sampled_from(["--seed=3", "--duration=2", "--controller.law=pd", "--name=a", "--json", "--live"])
argument = valid | flag | value | st.builds(lambda name, text: f"{name}={text}", flag, value)
scenario = st.sampled_from(["hold", *shipped(), "nutatoin", "none.toml"]) | value
refused = st.sampled_from(["--duration=-1", "--no.such.field=1"])


def ended(source, *arguments):
    """Exit code, stdout and stderr of a command that may not come as far as to run."""
    run = AssertionError("a run began, although an argument asks for help or is invalid")
    with patch.object(simulate, "Session", side_effect=run):
        return call("simulate", source, *arguments)


# 150 examples each: some seconds.
@settings(max_examples=150)
@given(scenario, st.lists(valid, max_size=6) | st.lists(argument, max_size=6), refused)
def test_any_arguments_before_one_that_is_invalid_are_refused_on_one_line(source, arguments, last):
    code, stdout, stderr = ended(source, *arguments, last)
    assert (code, stdout) == (2, "")
    assert stderr.endswith("\n")
    assert stderr[:-1].isprintable()


@settings(max_examples=60)
@given(st.sampled_from(shipped()), st.lists(valid, max_size=6))
def test_help_is_given_whatever_else_is_asked(source, arguments):
    code, stdout, stderr = ended(source, *arguments, "--help")
    assert (code, stderr) == (0, "")
    assert "--controller.law" in stdout
