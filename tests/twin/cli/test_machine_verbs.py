"""Verbs of a real machine: their output, files, JSON and exit codes."""

import json

import numpy as np
import pyarrow.parquet as pq
import pytest

from spheretwin.cli import main
from spheretwin.machine import write
from spheretwin.models.telemetry.table import read_parquet
from spheretwin.viz.recording.live import LivePage
from tests.twin.machine.machine_logs import KNOWN, SCENARIO, changing_log
from tests.viz.recording.panels import columns

pytestmark = pytest.mark.usefixtures("capsys")


def flags(fields):
    words = []
    for name, value in fields.items():
        words += [f"--{name}", *(map(str, value) if isinstance(value, list) else [str(value)])]
    return words


MACHINE = ["--scenario", SCENARIO, *flags(KNOWN)]


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    path = tmp_path_factory.mktemp("logs") / "log.parquet"
    write(changing_log(2.0, seed=2), path)
    return str(path)


def run(capsys, *words):
    code = main(list(words))
    captured = capsys.readouterr()
    return code, captured.out, captured.err


def test_shadow(log, tmp_path, capsys):
    telemetry, recording = tmp_path / "shadow.parquet", tmp_path / "shadow.rrd"
    words = ["--telemetry", str(telemetry), "--record", str(recording), "--accept", "jitter"]
    code, out, err = run(capsys, "shadow", log, *MACHINE, *words, "--json")
    figures = json.loads(out)
    assert (code, err) == (0, "")
    assert figures["rows"] == 2000
    assert figures["consistent"]
    assert 0 < figures["cpu_s_per_s"] < 10
    assert set(figures["chi2"]) == {"alpha", "beta", "gamma"}
    table, metadata = read_parquet(telemetry)
    assert len(table) == 2000
    innovation = np.sqrt(np.nanmean(table["innovation_rad"] ** 2, axis=0))
    assert np.allclose(figures["rms_innovation_rad"], innovation, rtol=1e-12)
    assert len(metadata["log_sha256"]) == 64
    assert figures["accepted_findings"] == json.loads(metadata["accepted_findings"]) == ["jitter"]
    assert recording.stat().st_size > 10_000
    code, out, _ = run(capsys, "shadow", log, *MACHINE, "--offsets")
    assert code == 0
    assert out.count("|") > 20


def test_shadow_with_the_wrong_machine_is_not_consistent(log, capsys):
    wrong = ["--plant.group_gain", *["-1"] * 18]
    code, _, err = run(capsys, "shadow", log, *MACHINE, *wrong, "--accept", "sign-of-groups")
    assert code in (1, 2)
    assert "not consistent" in err or "expected" in err


def test_identify_refuses_and_writes_nothing(log, tmp_path, capsys):
    twin = tmp_path / "twin.toml"
    wanted = ["--parameter", "torque_scale", "--parameter", "plant.group_gain"]
    code, out, err = run(capsys, "identify", log, *MACHINE, *wanted, "--out", str(twin), "--json")
    figures = json.loads(out)
    assert code == 1
    assert not figures["accepted"]
    assert "torque_scale" in figures["refused"][0]["parameters"]
    assert "cannot be distinguished" in err
    assert not twin.exists()


def test_a_twin_is_identified_validated_and_simulated(log, tmp_path, capsys):
    twin, wrong = str(tmp_path / "twin.toml"), ["--plant.coulomb_Nm", "0.003", "0.003", "0.003"]
    words = ["--parameter", "plant.coulomb_Nm", "--out", twin]
    code, out, _ = run(capsys, "identify", log, *MACHINE, *wrong, *words)
    assert code == 0
    assert "plant.coulomb_Nm.2" in out
    assert "smaller" in out
    accepted = ["--accept", "jitter", "--json"]
    code, out, _ = run(capsys, "validate", log, "--scenario", SCENARIO, "--twin", twin, *accepted)
    figures = json.loads(out)
    assert figures["accepted_findings"] == ["jitter"]
    assert figures["chi2"]["all"] == pytest.approx(1.0, abs=0.1)
    assert (
        33 <= len(figures["bins"]) <= 36
    )  # six of three hinges by angle and by rate, if a count changes there
    _sweep_over(twin, tmp_path, capsys)
    code, out, err = run(capsys, "validate", log, *MACHINE, *wrong)
    assert code == 1
    assert "the residuals show plant.coulomb_Nm" in err
    words = ["--twin", twin, "--duration", "0.01", "--json"]
    code, out, _ = run(capsys, "simulate", SCENARIO, *words)
    assert code == 0
    assert json.loads(out)["status"] == "completed"


def _sweep_over(twin, folder, capsys):
    study = folder / "study.toml"
    study.write_text(f'name = "study"\nscenario = "{SCENARIO}"\n[fields]\nduration = 0.002\n')
    words = ["--twin", twin, "--draws", "3", "--out", str(folder / "study"), "--json"]
    code, out, _ = run(capsys, "sweep", str(study), *words)
    figures = json.loads(out)
    assert (code, figures["rows"]) == (0, 3)
    friction_Nm = pq.read_table(figures["table"]).column("plant.coulomb_Nm").to_pylist()
    assert len({tuple(row) for row in friction_Nm}) == 3
    axis = '[[axis]]\nkind = "values"\nfield = "plant.coulomb_Nm.0"\nvalues = [0.001]\n'
    study.write_text(study.read_text() + axis)
    code, _, err = run(capsys, "sweep", str(study), *words)
    assert code == 2
    assert "expected no axis over a parameter of the twin, received plant.coulomb_Nm.0" in err


@pytest.mark.release("1 s and a viewer's server; tests/twin/machine has the figures")
def test_a_watch_without_alarms_and_one_that_is_too_short(log, tmp_path, capsys):
    short = tmp_path / "short.parquet"
    write(changing_log(2.4, seed=2), short)
    assert run(capsys, "watch", str(short), *MACHINE, "--json") == (0, "", "")
    code, out, err = run(capsys, "watch", log, *MACHINE)
    assert (code, out) == (1, "")
    assert "expected more than 2.1 s of data" in err


def test_watch_prints_a_line_of_json_for_each_alarm(tmp_path, capsys):
    path = tmp_path / "log.parquet"
    write(changing_log(3.0, (2.4, "sensors.angle_offset_rad", [2e-3, 0.0, 0.0])), path)
    code, out, err = run(capsys, "watch", str(path), *MACHINE, "--accept", "jitter")
    alarms = [json.loads(line) for line in out.splitlines()]
    assert code == 1
    assert alarms[0]["what"] == "sensors.angle_offset_rad.0"
    assert set(alarms[0]) == {"t_s", "what", "size", "unit", "confidence", "accepted_findings"}
    assert alarms[0]["accepted_findings"] == ["jitter"]
    assert "fewer than 0.1 in an hour" in err


@pytest.fixture
def pages(monkeypatch):
    """What viewers of live pages get that were open from the start, by the order of the pages."""
    readers, close = [], LivePage.close

    def read_and_close(page):
        readers.append(page._broadcast.read())
        close(page)

    monkeypatch.setattr(LivePage, "close", read_and_close)
    return readers


@pytest.mark.release("1 s and a viewer's server; tests/twin/machine has the figures")
def test_a_live_shadow_shows_the_log_and_has_the_figures_of_the_others(log, tmp_path, capsys, pages):
    words, received = [log, *MACHINE, "--json"], tmp_path / "live.rrd"
    _, plain, _ = run(capsys, "shadow", *words)
    _, live, err = run(capsys, "shadow", *words, "--live")
    assert err.startswith("watch: http://127.0.0.1:")
    plain, live = json.loads(plain), json.loads(live)
    assert {**live, "cpu_s_per_s": 0} == {**plain, "cpu_s_per_s": 0}
    received.write_bytes(b"".join(*pages))
    values, times = columns(received)
    assert sum(map(len, times["/plots/angle", "Scalars:scalars"])) == 120  # 2 s of 60 Hz
    (text,) = values["/verdict", "TextDocument:text"][-1].to_pylist()[0]
    assert f"| alpha | {plain['chi2']['alpha']:.3f} |" in text


@pytest.mark.release("1 s and a viewer's server; tests/twin/machine has the figures")
def test_a_live_watch_shows_windows_and_alarms(tmp_path, capsys, pages):
    path, received = tmp_path / "log.parquet", tmp_path / "live.rrd"
    write(changing_log(2.6, (2.4, "sensors.angle_offset_rad", [2e-3, 0.0, 0.0])), path)
    code, out, _ = run(capsys, "watch", str(path), *MACHINE, "--live")
    alarms = [json.loads(line) for line in out.splitlines()]
    received.write_bytes(b"".join(*pages))
    values, times = columns(received)
    texts = [row[0] for part in values["/watch/alarms", "TextLog:text"] for row in part.to_pylist()]
    assert code == 1
    assert [text.split()[0] for text in texts] == [alarm["what"] for alarm in alarms]
    assert "sensors.angle_offset_rad.0" in texts[0]
    assert len(np.concatenate(times["/watch/windows", "Scalars:scalars"])) == 25  # all complete ones
    windows = np.array(
        [row for part in values["/watch/windows", "Scalars:scalars"] for row in part.to_pylist()]
    )
    assert windows[:, 1].argmax() >= 23  # the sum exceeds its threshold after the change
    assert windows[:, 1].max() > 1


def test_design_writes_a_scenario_and_its_currents(tmp_path, capsys):
    scenario, currents = tmp_path / "design.toml", tmp_path / "design.csv"
    words = ["--parameter", "plant.coulomb_Nm", "--window", "1", "--candidates", "2"]
    files = ["--out", str(scenario), "--currents", str(currents)]
    code, out, _ = run(capsys, "identify", "--design", SCENARIO, *words, *files, *flags(KNOWN))
    assert code == 0
    assert "times narrower" in out
    code, out, _ = run(capsys, "simulate", str(scenario), "--manual.file", str(currents), "--json")
    assert code == 0
    assert json.loads(out)["status"] == "completed"
