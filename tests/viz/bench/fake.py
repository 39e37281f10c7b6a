"""A bench that does nothing but note what it is told, and a page of it."""

import contextlib
import threading
from types import SimpleNamespace

import numpy as np

from spheretwin.models import actuator as actuators
from spheretwin.models.base.errors import InputError
from spheretwin.viz.bench import server
from spheretwin.viz.bench.page import Page
from spheretwin.viz.bench.protocols import Bins, Choices, FieldSetting

GROUPS = 18

STATE = {
    **dict.fromkeys(("stopped", "saturated", "rank_lost"), False),
    **dict.fromkeys(("temperature_C", "reason", "note", "operator", "pose_rad", "manual_currents_A"), None),
    **dict.fromkeys(("replay_file", "replay_range_s", "capture_t_s"), None),
    **dict.fromkeys(("faults", "active_faults", "failed_groups", "pending", "snapshots"), ()),
    **dict.fromkeys(("recording", "completed_files", "watching", "asking"), ()),
    **{"mode": "hold", "stop_mode": "off", "scenario": "hold", "law": "afsm", "shape": "hold"},
    **{"status": "running", "running": True, "capture": "off", "allocation": "projected"},
    **{"t_s": 1.25, "speed": 1.0, "realtime_factor": 0.998, "chunks": 60, "missed": 2},
    **{"q_rad": (0.1, -0.2, 0.3), "q_ref_rad": (0.1, -0.1, 0.3), "error_mrad": 100.0, "error_deg": 5.7296},
    "current_command_A": (0.0,) * GROUPS,
    "current_A": tuple(np.linspace(-2.0, 2.0, GROUPS)),
    "current_limit_A": 8.0,
    "torque_margin": 0.75,
    "chatter_A_s": 12.3,
    "limits": (2.0, 20.0),
    "jog_rates_rad_s": (0.0, 0.0, 0.0),
}


class Bench:
    """Every command is noted and done, but the refused; the state is what a test makes it."""

    actuator = actuators.load()

    def __init__(self, refused=(), **state):
        self.told, self.beats, self.refused = [], [], dict(refused)
        self.now = SimpleNamespace(**STATE | state)
        self.run, self.capture = 1, {}
        self._lock = threading.Lock()

    def command(self, name, /, *, client=None, **arguments):
        with self._lock:
            if name == "beat":
                self.beats.append(client)
            else:
                self.told.append((name, client, arguments))
            if name == "hello" and self.now.operator is None:
                self.now.operator = client
            if name == "ask" and self.now.operator is None:
                self.now.operator = client
            if name == "leave" and self.now.operator == client:
                self.now.operator = None
        return SimpleNamespace(done=True, refused=self.refused.get(name))

    def may_command(self, client):
        return client == self.now.operator

    def commands(self):
        """Names and arguments of what it was told, but for who is there."""
        return [(name, given) for name, _, given in self.told if name not in ("hello", "leave")]

    def state(self):
        return self.now

    def bins(self, after=-1):
        numbers = [number for number in range(50) if number > after]
        t_s = 0.02 * np.array(numbers, dtype=float)
        angles = np.stack([np.sin(t_s), np.cos(t_s), t_s], axis=1)
        rows = {
            "t_s": t_s[:, None],
            "q_rad": angles,
            "q_ref_rad": angles + 0.01,
            "error_rad": 1e-3 * angles,
            "torque_command_Nm": angles,
            "current_A": t_s[:, None] * np.arange(GROUPS),
            "coil_temperature_degC": np.full((len(numbers), GROUPS), np.nan),
        }
        high = {name: values + (0.5 if name != "t_s" else 0.0) for name, values in rows.items()}
        return Bins(self.run, numbers, rows, rows, high)

    def captured(self):
        return self.capture

    def command_line(self):
        return "spheretwin simulate hold"


SETTINGS = [
    FieldSetting("controller.law", "afsm", "afsm", "law", ("pd", "afsm")),
    FieldSetting("controller.stiffness", "4 4 4", "1 1 1", "stiffness, N·m/rad", range=(0.0, 8.0)),
    FieldSetting("controller.known", "true", "false", "whether"),
    FieldSetting("disturbance.load", "0", "0", "load"),
    FieldSetting("plant.step_s", "0.0005", "0.0005", "physics step, s"),
]


def read(name, text):
    if text == "unreadable":
        raise InputError(f"{name}: expected a value, received {text}")
    return text


CHOICES = Choices(
    settings=lambda: SETTINGS,
    shape=lambda name: [FieldSetting("amplitude", "0.2", "0.2", "rad")] if name == "sinusoid" else [],
    read=read,
    scenarios=lambda: ("hold", "nutation"),
    shapes=("hold", "sinusoid"),
    laws=lambda: ("pd", "afsm"),
    runs=lambda: ("run.parquet",),
    limits=(2.0, 20.0),
    targets={"coil.00": ("open", "short"), "supply": ("off",)},
)


@contextlib.contextmanager
def shown(bench):
    """A page that follows a bench, in a thread of its own."""
    ended = threading.Event()
    with Page(bench, CHOICES, server.listen(0)) as page:
        following = threading.Thread(target=page.show, args=(ended.is_set,))
        following.start()
        try:
            yield page
        finally:
            ended.set()
            following.join()
