"""Descent, reaching, drift and margins of the laws, as tables, a figure and findings."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from spheretwin.models.telemetry.status import Status
from spheretwin.twin.reproduce.experiment import Experiment, Finding, Outcome, Outcomes, Section, Table
from spheretwin.twin.reproduce.laws import Compared
from spheretwin.twin.reproduce.stability.conditions import (
    LOADS,
    MARGINS,
    WATCHED,
    LONG_s,
    Margin,
    cases,
    drift,
    margin,
    reaching,
)
from spheretwin.twin.reproduce.stability.descent import Descent
from spheretwin.twin.reproduce.stability.kept import SLOPE, REACHED_rad_s, Span, keep
from spheretwin.viz.figures.drawing import Drawing

HOLDS_rad = 0.01
"""A law holds where its run completes and errs by less, RMS over the second half, on every hinge: a twentieth
of the amplitude."""

REACHING = (
    f"The first time at which |λe + ė| of every hinge is below {REACHED_rad_s:g} rad/s, with the λ of (58),"
    f" {SLOPE:g} 1/s, for every law. V is the function (44) along the run: θ* is fitted to what each axis"
    " needed, ξ* is the largest rest of that fit, and ζ* is 0. It is weak evidence, as nearly all of V is the"
    " error of the parameters; the proof has V falling always, and says nothing of a sampled loop."
)
DRIFT = (
    f"The sinusoid for {LONG_s:g} s. ξ̂ and ζ̂ of AFSM only ever grow, as printed; what the last minute costs"
    " beside the first says what comes of it."
)
MARGIN = (
    "One thing made worse, step by step, on the sinusoid with m = 0.2 and L = 1 (but where m itself is what"
    " is changed); the law is told of none. It *holds* as long as the run completes with an RMS error of less"
    f" than {1e3 * HOLDS_rad:g} mrad on every hinge over the second half. Told are the last step at which it"
    " holds, all before it held too, and the first at which it does not. Beyond its margin a loop amplifies"
    " what rounding leaves: these rows are in no sample that is compared with MuJoCo."
)


def tell(outcomes: Outcomes) -> list[Section]:
    """What was found of each law."""
    drawn = (
        [lambda: _draw(outcomes)]
        if any(_tried(outcomes, law, at) for law in WATCHED for at in MARGINS)
        else []
    )
    return [
        Section("Descent and reaching", REACHING, [_reaching(outcomes)]),
        Section("Ten minutes", DRIFT, [_drift(outcomes)]),
        Section("Margins", MARGIN, [_margins(outcomes)], drawn),
    ]


def findings(outcomes: Outcomes) -> list[Finding]:
    """Whether V falls, and what ten minutes do."""
    return [*_falls(outcomes), *_drifts(outcomes)]


def holds(outcome: Outcome) -> bool:
    """Whether a law held."""
    return outcome.status == Status.COMPLETED and bool(np.all(outcome.tail_rms_error < HOLDS_rad))


def ends_of(held: Sequence[bool]) -> tuple[int | None, int | None]:
    """Places of the last step at which all held until then, and of the first at which it does not."""
    first = held.index(False) if False in held else None
    last = (len(held) if first is None else first) - 1
    return (last if last >= 0 else None), first


def _falls(outcomes: Outcomes) -> list[Finding]:
    found = [
        (load, run.kept.descent)
        for law in WATCHED
        for load in LOADS
        for run in outcomes.get(reaching(law, load).name, ())
        if run.kept.descent
    ]
    if not found:
        return []
    told = ", ".join(
        f"at L = {load:g} it rises at {100 * each.rises:.2g} % of the ticks, by {each.risen:.1e} V₀ in all"
        for load, each in found
    )
    least = min(each.of_parameters for _, each in found)
    falls = all(each.risen < each.fallen for _, each in found)
    said = (
        f"V of (44) {'falls' if falls else 'does not fall'} along AFSM's runs ({told}); weak evidence, as"
        f" {100 * least:.2f} % of V₀ are the parameters' errors"
    )
    return [Finding(None if falls else False, said)]


def _drifts(outcomes: Outcomes) -> list[Finding]:
    told = []
    for law in WATCHED:
        for run in outcomes.get(drift(law).name, ()):
            if run.kept.early:
                early, late = run.kept.early, run.kept.late
                told.append(f"{law.label} {early.variation_A_s:.0f} to {late.variation_A_s:.0f} A/s")
    if not told:
        return []
    return [Finding(None, f"variation of the commands, first to last of ten minutes: {', '.join(told)}")]


def _reaching(outcomes: Outcomes) -> Table:
    rows = []
    for law in WATCHED:
        for load in LOADS:
            for run in outcomes.get(reaching(law, load).name, ()):
                fell, reached = run.kept.descent, run.kept.reached_s
                said = "not within the run" if reached is None else f"{reached:.2f} s"
                rows.append((law.label, f"{load:g}", said, *_descent(fell)))
    head = (
        "law",
        "L",
        "reached after",
        "V rises at",
        "all rises / V₀",
        "fallen / V₀",
        "parameters' share of V₀",
    )
    return Table("Reaching times, and V of (44) along AFSM's runs", head, rows, 2)


def _descent(fell: Descent | None) -> tuple[str, ...]:
    if fell is None:
        return ("–",) * 4
    share = f"{100 * fell.of_parameters:.2f} %"
    return f"{100 * fell.rises:.2g} %", f"{fell.risen:.1e}", f"{fell.fallen:.1e}", share


def _drift(outcomes: Outcomes) -> Table:
    rows = []
    for law in WATCHED:
        for run in outcomes.get(drift(law).name, ()):
            gains = "–" if run.kept.gains is None else " / ".join(f"{gain:.0f}" for gain in run.kept.gains)
            for name, span in (("first", run.kept.early), ("last", run.kept.late)):
                if span:
                    rows.append((law.label, name, *_span(span), gains if name == "last" else ""))
    head = (
        "law",
        "minute",
        "RMS error, mrad",
        "torque, N·m",
        "variation, A/s",
        "at the limit",
        "ξ̂ / ζ̂ at the end",
    )
    return Table(f"First and last minute of {LONG_s:g} s", head, rows, 2)


def _span(span: Span) -> tuple[str, ...]:
    return (
        f"{1e3 * span.rms_error_rad:.2f}",
        f"{span.rms_torque_Nm:.3f}",
        f"{span.variation_A_s:.1f}",
        f"{100 * span.at_limit:.0f} %",
    )


def _margins(outcomes: Outcomes) -> Table:
    rows = [
        (of.name, *(_cell(outcomes, law, of) for law in WATCHED))
        for of in MARGINS
        if any(_tried(outcomes, law, of) for law in WATCHED)
    ]
    head = ("made worse", *(f"{law.label}: last that holds / first that does not" for law in WATCHED))
    return Table("Margins", head, rows)


def _cell(outcomes: Outcomes, law: Compared, of: Margin) -> str:
    tried = _tried(outcomes, law, of)
    steps = [step for step, _ in tried]
    last, first = ends_of([holds(run) for _, run in tried])
    named = [f"{steps[place]:g}" if place is not None else "none tried" for place in (last, first)]
    return f"{' / '.join(named)} {of.unit}".strip()


def _tried(outcomes: Outcomes, law: Compared, of: Margin) -> list[tuple[float, Outcome]]:
    """Steps of a margin that were run, each with its outcome."""
    named = zip(of.steps, margin(law, of), strict=True)
    return [(step, outcomes[each.name][0]) for step, each in named if each.name in outcomes]


def _draw(outcomes: Outcomes) -> Drawing:
    from spheretwin.viz.figures.tracking import margins as figures

    panels = [
        figures.Panel(
            f"{of.name}{f', {of.unit}' if of.unit else ''}",
            {
                law.law: np.array([(step, run.tail_rms_error.max(), holds(run)) for step, run in tried])
                for law in WATCHED
                if (tried := _tried(outcomes, law, of))
            },
        )
        for of in MARGINS
        if any(_tried(outcomes, law, of) for law in WATCHED)
    ]
    labels = {law.law: law.label for law in WATCHED}
    figure = figures.margins(
        panels, labels, HOLDS_rad, "RMS error of the worst hinge, second half, mrad", "Margins"
    )
    caption = (
        "RMS error of the worst hinge over the second half of the run, as one thing is made worse; hollow"
        f" where the law does not hold; dashed, {1e3 * HOLDS_rad:g} mrad."
    )
    return Drawing("stability_margins.png", caption, figure)


EXPERIMENT = Experiment(
    name="stability",
    title="Stability beyond the proof",
    shows="The sinusoid with m = 0.2 on ideal hardware, one seed: V of (44), reaching times, ten minutes on"
    " end, and how much delay, inertia and control rate each law bears.",
    cases=cases,
    tell=tell,
    keep=keep,
    findings=findings,
)
