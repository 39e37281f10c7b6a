"""Columns that not every run has: there where their stage acts, and what they hold."""

import numpy as np
import pytest

from spheretwin.models.telemetry.signals import common_signals
from spheretwin.twin import scenario as scenarios
from spheretwin.twin.columns.registry import ALL
from spheretwin.twin.simulation import simulate

# What makes each stage log.
LOGGED_BY = {
    "q_measured_rad": {"sensors.angle_offset_rad": [0.01, 0.0, -0.02]},
    "friction_Nm": {"plant.viscous_Nm_s": [1e-3, 1e-3, 1e-3]},
    "supply_power_W": {"drive.supply_V": 12.0, "drive.dac_bits": 16},
}
STAGES = [columns for columns in ALL if columns.signals(18)[0].name in LOGGED_BY]


def run(changes):
    return simulate(scenarios.load("hold", {"duration": 0.05, **changes})).telemetry


@pytest.mark.parametrize("columns", STAGES, ids=list(LOGGED_BY))
def test_they_are_there_where_the_stage_acts_and_nowhere_else(columns):
    names = [signal.name for signal in columns.signals(18)]
    table = run(LOGGED_BY[names[0]])
    for name in names:
        assert np.isfinite(table[name]).all()
    assert table[names[0]].any()
    assert not set(names) & {signal.name for signal in run({}).signals}
    # They move no other column.
    others = [signal.name for signal in common_signals(18)]
    together = run({key: value for each in LOGGED_BY.values() for key, value in each.items()})
    assert set(names) <= {signal.name for signal in together.signals}
    assert [signal.name for signal in together.signals][: len(others)] == others


def test_each_holds_what_its_stage_did():
    changes = {key: value for each in LOGGED_BY.values() for key, value in each.items()}
    table = run(changes)
    offset = table["q_measured_rad"] - table["q_rad"]
    # A sum and a difference of numbers below 1: rounded twice.
    np.testing.assert_allclose(offset, np.tile([0.01, 0.0, -0.02], (50, 1)), rtol=0, atol=2.3e-16)
    np.testing.assert_array_equal(table["qdot_estimated_rad_s"], table["qdot_rad_s"])
    # Viscous friction is taken at the rates after the step: it falls short of -1e-3 qdot by a step's change.
    np.testing.assert_allclose(table["friction_Nm"], -1e-3 * table["qdot_rad_s"], rtol=0.2, atol=2e-5)
