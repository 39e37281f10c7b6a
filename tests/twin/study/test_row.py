"""What differs from row to row is what its scenario has; a row run alone gives the same figures."""

import json
import re
import shlex

import numpy as np
import pyarrow.parquet as parquet
import pytest

from spheretwin import cli, scenario
from spheretwin.metrics import METRICS
from spheretwin.models import actuator as actuators
from spheretwin.models.telemetry.table import read_parquet
from spheretwin.run import figures_of
from spheretwin.scenario import writing
from spheretwin.scenario.hardware import HARDWARE
from spheretwin.simulation import simulate
from spheretwin.study.grid import Grid
from spheretwin.study.row import Rows
from spheretwin.study.study import load
from tests.twin.study.cases import LOADS, SHORT, loads, run_rows, study, table, telemetry, values

FAULTS = (
    [],
    [{"target": "coil.07", "mode": "open"}],
    [{"target": "pot.alpha", "mode": "offset", "value": 0.02}],
)

LAW = """
def step(t, reference, measurement, parameters, state, torque):
    for axis in range(3):
        torque[axis] = 0.3 * (reference[0, axis] - measurement[0, axis])


def pull(run):
    return float(abs(run.telemetry["torque_command_Nm"]).max())


def ends(run):
    print("not among the figures")
    return {"status": str(run.status)}


def fails(run):
    if run.scenario.disturbance.load > 0:
        raise ValueError("too\\nmuch")
    return 1


def squares(run):
    return float("nan")
"""


@pytest.fixture
def mine(tmp_path):
    path = tmp_path / "mine.py"
    path.write_text(LAW)
    return path


def toml(chosen):
    return "\n".join(writing._table(chosen.model_dump(mode="json", exclude_none=True), ""))


def scenarios(chosen):
    rows = Rows(chosen)
    return [rows.scenario(row) for row in Grid(chosen)]


def test_each_row_has_its_values_and_what_the_study_says_of_all():
    chosen = loads(fields={"duration": 0.03, "plant.payload_kg": 0.01})
    for row, of_row in zip(Grid(chosen), scenarios(chosen), strict=True):
        plant = of_row.plant
        assert [of_row.disturbance.load, plant.modelling_error] == list(row.values.values())
        assert (of_row.duration, plant.payload_kg, of_row.seed) == (0.03, 0.01, row.seed)
        assert (of_row.controller.law, plant.engine) == (row.law["law"], "lagrangian")
    assert scenarios(chosen)[1].controller.surface_slope == (60.0, 60.0, 60.0)


def test_hardware_of_a_row_has_all_of_its_values():
    chosen = study(values("hardware", *HARDWARE), fields={"duration": 0.03})
    for row, of_row in zip(Grid(chosen), scenarios(chosen), strict=True):
        name = row.values["hardware"]
        whole = scenario.load("sinusoid", {"hardware": name, "duration": 0.03, "seed": row.seed})
        of_engine = whole.plant.model_copy(update={"engine": of_row.plant.engine})
        assert of_row == whole.model_copy(update={"plant": of_engine}), name


def test_an_entry_of_a_list_leaves_the_others():
    axes = [values("plant.coulomb_Nm.1", 0.0, 0.002), values("plant.group_gain.17", 0.9, 1.0)]
    chosen = study(*axes, fields={"duration": 0.02, "plant.group_gain": [1.0] * 18})
    friction = [each.plant.coulomb_Nm for each in scenarios(chosen)]
    assert friction == [(0, 0, 0), (0, 0, 0), (0, 0.002, 0), (0, 0.002, 0)]
    assert [each.plant.group_gain[16:] for each in scenarios(chosen)[:2]] == [(1.0, 0.9), (1.0, 1.0)]


def test_faults_are_an_axis(tmp_path):
    rows = run_rows(study(values("fault", *FAULTS), fast=False), tmp_path)
    assert [json.loads(row["fault"]) for row in rows] == list(FAULTS)
    assert [row["status"] for row in rows] == ["completed"] * 3
    assert len({tuple(row["rms_error_rad"]) for row in rows}) == 3


@pytest.mark.parametrize(
    ("field", "listed", "expected_type"),
    [
        ("disturbance.load", [0.5, 1.0], "double"),
        ("disturbance.load", [1, 2], "int64"),
        ("disturbance.load", [1, 2.5], "double"),
        ("disturbance.load", [1.0, "auto"], "string"),
        ("disturbance.load", [1, 2**70], "string"),
        ("plant.gravity_m_s2", [None, 1.62], "double"),
        ("nominal.inertia_kg_m2", [None, [3e-4, 3e-4, 3e-4]], "string"),
    ],
)
def test_columns_are_of_the_values_kind_and_empty_where_the_value_is_none(
    tmp_path, field, listed, expected_type
):
    rows = run_rows(study(values(field, *listed)), tmp_path)
    assert str(parquet.read_schema(tmp_path / "table.parquet").field(field).type) == expected_type
    texts = [each if each is None or isinstance(each, str) else json.dumps(each) for each in listed]
    assert [row[field] for row in rows] == (texts if expected_type == "string" else listed)
    assert [row["error"] is None for row in rows] == [each not in ("auto", 2**70) for each in listed]


def test_a_law_of_one_s_own_and_figures_of_one_s_own_are_found_beside_the_study(tmp_path, mine, monkeypatch):
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub" / "base.toml").write_text(
        'name = "base"\nduration = 0.02\n[trajectory]\nshape = "sinusoid"\n[controller]\nlaw = "afsm"\n'
        "surface_slope = [40.0, 40.0, 40.0]\n"
    )
    (tmp_path / "sub" / "study.toml").write_text(
        'name = "mine"\nscenario = "base.toml"\n'
        'metrics = ["rms_error_rad", "../mine.py:pull", "../mine.py:ends"]\n'
        '[[law]]\nlaw = "../mine.py:step"\n[[law]]\nlaw = "pd"\n'
        '[[axis]]\nfield = "disturbance.load"\nkind = "values"\nvalues = [0.0, 1.0]\n'
    )
    out = tmp_path / "out"
    rows = run_rows(load(str(tmp_path / "sub" / "study.toml")), out)
    assert [row["law"] for row in rows] == ["../mine.py:step", "pd"] * 2
    assert [json.loads(row["ends"]) for row in rows] == [{"status": "completed"}] * 4
    assert all(row["pull"] > 0 for row in rows)
    before = table(out)
    # From another folder it is the same study, and its journal is gone on with.
    for folder, name in ((tmp_path, "sub/study.toml"), (tmp_path / "sub", "study.toml")):
        monkeypatch.chdir(folder)
        run_rows(load(name), out)
        assert table(out) == before
    monkeypatch.setenv("HOME", str(tmp_path))
    run_rows(load("~/sub/study.toml"), out)
    assert table(out) == before


def test_files_among_the_values_are_found_beside_the_study(tmp_path):
    for name, end in (("a.csv", 0.1), ("b.csv", 0.2)):
        points = f"0,0,0,0\n0.5,{end},0,0\n1,{end},0,0\n"
        (tmp_path / name).write_text(f"t_s,alpha_rad,beta_rad,gamma_rad\n{points}")
    fields = {"duration": 0.05, "trajectory": {"shape": "waypoints", "file": "a.csv"}}
    chosen = study(values("trajectory.file", "a.csv", "b.csv"), fields=fields, folder=str(tmp_path))
    rows = run_rows(chosen, tmp_path / "out")
    assert [(row["trajectory.file"], row["error"]) for row in rows] == [("a.csv", None), ("b.csv", None)]
    assert rows[0]["max_abs_error_rad"] != rows[1]["max_abs_error_rad"]


def test_a_figure_that_fails_leaves_the_others_of_its_row(tmp_path, mine):
    metrics = ["rms_error_rad", f"{mine}:fails", f"{mine}:squares"]
    rows = run_rows(study(values("disturbance.load", 0.0, 1.0), metrics=metrics), tmp_path)
    assert [(row["status"], row["fails"]) for row in rows] == [("completed", 1.0), ("completed", None)]
    assert rows[1]["error"] == "metric fails: expected a figure, it raised ValueError: too much"
    assert len(rows[1]["rms_error_rad"]) == 3
    assert np.isnan(rows[0]["squares"])
    assert set(METRICS) & set(rows[0]) == {"rms_error_rad"}


def test_a_law_that_raises_is_a_row_with_its_error(tmp_path):
    law = tmp_path / "bad.py"
    law.write_text(
        "def step(t, reference, measurement, parameters, state, torque): raise ValueError('no more')"
    )
    rows = run_rows(study(law=[{"law": f"{law}:step"}, {"law": "pd"}]), tmp_path / "out")
    assert "no more" in rows[0]["error"]
    assert (rows[1]["status"], rows[1]["error"]) == ("completed", None)


def test_telemetry_of_chosen_rows_is_kept(tmp_path):
    chosen = loads(telemetry=[2, 3])
    rows = run_rows(chosen, tmp_path, threads=2)
    assert telemetry(tmp_path) == sorted(f"{rows[number]['key']}.parquet" for number in (2, 3))
    path = tmp_path / "telemetry" / f"{rows[3]['key']}.parquet"
    stored = read_parquet(path)[0]
    assert np.abs(stored["error_rad"]).max(axis=0).tolist() == rows[3]["max_abs_error_rad"]
    assert cli.main(["simulate", "--replay", str(path), "--telemetry", str(tmp_path / "again.parquet")]) == 0
    assert (tmp_path / "again.parquet").read_bytes() == path.read_bytes()


@pytest.mark.parametrize(
    "chosen",
    [
        {},
        {"axis": [*LOADS, values("fault", *FAULTS[1:])], "samples": 1, "fast": False},
        {"axis": [*LOADS, values("plant.coulomb_Nm.1", 0.0, 0.002)], "samples": 1},
        {"axis": [*LOADS, values("trajectory", {"shape": "hold"}, {"shape": "tilt"})], "samples": 1},
    ],
)
def test_a_row_alone_and_its_printed_command_give_the_same_figures(tmp_path, capsys, mine, chosen):
    fields = {"metrics": [*METRICS, f"{mine}:pull"], **chosen}
    source = tmp_path / "study.toml"
    a_study = loads(**fields)
    source.write_text(toml(a_study))
    assert load(str(source)).model_dump() == a_study.model_dump()
    for row in run_rows(a_study, tmp_path)[-2:]:
        assert cli.main(["sweep", str(source), "--row", row["key"], "--json"]) == cli.DONE
        alone = json.loads(capsys.readouterr().out)
        program, *words = shlex.split(alone["command"])
        assert program == "spheretwin"
        assert cli.main([*words, "--json"]) == cli.DONE
        printed = json.loads(capsys.readouterr().out)
        assert (alone["row"], alone["seed"]) == (row["row"], row["seed"])
        for name in ("status", *METRICS, "pull"):
            assert row[name] == alone[name] == printed[name]


def test_the_command_of_a_law_has_no_gain_of_the_scenario_s(tmp_path, capsys):
    base = tmp_path / "base.toml"
    base.write_text(
        'name = "base"\nduration = 0.02\ntrajectory = {shape = "hold"}\n'
        'controller = {law = "afsm", surface_slope = [40.0, 40.0, 40.0], period_s = 0.002}\n'
    )
    chosen = study(law=[{"law": "pd"}], scenario=str(base), fields={})
    (row,) = Grid(chosen)
    _, *words = shlex.split(Rows(chosen).command(row))
    assert cli.main([*words, "--json"]) == cli.DONE
    report = json.loads(capsys.readouterr().out)["scenario"]["controller"]
    assert (report["law"], report["period_s"]) == ("pd", 0.002)


def test_a_refused_row_alone_tells_why_and_its_command_is_refused_alike(capsys, tmp_path):
    source = tmp_path / "study.toml"
    axis = values("plant.payload_kg", 0.0, -1.0)
    source.write_text(toml(study(axis)))
    key = Grid(study(axis))[1].key
    assert cli.main(["sweep", str(source), "--row", key, "--json"]) == cli.FAILED
    alone = json.loads(capsys.readouterr().out)
    assert alone["status"] == "refused"
    _, *words = shlex.split(alone["command"])
    assert cli.main(words) == cli.BAD_INPUT
    assert capsys.readouterr().err.strip().removeprefix("spheretwin: ") == alone["error"]


def test_each_row_has_the_model_file_of_its_scenario(tmp_path):
    heavy = tmp_path / "heavy.xml"
    text = actuators.MJCF_PATH.read_text().replace('meshdir="', f'meshdir="{actuators.FOLDER}/')
    heavy.write_text(re.sub(r'diaginertia="2(\S+) 2(\S+) 2(\S+)"', r'diaginertia="3\1 3\2 3\3"', text))
    chosen = study(values("plant.mjcf", str(actuators.MJCF_PATH), str(heavy)), fields={"duration": 0.05})
    rows = run_rows(chosen, tmp_path / "out")
    shipped, changed = scenarios(chosen)
    alone = [figures_of(simulate(each))["rms_error_rad"] for each in (shipped, changed)]
    assert [row["rms_error_rad"] for row in rows] == alone
    light = changed.model_copy(update={"plant": shipped.plant})
    assert figures_of(simulate(light))["rms_error_rad"] != alone[1]


def test_a_row_that_cannot_be_set_up_leaves_the_others_together(monkeypatch):
    """A pose beyond the range of its hinge is refused when the row is set up, not when it is read."""
    poses = [0.0, 0.01, 9.0, 0.02, 0.03, 0.04, 0.05, 0.06]
    chosen = study(values("plant.initial_rad.0", *poses), fields={**SHORT, "plant.initial_rad": [0.0] * 3})
    sizes = []
    run_block = Rows._run_block
    monkeypatch.setattr(Rows, "_run_block", lambda self, of: (run_block(self, of), sizes.append(len(of)))[0])
    results = Rows(chosen).run(list(Grid(chosen)))
    assert [result.status for result in results] == ["completed"] * 2 + ["refused"] + ["completed"] * 5
    assert "expected a pose" in results[2].error
    assert sorted(sizes) == [2, 4]
