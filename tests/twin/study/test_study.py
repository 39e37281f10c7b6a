"""Studies from TOML: what cannot be run is refused in one line before the first row."""

import pytest

from spheretwin.study import runner
from spheretwin.study.grid import Grid
from spheretwin.study.row import Rows
from spheretwin.study.study import load, shipped


@pytest.mark.parametrize("name", shipped())
def test_shipped_studies_can_be_run(name):
    chosen = load(name)
    runner.check(Grid(chosen), Rows(chosen))
