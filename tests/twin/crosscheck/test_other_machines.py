"""The cross-check of machines other than the shipped one: every row holds, with bounds to their scale."""

import json

import pytest

from spheretwin import cli
from spheretwin.crosscheck import suite
from spheretwin.models import actuator as actuators
from tests.models.model_files import edited
from tests.twin.crosscheck.commands import FEW, GENERAL, MACHINES, ROWS, VENTUSFF, broken, crosscheck, machine

OF_STATES = ("dynamics", "identities", "trajectories")


def checks_of(mjcf, names):
    subject = suite.Subject(mjcf, actuators.load(mjcf), FEW)
    return [check for part in suite.PARTS if part.name in names for check in part.examine(subject).checks]


@pytest.mark.release("2 s each; the command takes the same parts of the shipped model in less")
@pytest.mark.parametrize("kind", GENERAL)
def test_the_parts_without_coils_hold_on_what_the_lagrangian_engine_runs(tmp_path, kind):
    checks = checks_of(edited(tmp_path, *GENERAL[kind]), OF_STATES)
    assert broken(checks) == set()
    assert len(checks) == 18


def test_bounds_of_a_lighter_machine_have_the_share_of_its_rings():
    """Rings of 1e-15 kg·m² are 1.5e-11 of a rotor of 1.3e-4 kg·m²."""
    checks = {check.name: check for check in checks_of(VENTUSFF, ("dynamics",))}
    assert broken(checks.values()) == set()
    assert checks["inertia matrix M: MuJoCo"].value == pytest.approx(9.9e-12, rel=0.05)
    assert checks["inertia matrix M: MuJoCo"].bound == pytest.approx(2e-15 / 1.3e-4 + 1e-13, rel=1e-6)


@pytest.mark.release("compiles loops of another machine, 4 min")
@pytest.mark.parametrize("kind", MACHINES)
def test_every_row_holds_on_other_machines(tmp_path, kind):
    code, out, _ = crosscheck("--mjcf", machine(kind, tmp_path), "--states", FEW, "--json")
    rows = json.loads(out)["checks"]
    assert [row["name"] for row in rows if not row["ok"]] == []
    assert code == cli.DONE
    assert len(rows) == len(ROWS)
