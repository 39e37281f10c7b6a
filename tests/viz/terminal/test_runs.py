"""A failed run in a terminal, and the command that opens its recording."""

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


def test_a_failure_stands_out_in_a_terminal(capsys, monkeypatch):
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("TERM", "xterm")
    assert COLOURS[Status.LEFT_WORKSPACE.level] == "bold red"
    print_run("pd", 10.0, {**SUMMARY, "status": "left_workspace"}, band_rad=0.01, why=None, faults=())
    first = capsys.readouterr().out.splitlines()[0]
    assert "\x1b[1;31m" in first
    assert Text.from_ansi(first).plain.startswith("hold under pd, electronics hardware: left_workspace")
    assert tables.terminal_console().is_terminal


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
