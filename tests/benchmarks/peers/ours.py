"""Our side of the comparison: a run, and the rows of a study."""

import os
import tempfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pyarrow.parquet as parquet
from problem import Problem, problem

from spheretwin import scenario as scenarios
from spheretwin.config.active_config import fill_defaults
from spheretwin.loop.block import RunBlock
from spheretwin.scenario.files import files_of
from spheretwin.scenario.sections import Scenario
from spheretwin.study import grid, row, runner
from spheretwin.study.study import Study, made

SCENARIO = "nutation"
ROW_s = 1.0

# At the scenario's load of 2 PD is at the current limit and leaves the workspace; at a quarter it completes.
CONDITIONS = {"pd": {"disturbance.load": 0.5}, "afsm": {}}

FIGURES = ("max_abs_error_rad", "rms_error_rad")


def scenario(law: str, engine: str = "mujoco") -> Scenario:
    return scenarios.load(SCENARIO, {"controller.law": law, "plant.engine": engine, **CONDITIONS[law]})


def study(law: str, rows: int) -> Study:
    """Return a study of rows that differ in modelling error and, by their seeds, in random torque."""
    fields = {
        "name": "peers", "scenario": SCENARIO, "samples": rows,
        "fields": {"duration": ROW_s, "plant.engine": "lagrangian", **CONDITIONS[law]}, "law": [{"law": law}],
        "metrics": list(FIGURES),
        "axis": [{"field": "plant.modelling_error", "kind": "uniform", "low": -0.2, "high": 0.5}],
    }  # fmt: skip
    return made(fields, "peers")


def problems(chosen: Study) -> list[Problem]:
    """Return the same rows in the form for a peer."""
    rows = row.Rows(chosen)
    return [problem(rows.scenario(each)) for each in grid.Grid(chosen)]


def run_rows(chosen: Study) -> dict[str, np.ndarray]:
    """Run a complete study with journal, figures and table; return the figures, (rows, 3) each."""
    with tempfile.TemporaryDirectory() as folder:
        runner.run(chosen, Path(folder))
        table = parquet.read_table(Path(folder) / "table.parquet", columns=list(FIGURES))
    return {name: np.array(table[name].to_pylist()) for name in FIGURES}


class Prepared:
    """Rows of a study as a peer has them: all prepared, with the same figures of each run."""

    def __init__(self, chosen: Study) -> None:
        self._rows, self._grid = row.Rows(chosen), grid.Grid(chosen)

    def prepare(self) -> None:
        """Build the blocks of all rows."""
        scenarios = [self._rows.scenario(each) for each in self._grid]
        files = files_of(scenarios[0])
        resolved = [fill_defaults(each, files, None, None) for each in scenarios]
        share = -(-len(resolved) // (4 * os.cpu_count()))
        parts = [resolved[first : first + share] for first in range(0, len(resolved), share)]
        self._blocks = [RunBlock(part, files, FIGURES) for part in parts]

    def __call__(self) -> None:
        """Run them on all cores."""
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            list(pool.map(RunBlock.run, self._blocks))
