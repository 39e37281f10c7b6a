"""A case as one row: its status is that of the first run that ended unexpectedly."""

import numpy as np

from spheretwin.models.telemetry.status import Status
from spheretwin.paper.cells import Numbers
from spheretwin.paper.page import rows
from spheretwin.paper.runner import make_plan
from tests.twin.paper.cases import NOISY, allowed, experiment, outcome


def test_status_is_what_should_not_have_been():
    mixed = [*map(outcome, (0.3, 0.1, 0.2)), outcome(1.0, Status.LEFT_WORKSPACE)]
    for case, status in ((NOISY, "left_workspace"), (allowed(NOISY), "completed")):
        (entry,) = rows(make_plan(experiment(case), len(mixed)), {case.name: mixed})
        assert entry["status"] == status
        assert entry["statuses"] == {"completed": 3, "left_workspace": 1}


def test_a_spread_in_degrees_has_no_range_if_it_is_none():
    assert f"{Numbers(np.radians([0.25, 0.25])):.2f deg}" == "0.25"
    assert f"{Numbers([np.nan, 1.0]):.3f deg}" == "–"


def test_a_row_has_the_interval_of_its_median_if_the_seeds_are_enough():
    for errors, ends in ((0.1, 0.2, 0.3), [None, None]), ((1, 2, 3, 4, 5, 6), [1.0, 6.0]):
        outcomes = list(map(outcome, errors))
        (entry,) = rows(make_plan(experiment(NOISY), len(errors)), {NOISY.name: outcomes})
        assert entry["max_abs_error_median_95_rad"] == [ends] * 3
