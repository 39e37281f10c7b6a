"""Short experiments on the shipped scenarios."""

import numpy as np

from spheretwin.models.telemetry.status import Status
from spheretwin.paper.cells import Numbers, of_axis
from spheretwin.paper.experiment import Case, Experiment, ExperimentSection, RunOutcome
from spheretwin.viz.pages.markdown import ResultTable

SHORT = {"duration": 0.2, "plant.engine": "lagrangian"}
NOISY = Case("noisy", "tilt", {**SHORT, "plant.engine": "mujoco", "hardware": "electronics"})
IDEAL = Case("ideal", "tilt", SHORT, is_random=False)
# 5 N·m: PD cannot hold it, and the rotor leaves its workspace.
HEAVY = {"duration": 1.0, "controller.law": "pd", "disturbance.load": 100.0}
LOST = Case("lost", "hold", HEAVY, is_random=False)


def sections(outcomes):
    rows = [
        (name, f"{Numbers(of_axis(runs, 'max_abs_error', 0)):.3f deg}") for name, runs in outcomes.items()
    ]
    tables = [ResultTable("Errors", ("case", "α"), rows)]
    return [ExperimentSection("What | was found", "In *words*, and <b>no tag</b>.", tables)]


def outcome(error=0.0, status=Status.COMPLETED, data=None, **figures):
    """Outcome with an error (rad) of all hinges, or of each."""
    errors = (np.array(error) * np.ones(3)).tolist()
    names = ("max_abs_error_rad", "rms_error_rad", "tail_rms_error_rad")
    return RunOutcome(status, {**dict.fromkeys(names, errors), **figures}, np.array(errors), data)


def experiment(*cases, **more):
    return Experiment("short", "A short one", "It is over soon.", lambda: list(cases), sections, **more)


def allowed(case):
    return case._replace(expected_statuses=(Status.COMPLETED, Status.LEFT_WORKSPACE))
