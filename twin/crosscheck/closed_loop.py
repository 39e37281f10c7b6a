"""The whole closed loop on two plants: MuJoCo, and the Lagrangian under our own steps.

Same scenario, same seed, same law, magnetics, drive and loop: only what is behind `step` differs.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.base.check import Check
from spheretwin.models.telemetry.table import Table
from spheretwin.twin import scenario as scenarios
from spheretwin.twin.crosscheck.part import Part
from spheretwin.twin.scenario.changing import changed
from spheretwin.twin.simulation import simulate

Array = NDArray[np.float64]

SCENARIO = "nutation"

# At the scenario's load of 2, PD lags so far behind that the currents saturate and the rotor leaves the
# workspace, on either plant; at a quarter of it, it completes.
CONDITIONS: dict[str, dict[str, Any]] = {
    "PD": {"controller.law": "pd", "disturbance.load": 0.5},
    "AFSM": {"controller.law": "afsm"},
}

BOUND_rad = 1e-9

WHY = {
    "PD": "a smooth law takes both runs to the same motion: only rounding and the gimbal rings (1e-12) part"
    " them; an inertia wrong by 1e-8 of itself moves the trace by 3e-9",
    "AFSM": "rounding and the gimbal rings (1e-12) as under PD, as long as they decide no sign of s: one"
    " flipped sign moves the trace by 1e-5. For that |s| must be below 1e-10 at a tick, where it moves by"
    " 1e-2 from tick to tick: less than once in a thousand runs",
}

# What the step size costs: a smooth law, and no random torque, so that the runs differ in nothing else.
ENGINES = {"MuJoCo": "mujoco", "Lagrangian": "lagrangian"}
STEP_s, FINE_s = 5e-4, 5e-5
SMOOTH: dict[str, Any] = {
    "controller.law": "afsm_eso",
    "controller.preset": "ideal",
    "disturbance.random_bound_Nm": 0.0,
    "seed": 101,
}
STEP_BOUND_rad = 2e-5


class Pair(NamedTuple):
    """One run on both plants."""

    mujoco: Table
    lagrangian: Table
    same_end: bool

    @property
    def difference_rad(self) -> Array:
        """(n,) largest difference of any hinge angle, up to where the shorter run ended."""
        rows = min(len(self.mujoco), len(self.lagrangian))
        apart: Array = np.abs(self.mujoco["q_rad"][:rows] - self.lagrangian["q_rad"][:rows])
        return np.max(apart, axis=1)


class ClosedLoop(NamedTuple):
    """Checks, and the runs they were taken from, by law."""

    checks: list[Check]
    pairs: dict[str, Pair]


def compare(mjcf: Path) -> ClosedLoop:
    """Run the nutation under both laws on both plants, and under a smooth law at two physics steps."""
    pairs = {law: _run(mjcf, overrides) for law, overrides in CONDITIONS.items()}
    traces = [_trace(law, pair) for law, pair in pairs.items()]
    return ClosedLoop([*traces, *(_step_size(mjcf, name) for name in ENGINES)], pairs)


def _run(mjcf: Path, overrides: dict[str, Any]) -> Pair:
    scenario = scenarios.load(SCENARIO, {**overrides, "plant.mjcf": str(mjcf)})
    on_mujoco = simulate(scenario)
    on_lagrangian = simulate(changed(scenario, "plant.engine", "lagrangian"))
    tables = on_mujoco.telemetry, on_lagrangian.telemetry
    same_end = on_mujoco.status == on_lagrangian.status and len(tables[0]) == len(tables[1])
    return Pair(*tables, same_end)


def _trace(law: str, pair: Pair) -> Check:
    load = CONDITIONS[law].get("disturbance.load", 2)
    return Check(
        name=f"closed loop under {law}: trace",
        compares=f"nutation at load {load:g} on MuJoCo with that on the Lagrangian, largest difference of any"
        " hinge angle at any tick",
        states=len(pair.difference_rad),
        value=float(np.max(pair.difference_rad)) if pair.same_end else float("inf"),
        bound=BOUND_rad,
        why=WHY[law],
        unit="rad",
        detail=_figures(pair),
    )


def _step_size(mjcf: Path, name: str) -> Check:
    fields = {**SMOOTH, "plant.mjcf": str(mjcf), "plant.engine": ENGINES[name]}
    runs = [simulate(scenarios.load(SCENARIO, {**fields, "plant.step_s": h})) for h in (STEP_s, FINE_s)]
    coarse, fine = (run.telemetry["q_rad"] for run in runs)
    same_end = runs[0].status == runs[1].status and len(coarse) == len(fine)
    return Check(
        name=f"closed loop: step size, {name}",
        compares=f"nutation under AFSM-ESO at {1e3 * STEP_s:g} ms with that at {1e3 * FINE_s:g} ms, largest"
        " difference of any hinge angle at any tick",
        states=len(coarse),
        value=float(np.max(np.abs(coarse - fine))) if same_end else float("inf"),
        bound=STEP_BOUND_rad,
        why="a step of second order, with a margin of two; a torque matrix taken at the start of each step"
        " gives 6e-4",
        unit="rad",
    )


def _figures(pair: Pair) -> dict[str, float]:
    ours, theirs = np.abs(pair.mujoco["error_rad"]), np.abs(pair.lagrangian["error_rad"])
    rms = np.sqrt(np.mean(ours**2, axis=0)), np.sqrt(np.mean(theirs**2, axis=0))
    largest = ours.max(axis=0), theirs.max(axis=0)
    return {
        "rms error, relative": float(np.max(np.abs(rms[0] / rms[1] - 1))),
        "largest error, relative": float(np.max(np.abs(largest[0] / largest[1] - 1))),
    }


PART = Part("closed loop", lambda on: compare(on.mjcf))
