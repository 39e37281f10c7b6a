"""Shipped prototype: what converges with the physics step, and what does not.

With noise, quantisation and static friction a motion depends on the last digits: traces at two steps part
within a second and stay apart by the same amount at any step. Figures over some seeds agree.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from spheretwin import scenario as scenarios
from spheretwin.crosscheck.scale import nutation_fields, scale_of
from spheretwin.models.actuator import Actuator
from spheretwin.models.base.checks import Check, Checks
from spheretwin.models.base.errors import InputError
from spheretwin.run import Run
from spheretwin.simulation import simulate

STEP_s, FINE_s = 5e-4, 1.25e-4
SEEDS = (1, 2, 3, 4)
SCENARIO = "nutation"
STATUS = {"left_workspace": "left the workspace"}
FIELDS: dict[str, Any] = {
    "hardware": "prototype",
    "controller.law": "afsm_eso",
    "controller.preset": "prototype",
}

FIGURES = {"rms error": "rms_error_rad", "variation of the commands": "current_variation_A_s"}
BOUND = 0.05
"""Relative difference of the medians of a figure."""
LEAST_TILT = 0.1
"""Share of the angles of the shipped actuator below which noise is most of the motion: no bound then."""


def compare(mjcf: Path, actuator: Actuator) -> Checks:
    """Compare runs of the prototype at two physics steps, seed by seed.

    Parameters
    ----------
    mjcf : Path
        Model file.
    actuator : Actuator
        Reference and load are scaled to it.
    """
    scale = scale_of(actuator)
    fields, bound = nutation_fields(mjcf, scale, FIELDS), BOUND if scale.tilt >= LEAST_TILT else None
    try:
        coarse, fine = ([_run(fields, step_s, seed) for seed in SEEDS] for step_s in (STEP_s, FINE_s))
    except InputError as error:
        return Checks([_check(name, None, str(error)) for name in (*FIGURES, "trace")])
    ends = {run.status for run in (*coarse, *fine)} - {"completed"}
    end = ", ".join(STATUS.get(str(status), str(status)) for status in sorted(ends))
    checks = [_check(name, _difference(coarse, fine, figure), end, bound) for name, figure in FIGURES.items()]
    return Checks([*checks, _check("trace", _apart_rad(coarse, fine), end)])


def _run(fields: dict[str, Any], step_s: float, seed: int) -> Run:
    return simulate(scenarios.load(SCENARIO, {**fields, "plant.step_s": step_s, "seed": seed}))


def _difference(coarse: list[Run], fine: list[Run], figure: str) -> float:
    """Return the relative difference of the medians over the seeds, of the worse of α and β."""
    first, second = (
        np.median([np.max(np.atleast_1d(run.figures[figure])[:2]) for run in runs]) for runs in (coarse, fine)
    )
    return float(abs(first / second - 1))


def _apart_rad(coarse: list[Run], fine: list[Run]) -> float:
    """Return the median over the seeds of the largest difference of any hinge angle."""
    apart = []
    for one, other in zip(coarse, fine, strict=True):
        rows = min(len(one.telemetry), len(other.telemetry))
        apart.append(np.abs(one.telemetry["q_rad"][:rows] - other.telemetry["q_rad"][:rows]).max())
    return float(np.median(apart))


def _check(name: str, value: float | None, note: str, bound: float | None = None) -> Check:
    is_trace = name == "trace"
    compares = "largest difference of any hinge angle" if is_trace else "relative difference of the medians"
    why = (
        "traces do not converge: noise, quantisation and static friction let two steps part, at any step"
        if is_trace
        else "figures converge; chance of the seeds is a part of the difference"
    )
    return Check(
        name=f"prototype: {name}",
        compares=f"nutation on the shipped prototype at {1e3 * STEP_s:g} ms with that at {1e3 * FINE_s:g} ms,"
        f" {len(SEEDS)} seeds, {compares}" + (f"; {note}" if note else ""),
        states=len(SEEDS),
        value=value,
        bound=bound,
        why=why,
        unit="rad" if is_trace else "1",
    )
