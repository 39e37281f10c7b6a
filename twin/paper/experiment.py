"""What an experiment is: cases to run, what to keep of each run, and what is told of them together."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.telemetry.status import Status
from spheretwin.run import Run
from spheretwin.viz.pages.markdown import Drawing

if TYPE_CHECKING:
    from spheretwin.viz.comparison.trajectories import LawTrajectory

Array = NDArray[np.float64]


class Case(NamedTuple):
    """One condition: a scenario with some of its fields changed, run once for each seed."""

    name: str
    """Within its experiment; no two have the same."""
    scenario: str
    fields: Mapping[str, Any]
    """Fields that all of its runs share."""
    told: Mapping[str, Any] = {}
    """What its row in the JSON says besides the figures."""
    draws: bool = True
    """Whether anything in it is drawn from the seed; if not, one run is all."""
    once: bool = False
    """Whether one run is all in any case, as of one of many that are drawn themselves."""
    ends: tuple[Status, ...] = (Status.COMPLETED,)
    """Statuses that are no failure."""
    compared: bool = True
    """Whether it may be in the sample that runs on both plants: a loop driven beyond its margin amplifies
    what rounding leaves, and is the same on no two plants."""
    drawn: Callable[[int], Mapping[str, Any]] = lambda seed: {}
    """Fields that depend on the seed, a function of the seed alone."""

    def fields_of(self, seed: int) -> dict[str, Any]:
        """Return the fields of the run with a seed, without the seed itself."""
        return {**self.fields, **self.drawn(seed)}


class Outcome(NamedTuple):
    """What remains of one run; angles in rad."""

    status: Status
    figures: Mapping[str, Any]
    """Every metric of the registry, by name."""
    measured_max_abs_error: Array
    """(3,) largest error as the sensors tell it, which is what a laboratory can report."""
    kept: Any
    """What the experiment keeps of the run itself."""

    @property
    def max_abs_error(self) -> Array:
        """(3,) largest error of the rotor itself."""
        return _three(self.figures["max_abs_error_rad"])

    @property
    def rms_error(self) -> Array:
        """(3,) root mean square of the error over the run."""
        return _three(self.figures.get("rms_error_rad"))

    @property
    def tail_rms_error(self) -> Array:
        """(3,) root mean square of the error over the second half of the run."""
        return _three(self.figures["tail_rms_error_rad"])


def _three(figure: Sequence[float] | None) -> Array:
    """A figure of each hinge; no numbers where a run ended before its first tick was over."""
    return np.full(3, np.nan) if figure is None else np.array(figure)


Outcomes = Mapping[str, Sequence[Outcome]]
"""By the name of its case, the outcome of each seed; a case that was not run is absent."""


class ResultTable(NamedTuple):
    """Rows of text under headings; `texts` columns at the left are words, the others figures."""

    title: str
    head: tuple[str, ...]
    rows: list[tuple[str, ...]]
    texts: int = 1


class Section(NamedTuple):
    """A piece of the page: what is shown, in words, tables and figures."""

    title: str
    text: str
    """Paragraphs in Markdown."""
    tables: Sequence[ResultTable] = ()
    draw: Sequence[Callable[[], Drawing]] = ()
    """Figures, drawn only where a page is written."""


class Finding(NamedTuple):
    """One line of the first page: whether something of the paper came out again."""

    held: bool | None
    """None where the paper says nothing of it, or what was found proves nothing of what it says."""
    text: str
    """What was found, and where it is not the paper's, why; without a full stop at its end."""


class Experiment(NamedTuple):
    """One row of the registry."""

    name: str
    title: str
    shows: str
    """What it shows, in a sentence or two."""
    cases: Callable[[], list[Case]]
    """In the order of the JSON's rows; the first of them are what a limit leaves."""
    tell: Callable[[Outcomes], list[Section]]
    keep: Callable[[Run], Any] = lambda run: None
    """What `tell` needs of a run beside its figures; the telemetry is let go."""
    more: Callable[[Sequence[Outcome]], Mapping[str, Any]] = lambda outcomes: {}
    """What the JSON says of a case's outcomes beside what it says of all."""
    findings: Callable[[Outcomes], list[Finding]] = lambda outcomes: []
    """What the first page says; nothing of cases that were not run."""
    side_by_side: Callable[[Outcomes], Mapping[str, LawTrajectory]] = lambda outcomes: {}
    """Runs of one condition for a recording, by the labels of their laws."""


class Compared(NamedTuple):
    """A law of the figures; its gains are its defaults."""

    law: str
    label: str
    gains: str
    """Whose they are."""
    of_paper: bool = False
    drawn: bool = False
    """Whether the figures show it beside the paper's; the tables and the JSON have all."""


# In the order of the paper, from the largest error to the smallest; then those that it does not have.
COMPARED: tuple[Compared, ...] = (
    Compared("pd", "PD", "K and λ of (58) as damping and stiffness", True, True),
    Compared("adaptive_fuzzy", "adaptive fuzzy", "(58)", True, True),
    Compared("afsm", "AFSM", "(58)", True, True),
    Compared("pid", "tuned PID", "triple pole at 40 1/s", drawn=True),
    Compared("afsm_eso", "AFSM-ESO", "preset ideal", drawn=True),
    Compared("lqi", "LQI", "integral's weight at 60 1/s"),
    Compared("computed_torque", "computed torque", "triple pole at 40 1/s"),
    Compared("backstepping_sliding_mode", "backstepping SM", "triple pole at 40 1/s"),
    Compared("super_twisting", "super-twisting", "triple pole at 40 1/s, μ = 8"),
    Compared("adrc", "ADRC", "140 1/s, observer 80 and 40 1/s"),
)
BY_LAW = {compared.law: compared for compared in COMPARED}
OF_PAPER = tuple(compared for compared in COMPARED if compared.of_paper)
