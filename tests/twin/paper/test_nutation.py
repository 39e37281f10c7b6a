"""Figure 8: reduction of a run and the finding."""

import numpy as np
import pytest

from spheretwin.models.telemetry.status import Status
from spheretwin.paper import nutation
from spheretwin.paper.experiment import Outcomes, padded
from spheretwin.paper.experiment_file import COMPARED_LAWS
from spheretwin.paper.runner import make_plan, run_plan, scenario_of


@pytest.fixture(scope="module")
def outcomes():
    return run_plan(make_plan(nutation.EXPERIMENT, seeds=2))


def test_it_is_the_paper_s_condition():
    for case in nutation.EXPERIMENT.cases():
        scenario = scenario_of(case, None)
        assert (scenario.trajectory.shape, scenario.duration) == ("nutation", 5.0)
        assert (scenario.plant.modelling_error, scenario.disturbance.load) == (0.2, 2.0)


def test_the_order_of_the_paper_is_reproduced(outcomes):
    (finding,) = nutation.findings(outcomes)
    assert finding.reproduced
    assert "PD" in finding.text
    swapped = Outcomes({**outcomes, "afsm: m 0.2, L 2": outcomes["adaptive_fuzzy: m 0.2, L 2"]})
    (finding,) = nutation.findings(swapped)
    assert not finding.reproduced


def test_a_run_that_ended_early_is_shown_as_far_as_it_went(outcomes):
    pd = outcomes["pd: m 0.2, L 2"]
    assert {run.status for run in pd} == {Status.LEFT_WORKSPACE}
    stacked = padded([np.ones((4, 3)), np.ones((2, 3))])
    assert np.isnan(stacked[1, 2:]).all()
    assert np.isfinite(stacked[0]).all()
    trajectories = nutation.EXPERIMENT.trajectories(outcomes)
    assert list(trajectories) == [law.label for law in COMPARED_LAWS if law.in_figures]
    assert len(trajectories["PD"].t_s) < len(trajectories["AFSM"].t_s) == 500
    assert all(second.data.trajectory is None for _, second in outcomes.values())
