"""Review of runs from their files: figures, differences from the first, tolerances that are exceeded."""

from __future__ import annotations

from pathlib import Path
from typing import Any, NamedTuple

from spheretwin.analysis import tolerances
from spheretwin.analysis.differences import differences, scenario_differences
from spheretwin.analysis.nominal_errors import nominal_errors
from spheretwin.analysis.recorded_run import Reviewed, read
from spheretwin.analysis.run_summary import figures
from spheretwin.analysis.tolerances import Exceeded, compare, exceeded
from spheretwin.models.base.errors import InputError, shortened
from spheretwin.viz.terminal.reviews import NominalError, SignalTolerance

LONGEST_VALUE = 60
"""Characters of a field's value."""


class Review(NamedTuple):
    """Review of one or more runs, in the order of the files."""

    runs: list[Reviewed]
    figures: list[dict[str, Any]]
    """Facts, metrics, spectrum and events of each run."""
    differences: list[dict[str, Any]]
    """Figures of each other run less those of the first."""
    exceeded: list[list[Exceeded]]
    """Signals of each other run that leave the tolerances; empty without tolerances."""
    tolerances: list[list[SignalTolerance]]
    """For each other run the share of its tolerance that each signal used; empty without tolerances."""
    differing_fields: dict[str, list[str]]
    """Fields in which the scenarios differ, with the value in each run."""
    nominal_errors: list[list[NominalError]]
    """For each run the values of the controller's nominal model that differ from the truth."""


def review(*paths: str | Path, tolerance: str | None = None) -> Review:
    """Review runs from their telemetry files or recordings.

    Parameters
    ----------
    *paths : str or Path
        Files of runs; the first is the reference of the others.
    tolerance : str, optional
        Name of shipped tolerances, or the path of a TOML file.

    Raises
    ------
    InputError
        There is no file, one is no file of a run, or tolerances are given for less than two runs.
    """
    if not paths:
        raise InputError("review: expected the file of a run, received none")
    if tolerance and len(paths) < 2:
        raise InputError("review: expected two runs or more for tolerances, received one")
    allowed = tolerances.load(tolerance) if tolerance else None
    first, *others = runs = [read(Path(path)) for path in paths]
    summaries = [figures(run) for run in runs]
    over = [exceeded(first, other, allowed) for other in others] if allowed else []
    used = [compare(first, other, allowed) for other in others] if allowed else []
    rows = scenario_differences([run.record.scenario for run in runs])
    fields = {name: [shortened(value, LONGEST_VALUE) for value in values] for name, values in rows}
    errors = [nominal_errors(run) for run in runs]
    return Review(runs, summaries, differences(summaries), over, used, fields, errors)
