"""A file replays to the same bytes, or says why it does not."""

import json

import numpy as np
import pytest

from spheretwin import cli
from spheretwin.models.base.errors import InputError
from spheretwin.models.telemetry import parquet as telemetry_file
from spheretwin.models.telemetry.parquet import TelemetryFile
from spheretwin.models.telemetry.table import read_parquet
from spheretwin.records import replay
from spheretwin.records.provenance import record_of
from spheretwin.session import Session
from spheretwin.simulation import follow
from tests.twin.session_cases import plain_law, recorded

CHANGES = [
    (0, "disturbance.load", 1.0),
    (100, "controller.surface_slope", 60.0),
    (250, "plant.payload_kg", 0.05),
    (250, "plant.group_gain", np.linspace(0.8, 1.2, 18)),
    (333, "trajectory.amplitude_rad", (0.1, 0.2, 0.1)),
    (400, "allocation", "bounded"),
    (450, "state", {"q_rad": [0.1, -0.1, 0.5], "current_A": [0.1] * 18}),
    (600, "nominal.torque_scale", np.float64(0.9)),  # after the last tick: it acts on none, but was made
]


OF_COLUMNS = [
    (200, "controller.law", "pd"),
    (300, "plant.coulomb_Nm", [0.001, 0.001, 0.001]),
    (450, "controller.law", "adaptive_fuzzy"),
]


@pytest.mark.parametrize(("engine", "part_rows"), [("mujoco", 128), ("lagrangian", telemetry_file.PART_ROWS)])
@pytest.mark.parametrize("changes", [[], CHANGES, OF_COLUMNS], ids=["none", "many", "columns"])
def test_a_file_replays_to_the_same_bytes(engine, part_rows, changes, tmp_path, monkeypatch):
    monkeypatch.setattr(telemetry_file, "PART_ROWS", part_rows)
    _, parts = recorded(first := tmp_path / "a.parquet", changes, **{"plant.engine": engine})
    plan = replay.read(first)
    again = Session(plan.scenario)
    file = TelemetryFile(second := tmp_path / "b.parquet", again.signals, record_of(again).metadata())
    assert follow(again, plan.ticks, [file], journal=plan.journal) == "completed"
    file.close(record_of(again).metadata())
    assert second.read_bytes() == first.read_bytes()
    assert again.journal == plan.journal
    table, start = read_parquet(second)[0], 0
    for part in parts:
        for signal in part.signals:
            assert table[signal.name][start : start + len(part)].tobytes() == part[signal.name].tobytes()
        start += len(part)
    assert len(table) == start == 600


@pytest.mark.parametrize(
    "changes",
    [
        {"controller.law": "pd", "disturbance.load": 5.0},
        # A rotor of hardly any inertia is beyond every rate within a step.
        {"plant.modelling_error": -0.99999999},
    ],
    ids=["left_workspace", "diverged"],
)
def test_a_run_that_ended_by_itself_replays_to_its_end(changes, tmp_path, request, capsys):
    expected = request.node.callspec.id
    live, _ = recorded(first := tmp_path / "a.parquet", ticks=3000, **changes)
    assert live.status == expected
    assert live.tick < 3000
    second = tmp_path / "b.parquet"
    assert cli.main(["simulate", "--replay", str(first), "--telemetry", str(second), "--json"]) == 1
    assert json.loads(capsys.readouterr().out)["status"] == expected
    assert second.read_bytes() == first.read_bytes()


def refused(path):
    with pytest.raises(InputError) as refusal:
        replay.read(path)
    return str(refusal.value)


def test_a_law_that_a_file_does_not_hold_is_refused(tmp_path):
    recorded(path := tmp_path / "mine.parquet", law=plain_law(), ticks=20)
    assert "received one under mine" in refused(path)
    # One of the user's that has the name of a shipped one is still the user's.
    recorded(path := tmp_path / "named.parquet", law=plain_law("pd"), ticks=20)
    assert "received one under pd of the user's" in refused(path)
    for law, name in (("mine", "mine"), ("afsm", "afsm of the user's")):
        recorded(path, [(10, "controller.law", plain_law(law))], ticks=20)
        assert f"received one to {name} at tick 10" in refused(path)
