"""Reports of recorded runs: sizes of differences, fields, nominal models, tolerances."""

import pytest

from spheretwin.viz.terminal import reviews
from spheretwin.viz.terminal.reviews import (
    NominalError,
    SignalTolerance,
    differences,
    print_comparison,
    print_run_report,
)

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


def cell(key, value, first=None):
    """Second cell of the row of a figure, if the second run, and the first, has this value."""
    reference = RUN if first is None else {**RUN, key: first}
    rows = {label: cells for label, *cells in differences([reference, {**RUN, key: value}], 0.01)}
    labels = {
        "max_abs_current_A": "largest current",
        "copper_loss_J": "copper loss",
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
        ("copper_loss_J", 400.0, "400 J\n+396 J, 100 times"),
        ("mechanical_work_J", 7.671, "7.67 J\n+7.67 J"),
        ("mechanical_work_J", -0.05, "-0.0500 J\n-0.0510 J"),
        ("saturated_fraction", 0.01, "1.00 %\n+0.0400 %, +4.17 %"),
        ("max_abs_error_rad", [0.015, 0.02, 0.01], "15.0 (0.859°)\n-15.0 (-0.859°), -50.0 %"),
    ],
)
def test_differences_have_sizes_that_can_be_read(key, value, text):
    assert cell(key, value) == text


@pytest.mark.parametrize(
    ("first", "value", "text"),
    [
        (-0.5, -0.375, "+0.125 J, +25.0 %"),
        (-0.5, -0.625, "-0.125 J, -25.0 %"),
        (0.5, 1.0, "+0.500 J, +100 %"),
        (0.25, 0.75, "+0.500 J"),  # the first is smaller than the difference
        (-0.25, -1.0, "-0.750 J"),
        (0.25, -0.25, "-0.500 J"),
        (0.0, 0.5, "+0.500 J"),
    ],
)
def test_a_signed_quantity_has_a_percentage_of_a_reference_that_is_not_near_zero(first, value, text):
    assert cell("mechanical_work_J", value, first).splitlines()[1] == text


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


PEAK = {"frequency_Hz": 12.5, "amplitude_rad": 0.001}
REPORT = {
    **RUN,
    "status": "failsafe",
    "reason": "no fresh measurement",
    "error_peaks": {"α": [PEAK, {**PEAK, "frequency_Hz": 30.0}], "β": [PEAK], "γ": []},
    "events": [],
}


def test_the_report_of_one_run_has_every_figure_once(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "200")
    print_run_report(REPORT, [NominalError("nominal.x", "1", "2")], 0.01)
    out = capsys.readouterr().out
    assert out.splitlines()[0].rstrip() == "hold under pd: failsafe at 1.000 s"
    peak, none = "Hz: 1.00 (0.0573°)", "–"
    assert [row for row in table_rows(out) if not set("".join(row)) <= set("-:")] == [
        ["tracking error, mrad (degrees)", "α", "β", "γ"],
        ["largest", "30.0 (1.72°)", "20.0 (1.15°)", "10.0 (0.573°)"],
        ["rms", *["10.0 (0.573°)"] * 3],
        ["rms, second half", *["10.0 (0.573°)"] * 3],
        ["overshoot", none, none, none],
        ["settled to ±10 mrad after", "0.300 s", none, "0 s"],
        ["strongest oscillation", f"12.5 {peak}", f"12.5 {peak}", none],
        ["second oscillation", f"30.0 {peak}", none, none],
        ["field", "run", "controller", "truth"],
        ["nominal.x", "a.parquet", "1", "2"],
    ]
    for line in (
        "largest current 2.00 A",
        "share of ticks at the limit 0.960 %",
        "rms torque 0.100 N·m",
        "variation of the commands 3.00 A/s",
        "copper loss 4.00 J",
        "work on the rotor 0.00100 J",
        "energy 4.00 J",
        "modelling_error 0.2, load 1.0, hardware ideal, seed 0, no fresh measurement",
    ):
        assert line in out.splitlines()
    print_run_report({**REPORT, "status": None, "reason": None}, [], 0.01)
    out = capsys.readouterr().out
    assert out.splitlines()[0].rstrip() == "hold under pd: not closed at 1.000 s"
    assert "hardware ideal, seed 0" in out.splitlines()[-1]
    assert out.splitlines()[-1].endswith("seed 0")


@pytest.mark.parametrize("more", [-1, 0, 1, 7])
def test_the_first_events_are_printed_and_the_others_counted(capsys, more):
    events = [{"t_s": 0.5 * place, "text": f"event {place}"} for place in range(reviews.MOST_EVENTS + more)]
    print_run_report({**REPORT, "events": events}, [], 0.01)
    lines = capsys.readouterr().out.splitlines()
    printed = [line.split(maxsplit=2) for line in lines if " s  event " in line]
    assert printed == [[f"{event['t_s']:.3f}", "s", event["text"]] for event in events[: reviews.MOST_EVENTS]]
    assert (f"and {more} more events; --json has them all" in lines) == (more > 0)
