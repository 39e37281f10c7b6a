"""The verdict on a torque curve: one that is computed, and one that somebody else has measured."""

from pathlib import Path

import numpy as np
import pytest

from spheretwin.models import actuator as actuators
from spheretwin.models import torque_curve
from spheretwin.models.base.checks import broken
from spheretwin.models.base.errors import InputError
from spheretwin.models.design import curve_check
from spheretwin.models.torque_curve import TorqueCurve
from tests.models.design.quadrature import sample_coarsely
from tests.models.model_files import edited

pytestmark = pytest.mark.release("recomputes a curve for 1.4 to 1.9 s; test_pole_torque.py has its parts")


@pytest.fixture
def few_samples(monkeypatch):
    """A twentieth of the samples, 5 degrees apart: the checks, not the figures."""
    sample_coarsely(monkeypatch)


def test_a_weaker_magnet_is_a_factor_and_no_difference_in_shape(actuator):
    curve = actuator.torque_curve
    rows = np.r_[0:120:4, 120:721:20]
    judged = curve_check.judge(TorqueCurve(curve.phi_rad[rows], 0.93 * curve.torque_Nm_per_A[rows]))
    assert judged.rows == 61
    # The shipped samples are rounded to 12 decimals, 5e-11 of the peak.
    assert judged.geometry.scale == pytest.approx(0.93, abs=1e-6)
    assert judged.geometry.scaled.worst < 1e-6
    assert judged.peak.peak_Nm_per_A == pytest.approx(0.93 * curve.peak_Nm_per_A, rel=0.01)
    assert 0 < judged.leave_one_out.rms < 0.01
    assert 0 < judged.lookup_error < 1e-4
    assert judged.warnings == []


@pytest.fixture(scope="module")
def computed():
    """Curve of the shipped model from a twentieth of the samples."""
    with pytest.MonkeyPatch.context() as patch:
        sample_coarsely(patch)
        return curve_check.compute()


def test_a_computed_curve_is_bounded(computed):
    mesh, lookup = computed.checks
    assert broken(computed.checks) == computed.warnings == []
    assert (mesh.bound, lookup.bound) == (5e-3, 1e-6)
    assert mesh.value == computed.doubled_mesh.peak
    assert lookup.value == computed.lookup_error
    # What is written is what was computed, to the twelve decimals of the file.
    again = torque_curve.parse(Path("mine.csv"), computed.csv.encode())
    np.testing.assert_allclose(again.torque_Nm_per_A, computed.curve.torque_Nm_per_A, rtol=0, atol=5.1e-13)


@pytest.mark.usefixtures("few_samples")
def test_a_table_that_misses_the_spline_breaks_its_bound_alone(monkeypatch):
    right = curve_check.lookup_table
    monkeypatch.setattr(curve_check, "lookup_table", lambda curve: (1 + 1e-5) * right(curve))
    computed = curve_check.compute()
    assert broken(computed.checks) == ["lookup"]
    # Over the peak of one coil, while the table holds it and its opposite; its own error is 3e-7.
    assert computed.lookup_error == pytest.approx(1e-5, rel=0.1)


@pytest.mark.usefixtures("few_samples")
def test_a_model_with_nothing_but_poles_and_coils_has_a_curve(tmp_path, computed):
    path = edited(tmp_path, ("group_resistance_ohm", "elsewhere"))
    with pytest.raises(InputError, match="group_resistance_ohm"):
        actuators.load(path)
    of_path = curve_check.compute(path)
    assert of_path.warnings == broken(of_path.checks) == []
    # The table's intervals are promised to the shipped model alone.
    assert of_path.checks[1].bound is None
    np.testing.assert_array_equal(of_path.curve.torque_Nm_per_A, computed.curve.torque_Nm_per_A)
