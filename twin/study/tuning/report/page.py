"""What a tuning found as one page: Markdown, HTML of the same content, and the figures."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from spheretwin.twin.study.study import Study
from spheretwin.twin.study.tuning.gains import section_of
from spheretwin.twin.study.tuning.report.telling import best, told
from spheretwin.twin.study.tuning.running import Found
from spheretwin.twin.study.tuning.section import Gain, Optimise
from spheretwin.viz.figures.drawing import Drawing
from spheretwin.viz.page import html
from spheretwin.viz.page import markdown as pieces
from spheretwin.viz.page.folder import save_drawings, save_text

MARKDOWN, HTML, GAINS = "tuning.md", "tuning.html", "gains.json"

HOW = {
    "tpe": "proposed by a tree-structured Parzen estimator",
    "nsga2": "proposed by NSGA-II",
    "random": "drawn at random",
    "local": "points of a Sobol sequence, then perturbations of the best within each limit",
}
ALIGNED = [False, False, True, True, False, False]
"""Whether the columns of the ranges are numbers."""


def write(folder: Path, study: Study, found: Found, command: str, versions: Mapping[str, str]) -> list[Path]:
    """Write the page, and its figures where matplotlib is, into a folder; returns both forms of the page.

    Parameters
    ----------
    folder : Path
        Exists.
    study : Study
    found : Found
    command : str
        What makes the page again.
    versions : mapping
        Version by package, for the foot.

    Raises
    ------
    SpheretwinError
        A file cannot be written there.
    """
    drawn: list[Drawing] = []
    if find_spec("matplotlib") is not None:
        from spheretwin.twin.study.tuning.report import drawing  # slow to import

        drawn = drawing.drawings(study.name, found, section_of(study).objective)
        save_drawings(folder, drawn)
    text = markdown(study, found, drawn, command, versions)
    gains = json.dumps(best(found, section_of(study).objective), indent=1, ensure_ascii=False)
    return [
        save_text(folder / MARKDOWN, text),
        save_text(folder / HTML, html.page(study.name, text)),
        save_text(folder / GAINS, f"{gains}\n"),
    ]


def markdown(
    study: Study, found: Found, drawn: Sequence[Drawing], command: str, versions: Mapping[str, str]
) -> str:
    """Text of the page."""
    optimise = section_of(study)
    whole = told(found, optimise.objective)
    used = ", ".join(f"{name} {version}" for name, version in versions.items())
    lines = [f"# {study.name}", "", study.description, "", *_what(study), ""]
    lines += [pieces.figure(each) for each in drawn]
    for law, of_law in whole["laws"].items():
        lines += [f"## {law}", "", _counted(of_law), "", *_chosen(of_law), ""]
    lines += [f"Made by `{command}` with {used}.", ""]
    return "\n".join(lines)


def _what(study: Study) -> list[str]:
    """What was looked for, and how."""
    optimise = section_of(study)
    ranges = [
        [each.called, each.law or "all", *_range(each), _sets(each.settings), each.reason]
        for each in optimise.gain
    ]
    objectives = " and ".join(f"*{each.called}*, to {each.direction}" for each in optimise.objective)
    fresh = (
        f" *Fresh* are {optimise.fresh} further seeds, which no trial was chosen by."
        if optimise.fresh
        else ""
    )
    return [
        f"Objectives: {objectives}, over {study.seeds} seeds of each point."
        f" Trials are {HOW[optimise.sampler]}, {optimise.together} at a time."
        + (" One that can no longer be among the best is pruned." if optimise.prune else "")
        + _limits(optimise)
        + fresh,
        "",
        *pieces.table(["gain", "law", "from", "to", "sets", "why"], ranges, ALIGNED),
    ]


def _limits(optimise: Optimise) -> str:
    if not optimise.limits:
        return ""
    listed = ", ".join(f"{limit:g}" for limit in optimise.limits)
    return f" The best trial within each limit on *{optimise.objective[1].called}* is chosen: {listed}."


def _range(gain: Gain) -> list[str]:
    return [f"{gain.low:g}", f"{gain.high:g}{', or off' if gain.optional else ''}"]


def _sets(settings: Sequence[Any]) -> str:
    return ", ".join(
        f"{each.field}"
        + (f" · {each.factor:g}" if each.factor != 1 else "")
        + (f" (power {each.power:g})" if each.power != 1 else "")
        for each in settings
    )


def _counted(of_law: Mapping[str, Any]) -> str:
    ended = ", ".join(f"{count} {how}" for how, count in of_law["ended"].items() if count)
    lost = f" The first that lost: {of_law['lost']}." if of_law["lost"] else ""
    return f"Trials: {ended or 'none'}; {of_law['rows']} rows were run.{lost}"


def _chosen(of_law: Mapping[str, Any]) -> list[str]:
    """The start, and the best or the front: gains, fields, objectives."""
    labelled = [("start", of_law["start"])] if of_law["start"] else []
    labelled += [(str(each["trial"]), each) for each in of_law["best"]]
    values = next((list(each["values"]) for _, each in labelled if each["values"]), None)
    if values is None:
        return ["No trial completed."]
    columns = dict.fromkeys(
        [*labelled[0][1]["gains"], *(field for _, each in labelled for field in each["fields"])]
    )
    is_fresh = any(each["fresh"] or each["fresh_reason"] for _, each in labelled)
    head = ["trial", *columns, *values, *(f"{each}, fresh" for each in values if is_fresh)]
    body = []
    for label, each in labelled:
        numbers = {**each["gains"], **each["fields"]}
        values_of = map(numbers.get, columns)
        cells = ["off" if value is None else f"{value:.4g}" for value in values_of]
        for told_of in [each["values"], *([each["fresh"]] if is_fresh else [])]:
            cells += [f"{told_of[name]:.4g}" if told_of else "lost" for name in values]
        body.append([label, *cells])
    return pieces.table(head, body, [False, *(True for _ in head[1:])])
