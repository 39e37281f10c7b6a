"""Sensitivities: derivatives of figures and telemetry of a run by numbers of its scenario.

The loop holds its state in records of one kind of number, calls laws by address, and switches: dual numbers
do not pass through it. The runs of a block are differenced instead, all with the seed of the scenario.
Central differences with a step and with its half are extrapolated, with an error of fourth order in the step;
their distance is stated as the error. Where a law chatters, it shows that there is no derivative.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import isfinite
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.loop.channels import CHANNELS
from spheretwin.models.base.errors import InputError, shown
from spheretwin.models.telemetry.signals import common_signals
from spheretwin.models.telemetry.status import Status
from spheretwin.scenario.fields import flat
from spheretwin.simulation import simulate
from spheretwin.study.engines import engine_in_process
from spheretwin.study.grid import Row
from spheretwin.study.relative import number
from spheretwin.study.row import Rows
from spheretwin.study.study import Study
from spheretwin.study.template import is_number

PLACES = (1.0, -1.0, 0.5, -0.5)
"""Steps from the scenario of the runs of a field."""


class Sensitivities(NamedTuple):
    """Figures and telemetry of a run, and their derivatives by some fields of its scenario."""

    figures: dict[str, Any]
    derivatives: dict[str, dict[str, NDArray[np.float64]]]
    """By figure and field; a number, or an entry for each of the figure."""
    errors: dict[str, dict[str, NDArray[np.float64]]]
    """Of the derivatives; larger than them where the figure has none."""


def sensitivities(
    scenario: str,
    steps: Mapping[str, float],
    changes: Mapping[str, Any] | None = None,
    figures: Sequence[str] = ("rms_error_rad",),
    *,
    engine: str = "local",
) -> Sensitivities:
    """Return the derivatives of figures and telemetry of a run.

    Parameters
    ----------
    scenario : str
        Name or file.
    steps : mapping of float
        Step of each field, by its dotted name: a small part of the range over which the figures are smooth.
    changes : mapping, optional
        Values by dotted name, such as ``{"controller.law": "pd"}``.
    figures : sequence of str
        Metrics whose value is a number in each of the runs, and columns of the telemetry, such as ``q_rad``:
        their derivatives at every tick, the last one that of the final state.
    engine : str
        Of the runs with metrics: ``local``, or ``cuda``, a GPU.

    Raises
    ------
    InputError
        A step is not a number above 0, a field has no number, a run does not complete, or a figure has no
        value in it.
    """
    signals = _signal_names()
    metrics = tuple(name for name in figures if name not in signals)
    study = Study(name="sensitivities", scenario=scenario, fields=dict(changes or {}), metrics=metrics)
    rows = engine_in_process(engine, "sensitivities").prepare(Rows(study))
    points: list[dict[str, Any]] = [{}]
    for name, step in steps.items():
        if not (is_number(step) and isfinite(step) and step > 0):
            raise InputError(f"sensitivities: expected a step of {name} above 0, received {shown(step)}")
        value = _number(rows, name)
        points += [{name: value + place * step} for place in PLACES]
    runs = [Row(number, str(number), rows.base.seed, point, None, 0) for number, point in enumerate(points)]
    columns = _columns(rows, runs, metrics) if metrics else {}
    columns |= _telemetry(rows, runs, [name for name in figures if name not in metrics])
    both = {figure: _derivatives(values, list(steps.values())) for figure, values in columns.items()}
    derivatives, errors = (
        {figure: dict(zip(steps, parts[kind], strict=True)) for figure, parts in both.items()}
        for kind in (0, 1)
    )
    first = {name: values[0].tolist() if name in metrics else values[0] for name, values in columns.items()}
    return Sensitivities(first, derivatives, errors)


def _signal_names() -> set[str]:
    logged = (channel.signals(1) for channel in CHANNELS)
    return {signal.name for signals in (common_signals(1), *logged) for signal in signals}


def _number(rows: Rows, name: str) -> float:
    """Return the number of a field, or of an entry of a list."""
    value = number(known := flat(rows.base.model_dump(mode="json")), name)
    if value is None:
        message = f"expected a field with a number, received {name} = {shown(known.get(name))}"
        raise InputError(f"sensitivities: {message}")
    return value


def _columns(rows: Rows, runs: Sequence[Row], figures: Sequence[str]) -> dict[str, NDArray[np.float64]]:
    """Return the figures of all runs, (runs, …)."""
    results = rows.run(runs)
    for run, result in zip(runs, results, strict=True):
        values: dict[str, Any] = {figure: result.figures.get(figure) for figure in figures}
        missing = [figure for figure, value in values.items() if None in np.ravel(value)]
        if result.status != Status.COMPLETED or missing:
            what = f"no {missing[0]}" if result.status == Status.COMPLETED else result.error or result.status
            raise InputError(f"sensitivities: expected runs that complete, received {what} at {run.values}")
    return {figure: np.array([result.figures[figure] for result in results]) for figure in figures}


def _telemetry(rows: Rows, runs: Sequence[Row], names: Sequence[str]) -> dict[str, NDArray[np.float64]]:
    """Return columns of the telemetry of all runs, (runs, ticks, …)."""
    kept: dict[str, list[NDArray[np.float64]]] = {name: [] for name in names}
    for row in runs if names else ():
        run = simulate(rows.scenario(row))
        missing = [name for name in names if name not in run.telemetry]
        if run.status != Status.COMPLETED or missing:
            what = f"no {missing[0]}" if missing else run.status
            raise InputError(f"sensitivities: expected runs that complete, received {what} at {row.values}")
        for name, columns in kept.items():
            columns.append(run.telemetry[name])
    return {name: np.array(columns) for name, columns in kept.items()}


def _derivatives(
    values: NDArray[np.float64], steps: Sequence[float]
) -> tuple[list[NDArray[np.float64]], list[NDArray[np.float64]]]:
    """Return derivatives by each field, and their errors."""
    of_fields = values[1:].reshape(len(steps), len(PLACES), *values.shape[1:])
    span = np.reshape(steps, (-1, *[1] * (values.ndim - 1)))
    whole = (of_fields[:, 0] - of_fields[:, 1]) / (2 * span)
    half = (of_fields[:, 2] - of_fields[:, 3]) / span
    return list(half + (half - whole) / 3), list(np.abs(half - whole))
