"""Figures 6 and 7: errors of every law on the sinusoid over the modelling error and over the load."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from itertools import pairwise

import numpy as np

from spheretwin.models.telemetry.signals import ANGLES
from spheretwin.paper.cells import of_axis
from spheretwin.paper.experiment import Array, ExperimentSection, Outcomes, RunOutcome, Statement
from spheretwin.paper.experiment_file import (
    COMPARED_LAWS,
    PAPER_LAWS,
    CaseRuns,
    ComparedLaw,
    ExperimentFile,
    printed_rad,
)
from spheretwin.viz.pages.markdown import Drawing

FIGURE6, FIGURE7 = (ExperimentFile("sinusoid", figure) for figure in ("figure6", "figure7"))

SIZE = 0.25
"""Largest deviation of a median from a printed number that counts as reproduced, relative to the number."""

NAMES = " > ".join(law.label for law in PAPER_LAWS)


def order(file: ExperimentFile, outcomes: Outcomes) -> list[Statement]:
    """Compare the order of the laws with the paper's at every point."""
    by_point = [
        (point[file["symbol"]], [outcomes.runs(file.case(law=law.law, **point)) for law in PAPER_LAWS])
        for point in file["condition"]
    ]
    by_point = [(value, runs) for value, runs in by_point if all(runs)]
    if not by_point:
        return []
    right, total = 0, 0
    for _, runs in by_point:
        largest = [[run.max_abs_error for run in of_law] for of_law in runs]
        for above, below in pairwise(largest):
            count = min(len(above), len(below))
            right += int(np.sum(np.array(above[:count]) > np.array(below[:count])))
            total += 3 * count
    span = f"{file['symbol']} = {by_point[0][0]:g} to {by_point[-1][0]:g}"
    share = "at every point, hinge and seed" if right == total else f"in {right} of {total} comparisons"
    return [Statement(right == total, f"the order {NAMES} over {span} holds {share}")]


def sizes(file: ExperimentFile, outcomes: Outcomes) -> list[Statement]:
    """Compare the errors of each law with the printed ones."""
    m, L = file["printed"].values()
    by_law = {law: outcomes.runs(file.case(law=law.law, m=m, L=L)) for law in PAPER_LAWS}
    by_law = {law: runs for law, runs in by_law.items() if runs}
    ratios = {law: _median_rad(runs) / np.array(printed_rad(law.law, m, L)) for law, runs in by_law.items()}
    lost = [law for law, runs in by_law.items() if not _all_complete(runs)]
    close = [law for law in by_law if law not in lost and np.all(np.abs(ratios[law] - 1) <= SIZE)]
    other = [law for law in by_law if law not in lost and law not in close]
    where = f"the printed errors at m = {m:g}, L = {L:g}"
    findings = []
    if close:
        findings.append(
            Statement(True, f"{where} within {100 * SIZE:.0f} %: {_ratios_text(close, ratios)} of them")
        )
    if other:
        smaller = all(np.all(ratios[law] < 1) for law in other)
        why = "; the printed gains hold the rotor closer than the paper says" if smaller else ""
        findings.append(Statement(False, f"{where}: {_ratios_text(other, ratios)} of them{why}"))
    for law in lost:
        text = f"{_ratios_text([law], ratios)} of them, but {_loss_text(by_law[law])}"
        findings.append(Statement(False, f"{where}: {text}"))
    return findings


def _ratios_text(laws: Sequence[ComparedLaw], ratios: Mapping[ComparedLaw, Array]) -> str:
    return ", ".join(f"{law.label} ×{ratios[law].min():.2f} to ×{ratios[law].max():.2f}" for law in laws)


def growth(file: ExperimentFile, outcomes: Outcomes) -> list[Statement]:
    """Test if AFSM's error grows with the load, as the paper concludes."""
    points = file.runs(outcomes, law="afsm")
    if len(points) < 2:
        return []
    medians = np.array([_median_rad(point.runs) for point in points])
    grows = bool(np.all(np.diff(medians, axis=0) > 0))
    first, last = 1e3 * medians.max(axis=1)[[0, -1]]
    verdict = "grows with the load" if grows else "does not grow with the load throughout"
    return [
        Statement(
            grows,
            f"{points[0]['label']}'s error {verdict}, from {first:.0f} mrad at L = {points[0]['L']:g} to"
            f" {last:.0f} mrad at L = {points[-1]['L']:g}",
        )
    ]


def _loss_text(runs: Sequence[RunOutcome]) -> str:
    """Describe how runs were lost."""
    lost = [run for run in runs if not run.is_complete]
    saturated = float(np.median([run.figures["saturated_fraction"] or 0.0 for run in lost]))
    statuses = ", ".join(sorted({str(run.status) for run in lost}))
    return (
        f"{len(lost)} of {len(runs)} runs ended as {statuses}, the current limit cutting the torque at"
        f" {100 * saturated:.0f} % of their ticks"
    )


def _median_rad(runs: Sequence[RunOutcome]) -> Array:
    return np.array([np.median(of_axis(runs, "max_abs_error", axis)) for axis in range(3)])


def _all_complete(runs: Sequence[RunOutcome]) -> bool:
    return all(run.is_complete for run in runs)


def _sections(file: ExperimentFile, outcomes: Outcomes) -> list[ExperimentSection]:
    items, symbol = file.runs(outcomes), file["symbol"]
    value = {symbol: f"{{{symbol}:g}}"}
    tables = [file.table(name, items, value) for name in ("largest", "effort")]
    return [file.section("errors", tables, [lambda: _draw(file, items)], quantity=file["quantity"])]


def _findings(file: ExperimentFile, outcomes: Outcomes) -> list[Statement]:
    findings = [*order(file, outcomes), *sizes(file, outcomes)]
    return [*findings, *growth(file, outcomes)] if file is FIGURE7 else findings


def _draw(file: ExperimentFile, items: Sequence[CaseRuns]) -> Drawing:
    from spheretwin.viz.figures import conditions as figures

    by_label = {}
    for law in filter(lambda law: law.in_figures, COMPARED_LAWS):
        by_value = {item[file["symbol"]]: item for item in items if item["law"] == law.law}
        if not by_value:
            continue
        errors = [
            np.quantile([run.max_abs_error for run in item.runs], [0, 0.5, 1], axis=0)
            for item in by_value.values()
        ]
        by_label[law.label] = figures.ErrorsByCondition(
            law=law.law,
            values=np.array(list(by_value)),
            error_rad=np.stack(errors, axis=1),
            whole=np.array([_all_complete(item.runs) for item in by_value.values()]),
            paper_rad={value: item["paper"] for value, item in by_value.items() if item["paper"]},
        )
    quantity, fixed = file["quantity"], file["fixed"]
    title = f"Figure {file['name'].removeprefix('figure')}: sinusoid, {fixed}, largest |error|"
    figure = figures.by_condition(by_label, ANGLES, quantity, "largest |error|", title)
    return file.drawing("errors", figure, name=file["name"], quantity=quantity, fixed=fixed)


EXPERIMENT_6, EXPERIMENT_7 = (
    file.experiment(sections=partial(_sections, file), findings=partial(_findings, file))
    for file in (FIGURE6, FIGURE7)
)
