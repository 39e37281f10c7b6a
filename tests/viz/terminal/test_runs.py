"""Tables of a run's figures: status in the title, errors in mrad and degrees."""

import math
import subprocess
import sys
from pathlib import Path

import pytest
from rich.text import Text

from spheretwin.models.telemetry.status import Status
from spheretwin.viz.terminal import tables
from spheretwin.viz.terminal.runs import COLOURS, print_files, print_run, rerun_command

SUMMARY = {
    "scenario": {"name": "hold", "hardware": "electronics"},
    "status": "completed",
    "reason": None,
    "max_abs_error_rad": [math.radians(72.26), 0.0301, 1e-9],
    "rms_error_rad": [0.5, 0.01, 0.0],
    "tail_rms_error_rad": [0.5, 0.01, 0.0],
    "settling_time_s": [None, 0.276, 0.0],
    "max_abs_current_A": 8.0,
    "saturated_fraction": 0.105,
    "rms_torque_Nm": 0.244,
    "copper_loss_J": 67.85,
    "current_variation_A_s": 10.6,
    "simulated_s": 1.2234,
    "wall_s": 0.5,
    "realtime_factor": None,
    "notes": [],
    "warnings": [],
}


def printed(capsys, why=None, faults=(), **changed):
    print_run("pd", 10.0, {**SUMMARY, **changed}, band_rad=0.01, why=why, faults=faults)
    return capsys.readouterr().out.splitlines()


def cells(lines, name):
    (line,) = (line for line in lines if line.startswith(f"| {name} "))
    return [cell.strip() for cell in line.strip("|").split("|")][1:]


@pytest.fixture(autouse=True)
def piped(monkeypatch):
    monkeypatch.delenv("COLUMNS", raising=False)


def test_errors_are_printed_in_mrad_and_degrees(capsys):
    lines = printed(capsys)
    assert lines[0].rstrip() == "hold under pd, electronics hardware: completed"
    assert cells(lines, "largest") == ["1260 (72.3°)", "30.1 (1.72°)", "< 0.001 (< 0.001°)"]
    assert cells(lines, "settled to ±10 mrad after") == ["never", "0.276 s", "0 s"]


@pytest.mark.parametrize(
    ("status", "why", "title"),
    [
        (
            Status.LEFT_WORKSPACE,
            None,
            "hold under pd, electronics hardware: left_workspace at 1.223 s of 10 s",
        ),
        (
            Status.FAILSAFE,
            "a coil is too hot",
            "hold under pd, electronics hardware: failsafe at 1.223 s of 10 s, a coil is too hot",
        ),
        (Status.INTERRUPTED, None, "hold under pd, electronics hardware: interrupted at 1.223 s of 10 s"),
    ],
)
def test_the_title_of_a_run_that_failed_says_when_and_why(capsys, status, why, title):
    assert printed(capsys, status=str(status), why=why)[0].rstrip() == title


def test_a_failure_stands_out_in_a_terminal(capsys, monkeypatch):
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("TERM", "xterm")
    assert COLOURS[Status.LEFT_WORKSPACE.level] == "bold red"
    first = printed(capsys, status="left_workspace")[0]
    assert "\x1b[1;31m" in first
    assert Text.from_ansi(first).plain.startswith("hold under pd, electronics hardware: left_workspace")
    assert tables.terminal_console().is_terminal


def test_shares_have_three_digits_and_faults_a_line_each(capsys):
    faults = ("coil.07 open from 0.5 s, detected after 5 ms", "adc noise from 1 s, not detected")
    lines = printed(capsys, saturated_fraction=0.0096, realtime_factor=0.5, faults=faults)
    assert "largest current 8.00 A, the limit cut the torque at 0.960 % of the ticks" in lines
    assert "1.2234 s simulated in 0.500 s: 0.500 times real time" in lines
    assert [line for line in lines if line.startswith("fault")] == [f"fault {fault}" for fault in faults]


def _installed(folder, monkeypatch):
    """A Python with a viewer in one folder, as in a virtual environment."""
    (folder / "bin").mkdir()
    for name in ("python", "rerun"):
        (folder / "bin" / name).write_text('#!/bin/sh\necho "$@"\n')
        (folder / "bin" / name).chmod(0o755)
    monkeypatch.setattr(sys, "executable", str(folder / "bin" / "python"))
    return folder / "bin"


@pytest.mark.parametrize(
    ("activated", "inside", "start"),
    [(True, True, "rerun "), (False, True, "bin/rerun "), (False, False, "{folder}/bin/rerun ")],
)
def test_the_printed_command_opens_the_recording(tmp_path, monkeypatch, capsys, activated, inside, start):
    binaries = _installed(tmp_path, monkeypatch)
    (elsewhere := tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path if inside else elsewhere)
    usual = "/usr/bin:/bin"
    monkeypatch.setenv("PATH", f"{binaries}:{usual}" if activated else usual)
    print_files(Path("a run.rrd"), None)
    command = capsys.readouterr().out.splitlines()[-1].removeprefix("open it:").strip()
    assert command.startswith(start.format(folder=tmp_path))
    done = subprocess.run(command, shell=True, capture_output=True, text=True, check=True)
    assert done.stdout == "a run.rrd\n"


def test_without_a_viewer_next_to_python_its_name_is_printed(tmp_path, monkeypatch):
    monkeypatch.setattr(sys, "executable", str(tmp_path / "python"))
    assert rerun_command() == "rerun"
