"""Static friction in the cross-check: the reference against closed forms, and what breaks which row."""

import numpy as np

from spheretwin.crosscheck import stiction
from spheretwin.crosscheck.stiction import STICTION, COULOMB_Nm, Reference, SAMPLE_s, START_rad
from spheretwin.plant.bristle_friction import StictionSection


def test_the_reference_breaks_away_and_slides_as_its_equations_say(actuator, monkeypatch):
    """Hinge γ alone, under three times its level: elastic swing, break-away, then uniform acceleration."""
    J, load = actuator.inertia[2], 6e-3
    monkeypatch.setattr(stiction, "torque_Nm", lambda t: np.array([0.0, 0.0, load]))
    section = StictionSection(on=True, break_away=1.0, presliding_rad=1e-4, damping_ratio=0.0)
    states, break_aways = Reference(actuator, section, COULOMB_Nm).integrate((0.0, 0.0, 0.0), 0.5)
    assert break_aways == 1
    t_s, level = SAMPLE_s * np.arange(len(states)), COULOMB_Nm[2]
    # Energy at any angle beyond the range: springs and sliders took k (y (q - y) + y²/2) each.
    slip = np.array([0.5e-4, 1e-4])
    spent = level / slip.sum() * np.sum(slip * (states[10:, [2]] - 0.5 * slip), axis=1)
    np.testing.assert_allclose(0.5 * J * states[10:, 5] ** 2, load * states[10:, 2] - spent, rtol=1e-8)
    np.testing.assert_allclose(np.diff(states[10:, 5]) / np.diff(t_s[10:]), (load - level) / J, rtol=1e-8)
    assert not states[:, [0, 1, 3, 4]].any()


def test_the_reference_starts_at_rest_in_its_pose(actuator):
    states, break_aways = Reference(actuator, STICTION, COULOMB_Nm).integrate(START_rad, 0.01)
    np.testing.assert_array_equal(states[0], [*START_rad, 0, 0, 0])
    assert break_aways == 0
