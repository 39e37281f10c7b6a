"""Tables and findings of the comparison."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from spheretwin.paper.experiment import BY_LAW, Finding, Outcomes, ResultTable
from spheretwin.paper.rival_conditions import HARDWARE, Condition, Hardware, study, tuned_gains
from spheretwin.paper.rival_results import LEVEL, OUR_LAW, Result, current_limits_rad, results, within

NONE = "–"
ALLOCATION_LABELS = {
    "least_norm": "full current, least norm",
    "bounded": "full current, bounded allocation",
}


def ranges(hardware: Hardware) -> ResultTable:
    """Gains that the search varies, their ranges and the reasons."""
    optimise = study(hardware.study).optimise
    rows: list[tuple[str, ...]] = [
        (
            BY_LAW[gain.law].label if gain.law else "all laws",
            gain.called.removeprefix("controller."),
            gain.reason,
            f"{gain.low:g}",
            f"{gain.high:g}",
            "yes" if gain.optional else "no",
        )
        for gain in (optimise.gain if optimise else ())
    ]
    head = ("law", "gain", "reason", "from", "to", "may be off")
    return ResultTable(f"Ranges of the search, {hardware.title}", head, rows, 3)


def gains(hardware: Hardware) -> ResultTable:
    """Gains that the search found."""
    rows: list[tuple[str, ...]] = [
        (f"{each.limit_A_s:g}", BY_LAW[each.law].label, _as_text(each.gains))
        for each in tuned_gains(hardware.study)
    ]
    return ResultTable(f"Gains found, {hardware.title}", ("limit, A/s", "law", "gains"), rows, 3)


def _as_text(found: Mapping[str, float | None]) -> str:
    named = {name.removeprefix("controller."): value for name, value in found.items()}
    return ", ".join(f"{name} {'off' if value is None else f'{value:.4g}'}" for name, value in named.items())


def errors(hardware: Hardware, outcomes: Outcomes) -> ResultTable:
    """Error, variation and tail of every law within each limit, and the limit that the currents set."""
    conditions = [each for each in hardware.conditions if not each.perturbed]
    rows = _rows(hardware, conditions, outcomes, with_tail=True)
    if not hardware.in_degrees:
        rows += _current_limits(conditions, outcomes)
    unit = _unit(hardware)
    title = (
        f"{hardware.title}: largest error in {unit} / variation in A/s / tail RMS in {_tail_unit(hardware)}"
    )
    return ResultTable(title, ("limit, A/s", "law", *(each.name for each in conditions)), rows, 2)


def robustness(hardware: Hardware, outcomes: Outcomes) -> ResultTable:
    """Error and variation under a wrong nominal model, with the gains of the table before."""
    first = hardware.conditions[0]
    conditions = [first, *(each for each in hardware.conditions if each.perturbed)]
    rows = _rows(hardware, conditions, outcomes, with_tail=False)
    title = f"{hardware.title}, wrong nominal model: largest error in {_unit(hardware)} / variation in A/s"
    return ResultTable(title, ("limit, A/s", "law", *(each.name for each in conditions)), rows, 2)


def _rows(
    hardware: Hardware, conditions: Sequence[Condition], outcomes: Outcomes, with_tail: bool
) -> list[tuple[str, ...]]:
    """A row a law, by limit and, within it, by the error under the first condition."""
    found = [results(hardware, condition, outcomes) for condition in conditions]
    by_law = [{(each.limit_A_s, each.label): each for each in of_condition} for of_condition in found]
    rows: list[tuple[str, ...]] = []
    for limit in hardware.limits_A_s:
        ordered = within(found[0], limit)
        rows += [_row(hardware, f"{limit:g}", each, by_law, with_tail) for each in ordered]
        missing = set(BY_LAW) - {each.law for each in ordered} if ordered else set()
        rows += [
            (f"{limit:g}", label, "none within the limit", *[NONE] * (len(conditions) - 1))
            for law, label in ((law, BY_LAW[law].label) for law in BY_LAW)
            if law in missing
        ]
    presets = [each for each in found[0] if each.limit_A_s is None]
    return rows + [_row(hardware, "as shipped", each, by_law, with_tail) for each in presets]


def _row(
    hardware: Hardware,
    limit: str,
    of_law: Result,
    by_law: Sequence[dict[tuple[float | None, str], Result]],
    with_tail: bool,
) -> tuple[str, ...]:
    key = of_law.limit_A_s, of_law.label
    cells = [_cell(hardware, each[key], with_tail) if key in each else NONE for each in by_law]
    return (limit, of_law.label, *cells)


def _cell(hardware: Hardware, result: Result, with_tail: bool) -> str:
    if result.is_lost:
        return "lost"
    cells = [_angle(hardware, result.largest_rad), f"{result.variation_A_s:.1f}"]
    if with_tail:
        tail = np.degrees(result.tail_rad) if hardware.in_degrees else 1e4 * result.tail_rad
        cells.append(f"{tail:.3f}" if hardware.in_degrees else f"{tail:.2f}")
    return " / ".join(cells)


def _angle(hardware: Hardware, value_rad: float) -> str:
    return f"{np.degrees(value_rad):.4f}" if hardware.in_degrees else f"{1e3 * value_rad:.2f}"


def _unit(hardware: Hardware) -> str:
    return "degrees" if hardware.in_degrees else "mrad"


def _tail_unit(hardware: Hardware) -> str:
    return "degrees" if hardware.in_degrees else "1e-4 rad"


def _current_limits(conditions: Sequence[Condition], outcomes: Outcomes) -> list[tuple[str, ...]]:
    found = [current_limits_rad(condition, outcomes) for condition in conditions]
    return [
        ("physical", label, *(f"{1e3 * each[name]:.2f}" if name in each else NONE for each in found))
        for name, label in ALLOCATION_LABELS.items()
        if any(name in each for each in found)
    ]


def findings(outcomes: Outcomes) -> list[Finding]:
    """Best law within each limit, and which laws are level with or better than our own."""
    return [
        Finding(None, f"{hardware.title}, {condition.name}, largest error: {'; '.join(parts)}")
        for hardware in HARDWARE
        for condition in hardware.conditions
        if (parts := _by_limit(hardware, condition, outcomes))
    ]


def _by_limit(hardware: Hardware, condition: Condition, outcomes: Outcomes) -> list[str]:
    found = results(hardware, condition, outcomes)
    completed = {
        limit: [each for each in within(found, limit) if not each.is_lost] for limit in hardware.limits_A_s
    }
    return [
        f"tuned within {limit:g} A/s {_compared_with_ours(hardware, laws)}"
        for limit, laws in completed.items()
        if laws
    ]


def _compared_with_ours(hardware: Hardware, ordered: Sequence[Result]) -> str:
    """The order of some laws against our own; the least error first."""
    unit, own_label = _unit(hardware), BY_LAW[OUR_LAW].label
    told = {each.law: f"{each.label} ({_angle(hardware, each.largest_rad)} {unit})" for each in ordered}
    ours = next((each for each in ordered if each.law == OUR_LAW), None)
    if ours is None:
        return f"{told[ordered[0].law]} is best, and {own_label} lost the rotor or is beyond the limit"
    rivals = [each for each in ordered if each.law != OUR_LAW]
    better = [told[each.law] for each in rivals if LEVEL * each.largest_rad < ours.largest_rad]
    level = [
        told[each.law]
        for each in rivals
        if ours.largest_rad / LEVEL <= each.largest_rad <= LEVEL * ours.largest_rad
    ]
    parts = [f"better: {', '.join(better)}"] if better else []
    parts += [f"level: {', '.join(level)}"] if level else []
    if not parts:
        nearest = f", before {told[rivals[0].law]}" if rivals else ""
        return f"{told[OUR_LAW]} is best{nearest}"
    return f"{told[OUR_LAW]} is not alone; {'; '.join(parts)}"
