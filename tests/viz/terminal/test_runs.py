"""Tables of a run's figures: status in the title, errors in mrad and degrees."""

import math

import pytest
from rich.text import Text

from spheretwin.models.telemetry.status import Status
from spheretwin.viz.terminal import tables
from spheretwin.viz.terminal.runs import COLOURS, print_run

SUMMARY = {
    "scenario": {"name": "hold"},
    "status": "completed",
    "reason": None,
    "simulated_s": 1.2234,
    "max_abs_error_rad": [math.radians(72.26), 0.0301, 1e-9],
    "rms_error_rad": [0.5, 0.01, 0.0],
    "tail_rms_error_rad": [0.5, 0.01, 0.0],
    "settling_time_s": [None, 0.276, 0.0],
    "max_abs_current_A": 8.0,
    "saturated_fraction": 0.105,
    "rms_torque_Nm": 0.244,
    "copper_loss_J": 67.85,
    "current_variation_A_s": 10.6,
    "realtime_factor": None,
    "notes": [],
    "warnings": [],
}


def printed(capsys, **changed):
    print_run("pd", 10.0, {**SUMMARY, **changed})
    return capsys.readouterr().out.splitlines()


def cells(lines, name):
    (line,) = (line for line in lines if line.startswith(f"| {name} "))
    return [cell.strip() for cell in line.strip("|").split("|")][1:]


@pytest.fixture(autouse=True)
def piped(monkeypatch):
    monkeypatch.delenv("COLUMNS", raising=False)


def test_errors_are_printed_in_mrad_and_degrees(capsys):
    lines = printed(capsys)
    assert lines[0].rstrip() == "hold under pd: completed"
    assert cells(lines, "largest") == ["1260 (72.3°)", "30.1 (1.72°)", "< 0.001 (< 0.001°)"]
    assert cells(lines, "settled after") == ["never", "0.276 s", "0 s"]


@pytest.mark.parametrize(
    ("status", "reason", "title"),
    [
        (Status.LEFT_WORKSPACE, None, "hold under pd: left_workspace at 1.223 s of 10 s"),
        (
            Status.FAILSAFE,
            "a coil is too hot",
            "hold under pd: failsafe at 1.223 s of 10 s, a coil is too hot",
        ),
        (Status.INTERRUPTED, None, "hold under pd: interrupted at 1.223 s of 10 s"),
    ],
)
def test_the_title_of_a_run_that_failed_says_when_and_why(capsys, status, reason, title):
    assert printed(capsys, status=str(status), reason=reason)[0].rstrip() == title


def test_a_failure_stands_out_in_a_terminal(capsys, monkeypatch):
    monkeypatch.setenv("FORCE_COLOR", "1")
    monkeypatch.setenv("TERM", "xterm")
    assert COLOURS[Status.LEFT_WORKSPACE.level] == "bold red"
    first = printed(capsys, status="left_workspace")[0]
    assert "\x1b[1;31m" in first
    assert Text.from_ansi(first).plain.startswith("hold under pd: left_workspace")
    assert tables.terminal_console().is_terminal
