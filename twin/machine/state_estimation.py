"""Shadow of a machine: its state, estimated from the angles and currents of a log or a stream."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import cache
from typing import Annotated, Any, NamedTuple

import numpy as np
from pydantic import Field

from spheretwin.electronics.logged_currents import mean_currents
from spheretwin.machine.log import MEASURED, Log, check_numbers, joined
from spheretwin.machine.model import EDGE_SHARE, Model, model_of
from spheretwin.machine.row_order import align_rows
from spheretwin.models.base.arrays import Array
from spheretwin.models.base.errors import InputError
from spheretwin.models.coil_group import of_each_group
from spheretwin.models.mjcf_reader import HINGES
from spheretwin.models.telemetry.signals import ANGLES, Signal
from spheretwin.models.telemetry.table import Table
from spheretwin.plant.state_filter import STATES, Estimates, StateFilter, run_filter
from spheretwin.scenario.fields import SettingsModel
from spheretwin.scenario.sections import Scenario


class ShadowSettings(SettingsModel):
    """Settings of the shadow."""

    disturbance_walk_Nm: Annotated[float, Field(ge=0, le=1e3)] = Field(
        0.01, description="growth of the disturbance torque within a second, N·m (assumed: 0.01)"
    )
    torque_noise_Nm_s: Annotated[float, Field(ge=0, le=1e3)] = Field(
        3e-4,
        description="white torque on each hinge, root of its density, N·m·√s (assumed: 0.01 N·m that change"
        " every millisecond)",
    )
    offset_walk_rad: Annotated[float, Field(ge=0, le=1)] | None = Field(
        None,
        description="growth of the offsets of the sensors within a second, rad; not estimated unless given",
    )
    shift_s: Annotated[float, Field(ge=-1, le=1)] = Field(
        0.0, description="delay of the currents against the angles, besides that of the drive, s"
    )
    longest_step_s: Annotated[float, Field(gt=0, le=0.1)] = Field(
        1e-3, description="longest plant step between two rows, s"
    )


# Before the first row the pose is unknown, and so are rates and disturbances of usual size.
_START = np.repeat([1.0, 10.0, 0.3, 0.01], 3)  # rad, rad/s, N·m, rad

CONSISTENT = (0.8, 1.25)
"""Mean square of the innovations over the expected one, within which a channel is consistent. A count has no
lower limit: at rest it says less than expected."""


class Shadow:
    """Estimate of the state of a machine that runs.

    Parameters
    ----------
    scenario : Scenario, str or Model
        Model of the machine.
    settings : ShadowSettings, optional

    Attributes
    ----------
    model : Model
    log_likelihood : float
        Of all angles so far.
    """

    def __init__(self, scenario: Scenario | str | Model, settings: ShadowSettings | None = None) -> None:
        self.model = scenario if isinstance(scenario, Model) else model_of(scenario)
        self.settings = settings or ShadowSettings()
        self.log_likelihood = 0.0
        walk = self.settings.offset_walk_rad
        size = STATES if walk is None else STATES + 3
        growth = np.repeat([0.0, 0.0, self.settings.disturbance_walk_Nm, walk or 0.0], 3)[:size]
        self._filter = StateFilter(
            mean=np.zeros(size),
            covariance=np.diag(_START[:size] ** 2),
            noise_rad=np.maximum(self.model.noise_rad, 2 * EDGE_SHARE * self.model.half_count_rad),
            half_count_rad=self.model.half_count_rad,
            density=growth**2,
            torque_noise_Nm_s=self.settings.torque_noise_Nm_s,
            longest_step_s=self.settings.longest_step_s,
            slopes=np.zeros((size, size)),
            product=np.zeros((size, size)),
            learned=self.model.learned,
        )
        groups = self.model.groups
        self._t_s, self._present_A = np.empty(0), np.zeros(groups)
        self._sample_s, self._sample_A = np.empty(0), np.empty((0, groups))
        self._squares, self._counts = np.zeros(3), np.zeros(3)
        self._first_rad, self._changes = np.full(3, np.nan), self.model.half_count_rad == 0

    def advance(self, log: Log) -> Table:
        """Advance over the next rows; the result does not depend on how a log is cut.

        Currents that were measured after the last row are not known yet: with a negative shift the last
        ones are held.

        Parameters
        ----------
        log : Log
            Rows after those before. An angle that is NaN is not used; a row with such a current has that of
            the row before.

        Returns
        -------
        Table
            Telemetry of the shadow, one row for each.

        Raises
        ------
        InputError
            Another number of groups, or times that do not rise.
        """
        check_numbers(log)
        if log.current_A.shape[1] != self.model.groups:
            raise InputError(
                f"shadow of {log.name}: expected {self.model.groups} group currents, received"
                f" {log.current_A.shape[1]}"
            )
        edges = np.concatenate([self._t_s if len(self._t_s) else log.t_s[:1], log.t_s])
        rises = np.diff(edges) > 0
        if not np.all(rises[len(self._t_s) == 0 :]):
            row = int(np.argmin(rises[1:])) + 1
            raise InputError(f"shadow of {log.name}: expected rising times, received {edges[row + 1]:.10g} s")
        mean_A = self._currents(log, edges)
        rows, size = len(log), len(self._filter.mean)
        estimates = Estimates(
            np.empty((rows, size)), np.empty((rows, size)), np.empty((rows, 3)), np.empty((rows, 3))
        )
        angle_rad = log.angle_rad - self.model.offset_rad
        self.log_likelihood = run_filter(
            self._filter, self.model.parameters, edges, mean_A, angle_rad, estimates, self.log_likelihood
        )
        self._t_s = log.t_s[-1:]
        normalised = estimates.innovation_rad / estimates.expected_rad
        self._add(normalised, angle_rad)
        return _table(log.t_s, angle_rad, estimates, normalised)

    def verdict(self) -> Consistency:
        """Return how well model and rows so far agree."""
        chi2 = np.divide(self._squares, self._counts, out=np.full(3, np.nan), where=self._counts > 0)
        low, high = CONSISTENT
        counted = self.model.half_count_rad > 0
        chi2[~self._changes & (chi2 <= high)] = np.nan
        within = np.isnan(chi2) | ((chi2 <= high) & (counted | (chi2 >= low)))
        return Consistency(dict(zip(HINGES, map(float, chi2), strict=True)), bool(np.all(within)))

    def motion(self) -> tuple[Array, Array]:
        """Return mean and covariance of angles and rates at the last row, (6,) and (6, 6)."""
        return self._filter.mean[:6].copy(), self._filter.covariance[:6, :6].copy()

    def _add(self, normalised: Array, angle_rad: Array) -> None:
        used = np.isfinite(angle_rad)
        for hinge, values in enumerate(angle_rad.T):
            known = values[used[:, hinge]]
            if len(known):
                if np.isnan(self._first_rad[hinge]):
                    self._first_rad[hinge] = known[0]
                self._changes[hinge] |= bool(np.any(known != self._first_rad[hinge]))
        # Summed row by row, so that a cut changes nothing. Without a finite estimate the sum is infinite.
        with np.errstate(over="ignore"):  # the square of an estimate that has diverged is infinite
            squares = np.where(used, np.where(np.isfinite(normalised), normalised**2, np.inf), 0.0)
        self._squares = np.cumsum(np.concatenate([self._squares[None], squares]), axis=0)[-1]
        self._counts += np.count_nonzero(used, axis=0)

    def _currents(self, log: Log, edges: Array) -> Array:
        """Return the mean current until each row, and store the samples that later rows need."""
        sample_s = np.concatenate([self._sample_s, log.t_s])
        sample_A = hold_last_value(np.concatenate([self._sample_A, log.current_A]))
        measured = log.currents == MEASURED
        delay_s = self.settings.shift_s + (0.0 if measured else self.model.delay_s)
        lag_s = of_each_group(0.0 if measured else self.model.lag_s, log.current_A.shape[1])
        if not len(self._t_s):
            self._present_A = sample_A[0].copy()
        mean_A, first = np.empty((len(log), len(self._present_A))), int(not len(self._t_s))
        mean_A[:first] = 0.0
        mean_currents(
            sample_s, sample_A, edges[first:], delay_s, lag_s, measured, self._present_A, mean_A[first:]
        )
        # The sample that acts at the last row, and all after it.
        keep = max(int(np.searchsorted(sample_s + delay_s, edges[-1], side="right")) - 1, 0)
        self._sample_s, self._sample_A = sample_s[keep:], sample_A[keep:]
        return mean_A


class Consistency(NamedTuple):
    """Agreement of a model with a log."""

    chi2: dict[str, float]
    """Mean square of the innovations of each hinge over the expected one: 1 if the model is right.

    NaN for a hinge that is not informative: without angles, or with a count that does not change.
    """
    consistent: bool

    def text(self) -> str:
        """Return the verdict as a line."""
        figures = ", ".join(f"{hinge} {chi2_text(value)}" for hinge, value in self.chi2.items())
        return f"model and machine are {'' if self.consistent else 'not '}consistent, χ² {figures}"

    def markdown(self, log: Log) -> str:
        """Return the verdict on a log as Markdown."""
        rows = [f"| {hinge} | {chi2_text(value)} |" for hinge, value in self.chi2.items()]
        findings = ", ".join(log.accepted)
        accepted = ["", f"Accepted findings of `log check`: {findings}."] if findings else []
        return "\n".join(
            [
                f"**{log.name}: model and measurement are {'' if self.consistent else 'not '}consistent.**",
                "",
                "| hinge | mean square of the innovations over the expected one |",
                "|---|---|",
                *rows,
                *accepted,
            ]
        )


def chi2_text(chi2: float) -> str:
    """Return a mean square over the expected one, or that the channel is not informative."""
    return "not informative" if np.isnan(chi2) else f"{chi2:.3f}"


class Shadowed(NamedTuple):
    """Result of `shadow`."""

    telemetry: Table
    chi2: dict[str, float]
    consistent: bool
    log_likelihood: float

    @property
    def rms_innovation_rad(self) -> Array:
        """Root mean square of the measured minus the predicted angles, (3,)."""
        return np.sqrt(np.nanmean(self.telemetry["innovation_rad"] ** 2, axis=0))


def shadow(
    log: Log,
    scenario: Scenario | str | Model,
    changes: Mapping[str, Any] | None = None,
    settings: ShadowSettings | None = None,
) -> Shadowed:
    """Return the estimated states of a machine over a log.

    Parameters
    ----------
    log : Log
    scenario : Scenario, str or Model
        Model of the machine: a scenario, the name or file of one, or a built model.
    changes : mapping, optional
        Fields by dotted name and their values, for a name or a file; they replace those of the log's
        conditions.
    settings : ShadowSettings, optional

    Raises
    ------
    InputError
        The scenario cannot be used, the log has another number of groups, or its times do not rise.
    """
    model = scenario if isinstance(scenario, Model) else _model(scenario, log, changes)
    return followed([align_rows(log)], model, settings)[1]


def followed(
    logs: Iterable[Log],
    model: Model,
    settings: ShadowSettings | None = None,
    report: Callable[[Log, Table, Consistency], object] = lambda log, telemetry, verdict: None,
) -> tuple[Log, Shadowed]:
    """Return the whole of a log that arrives in parts, and the estimated states.

    Parameters
    ----------
    logs : iterable of Log
    model : Model
    settings : ShadowSettings, optional
    report : callable
        Takes each part, its telemetry and the verdict on all rows so far.

    Raises
    ------
    InputError
        The parts do not fit the model or each other, or there is none.
    """
    running, parts, tables = Shadow(model, settings), [], []
    for log in logs:
        tables.append(running.advance(log))
        parts.append(log)
        report(log, tables[-1], running.verdict())
    whole = joined(parts)
    telemetry = Table(tables[0].signals, np.vstack([table.values for table in tables]))
    return whole, Shadowed(telemetry, *running.verdict(), running.log_likelihood)


def _model(scenario: Scenario | str, log: Log, changes: Mapping[str, Any] | None) -> Model:
    if isinstance(scenario, str):
        return model_of(scenario, {**log.conditions, **(changes or {})})
    if log.conditions:
        raise InputError(
            f"shadow of {log.name}: expected the name or file of a scenario for a log with conditions,"
            f" received a built one"
        )
    return model_of(scenario, changes)


def hold_last_value(samples: Array) -> Array:
    """Return samples with each NaN replaced by the value before, or by 0."""
    lost = np.isnan(samples)
    if not lost.any():
        return samples
    rows = np.maximum.accumulate(np.where(lost, -1, np.arange(len(samples))[:, None]), axis=0)
    values = np.take_along_axis(samples, np.maximum(rows, 0), axis=0)
    return np.where(rows < 0, 0.0, values)


def _table(t_s: Array, angle_rad: Array, estimates: Estimates, normalised: Array) -> Table:
    columns = [t_s[:, None], angle_rad]
    size = estimates.mean.shape[1]
    for first in range(0, size, 3):
        columns += [estimates.mean[:, first : first + 3], estimates.deviation[:, first : first + 3]]
    columns += [estimates.innovation_rad, normalised]
    return Table(signals(size > STATES), np.hstack(columns))


@cache
def signals(offsets: bool) -> tuple[Signal, ...]:
    """Return the telemetry of the shadow, with estimated offsets of the sensors or without."""
    named = [
        ("q_estimated_rad", "rad", "hinge angles"),
        ("qdot_estimated_rad_s", "rad/s", "hinge rates"),
        ("disturbance_estimated_Nm", "N·m", "torque that is subtracted from that of the model"),
        ("offset_estimated_rad", "rad", "offsets of the angle sensors"),
    ]
    estimated = [
        signal
        for name, unit, meaning in named[: 4 if offsets else 3]
        for signal in (
            Signal(name, unit, 3, f"{meaning}, estimated", ANGLES),
            Signal(f"{name}_std", unit, 3, f"standard deviation of the estimated {meaning}", ANGLES),
        )
    ]
    return (
        Signal("t_s", "s", 1, "time of the row"),
        Signal("q_measured_rad", "rad", 3, "hinge angles as measured, without their known offset", ANGLES),
        *estimated,
        Signal("innovation_rad", "rad", 3, "measured minus predicted angles", ANGLES),
        Signal("innovation_normalised", "1", 3, "innovation over its expected standard deviation", ANGLES),
    )
