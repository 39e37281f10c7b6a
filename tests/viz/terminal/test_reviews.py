"""Reports of recorded runs: sizes of differences, fields, nominal models, tolerances."""

import pytest

from spheretwin.viz.terminal import reviews
from spheretwin.viz.terminal.reviews import NominalError, SignalTolerance, differences, print_comparison

AXES = {
    "max_abs_error_rad": [0.03, 0.02, 0.01],
    "rms_error_rad": [0.01, 0.01, 0.01],
    "tail_rms_error_rad": [0.01, 0.01, 0.01],
    "overshoot_rad": [None, None, None],
    "settling_time_s": [0.3, None, 0.0],
}
RUN = {
    "path": "a.parquet",
    "scenario": "hold",
    "law": "pd",
    "modelling_error": 0.2,
    "load": 1.0,
    "hardware": "ideal",
    "seed": 0,
    "status": "completed",
    "reason": None,
    "simulated_s": 1.0,
    **AXES,
    "max_abs_current_A": 2.0,
    "saturated_fraction": 0.0096,
    "rms_torque_Nm": 0.1,
    "current_variation_A_s": 3.0,
    "copper_loss_J": 4.0,
    "mechanical_work_J": 0.001,
    "energy_J": 4.001,
}


@pytest.fixture(autouse=True)
def piped(monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")


def cell(key, value):
    """Second cell of the row of a figure, if the second run has this value."""
    rows = {label: cells for label, *cells in differences([RUN, {**RUN, key: value}], 0.01)}
    labels = {
        "max_abs_current_A": "largest current",
        "saturated_fraction": "share of ticks at the limit",
        "mechanical_work_J": "work on the rotor",
        "max_abs_error_rad": "largest α",
    }
    return rows[labels[key]][1]


@pytest.mark.parametrize(
    ("key", "value", "text"),
    [
        ("max_abs_current_A", 2.0, "the same"),
        ("max_abs_current_A", 2.0 - 4e-7, "2.00 A\n-4.00e-07 A, -2.00e-05 %"),
        ("max_abs_current_A", 2.5, "2.50 A\n+0.500 A, +25.0 %"),
        ("max_abs_current_A", None, "–"),
        ("mechanical_work_J", 7.671, "7.67 J\n+7.67 J, 7670 times"),
        ("mechanical_work_J", -0.05, "-0.0500 J\n-0.0510 J"),
        ("saturated_fraction", 0.01, "1.00 %\n+0.0400 %, +4.17 %"),
        ("max_abs_error_rad", [0.015, 0.02, 0.01], "15.0 (0.859°)\n-15.0 (0.859°), -50.0 %"),
    ],
)
def test_differences_have_sizes_that_can_be_read(key, value, text):
    assert cell(key, value) == text


def test_shares_are_percent_and_the_band_of_the_settling_time_is_stated():
    rows = {label: cells for label, *cells in differences([RUN], 0.01)}
    assert rows["share of ticks at the limit"] == ["0.960 %"]
    assert rows["settled to ±10 mrad after α"] == ["0.300 s"]
    assert rows["settled to ±10 mrad after β"] == ["–"]


def table_rows(text):
    return [
        [cell.strip() for cell in line.strip("|").split("|")] for line in text.splitlines() if "|" in line
    ]


def test_differing_fields_and_nominal_models_are_printed(capsys):
    runs = [RUN, {**RUN, "path": "b.parquet", "law": "pid", "load": 2.0}]
    shared, alone = NominalError("nominal.x", "1", "2"), NominalError("nominal.y", "3", "4")
    fields = {"law": ["pd", "pid"], "L": ["1", "2"]}
    print_comparison(runs, fields, [[shared], [shared, alone]], 0.01)
    out = capsys.readouterr().out
    rows = table_rows(out)
    for row in (
        ["field", "a.parquet", "b.parquet"],
        ["law", "pd", "pid"],
        ["L", "1", "2"],
        ["nominal.x", "all", "1", "2"],
        ["nominal.y", "b.parquet", "3", "4"],
    ):
        assert row in rows
    assert "in all runs: scenario hold, modelling_error 0.2, hardware ideal, seed 0" in out
    print_comparison([RUN, RUN], {}, [[], []], 0.01)
    out = capsys.readouterr().out
    assert "The scenarios of the runs do not differ." in out
    assert "truth" not in out


def test_tolerances_state_the_share_that_is_used_and_the_largest_excess(capsys):
    signals = [
        SignalTolerance("q_rad", 0.42, "β", 0.341, 0.0),
        SignalTolerance("current_A", 36.6, "group 5", 0.952, 1.83),
        SignalTolerance("error_rad", 0.0, "α", 0.0, 0.0),
        SignalTolerance("torque_Nm", float("inf"), "", 1.0, float("inf")),
    ]
    reviews.print_tolerances("a.rrd", "b.rrd", signals)
    out = capsys.readouterr().out
    assert out.splitlines()[0].rstrip() == "b.rrd against a.rrd: 2 of 4 signals within their tolerances"
    assert table_rows(out)[2:] == [
        ["q_rad", "42.0 %", "β, 0.341 s", "–"],
        ["current_A", "36.6 times", "group 5, 0.952 s", "1.83"],
        ["error_rad", "0 %", "–", "–"],
        ["torque_Nm", "exceeded", "1 s", "inf"],
    ]
