"""Stability of the laws: loads, ten minutes, delays, inertias, control rates."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from spheretwin import scenario as scenarios
from spheretwin.models.telemetry.table import Table
from spheretwin.paper import frequency_response as responses
from spheretwin.paper.cells import Cell, table
from spheretwin.paper.experiment import Array, Case, ExperimentSection, Outcomes, RunOutcome, Statement
from spheretwin.paper.experiment_file import BY_LAW, CaseRuns, ExperimentFile
from spheretwin.paper.lyapunov import Descent, descent
from spheretwin.run import Run
from spheretwin.viz.pages.markdown import Drawing, ResultTable

FILE = ExperimentFile("stability")
LAWS = [BY_LAW[entry["law"]] for entry in FILE["tested_law"]]
UNITS = {entry["quantity"]: entry["unit"] for entry in FILE["worse"]}
LONG_s = FILE["long"][0]["fields"]["duration"]


def cases() -> list[Case]:
    """Cases of loads, ten minutes and margins, and of a multisine on a rotor at rest."""
    return [with_multisine(case) if case.columns.get("part") == "response" else case for case in FILE.cases]


def with_multisine(case: Case) -> Case:
    """Return a case with the excitation of the frequency response."""
    return case._replace(fields={**case.fields, **responses.fields()})


REACHED_rad_s, SLOPE = 0.05, 50.0
"""Of |λe + ė|, and λ in 1/s: an error of 1 mrad that stays."""

SPAN_s = 60.0


class Span(NamedTuple):
    """A minute of a long run."""

    rms_error_rad: float
    rms_torque_Nm: float
    variation_A_s: float
    at_limit: float
    """Share of the ticks."""


class StabilityMeasures(NamedTuple):
    """Measures of one run."""

    reached_s: float | None
    """First time at which |λe + ė| of every hinge is below `REACHED_rad_s`; None if never."""
    early: Span | None
    late: Span | None
    """First and last minute; None for shorter runs."""
    gains: tuple[float, float] | None
    """Largest ξ̂ and ζ̂ at the end; None for laws without them."""
    descent: Descent | None
    response: Array | None = None
    """Measured response of the opened loop, real and imaginary; None for runs without the multisine."""


def reduce(run: Run) -> StabilityMeasures:
    """Reduce a run."""
    table, period_s = run.telemetry, run.scenario.controller.period_s
    if run.scenario.name == "hold":
        response = responses.measured(table, period_s)
        return StabilityMeasures(None, None, None, None, None, np.stack([response.real, response.imag]))
    ticks = round(SPAN_s / period_s)
    is_long = run.scenario.duration >= LONG_s and len(table) >= 2 * ticks
    surface = SLOPE * table["error_rad"] + table["qdot_rad_s"] - table["qdot_ref_rad_s"]
    inside = np.flatnonzero(np.all(np.abs(surface) < REACHED_rad_s, axis=1))
    named = {signal.name for signal in table.signals}
    has_gains = {"switching_gain", "bound_gain"} <= named and len(table) > 0
    return StabilityMeasures(
        reached_s=float(table["t_s"][inside[0]]) if len(inside) else None,
        early=_span_of(table, slice(0, ticks), period_s) if is_long else None,
        late=_span_of(table, slice(len(table) - ticks, None), period_s) if is_long else None,
        gains=(float(table["switching_gain"][-1].max()), float(table["bound_gain"][-1].max()))
        if has_gains
        else None,
        descent=None if is_long else descent(run),
    )


def _span_of(table: Table, ticks: slice, period_s: float) -> Span:
    commands = table["current_command_A"][ticks]
    return Span(
        rms_error_rad=float(np.sqrt(np.mean(table["error_rad"][ticks] ** 2, axis=0)).max()),
        rms_torque_Nm=float(np.sqrt(np.mean(np.sum(table["torque_Nm"][ticks] ** 2, axis=1)))),
        variation_A_s=float(
            np.abs(np.diff(commands, axis=0)).sum(axis=0).mean() / (len(commands) * period_s)
        ),
        at_limit=float(np.mean(table["allocation_scale"][ticks] < 1)),
    )


HOLDS_rad = 0.01
"""A law holds if its run completes with a smaller RMS error over the second half on every hinge: a twentieth
of the amplitude."""


def sections(outcomes: Outcomes) -> list[ExperimentSection]:
    """Descent and reaching, ten minutes, and margins of each law."""
    reached = FILE.runs(outcomes, part="reaching")
    reaching = FILE.table("reaching", reached, reached=_reached)
    tested = _tested(outcomes)
    drawings = [lambda: _draw(tested)] if tested else []
    return [
        FILE.section("reaching", [reaching], reached=REACHED_rad_s, slope=SLOPE),
        FILE.section("drift", [_drift(outcomes)]),
        FILE.section("margins", [_margins(tested)], drawings, holds_mrad=1e3 * HOLDS_rad),
        *_response_section(FILE.runs(outcomes, part="response")),
    ]


def findings(outcomes: Outcomes) -> list[Statement]:
    """Course of V, and of the variation over ten minutes."""
    return [*_descent_findings(outcomes), *_drift_findings(outcomes)]


def holds(outcome: RunOutcome) -> bool:
    """True if a law holds, as defined by `HOLDS_rad`."""
    return outcome.is_complete and bool(np.all(outcome.tail_rms_error < HOLDS_rad))


def ends_of(kept_within: Sequence[bool]) -> tuple[int | None, int | None]:
    """Return the indices of the last step up to which a law always holds, and of the first without."""
    first = kept_within.index(False) if False in kept_within else None
    last = (len(kept_within) if first is None else first) - 1
    return (last if last >= 0 else None), first


def _response_section(items: Sequence[CaseRuns]) -> list[ExperimentSection]:
    """Section of the frequency responses, if they were run."""
    if not items:
        return []
    by_law = {item["law"]: (_measured(item), _linear(item.case)) for item in items}
    rows = [
        (BY_LAW[law].label, source, responses.margins(responses.LINES_Hz, response))
        for law, both in by_law.items()
        for source, response in zip(("measured", "linear"), both, strict=True)
    ]
    cells: dict[str, Cell[tuple[str, str, responses.Margins]]] = {
        "law": "{0}",
        "response": "{1}",
        "crossover, Hz": "{2.crossover_Hz:.1f}",
        "phase margin, degrees": "{2.phase_deg:.1f}",
        "gain margin, dB": "{2.gain_dB:.1f}",
    }
    margins = table("Gain and phase margins of the sampled loop", rows, cells, 2)
    values: dict[str, Any] = {"lines": len(responses.LINES_Hz), "amplitude_mNm": 1e3 * responses.AMPLITUDE_Nm}
    values |= {"first": responses.LINES_Hz[0], "last": responses.LINES_Hz[-1]}
    return [FILE.section("response", [margins], [lambda: _bode(by_law)], **values)]


def _measured(item: CaseRuns) -> responses.Response:
    real, imaginary = item.runs[0].data.response
    response: responses.Response = real + 1j * imaginary
    return response


def _linear(case: Case) -> responses.Response:
    scenario = scenarios.load(case.scenario, with_multisine(case).fields)
    return responses.linear_loop(scenario).response(responses.LINES_Hz)


def _bode(by_law: dict[str, tuple[responses.Response, responses.Response]]) -> Drawing:
    from spheretwin.viz.figures import conditions as figures

    frequency_Hz = np.array(responses.LINES_Hz, np.float64)
    figure = figures.bode(
        {law: (frequency_Hz, *both) for law, both in by_law.items()},
        {law: BY_LAW[law].label for law in by_law},
        "Loop of alpha, opened at the torque of the law",
    )
    return FILE.drawing("response", figure)


def _drift_runs(outcomes: Outcomes) -> list[tuple[str, StabilityMeasures, Span, Span]]:
    """Label of the law, measures, and first and last minute of each run of ten minutes."""
    items = [(item["label"], item.runs[0].data) for item in FILE.runs(outcomes, part="drift")]
    return [(law, data, data.early, data.late) for law, data in items if data.early and data.late]


def _descent_findings(outcomes: Outcomes) -> list[Statement]:
    courses = [
        (item["L"], course)
        for item in FILE.runs(outcomes, part="reaching")
        if (course := item.runs[0].data.descent)
    ]
    if not courses:
        return []
    texts = ", ".join(
        f"at L = {load:g} it rises at {100 * course.rises:.2g} % of the ticks, by {course.risen:.1e} V₀"
        " in all"
        for load, course in courses
    )
    least = min(course.of_parameters for _, course in courses)
    falls = all(course.risen < course.fallen for _, course in courses)
    text = (
        f"V of (44) {'falls' if falls else 'does not fall'} along AFSM's runs ({texts}); weak evidence, as"
        f" {100 * least:.2f} % of V₀ are the parameters' errors"
    )
    return [Statement(None if falls else False, text)]


def _drift_findings(outcomes: Outcomes) -> list[Statement]:
    texts = [
        f"{law} {early.variation_A_s:.0f} to {late.variation_A_s:.0f} A/s"
        for law, _, early, late in _drift_runs(outcomes)
    ]
    if not texts:
        return []
    return [Statement(None, f"variation of the commands, first to last of ten minutes: {', '.join(texts)}")]


def _reached(item: CaseRuns) -> str:
    reached_s = item.runs[0].data.reached_s
    return "not within the run" if reached_s is None else f"{reached_s:.2f} s"


class Minute(NamedTuple):
    """First or last minute of a long run."""

    law: str
    name: str
    span: Span
    gains: Any
    """At its end, for the last minute; an empty text for the first one."""


def _drift(outcomes: Outcomes) -> ResultTable:
    minutes = [
        minute
        for law, data, early, late in _drift_runs(outcomes)
        for minute in (Minute(law, "first", early, ""), Minute(law, "last", late, data.gains))
    ]
    return FILE.table("drift", minutes)


Tested = dict[str, dict[str, list[CaseRuns]]]
"""Steps that were run, by margin and law."""


def _tested(outcomes: Outcomes) -> Tested:
    by_margin: Tested = {}
    for item in FILE.runs(outcomes, part="margin"):
        by_margin.setdefault(item["quantity"], {law.law: [] for law in LAWS})[item["law"]].append(item)
    return {quantity: by_margin[quantity] for quantity in UNITS if quantity in by_margin}


def _margins(tested: Tested) -> ResultTable:
    heads = {law.law: f"{law.label}: last that holds / first that does not" for law in LAWS}
    cells = {"made worse": str} | {head: _ends(tested, law) for law, head in heads.items()}
    return table("Margins", tested, cells)


def _ends(tested: Tested, law: str) -> Callable[[str], str]:
    def cell(quantity: str) -> str:
        steps = tested[quantity][law]
        ends = ends_of([holds(item.runs[0]) for item in steps])
        texts = [f"{steps[index]['step']:g}" if index is not None else "none tried" for index in ends]
        return f"{' / '.join(texts)} {UNITS[quantity]}".strip()

    return cell


def _draw(tested: Tested) -> Drawing:
    from spheretwin.viz.figures import conditions as figures

    panels = {
        ", ".join(filter(None, (quantity, UNITS[quantity]))): {
            law: np.array(
                [(item["step"], item.runs[0].tail_rms_error.max(), holds(item.runs[0])) for item in steps]
            )
            for law, steps in by_law.items()
            if steps
        }
        for quantity, by_law in tested.items()
    }
    labels = {law.law: law.label for law in LAWS}
    figure = figures.margins(
        panels, labels, HOLDS_rad, "RMS error of the worst hinge, second half, mrad", "Margins"
    )
    return FILE.drawing("margins", figure, holds_mrad=1e3 * HOLDS_rad)


EXPERIMENT = FILE.experiment(cases=cases, sections=sections, reduce=reduce, findings=findings)
