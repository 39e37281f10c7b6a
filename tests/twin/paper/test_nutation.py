"""Figure 8: what is kept of the nutation, and what is said of it."""

import numpy as np
import pytest

from spheretwin.models.telemetry.status import Status
from spheretwin.paper import nutation
from spheretwin.paper.cases import carried_out, planned, scenario_of
from spheretwin.paper.experiment import COMPARED
from spheretwin.paper.nutation import THINNED_s, WINDOW_s, keep
from spheretwin.simulation import simulate


@pytest.fixture(scope="module")
def outcomes():
    return carried_out(planned(nutation.EXPERIMENT, seeds=2))


def test_it_is_the_paper_s_condition():
    for case in nutation.EXPERIMENT.cases():
        scenario = scenario_of(case, None)
        assert (scenario.trajectory.shape, scenario.duration) == ("nutation", 5.0)
        assert (scenario.plant.modelling_error, scenario.disturbance.load) == (0.2, 2.0)


def test_windows_keep_the_largest_error_and_the_course_every_few_ticks():
    case = nutation.case(COMPARED[2])
    run = simulate(scenario_of(case._replace(fields={**case.fields, "duration": 0.38}), None))
    flown = keep(run)
    error = np.abs(run.telemetry["error_rad"])
    assert flown.windows_rad.shape == (7, 3)  # of 50 ticks each; the rest is less than a window
    np.testing.assert_array_equal(flown.windows_rad[2], error[100:150].max(axis=0))
    np.testing.assert_array_equal(flown.course.q_rad, run.telemetry["q_rad"][::10])
    np.testing.assert_array_equal(flown.largest_after(0.3), error[300:350].max(axis=0))
    assert np.isnan(flown.largest_after(1.0)).all()
    assert (WINDOW_s, THINNED_s) == (0.05, 0.01)


def test_the_order_of_the_paper_came_out_again(outcomes):
    (found,) = nutation.findings(outcomes)
    assert found.held
    assert "PD" in found.text
    assert "left_workspace" in found.text.replace(" ", "_")
    swapped = {**outcomes, "afsm: m 0.2, L 2": outcomes["adaptive_fuzzy: m 0.2, L 2"]}
    (found,) = nutation.findings(swapped)
    assert not found.held


def test_a_run_that_ended_early_is_shown_as_far_as_it_went(outcomes):
    pd = outcomes["pd: m 0.2, L 2"]
    assert {each.status for each in pd} == {Status.LEFT_WORKSPACE}
    stacked = nutation.stacked([np.ones((4, 3)), np.ones((2, 3))])
    assert np.isnan(stacked[1, 2:]).all()
    assert np.isfinite(stacked[0]).all()
    flights = nutation.EXPERIMENT.side_by_side(outcomes)
    assert list(flights) == [compared.label for compared in COMPARED if compared.drawn]
    assert len(flights["PD"].t_s) < len(flights["AFSM"].t_s) == 500
    assert all(each.kept.course is None for each in (found[1] for found in outcomes.values()))
