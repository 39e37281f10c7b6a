"""Stability of the laws: loads, ten minutes, delays, inertias, control rates."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from spheretwin import scenario as scenarios
from spheretwin.models.telemetry.status import Status
from spheretwin.models.telemetry.table import Table
from spheretwin.paper import frequency_response as responses
from spheretwin.paper.experiment import Case, Experiment, Finding, Outcome, Outcomes, ResultTable, Section
from spheretwin.paper.laws import COMPARED_LAWS, ComparedLaw
from spheretwin.paper.lyapunov import Descent, descent
from spheretwin.paper.page import NONE
from spheretwin.run import Run
from spheretwin.viz.pages.markdown import Drawing

SCENARIO = "sinusoid"

LAWS = tuple(law for law in COMPARED_LAWS if law.law in ("afsm", "pid", "afsm_eso"))

# The laws that are linear at rest; AFSM switches.
LOOPS = tuple(law for law in LAWS if law.law in ("pid", "afsm_eso"))

LONG_s = 600.0
LOADS = (1.0, 5.0)
STEP_s = 5e-4

# The steps go beyond the margin: a run may be lost there.
EXPECTED = (Status.COMPLETED, Status.LEFT_WORKSPACE, Status.DIVERGED)


class Margin(NamedTuple):
    """Quantity that is made worse step by step."""

    name: str
    unit: str
    steps: tuple[float, ...]
    """From the healthy value on."""


DELAY = Margin("unknown delay", "ms", (0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 12, 14))
HEAVIER = Margin("inertia, heavier: m", "", (0, 0.5, 1, 2, 3, 4, 5, 6, 8, 12, 16))
LIGHTER = Margin("inertia, lighter: m", "", (0, -0.3, -0.5, -0.6, -0.7, -0.8, -0.9, -0.95))
SLOWER = Margin("control rate, slower", "Hz", (1000, 500, 400, 250, 200, 100))
FASTER = Margin("control rate, faster", "Hz", (1000, 2000, 5000, 10000))
MARGINS = (DELAY, HEAVIER, LIGHTER, SLOWER, FASTER)


def cases() -> list[Case]:
    """Cases of loads, ten minutes and margins for every law."""
    of_margins = {case.name: case for law in LAWS for quantity in MARGINS for case in margin(law, quantity)}
    return [
        *(reaching(law, load) for law in LAWS for load in LOADS),
        *(drift(law) for law in LAWS),
        *of_margins.values(),
        *(frequency_response(law) for law in LOOPS),
    ]


def reaching(law: ComparedLaw, load: float) -> Case:
    """Case from rest under a load."""
    return _case(law, f"L {load:g}", {"disturbance.load": load}, (Status.COMPLETED,))


def drift(law: ComparedLaw) -> Case:
    """Case of ten minutes."""
    return _case(law, f"{LONG_s:g} s", {"duration": LONG_s}, EXPECTED)


def margin(law: ComparedLaw, quantity: Margin) -> list[Case]:
    """Cases of a law at every step of a margin."""
    conditions = [_worse(quantity, step) for step in quantity.steps]
    return [_case(law, *condition, EXPECTED)._replace(comparable=False) for condition in conditions]


def frequency_response(law: ComparedLaw) -> Case:
    """Case of the multisine on a rotor at rest."""
    return Case(
        name=f"{law.law}: frequency response",
        scenario="hold",
        fields={"controller.law": law.law, **responses.fields()},
        details={"condition": "frequency response"},
        single_run=True,
    )


def _worse(quantity: Margin, step: float) -> tuple[str, dict[str, Any]]:
    if quantity is DELAY:  # no law knows it
        return f"delay {step:g} ms", {"drive.delay_s": 1e-3 * step, "nominal.delay_s": 0.0}
    if quantity in (HEAVIER, LIGHTER):
        return f"m {step:g}", {"plant.modelling_error": float(step)}
    period_s = 1 / step
    return f"{step:g} Hz", {"controller.period_s": period_s, "plant.step_s": min(STEP_s, period_s)}


def _case(law: ComparedLaw, condition: str, fields: dict[str, Any], expected: tuple[Status, ...]) -> Case:
    return Case(
        name=f"{law.law}: {condition}",
        scenario=SCENARIO,
        fields={"controller.law": law.law, **fields},
        details={"condition": condition},
        single_run=True,
        expected_statuses=expected,
    )


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
    response: responses.Response | None = None
    """Measured response of the opened loop; None for runs without the multisine."""


def reduce(run: Run) -> StabilityMeasures:
    """Reduce a run."""
    table, period_s = run.telemetry, run.scenario.controller.period_s
    if run.scenario.name == "hold":
        return StabilityMeasures(None, None, None, None, None, responses.measured(table, period_s))
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

REACHING = (
    f"*Reached* is the first time at which |λe + ė| of every hinge is below {REACHED_rad_s:g} rad/s, with λ"
    f" of (58), {SLOPE:g} 1/s, for every law. V is the function (44) along the run: θ* is a fit of the torque"
    " that each axis needed, ξ* is the largest residual of that fit, and ζ* is 0. The evidence is weak, as"
    " nearly all of V is the error of the parameters; the proof says that V never rises in continuous time,"
    " and nothing about a sampled loop."
)
DRIFT = (
    f"The sinusoid for {LONG_s:g} s. ξ̂ and ζ̂ of AFSM never decrease, as printed; the table compares the last"
    " minute with the first."
)
MARGIN = (
    "One condition is made worse step by step, on the sinusoid with m = 0.2 and L = 1 (except for m itself),"
    " and the law has no information about it. The law *holds* if the run completes with an RMS error of less"
    f" than {1e3 * HOLDS_rad:g} mrad on every hinge over the second half. The table has the last step up to"
    " which the law holds, and the first at which it does not. Beyond its margin a loop amplifies rounding"
    " errors: these rows are not in the sample that is compared with MuJoCo."
)


RESPONSE = (
    f"A multisine of {len(responses.LINES_Hz)} lines from {responses.LINES_Hz[0]} to"
    f" {responses.LINES_Hz[-1]} Hz, {1e3 * responses.AMPLITUDE_Nm:g} mN·m each, acts as a disturbance on α of"
    " a rotor at rest, on ideal hardware without lag. The response of the opened loop is the ratio of the"
    " torque of the law to the torque that the rotor receives. The linear model has the law, differentiated"
    " at rest, and the linear plant, sampled at the control period. AFSM is left out: its switching has no"
    " linear model."
)


def sections(outcomes: Outcomes) -> list[Section]:
    """Descent and reaching, ten minutes, and margins of each law."""
    drawings = [lambda: _draw(outcomes)] if _tested(outcomes) else []
    return [
        Section("Descent and reaching", REACHING, [_reaching(outcomes)]),
        Section("Ten minutes", DRIFT, [_drift(outcomes)]),
        Section("Margins", MARGIN, [_margins(outcomes)], drawings),
        *_response_section(outcomes),
    ]


def findings(outcomes: Outcomes) -> list[Finding]:
    """Course of V, and of the variation over ten minutes."""
    return [*_descent_findings(outcomes), *_drift_findings(outcomes)]


def holds(outcome: Outcome) -> bool:
    """True if a law holds, as defined by `HOLDS_rad`."""
    return outcome.is_complete and bool(np.all(outcome.tail_rms_error < HOLDS_rad))


def ends_of(kept_within: Sequence[bool]) -> tuple[int | None, int | None]:
    """Return the indices of the last step up to which a law always holds, and of the first without."""
    first = kept_within.index(False) if False in kept_within else None
    last = (len(kept_within) if first is None else first) - 1
    return (last if last >= 0 else None), first


def _response_section(outcomes: Outcomes) -> list[Section]:
    """Section of the frequency responses, if they were run."""
    by_law = {law: run.data.response for law in LOOPS for run in outcomes.runs(frequency_response(law))}
    if not by_law:
        return []
    linear = {
        law: responses.linear_loop(scenarios.load("hold", frequency_response(law).fields)).response(
            responses.LINES_Hz
        )
        for law in by_law
    }
    rows = [
        (law.label, source, *_response_cells(responses.margins(responses.LINES_Hz, response)))
        for law in by_law
        for source, response in (("measured", by_law[law]), ("linear", linear[law]))
    ]
    head = ("law", "response", "crossover, Hz", "phase margin, degrees", "gain margin, dB")
    table = ResultTable("Gain and phase margins of the sampled loop", head, rows, 2)
    return [Section("Frequency response", RESPONSE, [table], [lambda: _bode(by_law, linear)])]


def _response_cells(margins: responses.Margins) -> tuple[str, ...]:
    return tuple(NONE if np.isnan(value) else f"{value:.1f}" for value in margins)


def _bode(
    measured: dict[ComparedLaw, responses.Response], linear: dict[ComparedLaw, responses.Response]
) -> Drawing:
    from spheretwin.viz.figures import frequency_response as figures

    frequency_Hz = np.array(responses.LINES_Hz, np.float64)
    figure = figures.bode(
        {law.law: figures.LoopResponse(frequency_Hz, measured[law], linear[law]) for law in measured},
        {law.law: law.label for law in measured},
        "Loop of alpha, opened at the torque of the law",
    )
    caption = (
        "Gain and phase of the opened loop of α at rest. Markers: measured with a multisine; lines: linear"
        " model of the sampled loop. Dashed: gain 1 and −180 degrees."
    )
    return Drawing("stability_frequency_response.svg", caption, figure)


def _reaching_runs(outcomes: Outcomes) -> list[tuple[ComparedLaw, float, StabilityMeasures]]:
    return [
        (law, load, run.data) for law in LAWS for load in LOADS for run in outcomes.runs(reaching(law, load))
    ]


def _drift_runs(outcomes: Outcomes) -> list[tuple[ComparedLaw, StabilityMeasures, Span, Span]]:
    """Runs of ten minutes with their first and last minute."""
    return [
        (law, run.data, run.data.early, run.data.late)
        for law in LAWS
        for run in outcomes.runs(drift(law))
        if run.data.early and run.data.late
    ]


def _descent_findings(outcomes: Outcomes) -> list[Finding]:
    courses = [(load, data.descent) for _, load, data in _reaching_runs(outcomes) if data.descent]
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
    return [Finding(None if falls else False, text)]


def _drift_findings(outcomes: Outcomes) -> list[Finding]:
    texts = [
        f"{law.label} {early.variation_A_s:.0f} to {late.variation_A_s:.0f} A/s"
        for law, _, early, late in _drift_runs(outcomes)
    ]
    if not texts:
        return []
    return [Finding(None, f"variation of the commands, first to last of ten minutes: {', '.join(texts)}")]


def _reaching(outcomes: Outcomes) -> ResultTable:
    rows = []
    for law, load, data in _reaching_runs(outcomes):
        reached = "not within the run" if data.reached_s is None else f"{data.reached_s:.2f} s"
        rows.append((law.label, f"{load:g}", reached, *_descent_cells(data.descent)))
    head = (
        "law", "L", "reached after", "V rises at", "all rises / V₀", "fallen / V₀", "parameters' share of V₀",
    )  # fmt: skip
    return ResultTable("Reaching times, and V of (44) along AFSM's runs", head, rows, 2)


def _descent_cells(course: Descent | None) -> tuple[str, ...]:
    if course is None:
        return (NONE,) * 4
    share = f"{100 * course.of_parameters:.2f} %"
    return f"{100 * course.rises:.2g} %", f"{course.risen:.1e}", f"{course.fallen:.1e}", share


def _drift(outcomes: Outcomes) -> ResultTable:
    rows = []
    for law, data, early, late in _drift_runs(outcomes):
        gains = NONE if data.gains is None else " / ".join(f"{gain:.0f}" for gain in data.gains)
        rows.append((law.label, "first", *_span_cells(early), ""))
        rows.append((law.label, "last", *_span_cells(late), gains))
    head = (
        "law", "minute", "RMS error, mrad", "torque, N·m", "variation, A/s", "at the limit",
        "ξ̂ / ζ̂ at the end",
    )  # fmt: skip
    return ResultTable(f"First and last minute of {LONG_s:g} s", head, rows, 2)


def _span_cells(span: Span) -> tuple[str, ...]:
    return (
        f"{1e3 * span.rms_error_rad:.2f}",
        f"{span.rms_torque_Nm:.3f}",
        f"{span.variation_A_s:.1f}",
        f"{100 * span.at_limit:.0f} %",
    )


Steps = list[tuple[float, Outcome]]


def _tested(outcomes: Outcomes) -> dict[Margin, dict[ComparedLaw, Steps]]:
    """Steps with their outcomes, by margin and law, of everything that was run."""
    by_margin = {
        quantity: {
            law: [
                (step, run)
                for step, case in zip(quantity.steps, margin(law, quantity), strict=True)
                for run in outcomes.runs(case)
            ]
            for law in LAWS
        }
        for quantity in MARGINS
    }
    return {quantity: by_law for quantity, by_law in by_margin.items() if any(by_law.values())}


def _margins(outcomes: Outcomes) -> ResultTable:
    rows = [
        (quantity.name, *(_cell(quantity, steps) for steps in by_law.values()))
        for quantity, by_law in _tested(outcomes).items()
    ]
    head = ("made worse", *(f"{law.label}: last that holds / first that does not" for law in LAWS))
    return ResultTable("Margins", head, rows)


def _cell(quantity: Margin, steps: Steps) -> str:
    ends = ends_of([holds(run) for _, run in steps])
    texts = [f"{steps[index][0]:g}" if index is not None else "none tried" for index in ends]
    return f"{' / '.join(texts)} {quantity.unit}".strip()


def _draw(outcomes: Outcomes) -> Drawing:
    from spheretwin.viz.figures import conditions as figures

    panels = [
        figures.MarginPanel(
            f"{quantity.name}{f', {quantity.unit}' if quantity.unit else ''}",
            {
                law.law: np.array([(step, run.tail_rms_error.max(), holds(run)) for step, run in steps])
                for law, steps in by_law.items()
                if steps
            },
        )
        for quantity, by_law in _tested(outcomes).items()
    ]
    labels = {law.law: law.label for law in LAWS}
    figure = figures.margins(
        panels, labels, HOLDS_rad, "RMS error of the worst hinge, second half, mrad", "Margins"
    )
    caption = (
        "RMS error of the worst hinge over the second half of the run, as one thing is made worse; hollow"
        f" where the law does not hold; dashed, {1e3 * HOLDS_rad:g} mrad."
    )
    return Drawing("stability_margins.svg", caption, figure)


EXPERIMENT = Experiment(
    name="stability",
    title="Stability beyond the proof",
    summary="The sinusoid with m = 0.2 on ideal hardware, one seed: V of (44), reaching times, ten minutes on"
    " end, and how much delay, inertia and control rate each law bears.",
    cases=cases,
    sections=sections,
    reduce=reduce,
    findings=findings,
)
