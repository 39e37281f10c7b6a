"""Verbs of a real machine: their output, files, JSON and exit codes."""

import argparse
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from spheretwin.cli.log_options import read_logs
from spheretwin.machine import read, write
from spheretwin.machine.twin_file import read_uncertainty
from spheretwin.models.base.errors import InputError
from spheretwin.models.telemetry.table import read_parquet
from spheretwin.scenario.writing import command_words
from spheretwin.viz.recording.live import LiveStream
from tests.twin.cli.calls import call, refusal, succeeded
from tests.twin.machine.machine_logs import KNOWN, SCENARIO, changing_log
from tests.viz.recording.panels import columns, series

MACHINE = ["--scenario", SCENARIO, *command_words("", KNOWN)[3:]]


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    path = tmp_path_factory.mktemp("logs") / "log.parquet"
    write(changing_log(2.0, seed=2), path)
    return str(path)


def test_shadow(log, tmp_path):
    telemetry, recording = tmp_path / "shadow.parquet", tmp_path / "shadow.rrd"
    words = ["--telemetry", telemetry, "--record", recording, "--accept", "jitter"]
    figures = json.loads(succeeded("shadow", log, *MACHINE, *words, "--json"))
    assert figures["rows"] == 2000
    assert figures["consistent"]
    assert 0 < figures["cpu_s_per_s"] < 10
    assert set(figures["chi2"]) == {"alpha", "beta", "gamma"}
    table, metadata = read_parquet(telemetry)
    assert len(table) == 2000
    innovation = np.sqrt(np.nanmean(table["innovation_rad"] ** 2, axis=0))
    assert np.allclose(figures["rms_innovation_rad"], innovation, rtol=1e-12)
    assert metadata["log_sha256"] == figures["log_sha256"] == read(log).digest
    assert figures["accepted_findings"] == json.loads(metadata["accepted_findings"]) == ["jitter"]
    assert recording.stat().st_size > 10_000
    result = call("shadow", log, *MACHINE, "--offsets")
    assert result.code == 0
    assert result.out.count("|") > 20


def test_shadow_with_the_wrong_machine_is_not_consistent(log):
    wrong = ["--plant.group_gain", *["-1"] * 18]
    refused = call("shadow", log, *MACHINE, *wrong)
    assert (refused.code, refused.out) == (1, "")
    assert "expected one that `spheretwin log check` accepts, received groups" in refused.err
    result = call("shadow", log, *MACHINE, *wrong, "--accept", "groups")
    assert (result.code, result.err) == (1, f"spheretwin: shadow: model and log {log} are not consistent\n")


def test_identify_refuses_and_writes_nothing(log, tmp_path):
    twin, wanted = tmp_path / "twin.toml", ["--parameter", "torque_scale", "--parameter", "plant.group_gain"]
    result = call("identify", log, *MACHINE, *wanted, "--out", twin, "--json")
    assert (result.code, result.json["accepted"]) == (1, False)
    assert "torque_scale" in result.json["refused"][0]["parameters"]
    assert "cannot be distinguished" in result.err
    assert not twin.exists()


def test_a_data_sheet_that_is_right_gives_a_covariance_and_a_page(log, tmp_path):
    twin, page = tmp_path / "twin.toml", tmp_path / "page.html"
    words = ["--parameter", "plant.coulomb_Nm", "--out", twin, "--report", page, "--json"]
    result = call("identify", log, *MACHINE, *words)
    assert (result.code, result.json["accepted"], result.json["nothing_to_correct"]) == (0, True, True)
    assert "nothing to correct" in result.err
    uncertainty = read_uncertainty(twin)
    value, (low, high), _, wider = result.json["parameters"]["plant.coulomb_Nm.0"].values()
    assert wider < 1.5
    assert 4 * uncertainty.covariance[0, 0] ** 0.5 == pytest.approx(high - low, rel=0.1)
    text = page.read_text(encoding="utf-8")
    for title in ("Data", "Excitation", "Parameters", "Residuals", "Refused", "What the model may lack"):
        assert f">{title}</h2>" in text
    assert text.count("<svg") == 3
    assert f'<td>plant.coulomb_Nm.0</td>\n<td style="text-align:right">{value:.5g}</td>' in text
    assert "each alone, the log determines" in text


def test_each_log_has_a_map_and_a_payload(tmp_path):
    raw = changing_log(1.0, seed=3)
    paths, maps = [tmp_path / name for name in ("a.csv", "b.csv")], [tmp_path / name for name in "ab"]
    for path, column_map, unit, factor in zip(paths, maps, ("rad", "deg"), (1.0, 180 / np.pi), strict=True):
        names = ["t", *(f"{unit}{axis}" for axis in "xyz"), *(f"{unit}_{group}" for group in range(18))]
        rows = np.column_stack([raw.t_s, factor * raw.angle_rad, raw.current_A])
        np.savetxt(path, rows, delimiter=";", header=";".join(names), comments="")
        column_map.write_text(
            f'time.column = "t"\nangles = {{columns = ["{unit}x", "{unit}y", "{unit}z"], unit = "{unit}"}}\n'
            f'currents.columns = ["{unit}_*"]\nconditions.plant.payload_kg = 0.2\n'
        )
    given = {
        "logs": paths,
        "columns": maps,
        "payload": [0.1, 0.05],
        "accept": ["lack-of-excitation"],
        "fields": [],
    }
    options = argparse.Namespace(**given, scenario=SCENARIO, twin=None)
    logs = read_logs(options)
    assert [log.conditions["plant.payload_kg"] for log in logs] == [0.1, 0.05]
    assert np.allclose(logs[0].angle_rad, logs[1].angle_rad, atol=1e-14)
    options.columns = maps * 2
    with pytest.raises(InputError, match="expected --columns once or for 2 logs, received 4 of them"):
        read_logs(options)


def test_a_twin_is_identified_validated_and_simulated(log, tmp_path):
    twin, wrong = tmp_path / "twin.toml", ["--plant.coulomb_Nm", "0.003", "0.003", "0.003"]
    result = call("identify", log, *MACHINE, *wrong, "--parameter", "plant.coulomb_Nm", "--out", twin)
    assert result.code == 0
    assert "plant.coulomb_Nm.2" in result.out
    assert "smaller" in result.out
    accepted = ["--accept", "jitter", "--json"]
    figures = call("validate", log, "--scenario", SCENARIO, "--twin", twin, *accepted).json
    assert figures["accepted_findings"] == ["jitter"]
    assert figures["log_sha256"] == read(log).digest
    assert figures["chi2"]["all"] == pytest.approx(1.0, abs=0.1)
    # Six of three hinges by angle, by rate and by time, if a count changes there.
    assert 48 <= len(figures["bins"]) <= 54
    _sweep_over(twin, tmp_path)
    result = call("validate", log, *MACHINE, *wrong)
    assert result.code == 1
    assert "the residuals show plant.coulomb_Nm" in result.err
    run = call("simulate", SCENARIO, "--twin", twin, "--duration", "0.01", "--json")
    assert (run.code, run.json["status"]) == (0, "completed")


def _sweep_over(twin, folder):
    study = folder / "study.toml"
    study.write_text(f'name = "study"\nscenario = "{SCENARIO}"\n[fields]\nduration = 0.002\n')
    words = ["sweep", study, "--twin", twin, "--draws", "3", "--out", folder / "study", "--json"]
    result = call(*words)
    assert (result.code, result.json["rows"]) == (0, 3)
    friction_Nm = pq.read_table(result.json["table"]).column("plant.coulomb_Nm").to_pylist()
    assert len({tuple(row) for row in friction_Nm}) == 3
    axis = '[[axis]]\nkind = "values"\nfield = "plant.coulomb_Nm.0"\nvalues = [0.001]\n'
    study.write_text(study.read_text() + axis)
    message = "expected no axis over a parameter of the twin, received plant.coulomb_Nm.0"
    assert message in refusal(*words)


def log_with_offset(path, duration_s):
    """Write a log of a machine whose sensor of alpha has an offset after 2.43 s."""
    write(changing_log(duration_s, (2.4317, "sensors.angle_offset_rad", [2e-3, 0.0, 0.0])), path)
    return path


@pytest.mark.release("1 s; tests/twin/machine/test_watching.py has the alarms")
def test_a_watch_without_alarms_and_one_that_is_too_short(log, tmp_path):
    short = tmp_path / "short.parquet"
    write(changing_log(2.4, seed=2), short)
    assert succeeded("watch", short, *MACHINE, "--json") == ""
    result = call("watch", log, *MACHINE)
    assert (result.code, result.out) == (1, "")
    assert "expected more than 2.1 s of data" in result.err


def test_watch_prints_a_line_of_json_for_each_alarm(tmp_path):
    path = log_with_offset(tmp_path / "log.parquet", 3.0)
    result = call("watch", path, *MACHINE, "--accept", "jitter")
    alarms = [json.loads(line) for line in result.out.splitlines()]
    assert result.code == 1
    assert alarms[0]["what"] == "sensors.angle_offset_rad.0"
    assert set(alarms[0]) == {
        *("t_s", "what", "size", "unit", "confidence", "onset_s", "lasted_s", "shares"),
        *("accepted_findings", "log", "log_sha256"),
    }
    assert alarms[0]["log_sha256"] == read(path).digest
    assert alarms[0]["accepted_findings"] == ["jitter"]
    assert "fewer than 0.1 in an hour" in result.err


def test_a_stream_that_the_twin_does_not_explain_warns_before_its_first_alarm(monkeypatch):
    log = changing_log(3.1, (2.1173, "plant.coulomb_Nm", [0.02] * 3), seed=2)
    log = replace(log, currents="measured", current_A=np.roll(log.current_A, 12, axis=0))  # late by 12 ms
    lines = []
    monkeypatch.setattr("spheretwin.cli.watch.print_json", lambda alarm: lines.append(alarm["what"]))
    monkeypatch.setattr("spheretwin.cli.watch.print_message", lines.append)
    blocks = [log.rows(first, first + 20) for first in range(0, len(log), 20)]
    monkeypatch.setattr("spheretwin.cli.log_options.streamed", lambda *_, **__: iter(blocks))
    assert call("watch", "udp://:0", *MACHINE).code == 1
    assert "times that of the noise" in lines[0]
    assert "or the currents are not measured (--currents)" in lines[0]
    assert len(lines) > 2  # false alarms, and the summary


@pytest.fixture
def pages(monkeypatch):
    """What viewers of live pages get that were open from the start, by the order of the pages."""
    readers, close = [], LiveStream.close

    def read_and_close(page):
        readers.append(page._broadcast.read())
        close(page)

    monkeypatch.setattr(LiveStream, "close", read_and_close)
    return readers


def test_a_watch_of_several_machines_ends_with_a_table(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    healthy, changed = "a.parquet", log_with_offset(Path("b.parquet"), 3.0)
    write(changing_log(2.5, seed=2), Path(healthy))
    result = call("watch", healthy, changed, *MACHINE)
    alarms = [line for line in result.out.splitlines() if line.startswith("{")]
    assert result.code == 1
    assert {json.loads(line)["log"] for line in alarms} == {str(changed)}
    first, second = (line for line in result.out.splitlines() if line.startswith(("| a.p", "| b.p")))
    assert [cell.strip() for cell in first.split("|")[2:-1]] == ["as its twin", "0", "none", "no history"]
    assert "changed" in second
    assert "2.43 s: sensors.angle_offset_rad.0" in second
    message = refusal("watch", healthy, "udp://:0", *MACHINE)
    assert "expected a stream or --live alone, received 2 machines" in message


@pytest.mark.release("1 s and a viewer's server; tests/twin/machine has the figures")
def test_a_live_watch_shows_windows_and_alarms(tmp_path, pages):
    path, received = log_with_offset(tmp_path / "log.parquet", 3.0), tmp_path / "live.rrd"
    result = call("watch", path, *MACHINE, "--live")
    alarms = [json.loads(line) for line in result.out.splitlines()]
    received.write_bytes(b"".join(*pages))
    values, _ = read = columns(received)
    texts = [row[0] for part in values["/watch/alarms", "TextLog:text"] for row in part.to_pylist()]
    assert result.code == 1
    assert [text.split()[0] for text in texts] == [alarm["what"] for alarm in alarms]
    assert "sensors.angle_offset_rad.0" in texts[0]
    _, windows = series(read, "watch/windows", "Scalars:scalars")
    assert len(windows) == 9  # all complete ones after the noise was measured
    assert windows[:, 1].argmax() >= 4  # the evidence exceeds its threshold after the change
    assert windows[:, 1].max() > 1


def test_design_writes_a_scenario_and_its_currents(tmp_path):
    scenario, currents = tmp_path / "design.toml", tmp_path / "design.csv"
    words = ["--parameter", "plant.coulomb_Nm", "--window", "1", "--candidates", "2"]
    files = ["--out", scenario, "--currents", currents]
    result = call("identify", "--design", SCENARIO, *words, *files, *command_words("", KNOWN)[3:])
    assert result.code == 0
    assert "times narrower" in result.out
    run = call("simulate", scenario, "--manual.file", currents, "--json")
    assert (run.code, run.json["status"]) == (0, "completed")
