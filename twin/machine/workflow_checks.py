"""Checks of the workflow on a hidden machine: its results against the truth."""

from __future__ import annotations

import numpy as np

from spheretwin.machine.intervals import Z95
from spheretwin.machine.validation import CHI2
from spheretwin.machine.workflow import Judged, Workflow
from spheretwin.models.base.arrays import Array
from spheretwin.models.base.checks import Check

SETTLED_s = 0.3
"""Time after which the shadow is judged: it starts without knowing the state."""

TRUE_COLUMNS = {"q_estimated_rad": "q_rad", "qdot_estimated_rad_s": "qdot_rad_s"}
"""True values of the estimates that are judged."""


def settled_errors(result: Workflow, judged: Judged, name: str) -> tuple[Array, Array]:
    """Return errors of an estimate against the truth, and their 95 % half-widths, once it has settled."""
    played, table = result.logs[-1], judged.shadowed.telemetry
    first = int(np.searchsorted(played.log.t_s, played.log.t_s[0] + SETTLED_s))
    return (table[name] - played.telemetry[TRUE_COLUMNS[name]])[first:], Z95 * table[f"{name}_std"][first:]


def checks_of(result: Workflow) -> list[Check]:
    """Return the checks of the results."""
    identified, held_out = result.identified, result.identified.held_out
    rate = [rms_error(result, judged, "qdot_estimated_rad_s") for judged in (result.before, result.after)]
    bands = [
        np.abs(error) > half
        for error, half in (settled_errors(result, result.after, n) for n in TRUE_COLUMNS)
    ]
    delays, sizes = _delays_s(result), _size_errors(result)
    changes = [one for one in result.watched if one.change]
    separated = ["torque_scale", "plant.modelling_error"]
    false = sum(len(one.others) for one in result.watched)
    return [
        Check(
            "design",
            "expected intervals of torque scale and inertia over those with the nutation, the widest",
            result.design.tried,
            max(1 / result.design.narrower[name] for name in separated),
            0.5,
            "at least two times narrower; friction, which any steady motion shows, is only reported",
        ),
        Check(
            "logs",
            "logs that the check does not accept",
            len(result.verdicts),
            sum(not one.accepted for one in result.verdicts),
            0,
            "nothing is derived from a log with an error",
        ),
        Check(
            "refusal",
            "identifications without a known payload that are accepted",
            1,
            int(result.without_payload.accepted),
            0,
            "currents and angles alone cannot separate torque, inertia and friction",
        ),
        Check(
            "found values",
            "distance from the true value over half of the 95 % interval, the largest",
            len(result.true),
            max((_distance(result, name) for name in identified.parameters), default=float("nan")),
            2.05,
            "four standard deviations",
        ),
        Check(
            "held-out windows",
            "mean square of the residuals over that of the noise",
            1,
            held_out.chi2 if held_out else float("nan"),
            CHI2[1],
            "the twin explains what it has not seen",
            at_least=CHI2[0],
        ),
        Check(
            "rates of the shadow",
            "rms error after identification over that before, the largest of three hinges",
            len(result.logs[-1].log),
            float(np.max(rate[1] / rate[0])),
            1.0,
            "a better model needs less disturbance torque, and gives better rates",
        ),
        Check(
            "bands of the shadow",
            "share of errors of angles and rates outside of their 95 % bands",
            len(result.logs[-1].log),
            float(np.mean(bands)),
            0.1,
            "5 % expected; neighbouring rows are not independent",
        ),
        Check(
            "validation",
            "mean square of the residuals of another motion over that of the noise",
            len(result.logs[-1].log),
            result.after.validation.fit.chi2,
            CHI2[1],
            "noise explains the residuals",
            at_least=CHI2[0],
        ),
        Check(
            "structure",
            "parameters of which the residuals still show a change",
            len(result.logs[-1].log),
            len(result.after.validation.structure),
            0,
            "each is reported by chance once in a hundred validations at most",
        ),
        Check(
            "named changes",
            "changes of the machine that no alarm names",
            len(changes),
            sum(one.named is None for one in changes),
            0,
            "what changed is what an alarm is for",
        ),
        Check(
            "delay of the alarms",
            "time from a change to the alarm that names it, the largest",
            len(changes),
            max(delays, default=float("nan")),
            0.8,
            "a change is named within some windows of 0.1 s",
            "s",
        ),
        Check(
            "sizes of the changes",
            "difference from the true size over it, the largest",
            len(changes),
            max(sizes, default=float("nan")),
            0.4,
            "an alarm comes as soon as a change is certain, with some tenths of a second of data",
        ),
        Check(
            "false alarms",
            "alarms without a change, or that name something else first",
            len(result.watched),
            false,
            0,
            "fewer than one in ten hours are expected",
        ),
    ]


def rms_error(result: Workflow, judged: Judged, name: str) -> Array:
    """Return the rms error of each hinge."""
    error, _ = settled_errors(result, judged, name)
    return np.asarray(np.sqrt(np.mean(error**2, axis=0)))


def _distance(result: Workflow, name: str) -> float:
    """Return the distance of a found value from the true one over half of its interval."""
    value, (low, high), *_ = result.identified.parameters[name]
    return 2 * abs(value - result.true[name]) / (high - low)


def _delays_s(result: Workflow) -> list[float]:
    return [one.named.t_s - one.change.t_s for one in result.watched if one.change and one.named]


def _size_errors(result: Workflow) -> list[float]:
    return [
        abs(one.named.size / one.change.size - 1)
        for one in result.watched
        if one.change and one.named and one.named.size
    ]
