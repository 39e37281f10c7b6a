"""What every law of the registry owes, whichever it is."""

import ast
import importlib
from pathlib import Path

import numpy as np
import pytest

from spheretwin import scenario as scenarios
from spheretwin.control.law import NominalModel
from spheretwin.control.laws import LAWS
from spheretwin.models.telemetry.status import Status
from spheretwin.simulation import simulate


@pytest.mark.parametrize("name", LAWS)
def test_every_law_runs_to_a_status(name):
    run = simulate(scenarios.load("hold", {"controller.law": name, "duration": 0.05}))
    assert run.status in set(Status)
    assert len(run.telemetry) == 50 or run.status != Status.COMPLETED
    known = NominalModel(run.scenario.controller.period_s, 0.0, run.actuator.inertia)
    for signal in run.scenario.controller.build(known).signals:
        assert np.isfinite(run.telemetry[signal.name]).all()
        assert signal.unit
        assert signal.meaning


@pytest.mark.parametrize("name", LAWS)
def test_every_law_s_parameters(name, check_parameters):
    assert LAWS[name].model_fields["law"].default == name
    check_parameters(LAWS[name](), "controller", lambda fields: {"controller": fields})


# What README and `control.law` tell whoever writes a law, and what laws are made of.
OPEN_TO_ALL = (
    "spheretwin.control.law",
    "spheretwin.control.law_components",
    "spheretwin.models.base",
    "spheretwin.models.kinematics",
    "spheretwin.models.lagrangian",
    "spheretwin.models.telemetry.signals",
)


def imported_by(path):
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom):
            yield node.module
        elif isinstance(node, ast.Import):
            yield from (each.name for each in node.names)


@pytest.mark.parametrize("name", LAWS)
def test_every_law_imports_only_modules_open_to_user_laws(name):
    path = Path(importlib.import_module(LAWS[name].__module__).__file__)
    ours = [module for module in imported_by(path) if module.startswith("spheretwin")]
    assert "spheretwin.control.law" in ours
    assert [module for module in ours if not module.startswith(OPEN_TO_ALL)] == []
