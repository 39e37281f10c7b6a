"""The laws of figure 11 with the gains of the paper."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from spheretwin.twin.reproduce.experiment import Finding, Outcome, Outcomes, Section, Table
from spheretwin.twin.reproduce.figure11 import drawing
from spheretwin.twin.reproduce.figure11.changes import REACHED
from spheretwin.twin.reproduce.figure11.laws import ALPHA, BETA, COMPARED, Compared, printed
from spheretwin.twin.reproduce.rows import ended, of_axis, spread_deg

MEASURED = (
    "The paper's figure has what its sensors told, so this one shows the *measured* error, and the table the"
    " true one too. A residual nonlinearity of a potentiometer and an offset of its converter add to the true"
    " error and cannot be seen in the measured one; noise does the opposite. γ is counted in steps of 0.18°,"
    " which hide its error. PD has no integral and sags under the mass. In the"
    " paper it errs by as much on β; here nothing pushes there."
)
HEAD = (
    "law",
    "gains",
    "how it ended",
    "paper",
    "α measured",
    "β measured",
    "α true",
    "β true",
    "γ true",
)


def section(outcomes: Outcomes) -> Section:
    """Errors of the laws beside the paper's, and their course."""
    ran = [compared for compared in COMPARED if printed(compared).name in outcomes]
    rows = [_row(compared, outcomes[printed(compared).name]) for compared in ran]
    windows = {compared.law: [each.kept for each in outcomes[printed(compared).name]] for compared in ran}
    return Section(
        "The laws as printed",
        f"{MEASURED}{_order(outcomes)}",
        [Table("Largest |error| over the run in degrees: median over the seeds, and range", HEAD, rows, 3)],
        [lambda: drawing.errors(windows)] if windows else [],
    )


def _row(compared: Compared, found: Sequence[Outcome]) -> tuple[str, ...]:
    measured = [spread_deg(of_axis(found, "measured_max_abs_error", axis)) for axis in (ALPHA, BETA)]
    true = [spread_deg(of_axis(found, "max_abs_error", axis)) for axis in range(3)]
    return compared.label, compared.gains, ended(found), compared.paper, *measured, *true


def findings(outcomes: Outcomes) -> list[Finding]:
    """Whether the paper's order came out again, and its sizes."""
    return [*_orders(outcomes), *_sizes(outcomes)]


def _order(outcomes: Outcomes) -> str:
    """Whether the laws of the paper are in its order, as a sentence."""
    return "".join(f" T{each.text.removeprefix('t')}." for each in _orders(outcomes))


def _orders(outcomes: Outcomes) -> list[Finding]:
    """Whether the laws of the paper are in its order, seed by seed."""
    of_paper = [compared for compared in COMPARED if compared.paper_deg]
    names = [printed(compared).name for compared in of_paper]
    if not all(name in outcomes for name in names):
        return []
    errors = np.array([of_axis(outcomes[name], "measured_max_abs_error", ALPHA) for name in names])
    kept, seeds = int(np.sum(np.all(np.diff(errors, axis=0) < 0, axis=0))), errors.shape[1]
    order = " > ".join(compared.label for compared in of_paper)
    return [Finding(kept == seeds, f"the paper's order, {order}, holds for α under {kept} of {seeds} seeds")]


def _sizes(outcomes: Outcomes) -> list[Finding]:
    """How large the measured errors of α are beside the paper's."""
    told, held = [], True
    for compared in COMPARED:
        if not compared.paper_deg or printed(compared).name not in outcomes:
            continue
        errors = of_axis(outcomes[printed(compared).name], "measured_max_abs_error", ALPHA)
        middle = float(np.degrees(np.median(errors)))
        held = held and middle <= REACHED * compared.paper_deg
        told.append(f"{compared.label} {middle:.2f}° (paper {compared.paper})")
    if not told:
        return []
    why = "" if held else "; what brings each law there alone is in its chapter"
    return [Finding(held, f"largest measured error of α: {', '.join(told)}{why}")]
