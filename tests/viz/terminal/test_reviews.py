"""Reports of recorded runs: sizes of differences, and tolerances."""

import pytest

from spheretwin.viz.terminal import reviews
from spheretwin.viz.terminal.reviews import SignalTolerance, differences

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
        ("max_abs_current_A", None, "–"),
        ("copper_loss_J", 400.0, "400 J\n+396 J, 100 times"),
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


def table_rows(text):
    return [
        [cell.strip() for cell in line.strip("|").split("|")] for line in text.splitlines() if "|" in line
    ]


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
