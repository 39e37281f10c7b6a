"""Refused calls: the message of each is the one in refusals.txt, and no file is written."""

import os
import shlex
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from spheretwin.models.actuator import TORQUE_CURVE_PATH
from spheretwin.models.telemetry.joint_states import ANGLE_NAMES
from tests.twin.cli.calls import refusal

LINES = Path(__file__).with_name("refusals.txt").read_text(encoding="utf-8").splitlines()
MESSAGES = [(line[2:], message) for line, message in pairwise(LINES) if line.startswith("$ ")]

COLUMNS = [
    "t_s",
    *(f"angle_rad_{axis}" for axis in ANGLE_NAMES),
    *(f"current_command_A_{j}" for j in range(18)),
]
ZEROS = ",".join(["0"] * 21)

FILES = {
    "taken": "",
    "mine.py": "def largest(run): pass\ndef max_abs_error_rad(run): pass",
    "other.py": "def status(run): pass",
    "empty.xml": "<mujoco/>",
    "broken.csv": "angle,torque\n0,0\n",
    "nan.csv": "\n".join(["phi_deg,torque_Nm_per_A", *(f"{deg},nan" for deg in np.linspace(0, 180, 10))]),
    "curve.csv": TORQUE_CURVE_PATH.read_text(encoding="utf-8"),
    "log.csv": "t,a\n0,0\n1,0\n",
    "whole.csv": "\n".join([",".join(COLUMNS), f"0,{ZEROS}", f"0.001,{ZEROS}", ""]),
    "scenario.toml": "duration = 1\n",
}


@pytest.mark.parametrize(("command", "message"), MESSAGES, ids=[command for command, _ in MESSAGES])
def test_a_refused_call_has_its_message_and_writes_no_file(command, message, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name, text in FILES.items():
        Path(name).write_text(text, encoding="utf-8")
    arguments = shlex.split(command)
    assert refusal(*arguments).replace(f"{tmp_path.resolve()}{os.sep}", "") == message
    assert {name: Path(name).read_text(encoding="utf-8") for name in os.listdir()} == FILES
