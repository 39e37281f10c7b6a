"""Commands of logs: export of a run, verdict with exit code and JSON, wide exports of a review."""

import json

import numpy as np
import pytest

import spheretwin as st
from spheretwin import cli, machine
from spheretwin.models.telemetry import joint_states
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
    assert cli.main(["simulate", "hold", *FLAGS, *map(str, arguments)]) == 0
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
    potentiometers, adcs = truth["sensors"]["stages"][:2]
    # The measured angle is that of the drawn residual, offset and gain, within noise of 0.02 degrees.
    (alpha, _), (adc, _) = potentiometers["channels"], adcs["channels"]
    phase = alpha["turns"] * run["q_rad"][:, 0, None] * np.arange(1, 1 + len(alpha["cosine_rad"]))
    residual = np.cos(phase) @ alpha["cosine_rad"] + np.sin(phase) @ alpha["sine_rad"]
    expected = (run["q_rad"][:, 0] + residual) * adc["gain"] + adc["offset_V"] / alpha["volts_per_rad"]
    errors = run["q_measured_rad"][:, 0] - expected
    # Mean of 1500 numbers of 0.35 mrad and of the conversion's 0.35 mrad: 0.013 mrad; five times that.
    assert abs(np.mean(errors)) < 7e-5
    assert np.std(errors) < 6e-4
    states = np.stack(
        [machine_column(files[1], f"q_rad_{axis}") for axis in joint_states.ANGLE_NAMES], axis=1
    )
    assert np.array_equal(states, run["q_rad"])


def machine_column(truth, name):
    import pyarrow.parquet

    return pyarrow.parquet.read_table(truth.with_suffix(".parquet"))[name].to_numpy()


def test_an_exported_log_is_accepted(files, capsys):
    assert cli.main(["log", "check", str(files[0])]) == 0
    assert capsys.readouterr().out.startswith(f"{files[0]}: accepted, 1500 rows, 1000 Hz\n")


def test_a_wrong_log_is_refused_with_advice(files, tmp_path, capsys):
    log = machine.read(files[0])
    machine.write(log.rows(0, 300), path := tmp_path / "short.csv")
    assert cli.main(["log", "check", str(path), "--json", "--accept", "gaps"]) == 1
    printed = capsys.readouterr()
    verdict = json.loads(printed.out)
    assert set(verdict) == {"accepted", "findings", "rows", "rate_Hz", "logs"}
    assert (verdict["accepted"], verdict["rows"]) == (False, 300)
    (finding,) = (finding for finding in verdict["findings"] if finding["severity"] == "error")
    assert set(finding) == {"name", "severity", "where", "advice"}
    assert finding["name"] == "lack-of-excitation"
    assert "accepted, but not found: gaps" in printed.err
    assert cli.main(["log", "check", str(path), "--accept", "lack-of-excitation"]) == 0
    assert cli.main(["log", "check", str(path), str(files[0]), "--json"]) == 1
    verdict = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert [entry["accepted"] for entry in verdict["logs"]] == [False, True]
    assert verdict["rows"] == 1800


def test_a_column_map_is_applied(tmp_path, capsys):
    log = multisine()
    names = ["t", "b", "a", "c", *(f"i{j}" for j in range(18))]
    raw = np.column_stack([1e3 * log.t_s, -np.degrees(log.angle_rad[:, [1, 0, 2]]), 1e3 * log.current_A])
    np.savetxt(path := tmp_path / "raw.csv", raw, delimiter=",", header=",".join(names), comments="")
    (columns := tmp_path / "map.toml").write_text(
        'time = {column = "t", unit = "ms"}\n'
        'angles = {columns = ["a", "b", "c"], unit = "deg", sign = [-1]}\n'
        'currents = {columns = ["i*"], unit = "mA"}\n'
    )
    assert cli.main(["log", "check", str(path), "--columns", str(columns)]) == 0
    assert cli.main(["log", "check", str(path)]) == 2
    assert "expected a column map (--columns MAP.toml)" in capsys.readouterr().err


@pytest.mark.release("1.2 s; changes with the library of MCAP")
@pytest.mark.parametrize("suffix", [".parquet", ".mcap"])
def test_a_review_exports_one_column_for_each_number(files, tmp_path, suffix, capsys):
    out = tmp_path / f"run{suffix}"
    assert cli.main(["review", str(files[2]), "--export", str(out)]) == 0
    run = st.read(files[2]).telemetry
    if suffix == ".parquet":
        again = st.read(out).telemetry
        assert again.signals == run.signals
        assert np.array_equal(again.values, run.values)
        return
    columns, metadata = joint_states.read(out)
    assert np.array_equal(columns["angles/position/gamma"], run["q_measured_rad"][:, 2])
    assert np.array_equal(columns["angles/velocity/beta"], run["qdot_estimated_rad_s"][:, 1])
    assert np.array_equal(columns["currents/effort/17"], run["current_command_A"][:, 17])
    assert np.array_equal(columns["telemetry/effort/q_rad_alpha"], run["q_rad"][:, 0])
    assert len(columns) == run.values.shape[1]
    assert json.loads(metadata["scenario"])["name"] == "hold"
    assert np.array_equal(machine.read(out).angle_rad, run["q_measured_rad"])


def test_a_run_that_gains_sensors_is_exported(tmp_path):
    log = tmp_path / "log.parquet"
    noise = (
        "--event.0.t-s",
        "0.02",
        "--event.0.set",
        "sensors.potentiometer.noise_rad",
        "--event.0.value",
        "0.01",
    )
    arguments = ["simulate", "hold", "--duration", "0.04", "--plant.engine", "lagrangian", *noise]
    assert cli.main([*arguments, "--export-log", str(log), "--telemetry", str(tmp_path / "run.parquet")]) == 0
    exported, run = machine.read(log), st.read(tmp_path / "run.parquet").telemetry
    assert np.array_equal(exported.angle_rad[:20], run["q_rad"][:20])
    assert np.array_equal(exported.angle_rad[20:], run["q_measured_rad"][20:])
    assert not np.array_equal(exported.angle_rad[20:], run["q_rad"][20:])
