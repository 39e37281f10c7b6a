"""Approved content of pages of studies, tunings, cross-check and magnetics, of constructed results."""

import shutil
from functools import partial
from pathlib import Path
from unittest.mock import patch

import numpy as np

from spheretwin.cli import crosscheck as crosscheck_verb
from spheretwin.crosscheck import suite
from spheretwin.models.actuator import TORQUE_CURVE_PATH
from spheretwin.models.design import curve_check, field_check, torque_map
from spheretwin.study import report, statistics
from spheretwin.study.statistics import StudyTable
from spheretwin.study.tuning import report as tuning_report
from spheretwin.study.tuning.trials import Ended, FinishedTrial, Tried
from spheretwin.study.tuning.tuning import Holdout, LawResult, ReportedTrial, TuningResult
from spheretwin.viz.pages import magnetics, markdown
from tests.content.content import Cases, command, content_test, scratch
from tests.content.figures import captured
from tests.content.pages import folder_text, html_text
from tests.content.values import tree
from tests.content.verdicts import (
    computed_curve,
    evidence,
    field_verdict,
    judged_curve,
    survey,
    workspace_verdict,
)
from tests.twin.study.test_report import made
from tests.twin.study.tuning.cases import TWO
from tests.twin.study.tuning.cases import study as tuning_study

COUNT = np.arange(48.0)


def rows_of(axes: dict, count: int = 48, laws=("pd", "afsm"), lost=(3, 8, 13, 40)) -> StudyTable:
    """Rows with three figures; some are lost, of three kinds, and one figure has gaps."""
    figures = {
        "max_abs_error_rad": 1e-3 * (5 + (7 * COUNT[:count]) % 31),
        "settling_time_s": np.where(COUNT[:count] % 9 == 4, np.nan, 0.01 * (COUNT[:count] % 17)),
        "copper_loss_J": 2.5 + COUNT[:count] ** 2,
    }
    rows = made(count, figures, {name: values[:count] for name, values in axes.items()}, laws, lost)
    rows.statuses[list(lost[2:])] = "failsafe"
    rows.complaints[list(lost[1:3])] = "no fresh | measurement"
    rows.study["axis"] = [{"field": field, "kind": "normal"} for field in axes]
    return rows


MANY_AXES = {
    "disturbance.load": (5 * COUNT) % 47, "plant.modelling_error": (11 * COUNT) % 43,
    "seed": (3 * COUNT) % 41,
}  # fmt: skip
STUDIES = {
    "one_axis": rows_of({"disturbance.load": COUNT % 4}),
    "one_axis_of_names": rows_of({"plant.engine": np.array(["mujoco", "lagrangian"] * 24, dtype=object)}),
    "two_axes": rows_of({"disturbance.load": COUNT % 4, "plant.modelling_error": (COUNT // 4) % 3 / 10}),
    "many_axes": rows_of(MANY_AXES),
    "few_rows": rows_of({"disturbance.load": COUNT % 4}, count=5, laws=("pd",), lost=(1,)),
    "seeds_only": rows_of({}, count=12, laws=("pd",), lost=()),
}


def study_page(name: str) -> str:
    rows = STUDIES[name]
    summary = statistics.summary(rows)
    requested = (60, 100) if name == "many_axes" else (len(rows.laws), len(rows.laws))
    return folder_text(
        lambda folder: report.write(folder, rows, summary, requested, f"{name}.toml"),
        scratch(f"study_{name}"),
    )


def _trials(shift: float, count: int) -> list[FinishedTrial]:
    ends = [Ended.COMPLETED, Ended.COMPLETED, Ended.PRUNED, Ended.LOST, Ended.COMPLETED]
    return [
        FinishedTrial(
            number,
            {"controller.stiffness": 100.0 + 7 * number + shift, "controller.damping": 20.0 - number},
            Tried(
                ends[number % 5],
                "left_workspace" if ends[number % 5] == Ended.LOST else "",
                [5.0 - 0.3 * number + shift, 1.0 + 0.25 * number],
                [[1.0, 2.0]] * 3,
            ),
        )
        for number in range(count)
    ]


def _reported(trial: FinishedTrial, holdout: Holdout | None) -> ReportedTrial:
    return ReportedTrial(
        trial, dict(trial.chosen), holdout, f"spheretwin simulate hold --seed {trial.number}"
    )


def tuning_result() -> TuningResult:
    """Two laws: one with a start and a front, one of which nothing completed."""
    trials, other = _trials(0.5, 11), [trial for trial in _trials(2.0, 10) if trial.number % 5 in (2, 3)]
    best = [
        _reported(trials[1], Holdout("", [4.5, 1.5])),
        _reported(trials[5], Holdout("failsafe", [])),
        _reported(trials[10], None),
    ]
    laws = [LawResult("pd", trials, _reported(trials[0], None), best), LawResult("pid", other, None, [])]
    return TuningResult(laws, 15, 30, 4, 1.5, Path("trials.parquet"))


def tuning_page() -> str:
    study = tuning_study(scratch("tuning_study"), **TWO, fresh=2, sampler="nsga2")
    result = tuning_result()
    text = folder_text(
        lambda folder: tuning_report.write(folder, study, result, "spheretwin sweep known --optimise"),
        scratch("tuning"),
    )
    summary = tree(tuning_report.summary(result, study.optimise.objective))
    return "\n".join([text, "=== summary", *summary])


def crosscheck_page() -> str:
    result = evidence()
    with patch.object(crosscheck_verb.suite, "run", lambda *_: result):
        outputs = [command("crosscheck", *more) for more in ((), ("--verbose",), ("--json",))]
    return "\n".join(
        [folder_text(lambda folder: suite.write(folder, result), scratch("crosscheck")), *outputs]
    )


def magnetics_pages() -> str:
    def write(folder: Path) -> None:
        magnetics.write_check(folder, field_verdict(), "spheretwin magnetics check --poses 15", "svg")
        magnetics.write_map(folder, survey(), workspace_verdict(), "spheretwin magnetics map", "svg")

    written, csv = scratch("magnetics_curve") / "curve.csv", scratch("magnetics_curve") / "bench.csv"
    shutil.copy(TORQUE_CURVE_PATH, csv)
    with (
        patch.object(field_check, "judge", lambda *_: field_verdict()),
        patch.multiple(torque_map, survey=lambda *_: survey(), judge=lambda *_: workspace_verdict()),
        patch.multiple(curve_check, judge=lambda *_: judged_curve(), compute=lambda *_: computed_curve()),
    ):
        parts = [
            ("check",), ("check", "--json"), ("map", "--need", "2"), ("map", "--json"), ("curve", "--json"),
            ("curve",), ("curve", "--out", written), ("curve", "--csv", csv),
            ("curve", "--csv", csv, "--json"),
        ]  # fmt: skip
        outputs = [command("magnetics", *part) for part in parts]
        assert written.read_text() == computed_curve().csv
    return "\n".join([folder_text(write, scratch("magnetics")), *outputs])


def html_page() -> str:
    """One page in HTML: headings, anchors, tables, lists, code, a figure and escaped tags."""
    text = "\n".join(
        [
            "# A title & more", "", "In *words*, **strong**, `code` and <b>no tag</b>.", "",
            *markdown.contents(["## First part", "### Inner", "## Second part"]), "",
            "## First part", "",
            *markdown.ResultTable("", ["a", "b | c"], [["1", "x|y"], ["2", "–"]], 0, ["b | c"]).lines(), "",
            "### Inner", "", "- one", "- two", "",
            "## Second part", "", "```sh", "spheretwin simulate", "```", "",
            *markdown.foot("spheretwin x"),
        ]
    )  # fmt: skip
    return html_text(markdown.page("A title", text))


def formats() -> str:
    """One figure in every format: the SVG before its width is that of a paper."""
    from spheretwin.viz.figures import faults

    out = []
    for kind in ("svg", "png", "pdf", "pdf-one-column", "pdf-two-columns"):
        figure = faults.shares({"a": {1: 0.5, 3: 1.0}, "b": {2: 0.25}}, "x of the figure", "y", "A title")
        drawing = markdown.Drawing("one.svg", "What it shows.", figure)
        with captured() as texts:
            markdown.save_drawings(scratch("formats"), [drawing], kind)
        out += [f"--- {kind}", *(line for name, text in texts.items() for line in (name, text))]
    return "\n".join(out)


CASES: Cases = {
    "page_formats": formats, **{f"study_{name}": partial(study_page, name) for name in STUDIES},
    "tuning_page": tuning_page, "crosscheck_page": crosscheck_page, "magnetics_pages": magnetics_pages,
    "html_page": html_page,
}  # fmt: skip


test_content = content_test(CASES)
