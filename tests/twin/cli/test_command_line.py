"""The command under hostile arguments, in this process: an exit code, one line, never a traceback."""

import contextlib
import io
import os
import subprocess
import sys
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from spheretwin import cli
from spheretwin import scenario as scenarios
from spheretwin.cli import simulate
from spheretwin.models.base.errors import LONGEST_LINE
from spheretwin.scenario import reading
from spheretwin.scenario.reading import shipped


def called(*arguments):
    """Exit code, stdout and stderr."""
    stdout, stderr = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(stdout), contextlib.redirect_stderr(stderr):
        try:
            code = cli.main(arguments)
        except SystemExit as ended:  # --help and --version end in argparse
            code = ended.code
    return code, stdout.getvalue(), stderr.getvalue()


def refusal(*arguments):
    code, stdout, stderr = called(*arguments)
    assert (code, stdout) == (2, "")
    assert stderr.startswith("spheretwin: ")
    assert stderr.endswith("\n")
    assert stderr[:-1].isprintable()
    assert len(stderr) < LONGEST_LINE + 20
    return stderr[:-1]


def test_version_is_printed():
    assert called("--version") == (0, f"spheretwin {version('spheretwin')}\n", "")


@pytest.mark.parametrize(
    ("arguments", "parts"),
    [
        (["fly"], ["simulate", "magnetics", "fly"]),
        ([], ["VERB"]),
        (["simulate", "--json"], ["bench, hold, nutation, sinusoid, tilt, ventusff"]),
        (["simulate", "spiral"], ["bench, hold, nutation, sinusoid, tilt, ventusff", "spiral"]),
        (["simulate", "hold", "--controller.law", "pdd"], ["pd, pid, lqi", "'pdd'"]),
        (["simulate", "hold", "--controler.law", "pd"], ["controller", "controler"]),
        (["simulate", "hold", "--duration", "nan"], ["duration", "nan"]),
        (["simulate", "hold", "--duration", "Infinity"], ["duration", "inf"]),
        (["simulate", "hold", "--duration", "-2"], ["duration", "greater than 0", "-2"]),
        (["simulate", "hold", "--duration"], ["value", "duration"]),
        (["simulate", "hold", "7"], ["flag", "7"]),
        (["simulate", "hold", "--controller.period-s", "0.0007"], ["whole multiple"]),
        (["simulate", "hold", "--record", "missing/run.rrd"], ["writable", "missing"]),
        (["simulate", "hold", "--telemetry", "."], ["file name", "folder"]),
        (["simulate", "hold", "--plant.mjcf", "broken.xml"], ["broken.xml", "MJCF"]),
        (["simulate", "hold", "--plant.mjcf", "empty.xml"], ["three degrees of freedom", "0"]),
        (["simulate", "hold", "--plant.initial-rad", "0", "1.6", "0"], ["expected a pose with", "1.6"]),
        (["simulate", "hold", "--plant.step-s", "1e-12"], ["step_s", "1e-12"]),
        (["simulate", "hold", "--trajectory.angle-rad", "1e200", "0", "0"], ["angle_rad", "1e+200"]),
        (["simulate", "hold", "--record", "same", "--telemetry", "./same"], ["separate path", "twice"]),
        (["simulate", "hold", "--seed", "9" * 5000], ["seed"]),
        (["simulate", "hold", "--plant.mjcf", "missing.xml"], ["missing.xml"]),
        (["simulate", "hold", "--plant.torque-curve", "broken.csv"], ["phi_deg", "broken.csv"]),
        (["simulate", "hold", "--plant.torque-curve", "nan.csv"], ["finite", "nan.csv"]),
        (["simulate", "scenario.toml"], ["trajectory"]),
        (["simulate", "hold", "--seed", "1", "--seed", "2"], ["expected --seed once, received it 2 times"]),
        (["simulate", "hold", "--seed=1", "--seed=1"], ["expected --seed once"]),
        (["simulate", "hold", "--drive.delay-s", "0", "--drive.delay_s", "0"], ["--drive.delay-s once"]),
        (["simulate", "hold", "--json", "--json"], ["expected --json once"]),
        (["simulate", "hold", "--record", ""], ["expected a value after --record, received an empty text"]),
        (["sweep", "paper", "--row", ""], ["expected a value after --row, received an empty text"]),
        (["sweep", "paper", "--out", ""], ["expected a value after --out, received an empty text"]),
        (["sweep", "paper", "--out=", "--json"], ["expected a value after --out"]),
        (["sweep", "paper", "--limit", "1", "--limit", "2"], ["expected --limit once"]),
        (["reproduce", "figure6", "--out", ""], ["expected a value after --out"]),
        (["review", "a.parquet", "--tolerance", ""], ["expected a value after --tolerance"]),
        (["bench", "--port", "abc"], ["expected a port from 0 to 65535, received abc"]),
        (["bench", "--hold-after", "x"], ["expected a time from 0 s on, received x"]),
        (["crosscheck", "--states", "x"], ["expected a number of states from 1 to", "received x"]),
        (["magnetics"], ["PART"]),
        (["magnetics", "curve", "--colour", "red"], ["--out", "--colour"]),
    ],
)
def test_bad_input_is_one_line_exit_2_and_no_file(tmp_path, monkeypatch, arguments, parts):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "broken.xml").write_text("<mujoco><worldbody>")
    (tmp_path / "empty.xml").write_text("<mujoco/>")
    (tmp_path / "broken.csv").write_text("angle,torque\n0,0\n")
    rows = "\n".join(f"{angle},nan" for angle in np.linspace(0, 180, 10))
    (tmp_path / "nan.csv").write_text(f"phi_deg,torque_Nm_per_A\n{rows}\n")
    (tmp_path / "scenario.toml").write_text("duration = 1\n")
    before = sorted(os.listdir(tmp_path))
    outputs = ["--record", "run.rrd", "--telemetry", "run.parquet"]
    asks_for_files = arguments[:1] == ["simulate"] and not set(outputs[::2]) & set(arguments)
    line = refusal(*arguments, *(outputs if asks_for_files and len(arguments) > 1 else []))
    for part in parts:
        assert part in line
    assert sorted(os.listdir(tmp_path)) == before


# Linux alone has this device. Elsewhere only a disk that is really full would fail so, and no test fills one.
@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no device that is always full")
def test_a_full_disk_behind_stdout_is_a_failure_and_no_bad_input():
    with Path("/dev/full").open("w") as full:
        command = [sys.executable, "-m", "spheretwin", "explain", "plant.step_s"]
        done = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, check=False)
    assert done.returncode == cli.FAILED
    (line,) = done.stderr.splitlines()
    assert line.startswith("spheretwin: output: ")


def test_the_verb_alone_lists_the_scenarios_a_line_each():
    code, stdout, stderr = called("simulate")
    assert code == cli.BAD_INPUT
    lines = stdout.splitlines()
    assert [line.split()[0] for line in lines] == [
        "bench",
        "hold",
        "nutation",
        "sinusoid",
        "tilt",
        "ventusff",
    ]
    assert all(line.endswith(".") and len(line) > 30 for line in lines)
    assert stderr.count("\n") == 1


LONG = "x" * 20_000


@pytest.mark.parametrize(
    ("arguments", "parts"),
    [
        (["hold", "--seed", "9" * 5000], ["seed: expected a whole number, received '99", "…"]),
        (["hold", "--seed", "9" * 100_000], ["seed: expected a whole number"]),
        ([f"{LONG}.toml"], ["expected a readable TOML file", "…"]),
        ([LONG], ["nutation", "…"]),
        (["hold", "--record", LONG], ["File name too long"]),
        (["hold", "--telemetry", f"/{'d/' * 20_000}x"], ["File name too long"]),
        (["hold", "--plant.mjcf", LONG], ["expected an MJCF file"]),
        (["hold", "--plant.torque-curve", LONG], ["expected a readable text file"]),
        (["hold", "--name", "a\nb"], ["without control characters", r"'a\nb'"]),
        (["hold", "--name", "\x1b[2J"], [r"'\x1b[2J'"]),
        (["hold", "--\x1b[2J", "1"], [r"\x1b[2J"]),
        (["hold", "--record", "a\x1bb.rrd"], [r"'a\x1bb.rrd'"]),
        (["hold", "--record", "a\udcff.rrd"], [r"'a\udcff.rrd'"]),
        (["a\0b.toml"], [r"'a\x00b.toml'"]),
        ([""], ["nutation", "received ''"]),
        (["hold", "--seed="], ["seed", "received ''"]),
        (["hold", "--="], ["such as controller.law, received ''"]),
        (["hold", "--a..b", "1"], ["such as controller.law, received 'a..b'"]),
        (["hold", "--controler.law", "pd"], ["controler; did you mean controller?"]),
        (["hold", "--controller.law", "afsn"], ["did you mean afsm?"]),
        (["nutatio"], ["did you mean nutation?"]),
        (["hold", "--plant", "[" * 100_000], ["plant"]),
        (["hold", f"--{'a.' * 5000}a", "1"], ["scenario hold"]),
    ],
)  # fmt: skip
def test_hostile_arguments_are_refused_on_one_line(arguments, parts):
    line = refusal("simulate", *arguments)
    for part in parts:
        assert part in line


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
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(simulate, "Session", _not_run)
        return called("simulate", source, *arguments)


def _not_run(scenario):
    raise AssertionError("a run began, although an argument asks for help or is invalid")


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
