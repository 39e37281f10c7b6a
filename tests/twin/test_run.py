"""A run as JSON: the metrics of every run, and functions of the user's own among them."""

import json
import sys
from dataclasses import replace

import h5py
import numpy as np
import pytest
from scipy.io import loadmat

from spheretwin import scenario as scenarios
from spheretwin.analysis.recorded_run import read
from spheretwin.metrics import METRICS
from spheretwin.metrics.figures import Figures
from spheretwin.metrics.reduction import PlannedRun
from spheretwin.metrics.user_metrics import OTHER_KEYS
from spheretwin.models.base.errors import InputError
from spheretwin.models.telemetry.table import Table
from spheretwin.run import figures_of, summary
from spheretwin.session import Session
from spheretwin.simulation import follow, simulate


@pytest.fixture(scope="module")
def run():
    return simulate(scenarios.load("hold", {"duration": 0.2}))


def followed(ticks):
    """Summary of a session that was followed for some ticks."""
    with Session(scenarios.load("hold", {"duration": 0.2})) as session:
        figures = Figures(PlannedRun(session.initial_scenario, session.actuator, 200))
        status = follow(session, ticks, [figures])
        return summary(session, status, figures.values(), figures.warnings())


def test_a_summary_has_the_metrics_and_what_stands_beside_them(run):
    written = followed(200)
    assert set(written) == {*METRICS, *OTHER_KEYS}
    assert (written["status"], written["simulated_s"]) == ("completed", 0.2)
    assert written["realtime_factor"] == written["simulated_s"] / written["wall_s"]
    assert {name: written[name] for name in METRICS} == figures_of(run)  # followed or kept, it is one run
    json.dumps(written, allow_nan=False)


def test_a_run_without_a_row_has_no_figures():
    written = followed(0)
    assert [written[name] for name in METRICS] == [None] * len(METRICS)
    assert written["realtime_factor"] is None
    assert written["warnings"] == written["notes"] == []


def test_a_function_of_the_user_s_is_one_more_figure(run):
    own = {
        "highest_error_rad": lambda run: run.telemetry["error_rad"].max(axis=0),
        "groups": lambda run: np.int64(len(run.actuator.groups)),
        "ended": lambda run: {"status": run.status, "at_s": run.telemetry["t_s"][-1]},
    }
    figures = figures_of(run, own)
    assert figures["highest_error_rad"] == run.telemetry["error_rad"].max(axis=0).tolist()
    assert figures["groups"] == len(run.actuator.groups)
    assert figures["ended"] == {"status": "completed", "at_s": pytest.approx(0.199)}
    assert list(figures) == [*METRICS, *own]


def test_an_event_at_the_end_of_a_run_is_not_in_its_log(tmp_path):
    events = [{"t_s": t_s, "set": "disturbance.load", "value": t_s} for t_s in (0.02, 0.05)]
    run = simulate(scenarios.load("hold", {"duration": 0.05, "event": events}))
    log = read(run.save(tmp_path / "run.rrd")).log
    assert [t_s for t_s, _, text in log if "disturbance.load" in text] == [pytest.approx(0.02)]


def test_a_matlab_file_has_a_matrix_for_each_signal(run, tmp_path):
    loaded = loadmat(run.save(tmp_path / "run.mat"), simplify_cells=True)
    for signal in run.telemetry.signals:
        np.testing.assert_array_equal(loaded[signal.name], run.telemetry[signal.name], err_msg=signal.name)
        assert loaded["unit"][signal.name] == (signal.unit or [])
    assert json.loads(loaded["provenance"]["scenario"])["name"] == "hold"


def test_an_hdf5_file_has_a_data_set_for_each_signal_with_its_unit(run, tmp_path):
    with h5py.File(run.save(tmp_path / "run.h5")) as file:
        assert set(file) == {"provenance", *(signal.name for signal in run.telemetry.signals)}
        for signal in run.telemetry.signals:
            np.testing.assert_array_equal(file[signal.name], run.telemetry[signal.name], err_msg=signal.name)
            assert dict(file[signal.name].attrs)["unit"] == signal.unit
        assert json.loads(file["provenance/scenario"].asstr()[()])["name"] == "hold"


def test_without_h5py_an_hdf5_file_is_refused_with_its_extra(run, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "h5py", None)
    with pytest.raises(InputError, match="expected h5py for HDF5 files, which the extra hdf5 installs: "):
        run.save(tmp_path / "run.h5")
    assert not (tmp_path / "run.h5").exists()


def test_a_csv_file_loses_no_bit(run, tmp_path):
    table = np.genfromtxt(run.save(tmp_path / "run.csv"), delimiter=",", names=True)
    scalars = run.telemetry.scalars()
    assert list(table.dtype.names) == list(scalars)
    for name in scalars:
        np.testing.assert_array_equal(table[name], scalars[name], err_msg=name)


def test_a_plot_has_angles_errors_and_currents(run):
    figure = run.plot()
    angles, errors, currents = figure.axes
    np.testing.assert_array_equal(angles.lines[0].get_xdata(), run.telemetry["t_s"])
    assert [bool(axes.lines) for axes in (angles, errors, currents)] == [True] * 3


def test_a_run_without_a_tick_has_no_plot(run):
    empty = replace(run, telemetry=Table(run.telemetry.signals, run.telemetry.values[:0]))
    with pytest.raises(InputError, match="expected at least one tick to plot"):
        empty.plot()
    assert "<svg" not in empty._repr_html_()
