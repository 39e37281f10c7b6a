"""A copy of the package with a new member in every family: one file and one row each, and it works.

What is added here is what CONTRIBUTING.md says. Nothing else of the copy is touched, so a family that needs
a third place to be told of a new member fails here, be it in a test that every member of the family passes.
"""

import ast
import json
import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from tests import additions, hardware_additions
from tests.adding_scripts import DRAWN, REPRODUCE, SCRIPT, TESTS
from tests.package_copy import copy_package

ROOT = Path(__file__).parents[1]
ADDITIONS = additions.ADDITIONS | hardware_additions.ADDITIONS


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Where the copy is, with its new members."""
    folder = tmp_path_factory.mktemp("grown")
    package = copy_package(folder)
    for addition in ADDITIONS.values():
        registry = package / addition.registry.removeprefix("twin/")
        text, (old, new) = registry.read_text(), addition.row
        assert text.count(old) == 1, f"{addition.registry} has no row {old!r}"
        if addition.file:
            file = package / addition.file.removeprefix("twin/")
            file.write_text((file.read_text() if file.exists() else '"""New."""\n') + "\n" + addition.text)
        else:
            lists = next(
                statement
                for statement in ast.parse(text).body
                if old in "".join(text.splitlines(keepends=True)[statement.lineno - 1 : statement.end_lineno])
            )
            lines = text.splitlines(keepends=True)
            lines.insert(lists.lineno - 1, addition.text + "\n\n")
            text = "".join(lines)
        text = text.replace(old, new)
        first = text.find("\nfrom spheretwin")
        registry.write_text(text[: first + 1] + addition.imported + text[first + 1 :])
    return folder


def python(folder, script, *arguments, compiles=False):
    """Run a script where the copy is the package; its machine code is cached as that of the package is."""
    environment = {**os.environ, "PYTHONPATH": str(folder), "NUMBA_DISABLE_JIT": str(int(not compiles))}
    command = [sys.executable, "-c", script, *map(str, arguments)]
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True)


def results_of(folder, *, compiles):
    """Return the summary of a run of the new members, and what the copy states of them."""
    done = python(folder, SCRIPT, folder, compiles=compiles)
    assert done.returncode == 0, done.stderr
    figures, output = done.stdout.split("RESULT")
    return {"summary": json.loads(figures.splitlines()[0]), **json.loads(output)}


@pytest.fixture(scope="module")
def grown(folder):
    """Results without a compiler: a copy with other sources would compile everything again."""
    return results_of(folder, compiles=False)


@pytest.mark.release("compiles the copy for 30 s; the other tests run its members as plain Python")
def test_the_members_compile_and_act_as_in_plain_python(folder, grown):
    compiled = results_of(folder, compiles=True)
    assert compiled["columns"] == grown["columns"]
    for name in ("q", "measured", "carried", "disturbance", "blown"):
        # Sums of at most some hundred products below 8, rounded differently, amplified in 50 ms.
        np.testing.assert_allclose(compiled[name], grown[name], rtol=0, atol=1e-12)


def test_a_law(grown):
    assert (grown["code"], grown["summary"]["status"]) == (0, "completed")
    assert grown["summary"]["scenario"]["controller"]["slackness"] == [1.0, 2.0, 3.0]
    assert grown["helped"]["--controller.slackness"] == "torque or acceleration per unit of error, 1/s²"
    assert "adaptive_fuzzy, afsm, afsm_eso, lazy" in grown["refused"]["controller.law"]


def test_a_trajectory(grown):
    # 49 ms at 0.1, 0.2 and 0.3 rad/s: a product, rounded once.
    assert grown["q_ref"] == pytest.approx([0.0049, 0.0098, 0.0147], rel=1e-14)
    assert grown["helped"]["--trajectory.rate-rad-s"] == "rate of each axis, rad/s"
    assert grown["refused"]["trajectory.shape"].count("ramp") == 1


def test_a_disturbance(grown):
    assert grown["disturbance"] == [0.02 if 10 <= tick < 20 else 0.0 for tick in range(50)]
    assert "--disturbance.terms.0.torque-Nm" in grown["helped"]


def test_a_telemetry_column(grown):
    assert "largest_current_A" in grown["columns"]
    assert max(grown["largest"]) > 0


def test_a_plant(grown):
    assert grown["summary"]["scenario"]["plant"]["engine"] == "uncoupled"
    assert "'uncoupled'" in grown["refused"]["plant.engine"]


def test_a_state_of_physics_of_a_sensor_and_of_a_law(grown):
    """Each is computed from the telemetry, and part of a snapshot without another line of code."""
    qdot, measured, q, q_ref = (np.array(values) for values in grown["moved"].values())
    delayed = np.zeros(3)
    for rates in qdot:
        delayed += 0.25 * (rates - delayed)
    # Sums of twelve numbers below 10.
    np.testing.assert_allclose(grown["delayed"], delayed, rtol=0, atol=1e-14)
    np.testing.assert_allclose(grown["errors"], (measured - q_ref).sum(axis=0), rtol=0, atol=1e-14)
    turned = ((1 + 0.1 * np.array(grown["ratio"])) * q).sum(axis=0)
    np.testing.assert_allclose(grown["turned"], turned, rtol=0, atol=1e-14)
    assert np.abs(grown["delayed"]).min() > 0
    assert grown["states"][0] == grown["states"][1]
    assert grown["helped"]["--plant.dashpot.damping-Nm-s"] == "torque per unit of the delayed rate, N·m·s"


def test_an_estimator(grown):
    assert "qdot_estimated_rad_s" in grown["columns"]
    assert "kalman, differentiator, rough" in grown["refused"]["estimator.kind"]


def test_a_fault(grown):
    assert all(grown["blown"][1:30])
    assert not any(grown["blown"][30:])
    assert len(grown["marks"]) == 4


def test_a_sensor_stage_and_its_fault(grown):
    """The fault leaves the stage, and all others, as they are."""
    ratio = 1 + 0.1 * np.array(grown["ratio"])
    expected = ratio * np.array(grown["q"])
    expected[40:, 1] += 0.02
    # Products and sums of a few numbers below 1.
    np.testing.assert_allclose(grown["measured"], expected, rtol=0, atol=1e-15)
    assert np.abs(np.array(grown["ratio"])).min() > 1e-3
    assert grown["helped"]["--sensors.gear.ratio-error"] == "largest error of a ratio, drawn from the seed"


def test_a_drive_stage_and_its_fault(grown):
    asked, carried = np.array(grown["asked"]), np.array(grown["carried"])
    expected = 0.5 * asked
    expected[30:, 3], expected[40:, 5] = 0.0, 0.25
    np.testing.assert_array_equal(carried, expected)
    assert np.abs(asked).max() > 0.1
    assert grown["helped"]["--drive.filter-gain"] == "gain of the filter"


def test_new_stages_and_faults_move_no_random_number_of_another_part_and_no_bit_while_off(grown):
    here = {}
    exec(DRAWN, here)
    numbers = json.loads(json.dumps(here["drawn_numbers"]()))
    assert grown["random"] == numbers
    assert any(numbers["supply"])
    assert np.unique(numbers["fault noise"]).size > 100


def test_an_allocation(grown):
    assert 0 < grown["current"] <= 4.0
    assert "'halved'" in grown["refused"]["allocation"]


def test_a_metric(grown):
    # Ten of fifty ticks with 0.02 N·m: sums of ten numbers, rounded at 1e-18.
    assert grown["summary"]["mean_load_Nm"] == pytest.approx([0.0, 0.004, 0.0], abs=1e-16)


def test_a_status(grown):
    assert grown["status"] == "bored"
    assert grown["recording"] > 0


def test_a_check(grown):
    assert "| inertia is small |" in grown["page"]


def test_a_figure(grown):
    assert "(names.svg)" in grown["page"]
    assert grown["figure"] > 1000


def test_an_experiment(folder):
    done = python(folder, REPRODUCE, folder / "page")
    assert done.returncode == 0, done.stderr
    page = (folder / "page" / "reproduce.md").read_text()
    assert "## Holding on" in page
    assert "| lazy | completed |" in page


# New members by the file of tests that every member of their family passes.
EVERY = {
    "control/laws/test_every_law.py": "lazy", "control/allocation/test_every_allocation.py": "halved",
    "twin/trajectories/test_every_shape.py": "ramp", "twin/test_every_disturbance.py": "kick",
    "twin/test_every_channel.py": "largest_current_A", "twin/test_every_metric.py": "mean_load_Nm",
    "twin/plant/test_every_engine.py": "uncoupled", "twin/paper/test_every_experiment.py": "holding",
    "twin/faults/test_every_target.py": "gear", "twin/study/test_every_axis.py": "triangular",
}  # fmt: skip


@pytest.mark.release("8 s; the same tests run the shipped members in the first suite")
def test_the_families_tests_run_the_new_members_and_pass(folder, grown):
    tests = ROOT / "tests"
    assert set(EVERY) == {str(path.relative_to(tests)) for path in tests.rglob("test_every_*.py")}
    # The shipped members run in the suite itself; of their tests, those that list the cases of experiments
    # depend on the members of other families.
    chosen = " or ".join([*sorted(set(EVERY.values())), "cases_told_apart"])
    options = ["-p", "no:cacheprovider", "-rA", "-q", "-k", chosen]
    done = python(folder, TESTS, *options, *(tests / name for name in EVERY))
    assert done.returncode == 0, done.stdout
    passed = [line for line in done.stdout.splitlines() if line.startswith("PASSED")]
    for file, member in EVERY.items():
        of_the_member = [line for line in passed if file in line and member in line.partition("[")[2]]
        assert len(of_the_member) >= 2, f"{file} runs nothing for {member}"


def test_contributing_names_the_file_and_the_row_of_each():
    text = (ROOT / "docs" / "project" / "contributing.md").read_text()
    for family, addition in ADDITIONS.items():
        name = family.split("'s ")[-1]  # a fault of a stage stands in the row of faults
        start = re.compile(rf"\| {name}( of [^|]*)? \|")
        (row,) = [line for line in text.splitlines() if start.match(line)]
        assert f"`{addition.registry}`" in row
        if addition.file:
            assert f"`{Path(addition.file).parent}/" in row
