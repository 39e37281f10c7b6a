"""Design of experiments: the motion whose log determines parameters best, within limits of the machine."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Annotated, Any, NamedTuple

import numpy as np
from pydantic import Field

from spheretwin import scenario as scenarios
from spheretwin.machine.identification import Problem
from spheretwin.machine.log import log_of
from spheretwin.models.base.arrays import Array
from spheretwin.models.base.errors import SpheretwinError
from spheretwin.models.telemetry.status import Status
from spheretwin.models.telemetry.table import Table
from spheretwin.scenario.fields import SettingsModel
from spheretwin.scenario.sections import Scenario
from spheretwin.simulation import simulate

REFERENCE = {"trajectory.shape": "nutation"}
"""Motion with which a design is compared."""


class DesignSettings(SettingsModel):
    """Settings of a design."""

    duration_s: Annotated[float, Field(ge=0.5, le=600)] = Field(
        4.0, description="length of the experiment, s"
    )
    candidates: Annotated[int, Field(ge=2, le=10_000)] = Field(
        24, description="motions that are tried; the second half are changes of the best"
    )
    sines: Annotated[int, Field(ge=1, le=20)] = Field(3, description="sines of each hinge")
    payloads_kg: tuple[Annotated[float, Field(ge=0)], ...] = Field(
        (0.0,), description="known payloads; the experiment is made with each"
    )
    seed: Annotated[int, Field(ge=0)] = Field(0, description="seed of the motions")
    slowest_Hz: Annotated[float, Field(gt=0, le=100)] = Field(0.2, description="lowest frequency of a sine")
    fastest_Hz: Annotated[float, Field(gt=0, le=100)] = Field(3.0, description="highest frequency of a sine")
    largest_angle_rad: Annotated[float, Field(gt=0, le=3)] = Field(0.5, description="limit of α and β")
    largest_rate_rad_s: Annotated[float, Field(gt=0, le=100)] = Field(8.0, description="limit of the rates")
    largest_current_A: Annotated[float, Field(gt=0, le=100)] = Field(6.0, description="limit of the currents")
    largest_temperature_degC: Annotated[float, Field(gt=0, le=300)] = Field(
        100.0, description="limit of the coils, for hardware with temperatures"
    )


class Design(NamedTuple):
    """Result of `design`."""

    scenario: Scenario
    """With the payload of the first experiment."""
    runs: tuple[Table, ...]
    """Telemetry of the simulated experiments, one for each payload."""
    deviations: dict[str, float]
    """Expected standard deviation of each parameter."""
    reference: dict[str, float]
    """The same with the nutation of the same length."""
    tried: int
    refused: int
    """Motions that exceeded a limit at every size."""

    @property
    def narrower(self) -> dict[str, float]:
        """Width of the interval of each parameter with the nutation over that with this motion."""
        return {name: self.reference[name] / value for name, value in self.deviations.items()}


def design(
    scenario: str,
    parameters: Sequence[str],
    changes: Mapping[str, Any] | None = None,
    settings: DesignSettings | None = None,
    track: Callable[[range], Iterable[int]] = lambda steps: steps,
) -> Design:
    """Return the motion under which the information on parameters has the largest determinant.

    Each motion is simulated in the closed loop of the scenario, with its sensors; the Fisher information of
    its log includes nuisance parameters.

    Parameters
    ----------
    scenario : str
        Name or file: hardware, law and plant.
    parameters : sequence of str
        As for `identify`.
    changes : mapping, optional
        Fields of the scenario by dotted name and their values.
    settings : DesignSettings, optional
    track : callable
        Returns the steps that it is given, and shows their progress.

    Raises
    ------
    InputError
        The scenario or a parameter cannot be used.
    SpheretwinError
        No motion stays within the limits.
    """
    settings = settings or DesignSettings()
    experiment = _Experiment(
        scenario, parameters, {**(changes or {}), "duration": settings.duration_s}, settings
    )
    generator = np.random.default_rng(settings.seed)
    best: _Candidate | None = None
    refused = 0
    for number in track(range(settings.candidates)):
        if best is None or number < settings.candidates // 2:
            motion = _random_motion(generator, settings)
        else:
            motion = _varied(best.motion, generator, settings)
        candidate = experiment.candidate(motion)
        if candidate is None:
            refused += 1
        elif best is None or candidate.merit > best.merit:
            best = candidate
    if best is None:
        raise SpheretwinError(
            f"design: expected a motion within the limits of angle, rate, current and temperature, received"
            f" none of {settings.candidates}"
        )
    reference = experiment.information(experiment.runs(REFERENCE))
    fields = {**experiment.fields, **_fields(best.motion), "plant.payload_kg": settings.payloads_kg[0]}
    return Design(
        scenarios.load(scenario, fields),
        best.runs,
        _deviations(best.information),
        _deviations(reference),
        settings.candidates,
        refused,
    )


class _Motion(NamedTuple):
    """Sines of each hinge, (sines, 3) each."""

    amplitude_rad: Array
    frequency_Hz: Array
    phase_rad: Array


class _Candidate(NamedTuple):
    motion: _Motion
    runs: tuple[Table, ...]
    information: tuple[Array, list[str]]
    merit: float


# A motion beyond a limit is tried smaller, so often and by this factor.
_SIZES, _SMALLER = 4, 0.6


class _Experiment(NamedTuple):
    """Experiment whose motion is sought; scenario, parameters and fields are those of `design`."""

    scenario: str
    parameters: Sequence[str]
    fields: Mapping[str, Any]
    settings: DesignSettings

    def candidate(self, motion: _Motion) -> _Candidate | None:
        """Return a motion at the largest size within the limits; None if there is none."""
        for _ in range(_SIZES):
            runs = self.runs(_fields(motion))
            if len(runs) == len(self.settings.payloads_kg) and all(map(self._is_within, runs)):
                information = self.information(runs)
                _, merit = np.linalg.slogdet(information[0])
                return _Candidate(motion, runs, information, float(merit))
            motion = motion._replace(amplitude_rad=_SMALLER * motion.amplitude_rad)
        return None

    def runs(self, motion: Mapping[str, Any]) -> tuple[Table, ...]:
        """Return the telemetry of the fields of a motion under each payload, as far as they completed."""
        fields = {**self.fields, **motion}
        payloads = self.settings.payloads_kg
        runs = [simulate(self.scenario, {**fields, "plant.payload_kg": payload}) for payload in payloads]
        return tuple(run.telemetry for run in runs if run.status is Status.COMPLETED)

    def information(self, runs: Sequence[Table]) -> tuple[Array, list[str]]:
        """Return the information of runs on the parameters, and their names."""
        payloads = zip(runs, self.settings.payloads_kg, strict=False)
        logs = [log_of(run, "experiment", {"plant.payload_kg": payload_kg}) for run, payload_kg in payloads]
        return Problem(logs, self.scenario, self.parameters, self.fields).information()

    def _is_within(self, run: Table) -> bool:
        settings = self.settings
        limits = [
            (run["q_rad"][:, :2], settings.largest_angle_rad),
            (run["qdot_rad_s"], settings.largest_rate_rad_s),
            (run["current_command_A"], settings.largest_current_A),
        ]
        if "coil_temperature_degC" in run:
            limits.append((run["coil_temperature_degC"], settings.largest_temperature_degC))
        return all(np.max(np.abs(values)) <= limit for values, limit in limits)


def _deviations(information: tuple[Array, list[str]]) -> dict[str, float]:
    matrix, names = information
    return dict(zip(names, map(float, np.sqrt(np.diag(np.linalg.inv(matrix)))), strict=True))


def _random_motion(generator: np.random.Generator, settings: DesignSettings) -> _Motion:
    shape = settings.sines, 3
    low, high = np.log(settings.slowest_Hz), np.log(settings.fastest_Hz)
    frequency = np.exp(generator.uniform(low, high, shape))
    # Fast sines are small: equal rates, as far as the angles allow.
    rate = generator.uniform(0.3, 1.0, shape) * settings.largest_rate_rad_s / settings.sines
    amplitude = np.minimum(rate / (2 * np.pi * frequency), settings.largest_angle_rad / settings.sines)
    return _Motion(amplitude, frequency, generator.uniform(0, 2 * np.pi, shape))


def _varied(motion: _Motion, generator: np.random.Generator, settings: DesignSettings) -> _Motion:
    shape = motion.amplitude_rad.shape
    return _Motion(
        motion.amplitude_rad * np.exp(generator.normal(0.1, 0.3, shape)),
        np.clip(
            motion.frequency_Hz * np.exp(generator.normal(0, 0.3, shape)),
            settings.slowest_Hz,
            settings.fastest_Hz,
        ),
        motion.phase_rad + generator.normal(0, 0.5, shape),
    )


def _fields(motion: _Motion) -> dict[str, Any]:
    components = [
        {"amplitude_rad": amplitude, "frequency_Hz": frequency, "phase_rad": phase}
        for amplitude, frequency, phase in zip(*(part.tolist() for part in motion), strict=True)
    ]
    return {"trajectory.shape": "multisine", "trajectory.components": components}
