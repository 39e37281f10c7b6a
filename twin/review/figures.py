"""What a review tells of one run: facts, the metrics of every run, work and spectrum, events."""

from __future__ import annotations

from typing import Any

import numpy as np

from spheretwin.models.base.errors import InputError
from spheretwin.models.base.wording import shown
from spheretwin.models.telemetry.signals import ANGLES
from spheretwin.models.telemetry.table import Table
from spheretwin.twin.in_force import InForce, at_start
from spheretwin.twin.metrics.metric import Planned
from spheretwin.twin.records.summary import Figures
from spheretwin.twin.review.happened import events
from spheretwin.twin.review.run import Reviewed
from spheretwin.twin.review.spectrum import peaks
from spheretwin.twin.review.work import mechanical_work_J
from spheretwin.twin.scenario.reading import validated


def figures(run: Reviewed) -> dict[str, Any]:
    """All that a review tells of a run, as JSON holds it.

    Raises
    ------
    InputError
        Its scenario is none of this version's, or its model file is no longer there or has other coil groups.
    """
    try:
        with np.errstate(all="ignore"):  # what damage leaves of numbers may be of any size
            return _figures(run)
    except KeyError as error:
        raise InputError(
            f"review {run.path}: expected facts and rows of a run, received no {shown(error.args[0])}"
        ) from None
    except (ValueError, TypeError, AttributeError, IndexError):
        raise InputError(f"review {run.path}: expected facts and rows of a run, received others") from None


def _figures(run: Reviewed) -> dict[str, Any]:
    scenario = run.record.scenario
    metrics = _metrics(run)
    work_J, copper_J = mechanical_work_J(run.every_tick, run.period_s), metrics["copper_loss_J"]
    return {
        "path": str(run.path),
        "scenario": scenario["name"],
        "law": scenario["controller"]["law"],
        "modelling_error": scenario["plant"]["modelling_error"],
        "load": scenario["disturbance"]["load"],
        "hardware": scenario["hardware"],
        "seed": scenario["seed"],
        "status": run.record.status,
        "reason": _reason(run.table),
        "whole": run.whole,
        "rows": len(run.table),
        "record_rate_Hz": run.rate_Hz,
        "simulated_s": run.simulated_s,
        "planned_s": scenario["duration"],
        **metrics,
        "mechanical_work_J": work_J,
        "energy_J": None if work_J is None or copper_J is None else work_J + copper_J,
        "error_peaks": {
            angle: [{"frequency_Hz": peak.frequency_Hz, "amplitude_rad": peak.amplitude} for peak in of_axis]
            for angle, of_axis in zip(ANGLES, _error_peaks(run), strict=True)
        },
        "events": [{"t_s": t_s, "level": level, "text": text} for t_s, level, text in events(run)],
        "versions": dict(run.record.versions),
    }


def _metrics(run: Reviewed) -> dict[str, Any]:
    scenario, files, *_ = of_the_actuator(run)
    gathered = Figures(Planned(scenario, files.actuator, scenario.ticks))
    gathered.write(run.every_tick)
    return gathered.values()


def of_the_actuator(run: Reviewed) -> InForce:
    """Return plant, drive and files of a run; law and trajectory, which may be gone, are others.

    Raises
    ------
    InputError
        It is none of this version's.
    """
    return at_start(validated(_what_metrics_take(run), str(run.path)), None, None)


def _what_metrics_take(run: Reviewed) -> dict[str, Any]:
    """The run's scenario without law and trajectory, whose files may be gone: no one runs them."""
    kept = ("name", "duration", "seed", "plant", "drive")
    return {
        **{name: run.record.scenario[name] for name in kept},
        "controller": {"law": "pd", "period_s": run.period_s},
        "trajectory": {"shape": "hold"},
    }


def _error_peaks(run: Reviewed) -> list[Any]:
    return [peaks(column, run.period_s) for column in run.every_tick["error_rad"].T]


def _reason(table: Table) -> str | None:
    """Why the watchdog took the currents away, if there was one and it did."""
    for signal in table.signals:
        if signal.name == "failsafe_reason" and len(table) and table[signal.name][-1] > 0:
            return signal.states[int(table[signal.name][-1])]
    return None
