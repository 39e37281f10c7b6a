"""The cross-check of machines other than the shipped one: every row holds, with bounds to their scale."""

import json
from pathlib import Path

import pytest

from spheretwin import cli
from spheretwin import scenario as scenario_files
from spheretwin.crosscheck import suite
from spheretwin.models import actuator as actuators
from tests.models.model_files import edited
from tests.twin.crosscheck.commands import FEW, ROWS, broken, crosscheck

GENERAL = {
    "centre": [('<inertial pos="0 0 0" mass="1.6"', '<inertial pos="0.001 -0.002 0.004" mass="1.6"')],
    "rings": [("mass=\"2.3e-12\" diaginertia=\"1.1e-15 1.1e-15 1.1e-15\"",
               "mass=\"0.15\" diaginertia=\"2e-4 2.5e-4 3e-4\"")],
    "light rings": [("1.1e-15", "4e-10")],
    "tilted": [('class="tilt_hinge" axis="1 0 0"', 'class="tilt_hinge" axis="1 0.02 0.01" pos="0 0.0002 0"')],
    "products": [("diaginertia=\"2.219e-3 2.176e-3 2.256e-3\"",
                  "fullinertia=\"2.219e-3 2.176e-3 2.256e-3 3e-5 -4e-5 2e-5\"")],
    "tiny": [("2.219e-3 2.176e-3 2.256e-3", "2.219e-6 2.176e-6 2.256e-6")],
    "uneven": [("2.219e-3 2.176e-3 2.256e-3", "1.2e-3 2.6e-3 3.1e-3")],
    "big, short range": [("2.219e-3 2.176e-3 2.256e-3", "2.2 2.1 2.3"), ('range="-80 80"', 'range="-5 20"')],
}  # fmt: skip
OF_STATES = ("dynamics", "identities", "trajectories", "torque-free rotor", "friction")


def checks_of(mjcf, names):
    subject = suite.Subject(mjcf, actuators.load(mjcf), FEW)
    return [check for part in suite.PARTS if part.name in names for check in part.examine(subject).checks]


@pytest.mark.release("2 s each; the command takes the same parts of the shipped model in less")
@pytest.mark.parametrize("kind", GENERAL)
def test_the_parts_without_coils_hold_on_what_the_lagrangian_engine_runs(tmp_path, kind):
    checks = checks_of(edited(tmp_path, *GENERAL[kind]), OF_STATES)
    assert broken(checks) == set()
    assert len(checks) == 35


VENTUSFF = Path(scenario_files.__file__).parent / "shipped" / "ventusff" / "actuator.xml"


def test_bounds_of_a_lighter_machine_have_the_share_of_its_rings():
    """Rings of 1e-15 kg·m² are 1.5e-11 of a rotor of 1.3e-4 kg·m²."""
    checks = {check.name: check for check in checks_of(VENTUSFF, ("dynamics",))}
    assert broken(checks.values()) == set()
    assert checks["inertia matrix M: MuJoCo"].value == pytest.approx(9.9e-12, rel=0.05)
    assert checks["inertia matrix M: MuJoCo"].bound == pytest.approx(2e-15 / 1.3e-4 + 1e-13, rel=1e-6)


@pytest.mark.release("compiles loops of another machine, 4 min")
@pytest.mark.parametrize("kind", ["ventusff", "centre", "rings", "big, short range"])
def test_every_row_holds_on_other_machines(tmp_path, kind):
    mjcf = VENTUSFF if kind == "ventusff" else edited(tmp_path, *GENERAL[kind])
    code, out, _ = crosscheck("--mjcf", mjcf, "--states", FEW, "--json")
    rows = json.loads(out)["checks"]
    assert [row["name"] for row in rows if not row["ok"]] == []
    assert code == cli.DONE
    assert len(rows) == len(ROWS)
