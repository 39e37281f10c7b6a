"""The torque curve's file: written, read back, refused."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from spheretwin.models import torque_curve
from spheretwin.models.actuator import TORQUE_CURVE_PATH
from spheretwin.models.curve_origin import computed_from

SHIPPED = torque_curve.read(TORQUE_CURVE_PATH)


def test_csv_round_trip(tmp_path):
    path = tmp_path / "curve.csv"
    path.write_text(torque_curve.to_csv(SHIPPED, ["Where it comes from", "and how"]), encoding="utf-8")
    again = torque_curve.read(path)
    assert path.read_text().startswith("# Where it comes from\n# and how\nphi_deg,torque_Nm_per_A\n")
    assert np.array_equal(again.phi_rad, SHIPPED.phi_rad)
    assert np.array_equal(again.torque_Nm_per_A, SHIPPED.torque_Nm_per_A)


def test_head_is_read_back(tmp_path, actuator):
    magnet, coil = replace(actuator.magnet, remanence_T=1.25), replace(actuator.coil, turns=123456.5)
    geometry = computed_from(magnet, coil)
    sensitivity = {"magnet gain": 123.4, "coil stretch": -5.6}
    path = tmp_path / "curve.csv"
    head = torque_curve.head(geometry, sensitivity)
    path.write_text(torque_curve.to_csv(SHIPPED, ["Before", *head, "after"]))
    again = torque_curve.read(path)
    assert again.distance_sensitivity == sensitivity
    assert again.computed_for == pytest.approx(geometry, rel=1e-11)  # written with 12 digits
    assert again.name == "torque curve curve.csv"


def test_data_from_elsewhere_say_nothing_of_a_geometry(tmp_path):
    path = tmp_path / "bench.csv"
    path.write_text(torque_curve.to_csv(SHIPPED, ["Computed for the bench: two weeks", "coil turns: 3"]))
    assert torque_curve.read(path).computed_for is None


def test_spreadsheet_s_csv_is_read(tmp_path):
    # A byte-order mark, spaces after the commas, an empty line, a further column, Windows' line ends.
    path = tmp_path / "curve.csv"
    rows = [f"{phi}, {np.sin(np.radians(phi)):.6f}, bench" for phi in range(0, 181, 20)]
    path.write_bytes("\r\n".join(["\ufeffphi_deg,torque_Nm_per_A,at", *rows[:3], "  ", *rows[3:]]).encode())
    curve = torque_curve.read(path)
    assert_allclose(np.degrees(curve.phi_rad), range(0, 181, 20))
    assert_allclose(curve.torque_Nm_per_A, np.sin(curve.phi_rad), atol=1e-6)
