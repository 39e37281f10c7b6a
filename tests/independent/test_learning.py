"""Learned torque of the independent machine: cogging is found, and nothing on a machine without it."""

import numpy as np
import pytest

from spheretwin import machine
from spheretwin.machine.learning import learn, samples_of
from spheretwin.machine.parameters import Machine
from spheretwin.plant.learned_torque import write_arrays
from tests.independent.laboratory import DATA_SHEET, SCENARIO, read_log
from tests.independent.test_laboratory import ALIKE
from tests.requirements import needs_c_compiler, needs_posix

pytestmark = [
    needs_c_compiler,
    needs_posix,
    pytest.mark.release("20 s of fits; test_learned_torque has the torque and its range"),
]

MOTIONS = (
    ("amplitude=0.22,0.18,0.3", "frequency=0.53,0.71,0.43", "seed=2"),
    ("amplitude=0.25,0.22,0.25", "frequency=0.41,0.63,0.57", "seed=3"),
)
OTHER = "amplitude=0.2,0.2,0.28", "frequency=0.47,0.59,0.51", "seed=4"
COGGING_Nm, WINDOW_s, TURN = 0.01, 0.2, 4


def learned(path, cogging_Nm):
    """Result of two logs of 8 s, and the machines."""
    settings = ALIKE, f"cogging={cogging_Nm}"
    logs = [read_log(path, 8.0, *motion, *settings) for motion in MOTIONS]
    machines = [Machine(SCENARIO, DATA_SHEET)] * len(logs)
    return learn(logs, machines, WINDOW_s, TURN), logs[0], machines[0]


def test_nothing_is_learned_without_a_cause(tmp_path):
    result, *_ = learned(tmp_path / "log.csv", 0.0)
    assert not result.accepted
    assert not result.used.any()
    assert not result.arrays["weight_Nm"].any()


def test_cogging_is_learned_within_its_intervals_and_explains_another_motion(tmp_path):
    """The shadow's disturbance in another motion was 4.4, 4.9, 7.5 mN·m, and with it 2.5, 0.7, 0.7."""
    path = tmp_path / "log.csv"
    result, log, known = learned(path, COGGING_Nm)
    assert result.used.all()
    assert np.all(result.gain > 0.7)
    samples = samples_of(log, known.model, known, WINDOW_s, TURN)
    q = samples.q_rad
    true_Nm = COGGING_Nm * np.stack(
        [
            np.sin(6 * q[:, 0]) * np.cos(8 * q[:, 2]),
            np.sin(6 * q[:, 1]) * np.cos(8 * q[:, 2]),
            np.sin(8 * q[:, 2]),
        ],
        axis=1,
    )
    torque_Nm, half_Nm = result.interval(q, samples.qdot_rad_s, samples.coil_Nm)
    assert np.all(np.mean(np.abs(torque_Nm - true_Nm) < half_Nm, axis=0) > 0.9)

    file = tmp_path / "learned.npz"
    section = {"file": str(file), "sha256": write_arrays(file, result.arrays)}
    fields = {f"plant.learned_torque.{name}": value for name, value in section.items()}
    other = read_log(path, 4.0, *OTHER, ALIKE, f"cogging={COGGING_Nm}")
    shadows = [machine.shadow(other, SCENARIO, DATA_SHEET | more).telemetry for more in ({}, fields)]
    rms_Nm = [np.sqrt(np.mean(one["disturbance_estimated_Nm"][500:] ** 2, axis=0)) for one in shadows]
    assert np.all(rms_Nm[1] < 0.7 * rms_Nm[0])
    assert np.all(rms_Nm[1][1:] < 0.25 * rms_Nm[0][1:])
