"""A case as one row: median and range over the seeds, in rad for programs and in degrees for people."""

import numpy as np
import pytest

from spheretwin.models.telemetry.status import Status
from spheretwin.paper.experiment import Outcome
from spheretwin.paper.page import of_axis, rows, spread_deg, statuses_text
from spheretwin.paper.runner import make_plan
from tests.twin.paper.cases import NOISY, allowed, experiment


def outcome(error, status=Status.COMPLETED):
    figures = {"max_abs_error_rad": [error, 2 * error, 3 * error], "tail_rms_error_rad": [error / 2] * 3}
    return Outcome(status, figures, np.full(3, 10 * error), None)


THREE = [outcome(0.3), outcome(0.1), outcome(0.2)]


def row(outcomes, case=NOISY):
    return rows(make_plan(experiment(case), len(outcomes)), {case.name: outcomes})[0]


def test_errors_are_medians_and_ranges():
    entry = row(THREE)
    assert entry["max_abs_error_rad"] == pytest.approx([0.2, 0.4, 0.6])
    assert entry["max_abs_error_range_rad"][2] == pytest.approx([0.3, 0.9])
    assert entry["measured_max_abs_error_rad"] == pytest.approx([2.0] * 3)
    assert entry["tail_rms_error_rad"] == pytest.approx([0.1] * 3)


def test_status_is_what_should_not_have_been():
    mixed = [*THREE, outcome(1.0, Status.LEFT_WORKSPACE)]
    assert row(mixed)["status"] == "left_workspace"
    assert row(mixed)["statuses"] == {"completed": 3, "left_workspace": 1}
    assert row(mixed, allowed(NOISY))["status"] == "completed"
    assert statuses_text(mixed) == "3 completed, 1 left_workspace"
    assert statuses_text(THREE) == "completed"


def test_spread_in_degrees():
    assert spread_deg(np.radians([1.0, 3.0, 2.0])) == "2.000 (1.000 to 3.000)"
    assert spread_deg(np.radians([0.25, 0.25]), digits=2) == "0.25"
    assert spread_deg([np.nan, 1.0]) == "–"
    np.testing.assert_array_equal(of_axis(THREE, "max_abs_error", 1), [0.6, 0.2, 0.4])
