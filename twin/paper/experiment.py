"""Experiment: cases to run, the data of each run, and the sections and findings of its page."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import PlainValidator

from spheretwin.models.telemetry.status import Status
from spheretwin.run import Run
from spheretwin.viz.pages.markdown import Drawing, ResultTable

if TYPE_CHECKING:
    from spheretwin.viz.comparison.runs import LawTrajectory

Array = Annotated[NDArray[np.float64], PlainValidator(lambda numbers: np.array(numbers, np.float64))]


SEEDS = 20
"""Runs of a case, unless it has more or the command states their number."""


STATUSES = {str(status): status for status in Status}


class Case(NamedTuple):
    """One condition: a scenario with some of its fields changed, run once for each seed."""

    name: str
    """Unique within its experiment."""
    scenario: str
    fields: Mapping[str, Any]
    """Fields that all of its runs share."""
    details: Mapping[str, Any] = {}
    """Entries of its row in the JSON in addition to the figures."""
    is_random: bool = True
    """Whether anything depends on the seed; if not, there is one run."""
    single_run: bool = False
    """Whether there is one run in any case, as of one of many random sets."""
    expected_statuses: tuple[Status, ...] = (Status.COMPLETED,)
    """Statuses that are no failure."""
    comparable: bool = True
    """Whether it may be in the sample that runs on both plants: a loop beyond its margin amplifies rounding,
    and differs between any two plants."""
    seeds: int = SEEDS
    """Runs unless the command states their number; more where a small difference or a rare case counts."""
    seeded_fields: Callable[[int], Mapping[str, Any]] = lambda seed: {}
    """Fields that depend on the seed, a function of the seed alone."""
    columns: Mapping[str, Any] = {}
    """Columns of its rows in the tables: law, condition and what else they name."""

    def fields_of(self, seed: int) -> dict[str, Any]:
        """Return the fields of the run with a seed, without the seed itself."""
        return {**self.fields, **self.seeded_fields(seed)}


class RunOutcome(NamedTuple):
    """Result of one run; angles in rad."""

    status: Status
    figures: Mapping[str, Any]
    """Every metric of the list, by name."""
    measured_max_abs_error: Array
    """(3,) largest error from the sensors, which is what a laboratory can report."""
    data: Any
    """`Experiment.reduce` of the run."""

    @property
    def max_abs_error(self) -> Array:
        """(3,) largest error of the rotor itself."""
        return _by_hinge(self.figures["max_abs_error_rad"])

    @property
    def rms_error(self) -> Array:
        """(3,) root mean square of the error over the run."""
        return _by_hinge(self.figures.get("rms_error_rad"))

    @property
    def tail_rms_error(self) -> Array:
        """(3,) root mean square of the error over the second half of the run."""
        return _by_hinge(self.figures["tail_rms_error_rad"])

    @property
    def is_complete(self) -> bool:
        """Whether the run completed."""
        return self.status == Status.COMPLETED


def _by_hinge(figure: Sequence[float] | None) -> Array:
    """Figure of each hinge; NaN if a run ended before its first tick was over."""
    return np.full(3, np.nan) if figure is None else np.array(figure)


class Outcomes(dict[str, Sequence[RunOutcome]]):
    """Outcomes of each seed by the name of the case; cases that were not run are absent."""

    def runs(self, case: Case) -> Sequence[RunOutcome]:
        """Outcomes of a case; empty if it was not run."""
        return self.get(case.name, ())


class ExperimentSection(NamedTuple):
    """Section of the page: text, tables and figures."""

    title: str
    text: str
    """Paragraphs in Markdown."""
    tables: Sequence[ResultTable] = ()
    drawings: Sequence[Callable[[], Drawing]] = ()
    """Functions that draw the figures; only a page calls them."""


class Statement(NamedTuple):
    """One line of the first page: a statement of the paper and the result."""

    reproduced: bool | None
    """None if the paper says nothing about it, or if the result does not prove it."""
    text: str
    """Result, and the reason if it differs from the paper; without a full stop at its end."""


class Experiment(NamedTuple):
    """One row of the list of experiments."""

    name: str
    title: str
    summary: str
    """Content in a sentence or two."""
    cases: Callable[[], list[Case]]
    """In the order of the JSON's rows; a limit leaves the first of them."""
    sections: Callable[[Outcomes], list[ExperimentSection]]
    reduce: Callable[[Run], Any] = lambda run: None
    """Data that `sections` need in addition to the figures; the telemetry is released."""
    row_fields: Callable[[Case, Sequence[RunOutcome]], Mapping[str, Any]] = lambda case, outcomes: {}
    """Further entries of a case's row in the JSON."""
    findings: Callable[[Outcomes], list[Statement]] = lambda outcomes: []
    """Lines of the first page; none of cases that were not run."""
    trajectories: Callable[[Outcomes], Mapping[str, LawTrajectory]] = lambda outcomes: {}
    """Runs of one condition for a recording, by the labels of their laws."""


def padded(arrays: Sequence[Array]) -> Array:
    """Stack arrays (n, k) of runs to (runs, longest n, k); NaN after the end of a run that ended early."""
    longest = max(arrays, key=len)
    stacked = np.full((len(arrays), *longest.shape), np.nan)
    for run, array in zip(stacked, arrays, strict=True):
        run[: len(array)] = array.reshape(len(array), *longest.shape[1:])
    return stacked


def window_maxima(error: Array, window_s: float, period_s: float) -> Array:
    """Largest absolute value of each column of an error (n, k) within each complete window."""
    ticks = max(1, round(window_s / period_s))
    windows = len(error) // ticks
    return np.abs(error)[: windows * ticks].reshape(windows, ticks, error.shape[1]).max(axis=1)
