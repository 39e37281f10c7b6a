"""Constructed results of checks: of the cross-check and of the magnetic model."""

import dataclasses
from types import SimpleNamespace

import numpy as np

from spheretwin.crosscheck.dynamics import QUANTITIES, Dynamics
from spheretwin.crosscheck.suite import CrosscheckResult
from spheretwin.crosscheck.trajectories import Convergence, Trajectories
from spheretwin.models import actuator as actuators
from spheretwin.models.base.checks import Check
from spheretwin.models.design.curve_check import (
    ComputedCurve,
    CurveDifference,
    CurvePeak,
    JudgedCurve,
    Misfit,
)
from spheretwin.models.design.field_check import Band, FieldVerdict, Sources
from spheretwin.models.design.torque_map import TorqueAtTilt, TorqueSurvey, WeakPose, WorkspaceVerdict

COUNT = np.arange(40.0)
T_s = COUNT / 8


def checks(*names: str) -> list[Check]:
    """Return checks that hold, one that is broken, one without a bound and one with two bounds."""
    made = [
        Check(name, f"{name} | ours against theirs", 10 * place, 1e-9 * place, 1e-6, f"why {name}")
        for place, name in enumerate(names, 1)
    ]
    made[1] = dataclasses.replace(made[1], value=3e-6, unit="rad")
    if len(made) > 2:
        bounds = {"bound": 4.2, "at_least": 3.8}
        made[2] = dataclasses.replace(made[2], value=4.02, **bounds, detail={"a": 4.0, "b": 4.02})
        made[3:] = [dataclasses.replace(check, value=2.5, bound=None, unit="N·m") for check in made[3:]]
    return made


def evidence() -> CrosscheckResult:
    """Return findings of each part of the cross-check that has a figure."""
    three = np.stack([T_s, 0.5 - T_s, T_s * T_s], axis=1)
    differences = {
        engine: {each.name: factor * (1 + COUNT + place) * 1e-13 for place, each in enumerate(QUANTITIES)}
        for engine, factor in (("MuJoCo", 1.0), ("Pinocchio", 3.0))
    }
    convergence = {
        "RK4": Convergence(np.array([1e-3, 2e-3]), np.array([1e-9, 1.6e-8]), 4.0),
        "Euler": Convergence(np.array([1e-3, 2e-3]), np.array([1e-4, 2e-4]), 1.0),
    }
    findings = {
        "dynamics": Dynamics(
            checks("inertia", "bias"), differences, {each.name: each.bound for each in QUANTITIES}
        ),
        "trajectories": Trajectories(
            checks("motion", "order", "slope"), T_s, three, 1e-9 * three, convergence
        ),
    }
    return CrosscheckResult(findings)


def field_verdict() -> FieldVerdict:
    """Return a comparison with direct sums that exceeds a bound."""
    bands = [Band((0.0, 10.0), 4, 1e-4, 2e-3, 3e-4, 4e-6), Band((10.0, 30.0), 11, 5e-4, 6e-3, 7e-4, 8e-6)]
    return FieldVerdict(1.234, bands, Sources(1e-6, 2e-2, 3e-7), checks("torque", "force"), ["a small mesh"])


def capability(values: np.ndarray) -> SimpleNamespace:
    """Return figures of a capability that are multiples of some values."""
    return SimpleNamespace(
        best_Nm=values,
        least_norm_Nm=values / 2,
        singular_value_Nm_per_A=values / 100,
        condition=10 * values,
        copper_W_per_Nm2=3 * values,
    )


def survey() -> TorqueSurvey:
    """Return a capability over three tilts, two azimuths and two spins."""
    tilt_rad, azimuth_rad = np.radians([0.0, 10.0, 20.0]), np.radians([0.0, 90.0])
    reachable = np.ones((3, 2, 2), bool)
    reachable[2, 0] = False
    space = SimpleNamespace(tilt_rad=tilt_rad, azimuth_rad=azimuth_rad, reachable=reachable)
    on_grid = capability(np.arange(1.0, 13.0).reshape(3, 2, 2))
    worst = {
        name: SimpleNamespace(capability=capability(factor * np.array([0.5, 4.0, 9.0])))
        for name, factor in (("least_norm", 0.9), ("best", 0.8), ("singular_value", 0.7))
    }
    return TorqueSurvey(actuators.load(), 20.0, space, on_grid, worst, {})


def workspace_verdict() -> WorkspaceVerdict:
    """Return a verdict of five tilts and three weak poses."""
    by_tilt = [
        TorqueAtTilt(5.0 * i, *(np.array([1.0, 1.5, 1.1, 1.6, 0.02, 3.0, 80.0]) - 0.1 * i)) for i in range(5)
    ]
    weakest = [
        WeakPose(
            name, [10.0 + i, -20.0, 0.04], 22.5 + i, 30.0, 5.0, [0.6, 0.0, -0.8], 0.9, 1.0 + i, 0.0123, 70.0
        )
        for i, name in enumerate(("least_norm", "best", "singular_value"))
    ]
    return WorkspaceVerdict(20.0, 10, 8.0, by_tilt, weakest, checks("need", "rank"), ["the model is coarse"])


def judged_curve() -> JudgedCurve:
    """Return the verdict on a user's curve."""
    geometry = CurveDifference(Misfit(1e-3, 4e-3, 12.5), 0.93, Misfit(1e-5, 2e-5, 30.0))
    return JudgedCurve(
        61, CurvePeak(0.0123, 9.75), Misfit(2e-4, 3e-4, 7.5), geometry, 5e-6, ["too few samples"]
    )


def computed_curve() -> ComputedCurve:
    """Return a computed curve."""
    curve = actuators.load().torque_curve
    mesh = SimpleNamespace(peak=1e-5, worst=2e-5)
    return ComputedCurve(
        curve, "phi,f\n0,1\n", CurvePeak(0.0125, 9.5), mesh, 3e-6, checks("mesh", "lookup"), []
    )
