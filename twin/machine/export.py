"""Export of a run: the log that a laboratory would record, also of a real machine, and the truth."""

from __future__ import annotations

import json
import math
from collections.abc import Container, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from spheretwin.config.plant_model import parameters_of
from spheretwin.electronics.drive_chain import DriveChain, fill_drive
from spheretwin.electronics.sensor_chain import SensorChain, fill_sensors
from spheretwin.loop.hardware_assembly import delays_of
from spheretwin.machine.log import COMMANDED, CONDITIONS, CURRENTS, MEASURED, conditions_of, log_signals
from spheretwin.models.base.errors import SpheretwinError
from spheretwin.models.base.files import check_writable, whole_file
from spheretwin.models.telemetry.parquet import TelemetryFile
from spheretwin.models.telemetry.run_record import versions
from spheretwin.models.telemetry.signals import Signal
from spheretwin.models.telemetry.table import Table
from spheretwin.scenario.files import files_of
from spheretwin.session import Session

Sources = dict[tuple[str, ...], Signal]

TRUE_STATES = ("t_s", "q_rad", "qdot_rad_s", "mean_current_A", "torque_Nm", "disturbance_Nm")


class SignalFile:
    """Sink of a run that writes some signals to a Parquet file, a scalar column for each number.

    Parameters
    ----------
    path : Path
        The file.
    signals : mapping
        Signals of the file, each by the names that it may have in the telemetry: the first that is there is
        written, NaN if none is. An event may add columns to a run and take them away.
    metadata : mapping
        Of the file.
    """

    def __init__(self, path: Path, signals: Sources, metadata: Mapping[str, str]) -> None:
        self.path, self._sources = path, signals
        self._signals = tuple(scalar for signal in signals.values() for scalar in signal.scalars())
        self._file = TelemetryFile(path, self._signals, metadata)

    def write(self, rows: Table) -> None:
        """Write the rows of one chunk."""
        columns = []
        for names, signal in self._sources.items():
            name = next((name for name in names if name in rows), None)
            columns.append(rows[name] if name else np.full((len(rows), signal.size), np.nan))
        self._file.write(Table(self._signals, np.column_stack(columns)))

    def note(self, t_s: float, text: str) -> None:
        """Ignore a note: a laboratory has none."""

    def finish(self, status: str) -> None:
        """Store the final status of the run."""
        self._file.finish(status)

    def close(self) -> None:
        """Write the file.

        Raises
        ------
        SpheretwinError
            Writing failed: an earlier file is unchanged.
        """
        self._file.close({})


class LogFile:
    """Sink that writes a log as Parquet: time, measured angles, commanded currents.

    Parameters
    ----------
    path : Path
    late_ticks : container of int
        Ticks without a new measurement: their angles are NaN.
    period_s : float
        Control period.
    conditions : mapping
        Known fields of the scenario during the run.

    Raises
    ------
    InputError
        The file cannot be written.
    """

    def __init__(
        self, path: Path, late_ticks: Container[int], period_s: float, conditions: Mapping[str, Any]
    ) -> None:
        check_writable(path, ".parquet")
        self._path, self._late_ticks, self._period_s = path, late_ticks, period_s
        self._metadata = {CURRENTS: COMMANDED, CONDITIONS: json.dumps(dict(conditions))}
        self._parts: list[np.ndarray] = []

    def write(self, rows: Table) -> None:
        """Add the rows of one chunk."""
        angle_rad = rows["q_rad"].copy()
        ticks = np.rint(rows["t_s"] / self._period_s).astype(int).tolist()
        angle_rad[[tick in self._late_ticks for tick in ticks]] = np.nan
        self._parts.append(np.column_stack([rows["t_s"], angle_rad, rows["current_A"]]))

    def note(self, t_s: float, text: str) -> None:
        """Ignore a message: a log has numbers alone."""

    def finish(self, status: str) -> None:
        """Ignore the final status: `close` writes the file."""

    def close(self) -> None:
        """Write the file, also after an error; no file without a tick."""
        if self._parts:
            rows = np.concatenate(self._parts)
            signals = log_signals(rows.shape[1] - 4, (COMMANDED,))
            Table(signals, rows).scalars().write_parquet(self._path, self._metadata)


def states_path(truth: Path) -> Path:
    """Return the path of the true states that belong to a file of true parameters."""
    return truth.with_suffix(".parquet")


def check_paths(log: Path | None, truth: Path | None) -> list[Path]:
    """Return the paths of all exported files.

    Raises
    ------
    InputError
        One has another suffix, or cannot be written.
    """
    paths = [path for path in (log, truth, truth and states_path(truth)) if path]
    for path in paths:
        check_writable(path, ".json" if path == truth else ".parquet")
    return paths


class Export:
    """Files of an exported run.

    Parameters
    ----------
    session : Session
        Before its first tick.
    log, truth : Path, optional
        Files to write; next to the truth also the true states (`states_path`).

    Attributes
    ----------
    written : list of Path
        After `close`: files that were written completely.

    Raises
    ------
    InputError
        A file cannot be created.
    """

    def __init__(self, session: Session, log: Path | None, truth: Path | None) -> None:
        check_paths(log, truth)
        self.written: list[Path] = []
        self._truth, self._values = truth, _true_values(session) if truth else {}
        available = {signal.name: signal for signal in session.signals}
        self.sinks: list[SignalFile] = []
        if log:
            self.sinks.append(_log_file(log, session, tuple(available)))
        if truth:
            states: Sources = {(name,): available[name] for name in TRUE_STATES}
            self.sinks.append(SignalFile(states_path(truth), states, {}))

    def close(self) -> list[SpheretwinError]:
        """Complete every file; return the errors."""
        errors = []
        for sink in self.sinks:
            try:
                sink.close()
                self.written.append(sink.path)
            except SpheretwinError as error:
                errors.append(error)
        if self._truth:
            try:
                with whole_file(self._truth) as temporary:
                    temporary.write_text(json.dumps(self._values, indent=1) + "\n", encoding="utf-8")
                self.written.append(self._truth)
            except SpheretwinError as error:
                errors.append(error)
        return errors


def _log_file(path: Path, session: Session, available: tuple[str, ...]) -> SignalFile:
    """Return the file of a log: measured angles, commanded currents, measured ones if there are sensors."""
    kinds = (COMMANDED, MEASURED) if "current_measured_A" in available else (COMMANDED,)
    time, angles, *currents = log_signals(len(session.actuator.groups), kinds)
    signals: Sources = {("t_s",): time, ("q_measured_rad", "q_rad"): angles}
    signals |= {(signal.name,): signal for signal in currents}
    conditions = conditions_of(session.initial_scenario.plant.payload_kg)
    return SignalFile(path, signals, {CURRENTS: COMMANDED, CONDITIONS: json.dumps(conditions)})


def _true_values(session: Session) -> dict[str, Any]:
    """Return the true parameters of a run at its start, in JSON types, also those drawn from the seed."""
    scenario = session.initial_scenario
    plant, delays = scenario.plant, delays_of(scenario)
    settings = scenario.drive, plant.step_s, scenario.substeps, scenario.seed
    sizes = {"groups": len(session.actuator.groups), "delays": delays["drive_delays"]}
    sensors = scenario.sensors, scenario.seed
    return {
        "scenario": scenario.model_dump(mode="json"),
        "plant": _plain(parameters_of(scenario, files_of(scenario))),
        "drive": _plain(DriveChain.filled(fill_drive, *settings, **sizes)[0]),
        "sensors": _plain(SensorChain.filled(fill_sensors, *sensors, delays=delays["sensor_delays"])[0]),
        "states": TRUE_STATES,
        "versions": versions(),
    }


def _plain(value: Any) -> Any:
    """Return a value in JSON types; null for a number that is not finite."""
    if hasattr(value, "_asdict"):
        return _plain(value._asdict())
    if isinstance(value, np.void):
        return {name: _plain(value[name]) for name in value.dtype.names or ()}
    if isinstance(value, np.ndarray) and value.dtype.names:
        return [_plain(entry) for entry in value]
    if isinstance(value, Mapping):
        return {name: _plain(entry) for name, entry in value.items()}
    if isinstance(value, np.ndarray | np.generic):
        return _plain(value.tolist())
    if isinstance(value, list | tuple):
        return [_plain(entry) for entry in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
