"""Changes of the independent machine at random times, sizes, hinges and motions, and their alarms.

`HELD_OUT` are kinds that nobody used while the watch was built.
"""

from typing import NamedTuple

import numpy as np

from spheretwin.machine import Alarm, Watch
from tests.independent.laboratory import DATA_SHEET, SCENARIO, read_log

DURATION_s = 3.9


class Change(NamedTuple):
    """Settings that take effect, and the name that a watch should give them; None: no alarm."""

    settings: tuple[str, ...]
    name: str | None
    size: float = 0.0


def _size(generator, low, high, *, signed=False):
    size = float(np.exp(generator.uniform(np.log(low), np.log(high))))
    return size * generator.choice([-1.0, 1.0]) if signed else size


def _vector(name, values):
    return f"{name}={','.join(f'{value:.6g}' for value in values)}"


def _torque(generator):
    size = _size(generator, 0.03, 0.15, signed=True)
    return Change((f"torque={1 + size}",), "torque_scale", size)


def _group(generator):
    group, size = generator.integers(18), _size(generator, 0.25, 1.0)
    return Change((f"gain={group}:{1 - size}",), f"plant.group_gain.{group}", -size)


def _offset(generator):
    hinge, size = generator.integers(3), _size(generator, 1.5e-3, 2e-2, signed=True)
    return Change((_vector("offset", size * np.eye(3)[hinge]),), f"sensors.angle_offset_rad.{hinge}", size)


def _friction(generator):
    size = _size(generator, 1.5e-3, 1.2e-2)
    return Change((f"coulomb={2e-3 + size}",), "plant.coulomb_Nm of all hinges", size)


def _load(generator):
    hinge, size = generator.integers(3), _size(generator, 4e-3, 4e-2, signed=True)
    return Change((_vector("load", -size * np.eye(3)[hinge]),), f"plant.modelling_torque_Nm.{hinge}", size)


def _payload(generator):
    size = _size(generator, 0.02, 0.08)
    return Change((f"payload={size}",), "plant.payload_kg", size)


KINDS = {
    "torque": _torque,
    "group": _group,
    "offset": _offset,
    "friction": _friction,
    "load": _load,
    "payload": _payload,
    "nothing": lambda _: Change((), None),
}

HELD_OUT = {
    "inertia": lambda generator: Change((f"inertia={1 + _size(generator, 0.2, 0.5)}",), "unexplained"),
    "cogging": lambda generator: Change((f"cogging={_size(generator, 0.005, 0.03)}",), "unexplained"),
    "slow amplifiers": lambda generator: Change((f"lag={_size(generator, 5e-3, 15e-3)}",), "unexplained"),
    "two groups": lambda generator: Change(("gain=2:0.2", "gain=9:0.3"), "unexplained"),
}


class Judged(NamedTuple):
    """First alarm of a watch after a change, and alarms before it."""

    kind: str
    change: Change
    changed_s: float
    early: int
    alarm: Alarm | None

    @property
    def is_right(self):
        """True if the alarm, or its absence, is that of the change."""
        return (self.alarm and self.alarm.what) == self.change.name

    @property
    def is_wrong(self):
        """True if the alarm has the name of something else."""
        return self.alarm is not None and self.alarm.what not in ("unexplained", self.change.name)


def judged(path, seed, kind):
    """Watch over a machine that changes."""
    generator = np.random.default_rng([48, seed])
    change = (KINDS | HELD_OUT)[kind](generator)
    changed_s = round(float(generator.uniform(2.2, 2.9)), 3)
    motion = (
        _vector("amplitude", generator.uniform(0.12, 0.28, 3)),
        _vector("frequency", generator.uniform(0.4, 0.9, 3)),
        f"seed={seed}",
    )
    log = read_log(path, DURATION_s, *motion, f"at={changed_s}", *change.settings)
    first_s = log.t_s[0]
    alarms = Watch(SCENARIO, DATA_SHEET).advance(log)
    late = [one for one in alarms if one.t_s - first_s > changed_s]
    return Judged(kind, change, changed_s, len(alarms) - len(late), late[0] if late else None)
