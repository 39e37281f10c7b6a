"""Nominal model of a controller compared with the true plant, drive and sensors of its run."""

from __future__ import annotations

from typing import Any

from spheretwin.active_config import true_sheet
from spheretwin.analysis.recorded_run import Reviewed, of_the_actuator
from spheretwin.scenario.fields import SHIPPED
from spheretwin.viz.terminal.reviews import NominalError


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
        NominalError(f"nominal.{name}", _text(nominal[name]), _text(true))
        for name, true in truth.items()
        if name in nominal and _plain(nominal[name]) != _plain(true)
    ]


def _plain(value: Any) -> Any:
    """Return a value for a comparison: lists of JSON equal tuples."""
    return tuple(value) if isinstance(value, list | tuple) else value


def _text(value: Any) -> str:
    if isinstance(value, list | tuple):
        return " ".join(map(_text, value))
    return f"{value:.4g}" if isinstance(value, float) else str(value)
