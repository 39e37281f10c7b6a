"""Result of a run: scenario, status, telemetry and figures; files, recordings and other formats of it."""

from __future__ import annotations

import html
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any

from spheretwin.metrics.figures import Figures
from spheretwin.metrics.reduction import PlannedRun
from spheretwin.metrics.user_metrics import UserMetric, check_names, own_value
from spheretwin.models.actuator import Actuator
from spheretwin.models.base.errors import InputError, LawError, shown
from spheretwin.models.base.extras import check_recordings, missing
from spheretwin.models.telemetry.run_record import RunRecord, versions
from spheretwin.models.telemetry.signals import ANGLES
from spheretwin.models.telemetry.status import Status
from spheretwin.models.telemetry.table import Table
from spheretwin.records.provenance import change_text, facts_of
from spheretwin.scenario.changes import scheduled_changes
from spheretwin.scenario.sections import ResolvedScenario
from spheretwin.session import Session

if TYPE_CHECKING:
    import pandas as pd
    import polars as pl
    import pyarrow as pa
    import xarray as xr
    from matplotlib.figure import Figure

TELEMETRY, RECORDING = ".parquet", ".rrd"


@dataclass(frozen=True)
class Run:
    """Result of a run.

    Attributes
    ----------
    scenario : ResolvedScenario
        Scenario at tick 0, with every default filled in.
    status : Status
        ``completed``, or the reason for an early end.
    telemetry : Table
        One row for each control tick, up to the end of the run.
    wall_s : float
        Wall time of the loop alone, s; NaN for a run that was read from a file.
    actuator : Actuator
        Simulated actuator.
    law_error : LawError, optional
        Exception of the law, which ended the run.
    record : RunRecord, optional
        Provenance: with it, a saved run can be replayed.
    """

    scenario: ResolvedScenario
    status: Status
    telemetry: Table
    wall_s: float
    actuator: Actuator
    law_error: LawError | None = None
    record: RunRecord | None = None

    @cached_property
    def figures(self) -> dict[str, Any]:
        """Metrics by name, as in the JSON of ``simulate``."""
        return figures_of(self)

    @property
    def provenance(self) -> RunRecord:
        """Scenario, changes, files, versions and status: the metadata of a saved run."""
        scenario = self.scenario.model_dump(mode="json")
        record = self.record or RunRecord(scenario, (), len(self.telemetry), {}, versions())
        return replace(record, status=self.status)

    def save(self, path: str | Path) -> Path:
        """Save the run; return the path.

        Telemetry with provenance (``.parquet``), a Rerun recording (``.rrd``), columns alone (``.csv``), or a
        matrix for each signal for MATLAB (``.mat``) or HDF5 (``.h5``).

        Raises
        ------
        InputError
            The name has another suffix, or the file cannot be created.
        SpheretwinError
            Writing failed; an earlier file is unchanged.
        """
        writers = {
            TELEMETRY: self.to_parquet,
            RECORDING: self.to_rrd,
            ".csv": self.to_csv,
            ".mat": self.to_mat,
            ".h5": self.to_hdf5,
        }
        if (suffix := Path(path).suffix) not in writers:
            expected = " or ".join(f"FILE{suffix}" for suffix in writers)
            raise InputError(f"run: expected {expected}, received {shown(str(path))}")
        return writers[suffix](path)

    def to_parquet(self, path: str | Path) -> Path:
        """Write telemetry and provenance, as ``simulate --telemetry`` does; return the path.

        Raises
        ------
        InputError, SpheretwinError
            As `save`.
        """
        self.telemetry.write_parquet(Path(path), self.provenance.metadata())
        return Path(path)

    def to_csv(self, path: str | Path) -> Path:
        """Write a column for each number; return the path. Errors as `save`."""
        self.telemetry.write_csv(Path(path))
        return Path(path)

    def to_mat(self, path: str | Path) -> Path:
        """Write a matrix for each signal, with units and provenance, for MATLAB; errors as `save`."""
        self.telemetry.write_mat(Path(path), self.provenance.metadata())
        return Path(path)

    def to_hdf5(self, path: str | Path) -> Path:
        """Write a data set for each signal, with units and provenance; errors as `save`."""
        self.telemetry.write_hdf5(Path(path), self.provenance.metadata())
        return Path(path)

    def plot(self) -> Figure:
        """Return a Matplotlib figure of the run: angles and references, errors, the largest current.

        Raises
        ------
        InputError
            Matplotlib is not installed, or the run has no tick.
        """
        try:
            from spheretwin.viz.figures import comparison
        except ModuleNotFoundError:
            raise missing("run", "matplotlib", "plots") from None
        if not len(self.telemetry):
            raise InputError("run: expected at least one tick to plot, received none")
        return comparison.overview(self.telemetry, self._title())

    def to_rrd(self, path: str | Path) -> Path:
        """Write a Rerun recording, as ``simulate --record`` does; return the path.

        Raises
        ------
        InputError, SpheretwinError
            As `save`.
        """
        check_recordings("run")
        from spheretwin.viz.recording.recorder import Recorder  # Rerun is slow to import

        facts = facts_of(self.scenario)
        with Recorder(self.actuator, self.telemetry.signals, facts, path=Path(path)) as recorder:
            if len(self.telemetry):
                recorder.write(self.telemetry)
            for t_s, text in self._changes():
                recorder.note(t_s, text)
            recorder.finish(self.status)
        return Path(path)

    def to_arrow(self) -> pa.Table:
        """Return the telemetry as an Arrow table: a fixed-size list for each signal of several numbers."""
        return self.telemetry.arrow(self.provenance.metadata())

    def to_pandas(self) -> pd.DataFrame:
        """Return the telemetry as a DataFrame over ``t_s``, a column for each number: ``q_rad_alpha``.

        Raises
        ------
        InputError
            pandas is not installed.
        """
        table = self.telemetry.scalars()
        columns = {name: table[name] for name in table}
        return _imported("pandas").DataFrame(columns).set_index("t_s")

    def to_polars(self) -> pl.DataFrame:
        """Return the telemetry as a polars DataFrame, an Array column for each signal of several numbers.

        Raises
        ------
        InputError
            polars is not installed.
        """
        return _imported("polars").from_arrow(self.to_arrow())

    def to_xarray(self) -> xr.Dataset:
        """Return the telemetry as a Dataset over ``t_s``, with units, labels and provenance as attributes.

        Raises
        ------
        InputError
            xarray is not installed.
        """
        xarray, t_s, variables = _imported("xarray"), self.telemetry["t_s"], {}
        for signal in self.telemetry.signals:
            if signal.name != "t_s":
                notes = {"units": signal.unit, "long_name": signal.meaning}
                coordinates: dict[str, Any] = {"t_s": t_s}
                if signal.size > 1:
                    coordinates[f"{signal.name}_entry"] = list(signal.labels or map(str, range(signal.size)))
                values = self.telemetry[signal.name]
                variables[signal.name] = xarray.DataArray(values, coordinates, list(coordinates), attrs=notes)
        return xarray.Dataset(variables, attrs=self.provenance.metadata())

    def __repr__(self) -> str:
        return "\n".join([f"Run: {self._title()}", *(f"  {name}: {value}" for name, value in self._rows())])

    def _repr_html_(self) -> str:
        """Return title, figures and, if matplotlib is installed, plots over time: for notebooks."""
        rows = "".join(
            f"<tr><th>{html.escape(name)}</th><td>{html.escape(value)}</td></tr>"
            for name, value in self._rows()
        )
        return f"<h4>{html.escape(self._title())}</h4><table>{rows}</table>{self._plots()}"

    def _plots(self) -> str:
        try:
            figure = self.plot()
        except InputError:  # no tick, or no Matplotlib
            return ""
        from spheretwin.viz.figures.comparison import as_html

        return as_html(figure)

    def _title(self) -> str:
        simulated_s = len(self.telemetry) * self.scenario.controller.period_s
        law = self.scenario.controller.law
        return f"{self.scenario.name} under {law}, {self.status} after {simulated_s:g} s"

    def _rows(self) -> list[tuple[str, str]]:
        """Return the metrics that have a value as text, those of several axes by the names of the hinges."""
        return [(name, _text(value)) for name, value in self.figures.items() if _has_value(value)]

    def _changes(self) -> list[tuple[float, str]]:
        """Return the events and the changes by the user, in the order of time."""
        record, period_s = self.provenance, self.scenario.controller.period_s
        events = [event for event in scheduled_changes(self.scenario) if event.tick < len(self.telemetry)]
        return sorted((change.tick * period_s, change_text(change)) for change in (*events, *record.journal))


def _has_value(value: Any) -> bool:
    return any(entry is not None for entry in value) if isinstance(value, list) else value is not None


def _text(value: Any) -> str:
    if value is None:
        return "none"
    if isinstance(value, list) and len(value) == len(ANGLES):
        return ", ".join(f"{axis} {_text(entry)}" for axis, entry in zip(ANGLES, value, strict=True))
    return f"{value:.4g}" if isinstance(value, float) and math.isfinite(value) else str(value)


def _imported(package: str) -> Any:
    """Import a package that is not a dependency.

    Raises
    ------
    InputError
        The package is not installed.
    """
    try:
        return import_module(package)
    except ModuleNotFoundError:
        raise missing("run", package, "tables") from None


def figures_of(run: Run, extra: Mapping[str, UserMetric] | None = None) -> dict[str, Any]:
    """Return the figures of a run whose telemetry is in memory.

    Parameters
    ----------
    run : Run
        From `simulate`.
    extra : mapping of callable, optional
        User functions by the names of their figures.

    Raises
    ------
    InputError
        A function has the name of another figure, raises, or returns a value that is not in JSON types.
    """
    own = extra or {}
    check_names(own)
    figures = Figures(PlannedRun(run.scenario, run.actuator, run.scenario.ticks))
    figures.write(run.telemetry)
    return {**figures.values(), **{name: own_value(name, metric, run) for name, metric in own.items()}}


def summary(
    session: Session, status: str, figures: Mapping[str, Any], warnings: Sequence[str]
) -> dict[str, Any]:
    """Return the summary of the run of a session, in JSON types.

    Parameters
    ----------
    session : Session
        Session at the end of the run.
    status : str
        Final status.
    figures : mapping
        Figures by name, including those of user functions.
    warnings : sequence of str
        Warnings about model, scenario and figures.
    """
    scenario, wall_s = session.initial_scenario, session.loop_s
    simulated_s = session.tick * scenario.controller.period_s
    return {
        "scenario": scenario.model_dump(mode="json"),
        "status": status,
        "reason": session.reason.text if session.reason else None,
        "simulated_s": simulated_s,
        **figures,
        "wall_s": wall_s,
        "realtime_factor": simulated_s / wall_s if wall_s > 0 else None,
        "versions": versions(),
        "notes": scenario.trajectory.notes(),
        "warnings": list(warnings),
    }
