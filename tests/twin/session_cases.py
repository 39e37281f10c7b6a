"""What the tests of sessions share: scenarios, laws of a user's, and the bytes of a table."""

import numba
import numpy as np

from spheretwin import scenario as scenarios
from spheretwin.control.law import Law
from spheretwin.models.telemetry.parquet import TelemetryFile
from spheretwin.models.telemetry.signals import Signal
from spheretwin.plant import plant_tick
from spheretwin.records.provenance import record_of
from spheretwin.session import Session

SHIPPED, ENGINES = ("pd", "adaptive_fuzzy", "afsm"), tuple(plant_tick.ENGINES)
RANDOM = {"disturbance.random_bound_Nm": 0.05}
WORN = {"plant.coulomb_Nm": [0.004, 0.003, 0.002], "plant.viscous_Nm_s": [1e-4, 1e-4, 2e-4]}
SENSED = {"detector.detect": True}
"""With it, MuJoCo's loop is that of the electronics, which is compiled anyway, also with exact sensors."""
COMPLETE = {"mujoco": {"hardware": "electronics"}, "lagrangian": {"hardware": "prototype"}}


def scenario(name="sinusoid", **changes):
    return scenarios.load(name, RANDOM | {key.replace("__", "."): value for key, value in changes.items()})


def session(law=None, **changes):
    return Session(scenario(**changes), law)


def rows(table):
    return table.values.tobytes()


def proportional(t, reference, measurement, parameters, state, torque):
    state[0] += 1.0  # calls
    parameters[1] *= 1.001  # a law may change what it was given
    for axis in range(3):
        error, rate = measurement[0, axis] - reference[0, axis], measurement[1, axis] - reference[1, axis]
        torque[axis] = -parameters[0] * error - parameters[1] * rate


compiled_proportional = numba.njit(proportional)

CALLS = (Signal("calls", "1", 1, "calls so far"),)


def plain_law(name="mine"):
    return Law(name, proportional, np.array([0.5, 0.05]), np.zeros(1), CALLS)


def compiled_law(name="mine"):
    return Law(name, compiled_proportional, np.array([0.5, 0.05]), np.zeros(1), CALLS)


OWN = {"plain": plain_law, "compiled": compiled_law}


def write_curve(path, curve, factor=1.0):
    """Write a torque curve times a factor to a file; return its path as text."""
    samples = zip(np.degrees(curve.phi_rad).tolist(), (factor * curve.torque_Nm_per_A).tolist(), strict=True)
    lines = ["phi_deg,torque_Nm_per_A", *(f"{phi!r},{torque!r}" for phi, torque in samples)]
    path.write_text("\n".join(lines))
    return str(path)


def same_future(one, other, ticks=200):
    assert (one.tick, one.journal, one.scenario, one.signals) == (
        other.tick, other.journal, other.scenario, other.signals,
    )  # fmt: skip
    return rows(one.advance(ticks)) == rows(other.advance(ticks))


def recorded(path, changes=(), law=None, ticks=600, **overrides):
    """A run of a session with changes at their ticks, as its user would write it to a file."""
    live = session(law, **overrides)
    file = TelemetryFile(path, live.signals, record_of(live).metadata())
    parts = []
    for tick, name, value in [*changes, (ticks, None, None)]:
        parts.append(live.advance(tick - live.tick))
        file.write(parts[-1])
        if name:
            live.set(name, value)
    file.finish("completed" if live.status == "running" else live.status)
    file.close(record_of(live).metadata())
    return live, parts


def not_compilable(t, reference, measurement, parameters, state, torque):
    torque[:] = {}.fromkeys("abc").popitem()


REFUSED = [
    ("disturbance.loud", 1.0), ("disturbance.load", float("nan")),
    ("disturbance", {"load": 2.0, "noise": 2.0}), ("disturbance.load", plain_law()), ("controller.law", None),
    ("controller.law", Law("broken", numba.njit(not_compilable), [], [])), ("nominal.torque_scale", 0.0),
    ("nominal.torque_curve", "/nowhere/curve.csv"), ("plant.torque_curve", "/nowhere/curve.csv"),
    ("plant.group_gain", [1.0, 1.0]), ("plant.integrator", "Verlet"), ("plant.integrator", "Euler"),
    ("fault", {"target": "coil.18", "mode": "open"}), ("state", {"current_A": [1.0] * 17}),
    ("state", {"q_rad": [0.0, 2.0, 0.0]}), ("", 1.0), (None, 1.0),
    # Fixed fields, and sections that would bring theirs with them.
    ("name", 1.0), ("seed", 1.0), ("controller.preset", 0.05), ("plant.step_s", 1e-3), ("plant.mjcf", None),
    ("plant.initial_rad_s", [0.0, 0.0, 0.0]), ("event", 1), ("event.0.t_s", 1),
    ("plant", {"engine": "mujoco"}), ("plant", {}), ("controller", {"period_s": 2e-3}),
]  # fmt: skip
"""A refusal of each stage: name, value, law, its compilation, files, model, engine, faults, fixed fields."""
