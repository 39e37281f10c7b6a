"""The verdict on the torque matrix: it passes what is right, and tells a wrong matrix from a wrong curve."""

from dataclasses import replace

import numpy as np
import pytest

from spheretwin.models.base.checks import broken
from spheretwin.models.design import direct_summation
from spheretwin.models.design import field_check as field_verdict
from spheretwin.models.torque_curve import TorqueCurve
from tests.models.design.quadrature import COARSE

pytestmark = pytest.mark.release("sums over windings for 0.7 to 7.5 s; test_field_check.py has the sums")


@pytest.fixture
def coarse(monkeypatch):
    """Fewer points in the windings, and one machine with scatter instead of three."""
    monkeypatch.setattr(direct_summation, "STANDARD", COARSE)
    monkeypatch.setattr(field_verdict, "SCATTER_POSES", 1)


def test_the_shipped_actuator_passes(actuator, monkeypatch):
    monkeypatch.setattr(field_verdict, "SCATTER_POSES", 1)
    verdict = field_verdict.judge(actuator, poses=2)
    assert max(band.median_relative_error for band in verdict.by_tilt) < 5e-4  # measured: 1.7e-4
    torque, _, scatter, *_ = verdict.checks
    assert torque.value < 1e-3  # measured: 2e-4
    assert 1e-3 < scatter.value < scatter.bound  # of second order; measured: 4e-3
    assert broken(verdict.checks) == verdict.warnings == []
    assert verdict.sources.curve_between_samples_of_peak < 1e-4
    assert verdict.sources.lookup_of_peak < 1e-6
    assert not verdict.curve_is_of_another_geometry


@pytest.mark.usefixtures("coarse")
def test_a_wrong_matrix_is_not_attributed_to_the_curve(actuator, monkeypatch):
    right = direct_summation.fill_torque_matrix

    def negative(q, arrangement, tables, G, scratch):
        right(q, arrangement, tables, G, scratch)
        G *= -1

    monkeypatch.setattr(direct_summation, "fill_torque_matrix", negative)
    verdict = field_verdict.judge(actuator, poses=1)
    assert broken(verdict.checks) == ["torque", "scatter"]
    assert verdict.checks[0].value == pytest.approx(2, abs=0.01)  # as far off as the torque is large, twice
    assert not verdict.curve_is_of_another_geometry


@pytest.mark.usefixtures("coarse")
def test_a_wrong_curve_is_found_and_named(actuator):
    curve = actuator.torque_curve
    stronger = replace(actuator, torque_data=TorqueCurve(curve.phi_rad, 1.03 * curve.torque_Nm_per_A))
    verdict = field_verdict.judge(stronger, poses=1)
    assert broken(verdict.checks) == ["torque"]
    assert verdict.checks[0].value == pytest.approx(0.03, abs=2e-3)  # the coarse sum's own error
    # In units of the judged curve's own peak, and next to it: no angle that is tried hits the peak.
    assert verdict.sources.curve_between_samples_of_peak == pytest.approx(0.03 / 1.03, rel=0.01)
    assert verdict.curve_is_of_another_geometry


def test_few_poses_come_from_all_bands(actuator, monkeypatch):
    monkeypatch.setattr(direct_summation, "direct_torque_matrix", lambda *_: np.ones((3, 18)))
    verdict = field_verdict.judge(actuator, poses=7, seed=3)
    assert [band.poses for band in verdict.by_tilt] == [2, 2, 1, 1, 1]
    assert [band.tilt_deg[1] for band in verdict.by_tilt] == list(field_verdict.BANDS_DEG[1:])
