"""Review of runs from their files: figures, differences, nominal errors, tolerances that are exceeded."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from spheretwin.analysis import tolerances
from spheretwin.analysis.recorded_run import Reviewed, of_the_actuator, read
from spheretwin.analysis.run_summary import figures
from spheretwin.analysis.tolerances import Exceeded, compare, exceeded
from spheretwin.config.active_config import true_sheet
from spheretwin.models.base.errors import InputError, shortened
from spheretwin.scenario.fields import SHIPPED, flat
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


def nominal_errors(run: Reviewed) -> list[NominalError]:
    """Return the nominal values that differ from the truth at the start of a run.

    Raises
    ------
    InputError
        The scenario is not valid in this version.
    """
    scenario, files, *_ = of_the_actuator(run)
    nominal = run.record.scenario.get("nominal") or {}
    truth = true_sheet(scenario, scenario.drive, files.actuator)
    truth |= {"torque_scale": 1.0, "torque_curve": scenario.plant.torque_curve or SHIPPED}
    return [
        NominalError(f"nominal.{name}", _short(nominal[name]), _short(true))
        for name, true in truth.items()
        if name in nominal and _plain(nominal[name]) != _plain(true)
    ]


def _plain(value: Any) -> Any:
    """Return a value for a comparison: lists of JSON equal tuples."""
    return tuple(value) if isinstance(value, list | tuple) else value


def _short(value: Any) -> str:
    if isinstance(value, list | tuple):
        return " ".join(map(_short, value))
    return f"{value:.4g}" if isinstance(value, float) else str(value)


# Numbers of which no difference is meaningful.
NOT_COMPARED = ("seed",)


def differences(figures: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return, for each run but the first, every number of both reports minus that of the first.

    Entry by entry for lists; None if one of the two has no value.

    Parameters
    ----------
    figures : sequence of mapping
        Report of each run.
    """
    first, *others = figures
    return [
        {
            "path": other["path"],
            **{
                name: _difference(first[name], value)
                for name, value in other.items()
                if name in first and name not in NOT_COMPARED and _are_numbers(first[name], value)
            },
        }
        for other in others
    ]


def _are_numbers(first: Any, value: Any) -> bool:
    """True if both are numbers, lists of numbers of one length, or one of these and None."""
    if isinstance(first, list) and isinstance(value, list):
        return len(first) == len(value) and all(map(_are_numbers, first, value))
    numbers = [item for item in (first, value) if item is not None]
    of_lists = all(isinstance(item, list) and all(_is_number(entry) for entry in item) for item in numbers)
    return bool(numbers) and (all(map(_is_number, numbers)) or (len(numbers) == 1 and of_lists))


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _difference(first: Any, value: Any) -> Any:
    if first is None or value is None:
        return None
    if isinstance(first, list):
        return [_difference(*pair) for pair in zip(first, value, strict=True)]
    return value - first


# Fields listed first, in the notation of the paper.
FIRST_FIELDS = {
    "controller.law": "law",
    "plant.modelling_error": "m",
    "disturbance.load": "L",
    "hardware": "hardware",
    "fault": "fault",
    "name": "scenario",
    "seed": "seed",
}
LONGEST_LABEL = 24
"""Characters of a value in a label."""

# Fields that follow from another one: if that one differs, they are not listed.
IMPLIED_FIELDS = {
    "name": ("description", "duration", "trajectory."),
    "controller.law": ("controller.",),
    "plant.modelling_error": ("plant.modelling_torque_Nm",),
    "hardware": ("sensors.", "estimator.", "drive.", "watchdog.", "plant.", "nominal."),
}


def scenario_differences(scenarios: Sequence[Mapping[str, Any]]) -> list[tuple[str, list[str]]]:
    """Return the fields that differ among scenarios, each with its value in every scenario.

    Fields that follow from another one are omitted: those of a law, a trajectory or a hardware that differs.
    """
    flattened = [_texts(scenario) for scenario in scenarios]
    all_names = list(dict.fromkeys([*FIRST_FIELDS, *(name for fields in flattened for name in fields)]))
    different = [name for name in all_names if len({fields.get(name, "none") for fields in flattened}) > 1]
    implied = tuple(part for name, parts in IMPLIED_FIELDS.items() if name in different for part in parts)
    return [
        (FIRST_FIELDS.get(name, name), [fields.get(name, "none") for fields in flattened])
        for name in different
        if name in FIRST_FIELDS or not name.startswith(implied)
    ]


def common_conditions(scenarios: Sequence[Mapping[str, Any]]) -> str:
    """Return scenario, load, modelling error and hardware as text, as far as all scenarios agree."""
    flattened = [_texts(scenario) for scenario in scenarios]
    names = {
        "name": "scenario",
        "disturbance.load": "L",
        "plant.modelling_error": "m",
        "hardware": "hardware",
    }
    values = {name: {fields.get(name) for fields in flattened} for name in names}
    return ", ".join(
        f"{names[name]} {shortened(str(*of_runs), LONGEST_LABEL)}"
        for name, of_runs in values.items()
        if len(of_runs) == 1 and of_runs != {None}
    )


def _texts(scenario: Mapping[str, Any]) -> dict[str, str]:
    """Return the text of every field by dotted name."""
    return {name: _text(value) for name, value in flat(scenario).items()}


def _text(value: Any) -> str:
    """Return a value as text: a whole number without a point, for entries of a list their names."""
    if isinstance(value, str):
        return value
    if isinstance(value, list) and all(isinstance(item, Mapping) for item in value):
        words = [" ".join(word for word in item.values() if isinstance(word, str)) for item in value]
        return " + ".join(words) or "none"
    return f"{value:g}" if isinstance(value, float) and value == float(f"{value:g}") else json.dumps(value)
