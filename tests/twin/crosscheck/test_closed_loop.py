"""The nutation in closed loop: the same motion on both engines, and what the physics step costs."""

import numpy as np
import pytest

from spheretwin import scenario as scenarios
from spheretwin.crosscheck.dynamics import MASS
from spheretwin.crosscheck.equations import ring_share
from spheretwin.crosscheck.scale import nutation_fields, scale_of
from spheretwin.loop import assembly
from spheretwin.models import actuator as actuators
from spheretwin.models import mjcf
from spheretwin.plant import lagrangian_rotor
from spheretwin.plant.lagrangian_rotor import LagrangianRotor
from spheretwin.simulation import simulate
from tests.twin.crosscheck.commands import MACHINES, fill_lagging, machine

# At the scenario's load of 2, PD lags so far behind that the currents saturate and the rotor leaves the
# workspace, on either plant; at a quarter of it, it completes.
PD = {"controller.law": "pd", "disturbance.load": 0.5}
AFSM = {"controller.law": "afsm"}
GENERAL = {**PD, "plant.coulomb_Nm": [2e-3] * 3, **{f"plant.mass.{name}": value for name, value in MASS}}

TRACE_rad, RINGS_rad = 1e-9, 3.0
"""Rounding parts a smooth law by 1e-14 rad; an inertia wrong by a share moves a trace by a third of it.

AFSM's trace moves by 1e-5 with one flipped sign of s: |s| is below 1e-10 at a tick less than once in
a thousand runs.
"""

# A smooth law, and no random torque, so that the runs differ in nothing else.
SMOOTH = {
    "controller.law": "afsm_eso",
    "controller.preset": "ideal",
    "disturbance.random_bound_Nm": 0.0,
    "seed": 101,
}
STEP_rad = 2e-5
"""A step of second order gives 9.7e-6 rad, a torque matrix taken at the start of each step 6e-4."""


def run(path, fields, **more):
    scale = scale_of(actuators.load(path))
    more = {name.replace("__", "."): value for name, value in more.items()}
    return simulate(scenarios.load("nutation", {**nutation_fields(path, scale, fields), **more}))


def difference_rad(one, other):
    assert (one.status, len(one.telemetry)) == (other.status, len(other.telemetry))
    return np.abs(one.telemetry["q_rad"] - other.telemetry["q_rad"]).max()


def between_engines_rad(path, fields):
    return difference_rad(*(run(path, fields, plant__engine=engine) for engine in ("mujoco", "lagrangian")))


def of_step_rad(path, engine):
    return difference_rad(*(run(path, SMOOTH, plant__engine=engine, plant__step_s=h) for h in (5e-4, 5e-5)))


def trace_bound_rad(path):
    share = ring_share(path, actuators.load(path)) if mjcf.read(path).has_ideal_joint else 0.0
    return TRACE_rad + RINGS_rad * share


@pytest.mark.parametrize(
    "fields", [PD, AFSM, pytest.param(GENERAL, marks=pytest.mark.release("compiles for 20 s"))]
)
def test_both_engines_take_the_same_motion(fields):
    assert between_engines_rad(actuators.MJCF_PATH, fields) < trace_bound_rad(actuators.MJCF_PATH)


@pytest.mark.parametrize("engine", ["mujoco", "lagrangian"])
def test_the_default_step_costs_little_unless_the_field_lags_by_half_a_step(monkeypatch, engine):
    assert of_step_rad(actuators.MJCF_PATH, engine) < STEP_rad
    monkeypatch.setattr(assembly, "fill_plant", fill_lagging)
    assert of_step_rad(actuators.MJCF_PATH, engine) > STEP_rad


@pytest.mark.release("1 to 2 s; other comparisons are broken in less")
@pytest.mark.parametrize(("error", "breaks"), [(1e-8, (True, False)), (0.1, (True, True))])
def test_a_wrong_plant_leaves_the_motion_of_the_other(monkeypatch, error, breaks):
    def heavier(joint, step_s):
        joint["inertia"] *= 1 + error / 1.2  # a share of the nominal inertia
        return LagrangianRotor(joint, step_s)

    monkeypatch.setattr(lagrangian_rotor, "LagrangianRotor", heavier)
    path = actuators.MJCF_PATH
    assert tuple(not between_engines_rad(path, law) < trace_bound_rad(path) for law in (PD, AFSM)) == breaks


@pytest.mark.release("compiles loops of another machine, 4 min")
@pytest.mark.parametrize("kind", MACHINES)
def test_closed_loops_of_other_machines_keep_their_bounds(tmp_path, kind):
    path = machine(kind, tmp_path)
    assert all(between_engines_rad(path, fields) < trace_bound_rad(path) for fields in (PD, AFSM, GENERAL))
    assert all(of_step_rad(path, engine) < STEP_rad for engine in ("mujoco", "lagrangian"))
