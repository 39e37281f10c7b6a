"""What each law is put through: loads, ten minutes, delays, inertias, control rates."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from spheretwin.control.law_components.fuzzy import CENTRES, SHAPE, WIDTH
from spheretwin.control.laws.afsm import AFSM
from spheretwin.models.telemetry.status import Status
from spheretwin.models.telemetry.table import Table
from spheretwin.paper.experiment import (
    COMPARED,
    Array,
    Case,
    Compared,
    Experiment,
    Finding,
    Outcome,
    Outcomes,
    ResultTable,
    Section,
)
from spheretwin.run import Run
from spheretwin.viz.pages.markdown import Drawing

SCENARIO = "sinusoid"

WATCHED: tuple[Compared, ...] = tuple(
    compared
    for compared in COMPARED
    if compared.law in ("afsm", "pid", "afsm_eso")  # one more joins by its name
)

LONG_s = 600.0
LOADS = (1.0, 5.0)
STEP_s = 5e-4

# A margin is looked for beyond its end: a run may be lost there.
ENDS = (Status.COMPLETED, Status.LEFT_WORKSPACE, Status.DIVERGED)


class Margin(NamedTuple):
    """One thing that is made worse step by step."""

    name: str
    unit: str
    steps: tuple[float, ...]
    """From what is healthy on."""


DELAY = Margin("unknown delay", "ms", (0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 12, 14))
HEAVIER = Margin("inertia, heavier: m", "", (0, 0.5, 1, 2, 3, 4, 5, 6, 8, 12, 16))
LIGHTER = Margin("inertia, lighter: m", "", (0, -0.3, -0.5, -0.6, -0.7, -0.8, -0.9, -0.95))
SLOWER = Margin("control rate, slower", "Hz", (1000, 500, 400, 250, 200, 100))
FASTER = Margin("control rate, faster", "Hz", (1000, 2000, 5000, 10000))
MARGINS = (DELAY, HEAVIER, LIGHTER, SLOWER, FASTER)


def cases() -> list[Case]:
    """Everything for every law."""
    found = [reaching(law, load) for law in WATCHED for load in LOADS]
    found += [drift(law) for law in WATCHED]
    by_name = {each.name: each for law in WATCHED for at in MARGINS for each in margin(law, at)}
    return [*found, *by_name.values()]


def reaching(compared: Compared, load: float) -> Case:
    """From rest under a load."""
    return _case(compared, f"L {load:g}", {"disturbance.load": load}, (Status.COMPLETED,))


def drift(compared: Compared) -> Case:
    """Ten minutes on end."""
    return _case(compared, f"{LONG_s:g} s", {"duration": LONG_s}, ENDS)


def margin(compared: Compared, of: Margin) -> list[Case]:
    """A law under every step of a margin."""
    return [_case(compared, *_worse(of, step), ENDS)._replace(compared=False) for step in of.steps]


def _worse(of: Margin, step: float) -> tuple[str, dict[str, Any]]:
    if of is DELAY:  # of which no law is told
        return f"delay {step:g} ms", {"drive.delay_s": 1e-3 * step, "nominal.delay_s": 0.0}
    if of in (HEAVIER, LIGHTER):
        return f"m {step:g}", {"plant.modelling_error": float(step)}
    period_s = 1 / step
    return f"{step:g} Hz", {"controller.period_s": period_s, "plant.step_s": min(STEP_s, period_s)}


def _case(compared: Compared, condition: str, fields: dict[str, Any], ends: tuple[Status, ...]) -> Case:
    return Case(
        name=f"{compared.law}: {condition}",
        scenario=SCENARIO,
        fields={"controller.law": compared.law, **fields},
        told={"condition": condition},
        once=True,
        ends=ends,
    )


CUT = 1e-3
"""Of the largest singular value: directions of theta that a run hardly excites are left at 0."""


class Descent(NamedTuple):
    """How V went."""

    rises: float
    """Share of the ticks at which it rose."""
    risen: float
    """Sum of all rises, over V at the start."""
    fallen: float
    """What was lost from start to end, over V at the start."""
    of_parameters: float
    """Share of V at the start that the parameters' errors make up."""


def descent(run: Run) -> Descent | None:
    """How V of a run went; None of another law, or level, than the proof is of."""
    gains = run.scenario.controller
    if not isinstance(gains, AFSM) or gains.level != "acceleration" or len(run.telemetry) < 2:
        return None
    axes = [_of_axis(run, gains, axis) for axis in range(3)]
    total, parameters = np.sum([each[0] for each in axes], axis=0), sum(each[1] for each in axes)
    steps = np.diff(total)
    up = steps[steps > 0]
    return Descent(len(up) / len(steps), float(up.sum() / total[0]), float(1 - total[-1] / total[0]),
                   float(parameters / total[0]))  # fmt: skip


def _of_axis(run: Run, gains: AFSM, axis: int) -> tuple[Array, float]:
    """V of an axis over the ticks but the last, and what the parameters' errors are of the first."""
    table, period_s = run.telemetry, gains.period_s
    s, mass = table["sliding_s"][:, axis], 1 + run.scenario.plant.modelling_error
    psi = regressor(table["qdot_rad_s"][:, axis], table["q_rad"][:, axis])
    theta = consequents(psi, s, gains.fuzzy_rate[axis], period_s)
    v = table["torque_command_Nm"][:-1, axis] / np.array(run.scenario.nominal.inertia_kg_m2)[axis]
    needed = v - mass * np.diff(s) / period_s
    best = np.linalg.lstsq(psi[:-1], needed, rcond=CUT)[0]
    bound = np.abs(needed - psi[:-1] @ best).max()
    of_theta = np.sum((theta[:-1] - best) ** 2, axis=1) / gains.fuzzy_rate[axis]
    of_xi = (table["switching_gain"][:-1, axis] - bound) ** 2 / gains.switching_rate[axis]
    of_zeta = table["bound_gain"][:-1, axis] ** 2 / gains.bound_rate[axis]
    errors = (of_theta + of_xi + of_zeta) / 2
    return mass * s[:-1] ** 2 / 2 + errors, float(errors[0])


def regressor(rate: Array, angle: Array) -> Array:
    """(n, 75) regressor Psi of an axis."""
    of_rate, of_angle = _memberships(rate), _memberships(angle)
    psi = (of_rate[:, :, None] * of_angle[:, None, :]).reshape(len(rate), -1)
    return np.hstack([psi, psi * rate[:, None], psi * angle[:, None]])


def consequents(psi: Array, s: Array, fuzzy_rate: float, period_s: float) -> Array:
    """(n, 75) estimates theta at each tick, from 0 on (43)."""
    steps = -fuzzy_rate * period_s * s[:, None] * psi
    return np.vstack([np.zeros(psi.shape[1]), np.cumsum(steps, axis=0)[:-1]])


def _memberships(x: Array) -> Array:
    degrees = np.exp(-SHAPE * ((x[:, None] - np.array(CENTRES)) / (2 * WIDTH)) ** 2)
    return degrees / degrees.sum(axis=1, keepdims=True)


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
    """First and last minute; None of shorter runs."""
    gains: tuple[float, float] | None
    """Largest ξ̂ and ζ̂ at the end; None of laws that have none."""
    descent: Descent | None


def keep(run: Run) -> StabilityMeasures:
    """Reduce a run."""
    table, period_s = run.telemetry, run.scenario.controller.period_s
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


def _reaching(outcomes: Outcomes) -> ResultTable:
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
    return ResultTable("Reaching times, and V of (44) along AFSM's runs", head, rows, 2)


def _descent(fell: Descent | None) -> tuple[str, ...]:
    if fell is None:
        return ("–",) * 4
    share = f"{100 * fell.of_parameters:.2f} %"
    return f"{100 * fell.rises:.2g} %", f"{fell.risen:.1e}", f"{fell.fallen:.1e}", share


def _drift(outcomes: Outcomes) -> ResultTable:
    rows = []
    for law in WATCHED:
        for run in outcomes.get(drift(law).name, ()):
            gains = "–" if run.kept.gains is None else " / ".join(f"{gain:.0f}" for gain in run.kept.gains)
            for name, span in (("first", run.kept.early), ("last", run.kept.late)):
                if span:
                    rows.append((law.label, name, *_span_cells(span), gains if name == "last" else ""))
    head = (
        "law",
        "minute",
        "RMS error, mrad",
        "torque, N·m",
        "variation, A/s",
        "at the limit",
        "ξ̂ / ζ̂ at the end",
    )
    return ResultTable(f"First and last minute of {LONG_s:g} s", head, rows, 2)


def _span_cells(span: Span) -> tuple[str, ...]:
    return (
        f"{1e3 * span.rms_error_rad:.2f}",
        f"{span.rms_torque_Nm:.3f}",
        f"{span.variation_A_s:.1f}",
        f"{100 * span.at_limit:.0f} %",
    )


def _margins(outcomes: Outcomes) -> ResultTable:
    rows = [
        (of.name, *(_cell(outcomes, law, of) for law in WATCHED))
        for of in MARGINS
        if any(_tried(outcomes, law, of) for law in WATCHED)
    ]
    head = ("made worse", *(f"{law.label}: last that holds / first that does not" for law in WATCHED))
    return ResultTable("Margins", head, rows)


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
    from spheretwin.viz.figures import conditions as figures

    panels = [
        figures.MarginPanel(
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
