"""The command line of a row, read as the command reads it, is the scenario that the row ran."""

import shlex

import pytest

from spheretwin import scenario as scenarios
from spheretwin.paper import EXPERIMENTS
from spheretwin.paper.experiment import Case
from spheretwin.paper.runner import command_line, scenario_of
from spheretwin.scenario import reading

SOME = 40  # cases of an experiment: the fault study has thousands, of a few kinds


def read(line):
    program, verb, source, *words = shlex.split(line)
    assert (program, verb) == ("spheretwin", "simulate")
    return scenarios.load(source, reading.overrides(words))


@pytest.mark.parametrize("name", EXPERIMENTS)
def test_every_row_can_be_run_alone(name):
    cases = EXPERIMENTS[name].cases()
    for case in cases[:: max(1, len(cases) // SOME)]:
        scenario = scenario_of(case, None, seed=3)
        assert read(command_line(case, scenario.plant.engine, seed=3)) == scenario


def test_lists_tables_texts_and_nothing():
    fields = {
        "plant.coulomb_Nm": (1e-3, 0.0, 2e-3),
        "drive.time_constant_s": None,
        "watchdog.on": True,
        "fault": [
            {"target": "coil.03", "mode": "open", "start_s": 0.5},
            {"target": "pot.alpha", "mode": "offset", "value": 0.02},
        ],
    }
    case = Case("many", "tilt", {**fields, "hardware": "electronics"})
    assert read(command_line(case, "mujoco", 7)) == scenario_of(case, "mujoco", 7)
