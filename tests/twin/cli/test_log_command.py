"""Commands of logs: export of a run, verdict with exit code and JSON, wide exports of a review."""

import json

import numpy as np
import pyarrow.parquet as pq
import pytest

import spheretwin as st
from spheretwin import machine
from spheretwin.models.base.errors import InputError
from spheretwin.models.telemetry import joint_states
from tests.twin.cli.calls import call, refusal, succeeded
from tests.twin.machine.logs import MULTISINE, multisine

FLAGS = [
    "--hardware", "electronics", "--duration", "1.5", "--controller.law", "computed_torque",
    "--trajectory.shape", "multisine", "--plant.payload-kg", "0.02",
    *(f"--trajectory.components.{place}.{name.replace('_', '-')}={json.dumps(value)}"
      for place, component in enumerate(MULTISINE["trajectory.components"])
      for name, value in component.items()),
]  # fmt: skip


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """Log, truth and telemetry of one run."""
    folder = tmp_path_factory.mktemp("log")
    log, truth, telemetry = (folder / name for name in ("log.parquet", "truth.json", "run.parquet"))
    arguments = ["--export-log", log, "--export-truth", truth, "--telemetry", telemetry]
    succeeded("simulate", "hold", *FLAGS, *arguments)
    return log, truth, telemetry


def test_the_log_has_what_a_laboratory_records(files):
    log, run = machine.read(files[0]), st.read(files[2]).telemetry
    assert np.array_equal(log.t_s, run["t_s"])
    assert np.array_equal(log.angle_rad, run["q_measured_rad"])
    assert np.array_equal(log.current_A, run["current_command_A"])
    assert log.conditions == {"plant.payload_kg": 0.02}
    measured = {
        "angles": {"columns": [f"angle_rad_{axis}" for axis in joint_states.ANGLE_NAMES]},
        "currents": {"columns": ["current_measured_A_*"], "kind": "measured"},
    }
    assert np.array_equal(machine.read(files[0], measured).current_A, run["current_measured_A"])


def test_the_truth_has_parameters_drawn_errors_and_states(files):
    truth, run = json.loads(files[1].read_text()), st.read(files[2]).telemetry
    assert truth["scenario"]["plant"]["payload_kg"] == 0.02
    assert truth["plant"]["coulomb_Nm"] == [2e-3] * 3
    assert truth["plant"]["weight_moment_Nm"] == pytest.approx(0.02 * 9.81 * 0.1)
    stages = truth["sensors"]["stages"]
    potentiometers, adcs = stages["potentiometer"], stages["adc"]
    # The measured angle is that of the drawn residual, offset and gain, within noise of 0.02 degrees.
    (alpha, _), (adc, _) = potentiometers["channels"], adcs["channels"]
    phase = alpha["turns"] * run["q_rad"][:, 0, None] * np.arange(1, 1 + len(alpha["cosine_rad"]))
    residual = np.cos(phase) @ alpha["cosine_rad"] + np.sin(phase) @ alpha["sine_rad"]
    expected = (run["q_rad"][:, 0] + residual) * adc["gain"] + adc["offset_V"] / alpha["volts_per_rad"]
    errors = run["q_measured_rad"][:, 0] - expected
    # Mean of 1500 numbers of 0.35 mrad and of the conversion's 0.35 mrad: 0.013 mrad; five times that.
    assert abs(np.mean(errors)) < 7e-5
    assert np.std(errors) < 6e-4
    states = pq.read_table(files[1].with_suffix(".parquet"))
    for hinge, axis in enumerate(joint_states.ANGLE_NAMES):
        assert np.array_equal(states[f"q_rad_{axis}"].to_numpy(), run["q_rad"][:, hinge])


def test_a_wrong_log_is_refused_unless_its_finding_is_accepted(files, tmp_path):
    log, path = machine.read(files[0]), tmp_path / "short.csv"
    machine.write(log.rows(0, 300), path)
    result = call("log", "check", path, "--json", "--accept", "gaps")
    verdict = result.json
    assert (result.code, verdict["accepted"], verdict["rows"]) == (1, False, 300)
    (finding,) = (finding for finding in verdict["findings"] if finding["severity"] == "error")
    assert finding["name"] == "lack-of-excitation"
    assert "accepted, but not found: gaps" in result.err
    assert call("log", "check", path, "--accept", "lack-of-excitation").code == 0
    both = call("log", "check", path, files[0], "--json")
    assert (both.code, both.json["rows"]) == (1, 1800)
    assert [entry["accepted"] for entry in both.json["logs"]] == [False, True]
    digests = [log.rows(0, 300).digest, log.digest]
    assert [entry["log_sha256"] for entry in both.json["logs"]] == digests
    text = path.read_text()
    path.write_text(text.replace(repr(float(log.angle_rad[7, 0])), repr(float(log.angle_rad[7, 0]) + 1e-9)))
    assert machine.read(path).digest != digests[0]  # one digit of a file without a checksum


def test_a_column_map_is_applied(tmp_path):
    log = multisine()
    names = ["t", "b", "a", "c", *(f"i{j}" for j in range(18))]
    raw = np.column_stack([1e3 * log.t_s, -np.degrees(log.angle_rad[:, [1, 0, 2]]), 1e3 * log.current_A])
    np.savetxt(path := tmp_path / "raw.csv", raw, delimiter=",", header=",".join(names), comments="")
    (columns := tmp_path / "map.toml").write_text(
        'time = {column = "t", unit = "ms"}\n'
        'angles = {columns = ["a", "b", "c"], unit = "deg", sign = [-1]}\n'
        'currents = {columns = ["i*"], unit = "mA"}\n'
    )
    assert call("log", "check", path, "--columns", columns).code == 0
    assert "expected a column map (--columns MAP.toml)" in refusal("log", "check", path)


def test_a_failure_of_identifiability_does_not_replace_the_verdict(files, monkeypatch):
    def fail(*_):
        raise InputError("expected 0.2 s without gaps")

    monkeypatch.setattr("spheretwin.cli.log.identifiability", fail)
    result = call("log", "check", files[0])
    assert (result.code, result.out.splitlines()[0].split(":")[1]) == (0, " accepted, 1500 rows, 1000 Hz")
    assert "what it identifies is not known: expected 0.2 s without gaps" in result.out


def test_a_review_exports_the_same_telemetry(files, tmp_path):
    out = tmp_path / "run.parquet"
    succeeded("review", files[2], "--export", out)
    run, again = st.read(files[2]).telemetry, st.read(out).telemetry
    assert again.signals == run.signals
    assert np.array_equal(again.values, run.values)


@pytest.mark.release("1.2 s; changes with the library of MCAP")
def test_a_review_exports_joint_states(files, tmp_path):
    out = tmp_path / "run.mcap"
    succeeded("review", files[2], "--export", out)
    run = st.read(files[2]).telemetry
    _, columns, metadata, _ = joint_states.read(out)
    for name, signal, place in (
        ("angles/position/gamma", "q_measured_rad", 2),
        ("angles/velocity/beta", "qdot_estimated_rad_s", 1),
        ("currents/effort/17", "current_command_A", 17),
        ("telemetry/effort/q_rad_alpha", "q_rad", 0),
    ):
        assert np.array_equal(columns[name], run[signal][:, place])
    assert len(columns) == run.values.shape[1] - 1  # without the time
    assert json.loads(metadata["scenario"])["name"] == "hold"
    assert np.array_equal(machine.read(out).angle_rad, run["q_measured_rad"])


@pytest.mark.release("a process of 2 s without a compiler; runs that have sensors are exported in less")
@pytest.mark.uncompiled
def test_a_run_that_gains_sensors_is_exported(tmp_path):
    log, path = tmp_path / "log.parquet", tmp_path / "run.parquet"
    event = {"t-s": "0.02", "set": "sensors.potentiometer.noise_rad", "value": "0.01"}
    flags = [text for name, value in event.items() for text in (f"--event.0.{name}", value)]
    short = ["--duration", "0.04", "--plant.engine", "lagrangian", *flags]
    assert call("simulate", "hold", *short, "--export-log", log, "--telemetry", path).code == 0
    exported, run = machine.read(log), st.read(path).telemetry
    assert np.array_equal(exported.angle_rad[:20], run["q_rad"][:20])
    assert np.array_equal(exported.angle_rad[20:], run["q_measured_rad"][20:])
    assert not np.array_equal(exported.angle_rad[20:], run["q_rad"][20:])
