"""Machines that change at random: motion, payload, kind of the change, hinge or group, size, and time.

Nothing lies on a grid of the watch. MuJoCo plays the machine, in its own steps; the watch has the Lagrangian.
`HELD_OUT` are kinds that were not used while the watch was built.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np

import spheretwin
from spheretwin.machine import Alarm, Log, Watch
from spheretwin.machine.log import log_of
from spheretwin.machine.workflow import NOMINAL

SCENARIO, FRICTION_Nm, VISCOUS_Nm_s = "sinusoid", 2e-3, 1e-4
LOAD, FRICTION, VISCOUS = "plant.modelling_torque_Nm", "plant.coulomb_Nm", "plant.viscous_Nm_s"
ALL = " of all hinges"
UNNAMED = "unexplained"


class Case(NamedTuple):
    """Log of a machine that changes."""

    kind: str
    name: str | None
    """What the watch should report; None: nothing."""
    size: float
    changed_s: float
    known: dict
    log: Log


def _log_uniform(generator, low, high):
    return float(np.exp(generator.uniform(np.log(low), np.log(high))))


def _sign(generator):
    return float(generator.choice([-1.0, 1.0]))


def _motion(generator):
    if generator.random() < 0.4:
        amplitude, frequency = generator.uniform(0.12, 0.28, 3), generator.uniform(0.4, 0.9)
        return {"trajectory.amplitude_rad": amplitude.tolist(), "trajectory.frequency_Hz": float(frequency)}
    components = []
    for middle in generator.uniform(0.3, 2.2, 4):
        amplitude = generator.uniform(0.03, 0.16, 3) / max(1.0, middle)
        frequency, phase = middle * generator.uniform(0.7, 1.4, 3), generator.uniform(0, 2 * np.pi, 3)
        names = "amplitude_rad", "frequency_Hz", "phase_rad"
        components.append(
            {name: one.tolist() for name, one in zip(names, (amplitude, frequency, phase), strict=True)}
        )
    return {"trajectory.shape": "multisine", "trajectory.components": components}


def _torque(generator, _):
    size = _sign(generator) * _log_uniform(generator, 0.03, 0.15)
    return "torque_scale", size, [(0.0, "plant.group_gain", [1 + size] * 18)]


def _group(generator, _):
    gains, group = np.ones(18), int(generator.integers(18))
    size = -_log_uniform(generator, 0.2, 1.0)
    gains[group] += size
    return f"plant.group_gain.{group}", size, [(0.0, "plant.group_gain", gains.tolist())]


def _hinges(generator, alone):
    """Return a suffix of names and the hinges that it means."""
    hinge = int(generator.integers(3))
    return (f".{hinge}", np.eye(3)[hinge]) if alone else (ALL, np.ones(3))


def _offset(generator, _):
    suffix, hinge = _hinges(generator, alone=True)
    size = _sign(generator) * _log_uniform(generator, 1e-3, 2e-2)
    field = "sensors.angle_offset_rad"
    return field + suffix, size, [(0.0, field, (size * hinge).tolist())]


COULOMB, VISCOUS_FRICTION = (FRICTION, FRICTION_Nm, 1.5e-3, 1.2e-2), (VISCOUS, VISCOUS_Nm_s, 1e-3, 5e-3)
"""Fields of friction, their values before, and the range of a change."""


def _friction(field, before, low, high, *, alone):
    def change(generator, _):
        suffix, hinges = _hinges(generator, alone)
        size = _log_uniform(generator, low, high)
        return field + suffix, size, [(0.0, field, (before + size * hinges).tolist())]

    return change


def _load(alone, push):
    def change(generator, _):
        suffix, hinges = _hinges(generator, alone)
        size = _sign(generator) * _log_uniform(generator, 3e-3, 4e-2)
        torques = [(0.0, size)] + [(float(generator.uniform(0.06, 0.16)), 0.0)] * push
        changes = [
            (after_s, "disturbance.terms", [{"kind": "constant", "torque_Nm": (torque * hinges).tolist()}])
            for after_s, torque in torques
        ]
        return LOAD + suffix, size, changes

    return change


def _two_loads(generator, _):
    torque_Nm = _log_uniform(generator, 3e-3, 4e-2) * np.array([1.0, _sign(generator), 0.0])
    terms = [{"kind": "constant", "torque_Nm": generator.permutation(torque_Nm).tolist()}]
    return UNNAMED, 0.0, [(0.0, "disturbance.terms", terms)]


def _payload(generator, payload_kg):
    size = _log_uniform(generator, 0.015, 0.08)
    return "plant.payload_kg", size, [(0.0, "plant.payload_kg", payload_kg + size)]


def _swing(generator, _):
    amplitude, frequency = _log_uniform(generator, 0.01, 0.04), generator.uniform(8, 20)
    terms = {"kind": "sinusoidal", "amplitude_Nm": [amplitude] * 3, "frequency_Hz": [float(frequency)] * 3}
    return UNNAMED, 0.0, [(0.0, "disturbance.terms", [terms])]


def _nothing(*_):
    return None, 0.0, []


def _sensor(*_):
    """The log is changed after the run."""
    return UNNAMED, 0.0, []


def _reversed(generator, _):
    """A group with the wrong sign: no gain that a watch knows."""
    gains = np.ones(18)
    gains[generator.integers(18)] = -1.0
    return UNNAMED, 0.0, [(0.0, "plant.group_gain", gains.tolist())]


KINDS = {
    "torque": _torque,
    "group": _group,
    "offset": _offset,
    "friction of one hinge": _friction(*COULOMB, alone=True),
    "friction of all hinges": _friction(*COULOMB, alone=False),
    "viscous friction": _friction(*VISCOUS_FRICTION, alone=False),
    "load on one hinge": _load(alone=True, push=False),
    "load on all hinges": _load(alone=False, push=False),
    "push on one hinge": _load(alone=True, push=True),
    "push on all hinges": _load(alone=False, push=True),
    "payload": _payload,
    "noise of a sensor": _sensor,
    "nothing": _nothing,
    "reversed group": _reversed,
    "swinging weight": _swing,
}

HELD_OUT = {
    "viscous friction of one hinge": _friction(*VISCOUS_FRICTION, alone=True),
    "load on two hinges": _two_loads,
    "spikes of a sensor": _sensor,
    "gain of a sensor": _sensor,
}


def random_case(seed, kind=None, duration_s=3.9):
    """Log of a machine of a seed; its kind goes round unless given."""
    generator = np.random.default_rng([47, seed])
    kind = kind or list(KINDS)[seed % len(KINDS)]
    change = (KINDS | HELD_OUT)[kind]
    known = {**NOMINAL, **_motion(generator), "plant.payload_kg": float(generator.choice([0.0, 0.05, 0.1]))}
    changed_s = float(generator.uniform(2.2, 2.9))
    name, size, changes = change(generator, known["plant.payload_kg"])
    events = [
        {"t_s": round(changed_s + after_s, 3), "set": field, "value": value}
        for after_s, field, value in changes
    ]
    fields = {**known, "duration": duration_s, "seed": seed, "event": events}
    log = log_of(spheretwin.simulate(SCENARIO, fields).telemetry, f"case {seed}")
    t_s, angle_rad = log.t_s, log.angle_rad.copy()
    after = np.flatnonzero(t_s > changed_s)
    if kind == "noise of a sensor":
        deviation_rad = 3.6e-4 * _log_uniform(generator, 2.0, 6.0)
        angle_rad[after, generator.integers(2)] += generator.normal(0, deviation_rad, len(after))
    if kind == "spikes of a sensor":
        spikes = after[generator.random(len(after)) < generator.uniform(0.02, 0.2)]
        angle_rad[spikes, generator.integers(2)] += _log_uniform(generator, 3e-3, 3e-2)
    if kind == "gain of a sensor":
        angle_rad[after, generator.integers(2)] *= 1 + _sign(generator) * _log_uniform(generator, 0.01, 0.04)
    return Case(kind, name, size, changed_s, known, replace(log, angle_rad=angle_rad))


class Outcome(NamedTuple):
    """What a watch reports of a case."""

    case: Case
    early: tuple
    """Alarms before the change."""
    alarm: Alarm | None
    """First one after it."""

    @property
    def is_named(self):
        """True if the alarm has a name."""
        return self.alarm is not None and self.alarm.what != UNNAMED

    @property
    def is_right(self):
        """True if the alarm, or its absence, is that of the change."""
        return (self.alarm and self.alarm.what) == self.case.name


def outcome_of(case):
    """Watch over a case."""
    alarms = Watch(SCENARIO, case.known).advance(case.log)
    late = [one for one in alarms if one.t_s > case.changed_s]
    return Outcome(case, tuple(one for one in alarms if one.t_s <= case.changed_s), late[0] if late else None)
