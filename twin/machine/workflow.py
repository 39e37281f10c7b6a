"""Complete workflow on a hidden machine: design, logs, identification, shadow, validation and watch.

MuJoCo plays the machine, with sensors and drive; its parameters are drawn from a seed. The twin starts from a
nominal scenario that does not know them, and steps its own plant.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Annotated, Any, NamedTuple

import numpy as np
from pydantic import Field

from spheretwin import scenario as scenarios
from spheretwin.machine.excitation import Design, DesignSettings, design
from spheretwin.machine.identification import Identified, identify
from spheretwin.machine.intervals import Uncertainty
from spheretwin.machine.log import Log, log_of
from spheretwin.machine.model import model_of
from spheretwin.machine.noise_fit import fit_noise
from spheretwin.machine.parameters import Machine, selected
from spheretwin.machine.state_estimation import Shadowed, shadow
from spheretwin.machine.validation import Validation, validate
from spheretwin.machine.verdict import LogVerdict, check
from spheretwin.machine.watching import Alarm, Watch
from spheretwin.models import actuator as actuators
from spheretwin.models.base.arrays import Array
from spheretwin.models.base.errors import SpheretwinError
from spheretwin.models.telemetry.status import Status
from spheretwin.models.telemetry.table import Table
from spheretwin.scenario.fields import SettingsModel
from spheretwin.simulation import simulate

SCENARIO = "sinusoid"
CALIBRATED: dict[str, Any] = {
    "hardware": "electronics",
    "disturbance.load": 0.0,
    "disturbance.random_bound_Nm": 0.0,
    "plant.modelling_error": 0.0,
    "plant.modelling_torque_Nm": [0.0, 0.0, 0.0],
    # Errors of sensors and converters would be nuisance parameters, and minutes of computing.
    "sensors.potentiometer.nonlinearity_rad": 0.0,
    "sensors.adc.offset_V": 0.0,
    "sensors.adc.gain_error": 0.0,
    "drive.dac_bits": 0,
    "drive.amplifier_offset_V": 0.0,
}
"""Machine with calibrated sensors and converters, without load and modelling error."""

NOMINAL: dict[str, Any] = {**CALIBRATED, "plant.engine": "mujoco", "controller.law": "pid"}
"""Known properties of the machine; the values to identify are those of the data sheet."""

REQUESTED = ("torque_scale", "plant.modelling_error", "plant.coulomb_Nm")
PAYLOADS_kg = (0.0, 0.1)
OTHER_PAYLOAD_kg = 0.05
"""Of the log that judges the twin."""

CHANGED_s, AFTER_s = (2.3, 2.7), 1.0
"""Range of the times of changes, after the watch has measured the noise, and time that follows it."""


class WorkflowSettings(SettingsModel):
    """Settings of the workflow."""

    seed: Annotated[int, Field(ge=0)] = Field(0, description="seed of the hidden machine and of its sensors")
    design: DesignSettings = Field(
        DesignSettings(
            duration_s=2.0,
            candidates=16,
            sines=2,
            payloads_kg=PAYLOADS_kg,
            largest_angle_rad=1.0,
            fastest_Hz=5.0,
            largest_rate_rad_s=20.0,
            largest_current_A=7.5,
        ),
        description="settings of the design",
    )
    judged_s: Annotated[float, Field(ge=1.0, le=60)] = Field(
        3.0, description="length of the log that judges the twin, s"
    )


class Played(NamedTuple):
    """Log and telemetry of a run of the hidden machine."""

    log: Log
    telemetry: Table


class Judged(NamedTuple):
    """A twin on the log that judges it."""

    shadowed: Shadowed
    validation: Validation


class MachineChange(NamedTuple):
    """Change of the machine during a log."""

    label: str
    field: str
    value: Any
    what: str
    """Parameter that an alarm should name, or its beginning."""
    size: float
    t_s: float


class Watched(NamedTuple):
    """Result of the watch over a log with a change, or without one."""

    change: MachineChange | None
    alarms: tuple[Alarm, ...]
    t_s: Array
    """End of each window."""
    sums: dict[str, Array]
    """Logarithm of the evidence of each change after each window."""
    threshold: float

    @property
    def named(self) -> Alarm | None:
        """First alarm after the change that names it."""
        if self.change is None:
            return None
        return next((one for one in self.alarms if self._names(one)), None)

    @property
    def others(self) -> list[Alarm]:
        """Alarms before `named`, or all of them if there is none."""
        place = self.alarms.index(self.named) if self.named else len(self.alarms)
        return list(self.alarms[:place])

    def _names(self, alarm: Alarm) -> bool:
        return bool(self.change and alarm.t_s > self.change.t_s and alarm.what.startswith(self.change.what))


class Workflow(NamedTuple):
    """Results of the workflow."""

    true: dict[str, float]
    """Parameters of the hidden machine, by the names of `identify`."""
    nominal: dict[str, float]
    design: Design
    logs: tuple[Played, ...]
    """Of the designed experiment under each payload, then the one that judges the twin."""
    verdicts: tuple[LogVerdict, ...]
    without_payload: Identified
    """From the first log alone."""
    identified: Identified
    before: Judged
    after: Judged
    watched: tuple[Watched, ...]


def run_workflow(
    settings: WorkflowSettings | None = None,
    track: Callable[[range], Iterable[int]] = lambda steps: steps,
) -> Workflow:
    """Run the workflow.

    Parameters
    ----------
    settings : WorkflowSettings, optional
    track : callable
        As for `design`.

    Raises
    ------
    SpheretwinError
        A run of the hidden machine ended early, or no motion stays within the limits of the design.
    """
    settings = settings or WorkflowSettings()
    nominal = Machine(SCENARIO, NOMINAL)
    true = hidden_machine(settings.seed)
    designed = design(SCENARIO, REQUESTED, NOMINAL, settings.design, track)
    motion = {"trajectory.shape": "multisine", "trajectory.components": _components(designed)}
    hidden = {**NOMINAL, **_fields(true)}
    logs = [
        _play({**hidden, **motion}, payload_kg, settings.design.duration_s, settings.seed + place)
        for place, payload_kg in enumerate(settings.design.payloads_kg)
    ]
    judge = _play(hidden, OTHER_PAYLOAD_kg, settings.judged_s, settings.seed + len(logs))
    identified = identify([one.log for one in logs], SCENARIO, REQUESTED, NOMINAL)
    twin = {**NOMINAL, **identified.fields}
    return Workflow(
        true=true,
        nominal={one.name: nominal.nominal(one) for one in selected(REQUESTED, nominal.model.actuator)},
        design=designed,
        logs=(*logs, judge),
        verdicts=tuple(check(one.log, scenarios.load(SCENARIO, NOMINAL)) for one in (*logs, judge)),
        without_payload=identify(logs[0].log, SCENARIO, REQUESTED, NOMINAL),
        identified=identified,
        before=_judge(judge.log, NOMINAL, None),
        after=_judge(judge.log, twin, identified.uncertainty),
        watched=tuple(
            _watch({**hidden, **motion}, twin, change, settings.seed)
            for change in (None, *_changes(true, settings.seed))
        ),
    )


def hidden_machine(seed: int) -> dict[str, float]:
    """Return the true parameters of a machine, by the names of `identify`."""
    generator = np.random.default_rng(seed)
    friction_Nm = generator.uniform(1.5e-3, 3.5e-3) * generator.uniform(0.9, 1.1, 3)
    return {
        "torque_scale": float(generator.uniform(0.92, 1.08)),
        "plant.modelling_error": float(generator.uniform(-0.1, 0.1)),
        **{f"plant.coulomb_Nm.{hinge}": float(value) for hinge, value in enumerate(friction_Nm)},
    }


def _fields(true: Mapping[str, float]) -> dict[str, Any]:
    """Return the fields of a scenario of a machine with some parameters."""
    return {
        "plant.modelling_error": true["plant.modelling_error"],
        "plant.coulomb_Nm": [true[f"plant.coulomb_Nm.{hinge}"] for hinge in range(3)],
        "plant.group_gain": [true["torque_scale"]] * len(actuators.load().groups),
    }


def _components(designed: Design) -> Any:
    return designed.scenario.model_dump(mode="json")["trajectory"]["components"]


def _play(
    fields: Mapping[str, Any],
    payload_kg: float,
    duration_s: float,
    seed: int,
    change: MachineChange | None = None,
) -> Played:
    """Return what the hidden machine leaves; a change takes place at its time."""
    event = {"t_s": round(change.t_s, 3), "set": change.field, "value": change.value} if change else None
    own = {
        "plant.payload_kg": payload_kg,
        "duration": duration_s,
        "seed": seed,
        "event": [event] if event else [],
    }
    run = simulate(SCENARIO, {**fields, **own})
    if run.status is not Status.COMPLETED:
        raise SpheretwinError(
            f"workflow: expected a run of {duration_s:g} s, received {run.status} after"
            f" {run.telemetry['t_s'][-1]:.3g} s"
        )
    name, conditions = f"payload {1e3 * payload_kg:g} g", {"plant.payload_kg": payload_kg}
    return Played(log_of(run.telemetry, name, conditions), run.telemetry)


_FIT_s = 1.0  # rows for the noise of the shadow


def _judge(log: Log, fields: Mapping[str, Any], uncertainty: Uncertainty | None) -> Judged:
    """Return the shadow, with fitted noise, and the validation of a twin."""
    model = model_of(SCENARIO, {**fields, **log.conditions})
    rows = int(np.searchsorted(log.t_s, log.t_s[0] + _FIT_s))
    fitted = fit_noise(log.rows(0, rows), model)
    validation = validate(log, SCENARIO, fields, uncertainty=uncertainty)
    return Judged(shadow(log, model, settings=fitted.settings), validation)


def _changes(true: Mapping[str, float], seed: int) -> list[MachineChange]:
    """Return the changes that the watch should name, at times from a seed."""
    times_s = np.random.default_rng([seed, 1]).uniform(*CHANGED_s, 4).tolist()
    fields = _fields(true)
    gains, friction_Nm = np.array(fields["plant.group_gain"]), np.array(fields["plant.coulomb_Nm"])
    weak, offset_rad = 0.2 * gains[_WEAK] * (np.arange(len(gains)) == _WEAK), float(np.radians(0.1))
    offset, group = "sensors.angle_offset_rad", f"plant.group_gain.{_WEAK}"
    rows = (
        ("torque −3 %", "plant.group_gain", 0.97 * gains, "torque_scale", -0.03),
        (f"group {_WEAK} −20 %", "plant.group_gain", gains - weak, group, -weak[_WEAK]),
        ("offset of α +0.1°", offset, np.array([offset_rad, 0.0, 0.0]), f"{offset}.0", offset_rad),
        ("friction doubled", "plant.coulomb_Nm", 2 * friction_Nm, "plant.coulomb_Nm", np.mean(friction_Nm)),
    )
    return [
        MachineChange(label, field, value.tolist(), what, float(size), t_s)
        for (label, field, value, what, size), t_s in zip(rows, times_s, strict=True)
    ]


_WEAK = 5  # a group that the motion needs


def _watch(
    hidden: Mapping[str, Any], twin: Mapping[str, Any], change: MachineChange | None, seed: int
) -> Watched:
    """Return the alarms of a log, judged window by window."""
    log = _play(hidden, max(PAYLOADS_kg), CHANGED_s[1] + AFTER_s, seed, change).log
    watch = Watch(SCENARIO, {**twin, **log.conditions})
    count = round(watch.settings.window_s / float(np.median(np.diff(log.t_s))))
    alarms: list[Alarm] = []
    times: list[float] = []
    sums: list[dict[str, float]] = []
    for end in range(count + 2, len(log) + 1, count):  # the last row of a window, and that which starts it
        alarms += watch.advance(log.rows(end - count if times else 0, end))
        times.append(float(log.t_s[end - 1]))
        sums.append(watch.sums)
    return Watched(
        change,
        tuple(alarms),
        np.array(times),
        {name: np.array([one[name] for one in sums]) for name in watch.sums},
        watch.threshold,
    )
