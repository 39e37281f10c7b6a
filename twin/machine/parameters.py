"""Parameters of a machine that a log can identify: their names, sizes, priors, and what they change."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import inf, sqrt
from typing import Any, NamedTuple

import numpy as np

from spheretwin.electronics.drive_section import drive_sheet
from spheretwin.electronics.transducers import HARMONICS
from spheretwin.machine.log import Log
from spheretwin.machine.model import Model, model_of
from spheretwin.machine.row_order import OWN_STAMPS
from spheretwin.models.actuator import Actuator
from spheretwin.models.base.arrays import Array
from spheretwin.models.base.errors import InputError, did_you_mean
from spheretwin.models.coil_group import PerGroup
from spheretwin.models.mjcf_reader import HINGES
from spheretwin.plant.plant_step import Parameters


class ParameterKind(NamedTuple):
    """A kind of parameter; a member for each part that has one."""

    name: str
    """Field of a scenario, or a name of its own."""
    unit: str
    size: float
    """Size of a change that matters, in the unit: a parameter is identified if its deviation is smaller."""
    members: str
    """Owner: ``one``, ``hinges``, ``groups``, ``poles``, or ``harmonics`` of a residual."""
    meaning: str
    least: float = -inf
    most: float = inf


_WHOLE = "one"
_PER_HINGE = "hinges"
_PER_GROUP = "groups"
_PER_POLE = "poles"
_PER_HARMONIC = "harmonics"

_ROWS: tuple[tuple[Any, ...], ...] = (
    ("torque_scale", "1", 0.05, _WHOLE, "torque of all groups over that of the torque curve"),
    ("plant.modelling_error", "1", 0.1, _WHOLE, "relative error of the inertia", -0.9),
    ("plant.coulomb_Nm", "N·m", 2e-3, _PER_HINGE, "Coulomb friction", 0.0),
    ("plant.coulomb_asymmetry", "1", 0.1, _PER_HINGE, "excess of Coulomb friction to one side", -1.0, 1.0),
    ("plant.viscous_Nm_s", "N·m·s", 2e-4, _PER_HINGE, "viscous friction", 0.0),
    ("plant.modelling_torque_Nm", "N·m", 2e-3, _PER_HINGE, "constant torque"),
    ("plant.cable.stiffness_Nm_rad", "N·m/rad", 5e-3, _PER_HINGE, "stiffness of the cable", 0.0),
    ("plant.backlash_rad", "rad", 1e-3, _PER_HINGE, "play between rotor and measured shaft", 0.0, 0.5),
    ("plant.mass.centre_m", "m", 2e-4, _PER_HINGE, "centre of mass of the rotor"),
    ("plant.mass.products_kg_m2", "kg·m²", 5e-5, _PER_HINGE, "products of inertia xy, xz, yz"),
    ("plant.payload_kg", "kg", 0.02, _WHOLE, "payload", 0.0),
    ("plant.group_gain", "1", 0.05, _PER_GROUP, "torque of a group over that of the torque curve"),
    ("pole_gain_error", "1", 0.03, _PER_POLE, "relative error of the remanence of a pole"),
    ("current_offset_A", "A", 0.02, _PER_GROUP, "current of a group besides that of the log"),
    ("sensors.angle_offset_rad", "rad", 2e-3, _PER_HINGE, "offset of an angle sensor"),
    ("sensor_gain_error", "1", 5e-3, _PER_HINGE, "relative error of the slope of an angle sensor"),
    ("sensor_residual_rad", "rad", 5e-4, _PER_HARMONIC, "harmonics of a potentiometer's residual"),
    ("delay_s", "s", 3e-4, _WHOLE, "delay of the currents against the angles, clocks included"),
    ("lag_s", "s", 3e-4, _WHOLE, "time constant of the currents, L/R without a current loop", 0.0),
)
KINDS = {row[0]: ParameterKind(*row) for row in _ROWS}
"""Kinds of parameters by name."""


class Parameter(NamedTuple):
    """One number."""

    kind: ParameterKind
    place: int

    @property
    def name(self) -> str:
        """Name of the kind, and of the part if there are several."""
        if self.kind.members == _WHOLE:
            return self.kind.name
        if self.kind.members == _PER_HARMONIC:
            hinge, harmonic, part = _harmonic(self.place)
            return f"{self.kind.name}.{HINGES[hinge]}.{'cos' if part == 0 else 'sin'}{harmonic + 1}"
        return f"{self.kind.name}.{self.place}"


def _harmonic(place: int) -> tuple[int, int, int]:
    hinge, rest = divmod(place, 2 * HARMONICS)
    return hinge, rest // 2, rest % 2


def selected(names: Sequence[str], actuator: Actuator) -> list[Parameter]:
    """Return the parameters of some names, of whole kinds or of single parts, without repetition.

    Raises
    ------
    InputError
        An unknown name.
    """
    every = {parameter.name: parameter for kind in KINDS.values() for parameter in members(kind, actuator)}
    parameters: dict[str, Parameter] = {}
    for name in names:
        if name in KINDS:
            parameters |= {parameter.name: parameter for parameter in members(KINDS[name], actuator)}
        elif name in every:
            parameters[name] = every[name]
        else:
            raise InputError(
                f"identification: expected parameters among {', '.join(KINDS)}, or one of their parts such as"
                f" plant.coulomb_Nm.0, received {name}{did_you_mean(name, [*KINDS, *every])}"
            )
    return list(parameters.values())


def short_names(parameters: Sequence[Parameter], among: Sequence[Parameter]) -> list[str]:
    """Return names, one for a kind of which all that are `among` some are given."""
    names = []
    for kind in dict.fromkeys(parameter.kind for parameter in parameters):
        given = [parameter for parameter in parameters if parameter.kind == kind]
        complete = len(given) == sum(parameter.kind == kind for parameter in among) > 1
        names += [kind.name] if complete else [parameter.name for parameter in given]
    return names


def members(kind: ParameterKind, actuator: Actuator) -> list[Parameter]:
    """Return all parameters of a kind."""
    counts = {
        _WHOLE: 1,
        _PER_HINGE: 3,
        _PER_GROUP: len(actuator.groups),
        _PER_POLE: len(actuator.pole_axes),
        _PER_HARMONIC: 4 * HARMONICS,
    }
    return [Parameter(kind, place) for place in range(counts[kind.members])]


class Setup(NamedTuple):
    """Machine under some values of the parameters."""

    plant: Parameters
    delay_s: float
    lag_s: PerGroup
    current_offset_A: Array  # (groups,)
    backlash_rad: Array  # (3,)
    offset_rad: Array  # (3,)
    gain_error: Array  # (3,)
    cosine_rad: Array  # (3, HARMONICS) of the residual; that of the encoder is 0
    sine_rad: Array  # (3, HARMONICS)
    turns: float  # phase of the first harmonic per radian


class Machine:
    """Machine of a scenario whose parameters can be set.

    Parameters
    ----------
    scenario : str
        Name or file.
    changes : mapping
        Fields that are known, by dotted name.
    """

    def __init__(self, scenario: str, changes: Mapping[str, Any]) -> None:
        self._scenario, self._changes = scenario, dict(changes)
        self.model: Model = model_of(scenario, self._changes)
        self._plants: dict[tuple[Any, ...], Parameters] = {}
        self._nominal: dict[ParameterKind, Array] = {}

    def nominal(self, parameter: Parameter) -> float:
        """Return the value of a parameter in the scenario."""
        kind, resolved = parameter.kind.name, self.model.scenario
        if "." in kind:
            value: Any = resolved
            for part in kind.split("."):
                value = getattr(value, part)
            return float(value if parameter.kind.members == _WHOLE else value[parameter.place])
        lag_s = float(np.mean(self.model.lag_s))
        return {"torque_scale": 1.0, "delay_s": self.model.delay_s, "lag_s": lag_s}.get(kind, 0.0)

    def setup(self, parameters: Sequence[Parameter], values: Sequence[float]) -> Setup:
        """Return the machine under some values.

        Raises
        ------
        InputError
            A value is out of the range of its field.
        """
        given = {kind: self._defaults(kind).copy() for kind in KINDS.values()}
        for parameter, value in zip(parameters, values, strict=True):
            given[parameter.kind][parameter.place] = float(value)
        fields = {
            kind: numbers for kind, numbers in given.items() if kind.name.startswith(("plant.", "pole"))
        }
        gain, model, lag = given[KINDS["torque_scale"]][0], self.model, KINDS["lag_s"]
        plant = self._plant(fields, {parameter.kind for parameter in parameters})
        residual = given[KINDS["sensor_residual_rad"]].reshape(2, HARMONICS, 2)
        return Setup(
            plant=plant._replace(torque_gain=gain * plant.torque_gain),
            delay_s=float(given[KINDS["delay_s"]][0]),
            lag_s=float(given[lag][0]) if any(one.kind == lag for one in parameters) else model.lag_s,
            current_offset_A=given[KINDS["current_offset_A"]],
            backlash_rad=given[KINDS["plant.backlash_rad"]],
            offset_rad=given[KINDS["sensors.angle_offset_rad"]],
            gain_error=given[KINDS["sensor_gain_error"]],
            cosine_rad=np.vstack([residual[:, :, 0], np.zeros(HARMONICS)]),
            sine_rad=np.vstack([residual[:, :, 1], np.zeros(HARMONICS)]),
            turns=2 * np.pi / model.scenario.sensors.potentiometer.electrical_angle_rad,
        )

    def fields(self, parameters: Sequence[Parameter], values: Sequence[float]) -> dict[str, Any]:
        """Return the fields of a scenario that state some values; the others are not fields.

        The torque scale is a field by the gains of the groups.
        """
        given = {parameter.kind: self._defaults(parameter.kind).copy() for parameter in parameters}
        for parameter, value in zip(parameters, values, strict=True):
            given[parameter.kind][parameter.place] = float(value)
        gains, scale = KINDS["plant.group_gain"], given.get(KINDS["torque_scale"])
        if scale is not None:
            given[gains] = scale[0] * given.get(gains, self._defaults(gains))
        return _as_fields(given)

    def _defaults(self, kind: ParameterKind) -> Array:
        if kind not in self._nominal:
            every = members(kind, self.model.actuator)
            self._nominal[kind] = np.array([self.nominal(parameter) for parameter in every])
        return self._nominal[kind]

    def _plant(self, given: Mapping[ParameterKind, Array], varied: set[ParameterKind]) -> Parameters:
        fields = _as_fields({kind: numbers for kind, numbers in given.items() if kind in varied})
        key = tuple((kind.name, *numbers.tolist()) for kind, numbers in given.items() if kind in varied)
        if key not in self._plants:
            if len(self._plants) > _MOST_PLANTS:
                self._plants.clear()
            changes = {**self._changes, **fields}
            self._plants[key] = (
                model_of(self._scenario, changes).parameters if fields else self.model.parameters
            )
        return self._plants[key]


def _as_fields(given: Mapping[ParameterKind, Array]) -> dict[str, Any]:
    """Return values as fields of a scenario; those that no field states are left out."""
    fields: dict[str, Any] = {}
    for kind, numbers in given.items():
        if kind.members == _PER_POLE:
            fields["plant.poles.errors"] = [[float(gain), 0.0, 0.0, 0.0] for gain in numbers]
        elif "." in kind.name:
            fields[kind.name] = float(numbers[0]) if kind.members == _WHOLE else numbers.tolist()
    return fields


_MOST_PLANTS = 200


def sensor_angles(setup: Setup, q: Array, start_rad: Array | None = None) -> Array:
    """Return what the sensors report at the angles of a motion, (rows, 3), without noise and counts.

    Parameters
    ----------
    setup : Setup
    q : (rows, 3) array, rad
        Angles of the rotor.
    start_rad : (3,) array, rad, optional
        Measured angles at the start: a joint with play is there; in the middle of its play by default.
    """
    if setup.backlash_rad.any():
        measured = None if start_rad is None else (start_rad - setup.offset_rad) / (1 + setup.gain_error)
        q = joint_angles(q, setup.backlash_rad, q[0] if measured is None else measured)
    reported = (1 + setup.gain_error) * q + setup.offset_rad
    harmonics = HARMONICS if setup.cosine_rad.any() or setup.sine_rad.any() else 0
    for k in range(harmonics):
        phase = (k + 1) * setup.turns * q
        reported = reported + setup.cosine_rad[:, k] * np.cos(phase) + setup.sine_rad[:, k] * np.sin(phase)
    return reported


def joint_angles(q: Array, backlash_rad: Array, start_rad: Array) -> Array:
    """Return the angles of joints behind their play, from given ones at the start, (rows, 3)."""
    low, high, joint = q - 0.5 * backlash_rad, q + 0.5 * backlash_rad, np.empty_like(q)
    for row in range(len(q)):
        joint[row] = start_rad = np.clip(start_rad, low[row], high[row])
    return joint


def priors(machine: Machine, log: Log) -> dict[Parameter, float]:
    """Return the standard deviations of the errors that the data sheets of sensors and drive state.

    If the currents have stamps of their own, these are known to half a period of the angles. All are nuisance
    parameters: a log that is explained without them gives other parameters a bias.
    """
    scenario, actuator = machine.model.scenario, machine.model.actuator
    sensors, drive = scenario.sensors, scenario.drive
    track = sensors.potentiometer
    adc_rad = sensors.adc.offset_V / track.volts_per_rad / sqrt(3)
    sheet = drive_sheet(drive)
    stamps_s = float(np.median(np.diff(log.t_s))) / 2 if OWN_STAMPS in log.notes else 0.0
    # Four harmonics with amplitudes of 1/k² and any phase have about this share of their peak each.
    shares = np.repeat([0.5 / (k + 1) ** 2 for k in range(HARMONICS)], 2)
    sizes: dict[str, Any] = {
        "sensors.angle_offset_rad": [adc_rad, adc_rad, 0.0],
        "sensor_gain_error": [sensors.adc.gain_error / sqrt(3)] * 2 + [0.0],
        "sensor_residual_rad": np.tile(track.nonlinearity_rad * shares, 2),
        "plant.group_gain": [sheet["gain_error"] / sqrt(3)] * len(actuator.groups),
        "current_offset_A": [sheet["offset_error_A"] / sqrt(3)] * len(actuator.groups),
        "delay_s": [stamps_s],
    }
    return {
        parameter: float(size)
        for name, deviations in sizes.items()
        for parameter, size in zip(members(KINDS[name], actuator), deviations, strict=True)
        if size > 0
    }
