"""Memory of laws in plain Python: it begins anew in each run, and no run finds that of another."""

import os
import threading

import numpy as np
import pyarrow.parquet
import pytest

from spheretwin import cli
from spheretwin import scenario as scenarios
from spheretwin.control.law import Law
from spheretwin.session import Session
from spheretwin.simulation import simulate
from spheretwin.study import runner
from tests.requirements import needs_compiled_functions

FILE = """
import numpy as np
from spheretwin import Law
from spheretwin.control.law_components.parameters import LawParameters
J = np.array([2.2e-3, 2.2e-3, 2.3e-3])
count = 0

class Pid:
    def __init__(self):
        self.i = np.zeros(3)
    def step(self, t, r, m, p, x, torque):
        self.i = self.i + (r[0] - m[0]) * 1e-3
        torque[:] = J * (1600 * (r[0] - m[0]) + 80 * (r[1] - m[1]) + 20000 * self.i)
    __call__ = step

def closure():
    memory = np.zeros(3)
    def step(t, r, m, p, x, torque):
        memory[:] += (r[0] - m[0]) * 1e-3
        torque[:] = J * (1600 * (r[0] - m[0]) + 80 * (r[1] - m[1]) + 20000 * memory)
    return step

def writes(t, r, m, p, x, torque):
    global count
    count += 1
    torque[:] = J * (1600 * (r[0] - m[0]) + 80 * (r[1] - m[1])) * (1 + 1e-3 * count)

METHOD = Law("method", Pid().step, [], [])
OBJECT = Law("object", Pid(), [], [])
CLOSURE = Law("closure", closure(), [], [])
GLOBAL = Law("global", writes, [], [])

class Built(LawParameters):
    def build(self, known):
        return Law("built", writes, [], [])
"""
NAMES = ("METHOD", "OBJECT", "CLOSURE", "GLOBAL", "Built")
SHORT = {"duration": 0.03, "plant.engine": "lagrangian"}


@pytest.fixture
def file(tmp_path):
    (path := tmp_path / "law.py").write_text(FILE)
    return path


@pytest.mark.parametrize("name", NAMES)
def test_runs_of_a_law_of_a_file_are_the_same(file, name):
    scenario = scenarios.load("hold", {**SHORT, "controller.law": f"{file}:{name}"})
    first, second = (simulate(scenario).telemetry.values for _ in range(2))
    np.testing.assert_array_equal(first, second)


@pytest.mark.parametrize("name", ["METHOD", "OBJECT"])
def test_runs_of_a_law_that_is_an_object_are_the_same(file, name):
    names = {}
    exec(FILE, names)
    scenario = scenarios.load("hold", SHORT)
    first, second = (simulate(scenario, law=names[name]).telemetry.values for _ in range(2))
    np.testing.assert_array_equal(first, second)
    # And the memory acts: another run of the same object would differ.
    with Session(scenario, names[name]) as session:
        session.advance(10)
        assert session.law.step is not names[name].step


@pytest.mark.parametrize("threads", [1, 2])
def test_rows_of_a_study_are_those_of_single_runs(file, tmp_path, threads):
    loads = [0.0, 2.0, 4.0]
    (tmp_path / "s.toml").write_text(
        'name = "s"\nscenario = "hold"\nseeds = 1\n[fields]\nduration = 0.03\n[[law]]\n'
        'law = "law.py:METHOD"\n[[axis]]\nfield = "disturbance.load"\nkind = "values"\n'
        f"values = {loads}\n"
    )
    runner.run(str(tmp_path / "s.toml"), tmp_path / "out", threads=threads)
    rows = pyarrow.parquet.read_table(tmp_path / "out" / "table.parquet")["max_abs_error_rad"].to_pylist()
    for load, row in zip(loads, rows, strict=True):
        changes = {**SHORT, "controller.law": f"{file}:METHOD", "disturbance.load": load}
        single = simulate(scenarios.load("hold", changes)).figures["max_abs_error_rad"]
        assert row == pytest.approx(single, rel=1e-12)


def test_an_object_that_cannot_be_copied_is_shared():
    class Locked:
        def __init__(self):
            self.lock = threading.Lock()

        def __call__(self, t, r, m, p, x, torque):
            torque[:] = 0.0

    law = Law("locked", Locked(), [], [])
    with Session(scenarios.load("hold", SHORT), law) as session:
        assert session.law.step is law.step


@needs_compiled_functions
def test_a_law_file_that_changes_the_folder_loses_no_path(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "other").mkdir()
    (tmp_path / "law.py").write_text(f"import os\nos.chdir('other')\n{FILE}")
    arguments = ["simulate", "hold", "--controller.law", "law.py:METHOD", "--duration", "0.02"]
    assert cli.main([*arguments, "--telemetry", "run.parquet"]) == 0
    assert (tmp_path / "run.parquet").exists()
    assert os.getcwd() == str(tmp_path)
