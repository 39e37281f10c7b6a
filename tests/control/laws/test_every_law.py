"""What every law of the registry owes, whichever it is."""

import numpy as np
import pytest

from spheretwin.control.law import Known
from spheretwin.control.laws.registry import LAWS
from spheretwin.models.telemetry.status import Status
from spheretwin.twin import scenario as scenarios
from spheretwin.twin.simulation import simulate


@pytest.mark.parametrize("name", LAWS)
def test_every_law_runs_to_a_status(name):
    run = simulate(scenarios.load("hold", {"controller.law": name, "duration": 0.05}))
    assert run.status in set(Status)
    assert len(run.telemetry) == 50 or run.status != Status.COMPLETED
    known = Known(run.scenario.controller.period_s, 0.0, run.actuator.inertia)
    for signal in run.scenario.controller.build(known).signals:
        assert np.isfinite(run.telemetry[signal.name]).all()
        assert signal.unit
        assert signal.meaning


@pytest.mark.parametrize("name", LAWS)
def test_every_law_s_parameters(name, check_parameters):
    assert LAWS[name].model_fields["law"].default == name
    check_parameters(LAWS[name](), "controller", lambda fields: {"controller": fields})
