"""What brings each law of figure 11 to the error that the paper shows."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from spheretwin.twin.reproduce.experiment import Outcome, Outcomes, Section, Table
from spheretwin.twin.reproduce.figure11 import drawing
from spheretwin.twin.reproduce.figure11.changes import CHANGES, REACHED, Change
from spheretwin.twin.reproduce.figure11.laws import ALPHA, COMPARED, Compared, printed
from spheretwin.twin.reproduce.rows import of_axis, spread_deg

Array = NDArray[np.float64]

ONE_THING = (
    "Everything is as above but for one thing. The values come from scans: of a gain the one whose error is"
    " the paper's, or where none is, as of corners and estimators, the one with the least. *Reached* means"
    f" that the median over the seeds is at most {REACHED:g} times the paper's figure, which is read from a"
    " plot; where only the true error gets there, it says so. On ideal hardware (true angles and rates, no"
    " delay, no friction, coils behind their lag L/R alone) the printed gains leave what the corners of the"
    " reference cost: its rate jumps, and none of the laws feeds an acceleration forward. Neither a better"
    " estimator nor true rates take that away."
)
HEAD = ("law", "changed alone", "paper's reached", "paper", "α measured", "α true")


def section(outcomes: Outcomes) -> Section:
    """Errors under every single change."""
    tried = [change for change in CHANGES if change.case().name in outcomes]
    rows = [_row(change, outcomes[change.case().name]) for change in tried]
    return Section(
        "What brings each law to the paper's figure",
        f"{ONE_THING}{_what_reaches(outcomes, tried)}",
        [Table("Largest |error| of α in degrees: median over the seeds, and range", HEAD, rows, 3)],
        [lambda: drawing.changes(_drawn(outcomes, tried))] if tried else [],
    )


def reached(compared: Compared, measured: Array, true: Array) -> str:
    """Whether a law has come to the paper's figure, by the errors (rad) of all seeds."""
    if compared.paper_deg is None:
        return "–"
    most = REACHED * np.radians(compared.paper_deg)
    if np.median(measured) <= most:
        return "yes"
    return "by the true error" if np.median(true) <= most else "no"


def _row(change: Change, found: Sequence[Outcome]) -> tuple[str, ...]:
    errors, compared = _alpha(found), change.compared
    said = reached(compared, *errors)
    return compared.label, change.label, said, compared.paper, *map(spread_deg, errors)


def _what_reaches(outcomes: Outcomes, tried: Sequence[Change]) -> str:
    """The changes of each law that bring it there on the prototype."""
    found: dict[str, list[str]] = {}
    for change in tried:
        if not change.ideal and reached(change.compared, *_alpha(outcomes[change.case().name])) == "yes":
            found.setdefault(change.compared.label, []).append(change.label)
    said = "; ".join(f"{law} by {' or '.join(labels)}" for law, labels in found.items())
    return f" What brings a law there on the prototype: {said}." if said else ""


def _drawn(
    outcomes: Outcomes, tried: Sequence[Change]
) -> list[tuple[Compared, list[tuple[str, Array, Array]]]]:
    """Lines of each law: what is changed, and the errors for each seed."""
    drawn = []
    for compared in COMPARED:
        cases = {printed(compared).name: "unchanged"}
        cases |= {change.case().name: change.label for change in tried if change.law == compared.law}
        lines = [(label, *_alpha(outcomes[name])) for name, label in cases.items() if name in outcomes]
        if lines:
            drawn.append((compared, lines))
    return drawn


def _alpha(found: Sequence[Outcome]) -> tuple[Array, Array]:
    """Largest measured and true errors of α for each seed, rad."""
    return of_axis(found, "measured_max_abs_error", ALPHA), of_axis(found, "max_abs_error", ALPHA)
