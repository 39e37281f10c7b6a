"""The torque curve's file: written, read back, refused."""

import re
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from spheretwin.models import torque_curve
from spheretwin.models.actuator import TORQUE_CURVE_PATH
from spheretwin.models.base.errors import InputError
from spheretwin.models.magnetics import computed_from
from spheretwin.models.torque_curve import TorqueCurve


@pytest.fixture(scope="module")
def shipped() -> TorqueCurve:
    return torque_curve.read(TORQUE_CURVE_PATH)


def test_csv_round_trip(tmp_path, shipped):
    path = tmp_path / "curve.csv"
    path.write_text(torque_curve.to_csv(shipped, ["Where it comes from", "and how"]), encoding="utf-8")
    again = torque_curve.read(path)
    assert path.read_text().startswith("# Where it comes from\n# and how\nphi_deg,torque_Nm_per_A\n")
    assert np.array_equal(again.phi_rad, shipped.phi_rad)
    assert np.array_equal(again.torque_Nm_per_A, shipped.torque_Nm_per_A)


def test_head_is_read_back(tmp_path, actuator, shipped):
    geometry = computed_from(
        replace(actuator.magnet, remanence_T=1.25), replace(actuator.coil, turns=123456.5)
    )
    sensitivity = {"magnet gain": 123.4, "coil stretch": -5.6}
    path = tmp_path / "curve.csv"
    head = torque_curve.head(geometry, sensitivity)
    path.write_text(torque_curve.to_csv(shipped, ["Before", *head, "after"]))
    again = torque_curve.read(path)
    assert again.distance_sensitivity == sensitivity
    assert again.computed_for == pytest.approx(geometry, rel=1e-11)  # written with 12 digits
    assert again.name == "torque curve curve.csv"


def test_data_from_elsewhere_say_nothing_of_a_geometry(tmp_path, shipped):
    path = tmp_path / "bench.csv"
    path.write_text(torque_curve.to_csv(shipped, ["Computed for the bench: two weeks", "coil turns: 3"]))
    assert torque_curve.read(path).computed_for is None


GOOD_ROWS = [f"{phi},0.001" for phi in range(0, 181, 20)]
BUMP = ["0,0", *GOOD_ROWS[1:-1], "180,0"]
HEADER = "phi_deg,torque_Nm_per_A"
COMPUTED_FOR = "# Computed for coil turns:"


@pytest.mark.parametrize(
    ("lines", "complaint"),
    [
        (["phi_deg,torque", *GOOD_ROWS], "expected the columns phi_deg, torque_Nm_per_A"),
        ([], "expected the columns"),
        ([HEADER, "0,0", "40,0", "20,0", *GOOD_ROWS[3:]], "expected rising angles, received 40 then 20"),
        ([HEADER, *GOOD_ROWS[:-1], "180,nan"], "expected finite numbers"),
        ([HEADER, *GOOD_ROWS[:5], "90,north", *GOOD_ROWS[5:]], "expected numbers only"),
        ([HEADER, *GOOD_ROWS[:5], "90", *GOOD_ROWS[5:]], "expected numbers only"),
        ([HEADER, "0,0", "90,0.01", "180,0"], "expected at least 8 rows, received 3"),
        ([HEADER], "expected at least 8 rows, received 0"),
        ([HEADER, *GOOD_ROWS[1:]], "expected angles from 0 to 180 degrees, received 20 to 180"),
        ([HEADER, *GOOD_ROWS[:-1]], "expected angles from 0 to 180 degrees, received 0 to 160"),
        ([HEADER, "-20,0", *GOOD_ROWS], "received -20, which is outside"),
        ([HEADER, "0,0", "400,0", *GOOD_ROWS[1:]], "received 400, which is outside"),
        ([HEADER, *GOOD_ROWS], "expected no torque at 0 and 180 degrees"),
        ([HEADER, *(f"{phi},0" for phi in range(0, 181, 20))], "expected a torque somewhere"),
        ([HEADER.replace(",", ";"), *GOOD_ROWS], "expected the columns phi_deg, torque_Nm_per_A"),
        ([HEADER, *GOOD_ROWS[:4], '"80,0.001'], "expected numbers only"),
        ([HEADER, *GOOD_ROWS[:4], "80,0.001,7", *GOOD_ROWS[5:]], "another number of them in row 5"),
        ([HEADER + ",phi_deg", *(f"{row},1" for row in GOOD_ROWS)], "a column twice"),
        ([HEADER, "0,0", "20,1e308", "40,-1e308", *GOOD_ROWS[3:-1], "180,0"], "expected a peak between"),
        (
            [HEADER, "0,0", "20,0.1", "20.0000000000001,0.1", *GOOD_ROWS[2:]],
            "received 20 then 20.0000000000001",
        ),
        ([HEADER, *GOOD_ROWS[:-1], "180.00000001,0"], "received 180.00000001, which is outside"),
        ([COMPUTED_FOR + " many", HEADER, *BUMP], "number after Computed for coil turns:, received many"),
        ([COMPUTED_FOR + " nan", HEADER, *BUMP], "expected a finite number after"),
        ([COMPUTED_FOR, HEADER, *BUMP], "number after Computed for coil turns:, received none"),
    ],
)
def test_bad_csv_is_refused(tmp_path, lines, complaint):
    path = tmp_path / "curve.csv"
    path.write_text("\n".join(lines), encoding="utf-8")
    with pytest.raises(InputError, match=re.escape(complaint)) as refusal:
        torque_curve.read(path)
    assert str(path) in str(refusal.value)


def test_spreadsheet_s_csv_is_read(tmp_path):
    # A byte-order mark, spaces after the commas, an empty line, a further column, Windows' line ends.
    path = tmp_path / "curve.csv"
    rows = [f"{phi}, {np.sin(np.radians(phi)):.6f}, bench" for phi in range(0, 181, 20)]
    path.write_bytes("\r\n".join(["\ufeff" + HEADER + ",where", *rows[:3], "  ", *rows[3:]]).encode())
    curve = torque_curve.read(path)
    assert_allclose(np.degrees(curve.phi_rad), range(0, 181, 20))
    assert_allclose(curve.torque_Nm_per_A, np.sin(curve.phi_rad), atol=1e-6)


def test_missing_csv_is_refused(tmp_path):
    with pytest.raises(InputError, match="expected a readable text file"):
        torque_curve.read(tmp_path / "absent.csv")
