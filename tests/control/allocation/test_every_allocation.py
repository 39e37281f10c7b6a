"""What every allocation of the registry owes, whichever it is."""

import numpy as np
import pytest

from spheretwin import scenario as scenarios
from spheretwin.control.allocation import ALLOCATIONS, SIGNATURE
from spheretwin.control.law import Law
from spheretwin.models.base.compiled import compiled_callback
from spheretwin.models.magnetics import torque_matrix
from spheretwin.models.telemetry.status import Status
from spheretwin.simulation import simulate

LIMIT_A = 8.0


@pytest.mark.parametrize("name", ALLOCATIONS)
def test_every_allocation_gives_its_share_within_the_limit(name, actuator):
    call = compiled_callback(SIGNATURE, ALLOCATIONS[name])
    rng = np.random.default_rng(0)
    groups = len(actuator.groups)
    shares = []
    for size_Nm in np.geomspace(1e-3, 10.0, 40):  # from what any currents give to what none do
        G = np.ascontiguousarray(torque_matrix(rng.uniform(-1.0, 1.0, 3), actuator))
        torque_S, current = rng.normal(size=3) * size_Nm, np.full(groups, np.nan)
        share = call(G, torque_S, LIMIT_A, current, np.full((5, groups), np.nan))
        assert 0 < share <= 1
        assert np.abs(current).max() <= LIMIT_A
        # Solved with the inverse of G Gᵀ, whose condition number is below 30 here.
        np.testing.assert_allclose(G @ current, share * torque_S, rtol=0, atol=1e-12 * size_Nm)
        shares.append(share)
    assert shares[0] == 1
    assert shares[-1] < 1


@pytest.mark.parametrize("name", ALLOCATIONS)
def test_every_allocation_runs_and_says_what_it_is(name):
    assert ALLOCATIONS[name].__doc__
    run = simulate(scenarios.load("hold", {"allocation": name, "duration": 0.02}))
    assert run.status == Status.COMPLETED
    assert np.isfinite(run.telemetry.values).all()


@pytest.mark.parametrize("name", ALLOCATIONS)
def test_every_allocation_gives_no_current_for_no_torque_or_in_a_lost_direction(name, actuator):
    call = compiled_callback(SIGNATURE, ALLOCATIONS[name])
    lost = np.zeros((3, 18))
    lost[:2] = np.random.default_rng(0).normal(size=(2, 18))
    at_rest = torque_matrix(np.zeros(3), actuator)
    for G, torque_S, expected in (
        (lost, [0.1, 0.2, 0.3], 0),
        (lost, [1e3, 0.0, 0.0], 0),
        (at_rest, [0.0, 0.0, 0.0], 1),
        (at_rest, [1e-300, 0.0, 0.0], 1),
    ):
        current = np.full(18, np.nan)
        assert call(G, np.array(torque_S), LIMIT_A, current, np.full((5, 18), np.nan)) == expected
        assert np.abs(current).max() < 1e-290


def push(t, reference, measurement, parameters, state, torque):
    torque[:] = 3.0, -2.0, 1.0


@pytest.mark.uncompiled
@pytest.mark.parametrize("sheet_A", [0.5, 8.0])
@pytest.mark.parametrize("name", ALLOCATIONS)
def test_no_command_exceeds_the_limit_of_the_law_or_of_the_data_sheet(name, sheet_A):
    """Also with a feed-forward torque, and with the torque of a group that is open."""
    fields = {
        "allocation": name,
        "duration": 0.02,
        "nominal.current_limit_A": sheet_A,
        "controller.feed_forward.friction": 1.0,
        "fault.0": {"target": "coil.03", "mode": "open", "start_s": 0.01, "reported_to_controller": True},
    }
    law = Law("push", push, [], [], current_limit_A=0.7)
    run = simulate(scenarios.load("hold", fields), law=law)
    largest_A, limit_A = np.abs(run.telemetry["current_command_A"]).max(axis=1), min(sheet_A, 0.7)
    assert largest_A.max() <= limit_A
    np.testing.assert_allclose(largest_A, limit_A, rtol=1e-12)
