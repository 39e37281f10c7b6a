"""Report of a tuning: page, figures and the file of the best gains."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from spheretwin.scenario.fields import quantity_text
from spheretwin.study.optimise import ON, SWITCH, Gain, Objective, Optimise, best_within
from spheretwin.study.report import can_be_drawn
from spheretwin.study.study import Study
from spheretwin.study.tuning.gains import section_of
from spheretwin.study.tuning.trials import Ended
from spheretwin.study.tuning.tuning import LawResult, ReportedTrial, TuningResult
from spheretwin.viz.pages import markdown as pieces
from spheretwin.viz.pages.markdown import Drawing, PageSection, ReportPage, ResultTable, save_text

if TYPE_CHECKING:
    from spheretwin.viz.figures import fronts


def drawings(name: str, result: TuningResult, objectives: Sequence[Objective]) -> list[Drawing]:
    """Figures of a tuning; none of one without a trial."""
    from spheretwin.viz.figures import fronts  # matplotlib is slow to import

    by_label = {law.law: _trials(law, objectives) for law in result.laws if law.trials}
    if not by_label:
        return []
    names = [_objective_text(objective.called) for objective in objectives]
    figures = [
        Drawing(
            "trials.svg",
            "Objectives of each trial. A ring is a pruned trial, whose objective is at least this value; a"
            " cross is a lost trial.",
            fronts.progress(by_label, names, f"{name}: trials"),
        )
    ]
    if len(objectives) == 2:
        caption = "Pareto front: no other trial is at least as good in both objectives and better in one."
        figures.append(Drawing("front.svg", caption, fronts.front(by_label, names, f"{name}: front")))
    return figures


def _trials(law: LawResult, objectives: Sequence[Objective]) -> fronts.Trials:
    from spheretwin.viz.figures import fronts

    signs = np.array([objective.sign for objective in objectives])
    best = {trial.finished.number for trial in law.best}
    lost = [np.nan] * len(objectives)
    values = [lost if trial.tried.ended == Ended.LOST else trial.tried.values for trial in law.trials]
    holdouts = [trial.holdout.values for trial in law.best if trial.holdout and trial.holdout.values]
    return fronts.Trials(
        law=law.law,
        numbers=np.array([float(trial.number) for trial in law.trials]),
        values=signs * np.array(values, dtype=float),
        completed=np.array([trial.tried.ended == Ended.COMPLETED for trial in law.trials]),
        best=np.array([trial.number in best for trial in law.trials]),
        signs=signs,
        has_start=law.start is not None,
        fresh=signs * np.array(holdouts, dtype=float).reshape(-1, len(objectives)),
    )


FIELDS = ("trial", "gains", "fields", "values")
"""Fields of a trial in the file of the best gains."""


def summary(result: TuningResult, objectives: Sequence[Objective]) -> dict[str, Any]:
    """Summary by law: statuses of its trials, its start, and its best or its front."""
    return {
        "objectives": [objective.model_dump(mode="json") for objective in objectives],
        "laws": {law.law: _of_law(law, objectives) for law in result.laws},
        "trials": result.trials,
        "of": result.of,
        "resumed": result.resumed,
        "wall_s": result.wall_s,
        "table": str(result.table),
    }


def best(result: TuningResult, objectives: Sequence[Objective]) -> dict[str, Any]:
    """Best gains of each law: the best trial, that within each limit, or the trials of the front."""
    return {"laws": {law.law: _best_of(law, objectives) for law in result.laws}}


def _best_of(law: LawResult, objectives: Sequence[Objective]) -> list[dict[str, Any]]:
    by_number = {trial.finished.number: trial for trial in law.best}
    values = {number: trial.finished.tried.values for number, trial in by_number.items()}
    limits = objectives[-1].limits
    numbers: list[tuple[float | None, int | None]] = [(limit, best_within(values, limit)) for limit in limits]
    return [
        {"limit": limit, **{name: _trial_figures(by_number[number], objectives)[name] for name in FIELDS}}
        for limit, number in (numbers if limits else [(None, number) for number in by_number])
        if number is not None
    ]


def _of_law(law: LawResult, objectives: Sequence[Objective]) -> dict[str, Any]:
    counts = Counter(trial.tried.ended for trial in law.trials)
    lost = [trial.tried.reason for trial in law.trials if trial.tried.ended == Ended.LOST]
    return {
        "ended": {str(ending): counts[ending] for ending in Ended},
        "lost": lost[0] if lost else None,
        "rows": sum(len(trial.tried.by_row) for trial in law.trials),
        "start": _trial_figures(law.start, objectives) if law.start else None,
        "best": [_trial_figures(trial, objectives) for trial in law.best],
    }


def _trial_figures(trial: ReportedTrial, objectives: Sequence[Objective]) -> dict[str, Any]:
    tried, holdout = trial.finished.tried, trial.holdout
    completed = tried.ended == Ended.COMPLETED
    return {
        "trial": trial.finished.number,
        "ended": str(tried.ended),
        "reason": tried.reason or None,
        "gains": _gains(trial.finished.chosen),
        "fields": dict(trial.fields),
        "values": _signed(tried.values, objectives) if completed else None,
        "fresh": _signed(holdout.values, objectives) if holdout and holdout.values else None,
        "fresh_reason": (holdout.reason or None) if holdout else None,
        "command": trial.command,
    }


def _gains(chosen: Mapping[str, float]) -> dict[str, float | None]:
    """Values by gain; None of an optional one that is off."""
    is_on = {
        name.removesuffix(SWITCH): value >= ON for name, value in chosen.items() if name.endswith(SWITCH)
    }
    return {
        name: value if is_on.get(name, True) else None
        for name, value in chosen.items()
        if not name.endswith(SWITCH)
    }


def _signed(values: Sequence[float], objectives: Sequence[Objective]) -> dict[str, float]:
    pairs = zip(objectives, values, strict=True)
    return {objective.called: objective.sign * value for objective, value in pairs}


NAME, GAINS = "tuning", "gains.json"

METHODS = {
    "tpe": "proposed by a tree-structured Parzen estimator",
    "nsga2": "proposed by NSGA-II",
    "random": "drawn at random",
    "local": "points of a Sobol sequence, then perturbations of the best within each limit",
}


def write(
    folder: Path, study: Study, result: TuningResult, command: str, figure_format: str = "svg"
) -> list[Path]:
    """Write the page, its figures if matplotlib is installed, and the gains; return pages and gains.

    Parameters
    ----------
    folder : Path
        Exists.
    study : Study
    result : TuningResult
    command : str
        Command that creates the page.
    figure_format : str
        Format of the figures in addition to SVG.

    Raises
    ------
    SpheretwinError
        A file cannot be written there.
    """
    optimise = section_of(study)
    figures = drawings(study.name, result, optimise.objective) if can_be_drawn() else []
    sections = [PageSection("Method", _what(study)), *pieces.figures_section(figures)]
    sections += [
        PageSection(law, [counted(of_law), chosen(of_law) or NONE_COMPLETED])
        for law, of_law in summary(result, optimise.objective)["laws"].items()
    ]
    gains = json.dumps(best(result, optimise.objective), indent=1, ensure_ascii=False)
    lead = f"{study.description}\n\n{result.trials} of {result.of} trials are finished."
    return [
        *ReportPage(NAME, study.name, lead, sections, command).write(folder, figure_format),
        save_text(folder / GAINS, f"{gains}\n"),
    ]


def _what(study: Study) -> list[str | ResultTable]:
    """Objectives, method and ranges."""
    optimise = section_of(study)
    ranges = [
        [quantity_text(gain.called), gain.law or "all", *_range(gain), _sets(gain.settings), gain.reason]
        for gain in optimise.gain
    ]
    objectives = " and ".join(
        f"{objective.direction} *{_objective_text(objective.called)}*" for objective in optimise.objective
    )
    fresh = (
        f" *Fresh* are {optimise.fresh} further seeds, which the choice of the trials did not use."
        if optimise.fresh
        else ""
    )
    return [
        f"Objectives: {objectives}, over {study.seeds} seeds of each point."
        f" Trials are {METHODS[optimise.sampler]}, {optimise.together} at a time."
        + (" A trial that can no longer be among the best is pruned." if optimise.prune else "")
        + _limits(optimise)
        + fresh,
        ResultTable("", ["gain", "law", "from", "to", "fields", "reason"], ranges, 2, ["fields", "reason"]),
    ]


def _limits(optimise: Optimise) -> str:
    if not optimise.limits:
        return ""
    listed = ", ".join(f"{limit:g}" for limit in optimise.limits)
    limited = _objective_text(optimise.objective[1].called)
    return f" The best trial within each limit on *{limited}* is chosen: {listed}."


def _objective_text(called: str) -> str:
    """Return the name of an objective in words, with its unit and its entries."""
    name, _, entries = called.partition(" of ")
    return f"{quantity_text(name)} ({entries})" if entries else quantity_text(name)


def _range(gain: Gain) -> list[str]:
    return [f"{gain.low:g}", f"{gain.high:g}{', or off' if gain.optional else ''}"]


def _sets(settings: Sequence[Any]) -> str:
    return ", ".join(
        f"`{setting.field}`"
        + (f" · {setting.factor:g}" if setting.factor != 1 else "")
        + (f" (power {setting.power:g})" if setting.power != 1 else "")
        for setting in settings
    )


def counted(of_law: Mapping[str, Any]) -> str:
    """Trials of a law by their statuses, its rows, and the reason of the first that lost."""
    ended = ", ".join(f"{count} {how}" for how, count in of_law["ended"].items() if count)
    lost = f" The first that lost: {of_law['lost']}." if of_law["lost"] else ""
    return f"Trials: {ended or 'none'}; {of_law['rows']} rows were run.{lost}"


NONE_COMPLETED = "No trial completed."


def chosen(of_law: Mapping[str, Any], title: str = "") -> ResultTable | None:
    """Table of gains, fields and objectives of the start, and of the best or the front.

    None if no trial completed.
    """
    labelled = [("start", of_law["start"])] if of_law["start"] else []
    labelled += [(str(candidate["trial"]), candidate) for candidate in of_law["best"]]
    values = next((list(candidate["values"]) for _, candidate in labelled if candidate["values"]), None)
    if values is None:
        return None
    columns = dict.fromkeys(
        [*labelled[0][1]["gains"], *(field for _, candidate in labelled for field in candidate["fields"])]
    )
    is_fresh = any(candidate["fresh"] or candidate["fresh_reason"] for _, candidate in labelled)
    names = [_objective_text(name) for name in values]
    fresh = [f"{name}, fresh" for name in names if is_fresh]
    head = ["trial", *map(quantity_text, columns), *names, *fresh]
    body = []
    for label, candidate in labelled:
        numbers = {**candidate["gains"], **candidate["fields"]}
        values_of = map(numbers.get, columns)
        cells = ["off" if value is None else f"{value:.4g}" for value in values_of]
        groups = [(candidate["values"], candidate["ended"]), (candidate["fresh"], "lost")]
        for figures, otherwise in groups if is_fresh else groups[:1]:
            cells += [f"{figures[name]:.4g}" if figures else otherwise for name in values]
        body.append([label, *cells])
    return ResultTable(title, head, body)
