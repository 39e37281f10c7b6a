"""The public API: `import spheretwin as st`, runs that are saved, read and converted."""

import json
import subprocess
import sys

import numpy as np
import pytest

import spheretwin as st
from spheretwin import cli
from spheretwin.models.base.errors import InputError

SHORT = {"duration": 0.05, "plant.engine": "lagrangian"}

LAW = """
from spheretwin import Law


def step(t, reference, measurement, parameters, state, torque):
    for axis in range(3):
        torque[axis] = parameters[0] * (reference[0, axis] - measurement[0, axis])


law = Law("proportional", step, [4.0], [])


def make(gain):
    return Law("made", step, [gain], [])
"""


@pytest.fixture(scope="module")
def run():
    return st.simulate("nutation", SHORT | {"controller.law": "afsm"})


@pytest.fixture
def own(tmp_path, monkeypatch):
    """An importable module with a law."""
    (tmp_path / "laws").mkdir()
    (tmp_path / "laws" / "proportional_law.py").write_text(LAW)
    monkeypatch.syspath_prepend(str(tmp_path / "laws"))
    monkeypatch.delitem(sys.modules, "proportional_law", raising=False)
    import proportional_law

    return proportional_law


def same(first, second):
    assert [signal.name for signal in first.signals] == [signal.name for signal in second.signals]
    assert first.values.tobytes() == second.values.tobytes()


def test_every_public_name_is_what_it_says():
    assert set(st.__all__) <= set(dir(st))
    for name in st.__all__:
        assert getattr(st, name) is not None
    assert st.__version__.count(".") == 2
    misspelt = "simulat"
    with pytest.raises(AttributeError, match="has no attribute 'simulat'; it has Bench, Law, LawParameters"):
        getattr(st, misspelt)


def test_importing_it_imports_no_heavy_package():
    heavy = "{'numpy', 'numba', 'mujoco', 'rerun', 'pydantic', 'scipy', 'pyarrow'}"
    script = f"import sys, spheretwin; assert not {heavy} & set(sys.modules); spheretwin.__version__"
    subprocess.run([sys.executable, "-c", script], check=True)


def test_a_run_by_name_is_that_of_its_scenario(run):
    assert isinstance(run, st.Run)
    scenario = st.load("nutation", SHORT)
    with st.Session(st.load("nutation", SHORT | {"controller.law": "afsm"})) as session:
        same(session.advance(50), run.telemetry)
    same(st.simulate(scenario, {"controller.law": "afsm"}).telemetry, run.telemetry)
    assert run.scenario.controller.law == "afsm"


@pytest.mark.parametrize("name", ["run.parquet", "run.rrd"])
def test_a_saved_run_is_read_again(run, tmp_path, name):
    again = st.read(run.save(tmp_path / name))
    same(again.telemetry, run.telemetry)
    assert again.status == run.status == "completed"
    assert again.scenario == run.scenario
    assert again.figures == run.figures
    # What was read is saved again, as the other kind too, with the same rows.
    for second in ("second.parquet", "second.rrd"):
        same(st.read(again.save(tmp_path / second)).telemetry, run.telemetry)


def test_a_saved_run_is_that_of_the_command_byte_for_byte_and_replays(run, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    run.save("saved.parquet")
    arguments = ["--duration", "0.05", "--plant.engine", "lagrangian", "--controller.law", "afsm", "--json"]
    assert cli.main(["simulate", "nutation", *arguments, "--telemetry", "written.parquet"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert {name: printed[name] for name in run.figures} == run.figures
    assert (tmp_path / "saved.parquet").read_bytes() == (tmp_path / "written.parquet").read_bytes()
    assert cli.main(["simulate", "--replay", "saved.parquet", "--telemetry", "again.parquet", "--json"]) == 0
    assert (tmp_path / "again.parquet").read_bytes() == (tmp_path / "saved.parquet").read_bytes()


def test_both_files_of_a_run_have_the_same_review(tmp_path):
    fault = {"target": "coil.07", "mode": "open", "start_s": 0.02}
    event = {"t_s": 0.03, "set": "disturbance.load", "value": 2.0}
    changes = {"duration": 0.05, "hardware": "electronics", "fault": [fault], "event": [event]}
    run = st.simulate("nutation", changes)
    telemetry, recording = run.save(tmp_path / "run.parquet"), run.save(tmp_path / "run.rrd")
    reviewed = st.review(telemetry, recording)
    first, second = reviewed.figures
    assert first["events"] == second["events"]
    assert len(first["events"]) >= 3
    assert {name for name in first if first[name] != second[name]} == {"path"}
    with pytest.raises(InputError, match="expected the file of a run, received none"):
        st.review()
    with pytest.raises(InputError, match="expected two runs or more for tolerances, received one"):
        st.review(telemetry, tolerance="gate")


def test_a_law_of_an_importable_file_is_replayed_also_after_the_file_moved(own, tmp_path, monkeypatch):
    run = st.simulate("hold", {"duration": 0.05}, law=own.law)
    assert run.scenario.controller.law == "proportional"
    (out := tmp_path / "out").mkdir()
    path = run.save(out / "run.parquet")

    def replay():
        again = out / "again.parquet"
        assert cli.main(["simulate", "--replay", str(path), "--telemetry", str(again), "--json"]) == 0
        same(st.read(again).telemetry, run.telemetry)

    replay()
    law = tmp_path / "laws" / "proportional_law.py"
    law.rename(out / law.name)
    replay()
    # One of the same name with another content is not taken for it.
    (out / law.name).write_text(LAW.replace("parameters[0] *", "2 * parameters[0] *"))
    assert cli.main(["simulate", "--replay", str(path), "--json"]) == 2
    read = st.read(path)
    same(read.telemetry, run.telemetry)
    assert read.scenario.controller.law.endswith("proportional_law.py:law")
    assert read.figures == run.figures


def test_it_converts_to_the_tables_of_other_packages(run):
    pandas, polars = pytest.importorskip("pandas"), pytest.importorskip("polars")
    pytest.importorskip("xarray")
    frame, dataset, arrow = run.to_pandas(), run.to_xarray(), run.to_arrow()
    assert isinstance(frame, pandas.DataFrame)
    np.testing.assert_array_equal(frame.index, run.telemetry["t_s"])
    np.testing.assert_array_equal(frame["q_rad_beta"], run.telemetry["q_rad"][:, 1])
    np.testing.assert_array_equal(frame["allocation_scale"], run.telemetry["allocation_scale"])
    assert len(frame.columns) == run.telemetry.values.shape[1] - 1
    table = run.to_polars()
    assert isinstance(table, polars.DataFrame)
    np.testing.assert_array_equal(table["error_rad"].to_numpy(), run.telemetry["error_rad"])
    np.testing.assert_array_equal(dataset["q_rad"].sel(q_rad_entry="γ"), run.telemetry["q_rad"][:, 2])
    assert dataset["q_rad"].attrs["units"] == "rad"
    assert arrow.num_rows == len(run.telemetry)


def test_a_law_that_no_file_holds_is_saved_and_read(own, tmp_path):
    run = st.simulate("hold", {"duration": 0.05}, law=own.make(3.0))
    again = st.read(run.save(tmp_path / "run.parquet"))
    same(again.telemetry, run.telemetry)
    assert again.scenario.controller.law == "made"


def test_a_page_of_a_run_has_a_figure_if_there_is_a_package_for_it(run, monkeypatch):
    assert run._repr_html_().count("<img ") == 1
    monkeypatch.setitem(sys.modules, "spheretwin.viz.figures.comparison", None)
    monkeypatch.delattr("spheretwin.viz.figures.comparison", raising=False)
    assert "<img " not in run._repr_html_()


def test_representations_name_scenario_and_law():
    assert repr(st.load("hold")) == "Scenario(hold: hold under afsm, ideal hardware, 3 s)"
    with st.Session(st.load("hold", SHORT)) as session:
        assert repr(session.law) == "Law(afsm: 19 parameters, 240 state numbers)"
