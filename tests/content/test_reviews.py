"""Approved content of reviews, recoveries and exports of constructed runs, of short runs and of tables."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np

from spheretwin import scenario as scenarios
from spheretwin.analysis import review
from spheretwin.analysis.comparison import labels
from spheretwin.analysis.tolerances import Exceeded
from spheretwin.cli.review import _first as first_exceeded
from spheretwin.models.telemetry.fault_log import FaultLog
from spheretwin.models.telemetry.status import Status
from spheretwin.models.telemetry.table import read_parquet
from spheretwin.records.provenance import facts_of, record_of
from spheretwin.viz.recording.recorder import Recorder
from spheretwin.viz.terminal import reviews as reviews_printed
from spheretwin.viz.terminal import runs, tables, texts
from spheretwin.viz.terminal.reviews import SignalTolerance
from spheretwin.viz.terminal.reviews import differences as compare
from spheretwin.viz.terminal.texts import Verdict
from tests.content.content import Cases, command, content_test, printed, scratch
from tests.content.pages import folder_text
from tests.content.recordings import recording_text
from tests.content.runs import FAULTS, made_run, session_of
from tests.content.values import array, tree
from tests.twin.analysis.runs import made_of, named
from tests.viz.terminal.test_runs import SUMMARY

RUN = {
    "path": "a.parquet", "scenario": "hold", "law": "pd", "modelling_error": 0.2, "load": 1.0,
    "hardware": "ideal", "seed": 0, "status": "completed", "reason": None, "simulated_s": 1.0,
    "max_abs_error_rad": [0.03, 0.02, 0.01], "rms_error_rad": [0.01, 0.01, 0.01],
    "tail_rms_error_rad": [0.01, 0.01, 0.01], "overshoot_rad": [None, None, None],
    "settling_time_s": [0.3, None, 0.0], "max_abs_current_A": 2.0, "saturated_fraction": 0.0096,
    "rms_torque_Nm": 0.1, "current_variation_A_s": 3.0, "copper_loss_J": 4.0, "mechanical_work_J": 0.001,
    "energy_J": 4.001,
}  # fmt: skip


@cache
def run_files() -> dict[str, Path]:
    """Telemetry and recordings of constructed runs: other law, load, rate and hardware."""
    changes = {
        "first": {},
        "other": {"controller.law": "pd", "disturbance.load": 1.5},
        "slow": {"controller.period_s": 2e-3, "seed": 7},
        "electronics": {
            "hardware": "electronics", "fault": FAULTS, "watchdog.on": True, "controller.law": "afsm_eso",
        },
    }  # fmt: skip
    files = {}
    for name, fields in changes.items():
        scenario = scenarios.load("tilt", {"plant.engine": "lagrangian", "duration": 0.4, **fields})
        run = made_run(scenario, f"run {name}")
        for suffix in ("parquet", "rrd"):
            files[f"{name}.{suffix}"] = run.save(scratch("files") / f"{name}.{suffix}")
    return files


def review_of(*names: str, options: tuple = ()) -> str:
    files = run_files()
    return command("review", *(files[name] for name in names), *options)


def reviews() -> str:
    calls = [
        (("first.parquet",), ()),
        (("electronics.rrd",), ()),
        (("first.parquet", "other.parquet", "slow.rrd", "electronics.parquet"), ()),
        (("first.parquet", "other.parquet"), ("--tolerance", "gate")),
        (("first.parquet", "first.rrd"), ("--tolerance", "gate")),
        (("first.parquet",), ("--merge", "x.rrd")),
    ]
    return "\n".join(review_of(*names, options=options) for names, options in calls)


def review_json() -> str:
    import json

    out = []
    compared = ("first.parquet", "other.parquet"), ("--tolerance", "gate")
    for names, options in ((("electronics.parquet",), ()), compared):
        text = review_of(*names, options=(*options, "--json"))
        report = json.loads(text.partition("stdout:\n")[2].partition("\n")[0])
        out += [text.partition("stdout:")[0], *tree(report)]
    return "\n".join(out)


def review_page() -> str:
    """Figures and page of a comparison; the plots of the page with their data."""
    folder = scratch("review_page")
    return folder_text(
        lambda into: review_of("first.parquet", "other.parquet", "slow.parquet", options=("--figures", into)),
        folder,
        html=True,
    )


def review_merge() -> str:
    path = scratch("merge") / "all.rrd"
    path.unlink(missing_ok=True)
    text = review_of("first.parquet", "other.parquet", options=("--merge", path))
    result = recording_text(path).splitlines()
    return "\n".join([text, *(line for line in result if not line.startswith("    "))])


def exported() -> str:
    """Tables of a run in other formats, its text, and its HTML."""
    table, metadata = read_parquet(run_files()["electronics.parquet"])
    csv = scratch("export") / "run.csv"
    text = review_of("electronics.parquet", options=("--export", csv))
    lines = csv.read_text().splitlines()
    scenario = scenarios.load("hold", {"plant.engine": "lagrangian", "duration": 0.2})
    run = made_run(scenario, "exported")
    frame = run.to_pandas()
    columns = [
        f"{signal.name} [{signal.unit}] {signal.size} {array(table[signal.name])}" for signal in table.signals
    ]
    return "\n".join(
        [
            text, lines[0], lines[1][:200], f"{len(lines)} lines", *columns, *sorted(metadata),
            repr(run), run._repr_html_().partition("<img")[0],
            *(f"{name} {array(frame[name].to_numpy())}" for name in frame.columns),
        ]
    )  # fmt: skip


def recoveries() -> str:
    """Recovery of a partial recording and of a complete file."""
    scenario = scenarios.load("hold", {"plant.engine": "lagrangian", "duration": 2.0})
    run = made_run(scenario, "cut", most_ticks=2000)
    cut = scratch("recover") / "cut.rrd"
    recorder = Recorder(run.actuator, run.telemetry.signals, facts_of(run.scenario), path=cut)
    recorder.write(run.telemetry)
    cut.with_name("partial.rrd").write_bytes(recorder.partial().path.read_bytes())
    recorder.close()
    out = scratch("recover") / "whole.parquet"
    calls = [
        command("recover", cut.with_name("partial.rrd"), "--out", cut.with_name("again.rrd")),
        command("review", cut.with_name("again.rrd")),
        command("recover", run_files()["first.parquet"], "--out", out),
        command("recover", scratch("recover") / "nowhere.rrd", "--out", out),
    ]
    return "\n".join(calls)


def simulations() -> str:
    """Short real runs: files, JSON, a failed run, a failsafe, faults and a manual mode."""
    short = ("--plant.engine", "lagrangian", "--duration", "0.2")
    faults = [
        text
        for place, fault in enumerate(FAULTS)
        for name, value in fault.items()
        for text in (f"--fault.{place}.{name.replace('_', '-')}", str(value).lower())
    ]
    folder = scratch("simulate")
    calls = [
        ("nutation", *short),
        ("tilt", *short, "--hardware", "electronics", *faults),
        ("sinusoid", *short, "--telemetry", folder / "a.parquet", "--record", folder / "a.rrd",
         "--record-rate", "50"),
        ("sinusoid", "--plant.engine", "lagrangian", "--controller.law", "pd", "--disturbance.load", "90"),
        ("hold", *short, "--hardware", "electronics", "--watchdog.on", "true",
         "--fault.0.target", "encoder.gamma", "--fault.0.mode", "dropout", "--fault.0.start-s", "0.01"),
    ]  # fmt: skip
    return "\n".join(command("simulate", *call) for call in calls)


def terminal() -> str:
    """Tables and texts of the terminal that no verb prints from constructed runs, also in colour."""
    figures = {"law_metric": 3, **SUMMARY}
    figures |= {
        "warnings": ["a [warning]"], "notes": ["a note"], "realtime_factor": 12.3456, "overshoot_rad": None,
    }  # fmt: skip

    def all_tables() -> None:
        ends = {Status.COMPLETED: None, Status.FAILSAFE: "a coil is too hot", Status.INTERRUPTED: None}
        for status, why in ends.items():
            summary = {**figures, "status": str(status)}
            runs.print_run("pd", 10.0, summary, band_rad=0.01, why=why, faults=["coil.07 open", "supply off"])
        runs.print_scenarios({"hold": "a [short] one", "nutation": "a longer one"})
        runs.print_files(Path("a b.rrd"), Path("c.parquet"))
        runs.print_written([Path("x.svg"), Path("[y].svg")])
        wide = [f"heading {place}" for place in range(14)]
        body = [[f"label {row}", *(f"{row * 10.5 + column:.2f}" for column in range(13))] for row in range(3)]
        runs.print_rows("a wide table", wide, body, 1)
        runs.print_rows("two words", ["a", "b", "c"], [["x", "some [text]", "1.5"], ["y", "z", "-2"]], 2)
        long = "a long text of many words that has no room in a cell of three lines of a narrow terminal " * 4
        runs.print_rows("a list", ["a", "b", "c"], [["x", long, "1"], ["y", "z", "2"]], 1)
        values = (0.0, 1e-4, -2e-4, 0.0123456, 1.005, 99.95, 123456.0, np.inf)
        print([tables.three_digits(value) for value in values])
        print([tables.percent(share) for share in (0.0, 1e-6, 0.1234, 1.0)], runs.angle(0.0301))
        results = [(None, "more " * 40), (True, "this " * 30), (False, "that")]
        verdicts = [Verdict(f"figure{number}", "A title", results[: number + 1]) for number in range(4)]
        texts.print_verdicts(verdicts)
        texts.print_fields(
            "fields", [texts.FieldText("--a", "1", "meaning " * 12), texts.FieldText("--b.c", "x" * 40, "m")]
        )
        texts.print_facts("facts", [("a", "1", "m", "normal", "a sheet", "why"), ("b", "", "", "", "", "")])
        texts.print_sections(["run", "controller", "plant"])

    return "\n".join([printed(all_tables), printed(all_tables, columns=50)])


def differs(row: list[str]) -> bool:
    return row[2] not in (row[1], "the same")


DIFFERING = [
    ("max_abs_current_A", 2.0, 2.0), ("max_abs_current_A", 2.0, 2.0 - 4e-7), ("max_abs_current_A", 2.0, None),
    ("copper_loss_J", 4.0, 400.0), ("saturated_fraction", 0.0096, 0.01),
    ("max_abs_error_rad", [0.03, 0.02, 0.01], [0.015, 0.02, 0.01]),
    # A percentage is of a reference that is not near zero: not smaller than the difference.
    *(("mechanical_work_J", first, value) for first, value in (
        (-0.5, -0.375), (-0.5, -0.625), (0.5, 1.0), (0.25, 0.75), (-0.25, -1.0), (0.25, -0.25), (0.0, 0.5),
    )),
]  # fmt: skip
TOLERANCES = [
    SignalTolerance("q_rad", 0.42, "β", 0.341, 0.0), SignalTolerance("error_rad", 0.0, "α", 0.0, 0.0),
    SignalTolerance("current_A", 36.6, "group 5", 0.952, 1.83),
    SignalTolerance("torque_Nm", float("inf"), "", 1.0, float("inf")),
]  # fmt: skip


def many_events() -> str:
    """Report of a run with more events than are printed, of one without numbers, differences, tolerances."""
    events = [{"t_s": 0.125 * place, "level": "WARN", "text": f"event [{place}]"} for place in range(15)]
    peak = {"frequency_Hz": 5.0, "amplitude_rad": 1e-3}
    peaks = {"α": [peak, {**peak, "frequency_Hz": 0.5}], "β": [], "γ": [{**peak, "amplitude_rad": 2e-3}]}
    some = {**RUN, "events": events, "error_peaks": peaks, "reason": "a reason", "rms_torque_Nm": None}
    few = {
        **RUN,
        "events": events[:12],
        "error_peaks": {"α": [], "β": [], "γ": []},
        "overshoot_rad": [0.1, None, 1e-9],
    }
    errors = [reviews_printed.NominalError("nominal.x", "1", "2")]
    reports = [
        printed(lambda run=run: reviews_printed.print_run_report(run, errors, 0.01)) for run in (some, few)
    ]
    differing = [
        f"{key} {first} {value}: "
        f"{[row for row in compare([{**RUN, key: first}, {**RUN, key: value}], 0.01) if differs(row)]}"
        for key, first, value in DIFFERING
    ]
    tolerances = printed(lambda: reviews_printed.print_tolerances("a.rrd", "b.rrd", TOLERANCES))
    places = [Exceeded("b.parquet", name, axis, 0.5, 0.125) for name, axis in (
        ("q_rad", "β"), ("torque_Nm", ""), ("current_A", "group 5"),
    )]  # fmt: skip
    first = [first_exceeded(places[begin:end], TOLERANCES) for begin, end in ((0, 1), (0, 2), (0, 3), (1, 2))]
    return "\n".join([*reports, *differing, tolerances, *first])


def fault_texts() -> str:
    """Texts of faults of a constructed run."""
    table, _ = read_parquet(run_files()["electronics.parquet"])
    log = FaultLog()
    log.write(table)
    return "\n".join(f"{fault.text()} | {fault!r}" for fault in log.faults)


BASE = {
    "name": "tilt", "hardware": "ideal", "plant": {"modelling_error": 0.2, "payload_kg": 0.05},
    "disturbance": {"load": 0.0}, "controller": {"law": "pd", "stiffness": [1.0, 2.0]},
    "sensors": {"adc": {"bits": 16}},
}  # fmt: skip
FAULT_PAIR = [{"target": "coil.07", "mode": "open", "start_s": 1.0}, {"target": "group.3", "mode": "stuck"}]
OWN = {"name": "x", "description": "a", "duration": 1.0, "trajectory": {"shape": "hold"}}
ANOTHER = {"name": "x", "description": "b", "duration": 2.0, "trajectory": {"shape": "sine"}}


def but(**sections: object) -> dict:
    """Return the base with other entries of some sections."""
    changed = {name: {**BASE[name], **inside} if isinstance(inside, dict) else inside
               for name, inside in sections.items()}  # fmt: skip
    return {**BASE, **changed}


PAIRS = [
    (BASE, BASE), (BASE, but(plant={"modelling_error": 0.0, "payload_kg": 0.1}, disturbance={"load": 2.0})),
    (BASE, but(controller={"stiffness": [3.0, 2.0]})), (BASE, but(controller={"law": "pid", "kp": 1.0})),
    (BASE, but(hardware="electronics", sensors={"adc": {"bits": 12}})), (BASE, {**BASE, "watch": 1}),
    ({"fault": FAULT_PAIR}, {"fault": []}), (OWN, {**ANOTHER, "name": "y"}), (OWN, ANOTHER),
    tuple({"plant": {"modelling_error": m, "modelling_torque_Nm": m}} for m in (0.0, 0.2)),
    (BASE, but(disturbance={"load": 2.0}, hardware="electronics")), ({"name": "a"}, {"name": "b"}),
    *(({"x": value}, {"x": "other"}) for value in (0.100000001, 1e-7, 3.0, True, None, "pd", [], [1, 2])),
]  # fmt: skip
FIGURES_OF_RUNS = [
    {"path": "a", "x": 1.5, "each": [1.0, None, 3.0], "law": "pd", "seed": 1, "whole": True, "y": None},
    {"path": "b", "x": 4.0, "each": [0.5, 2.0, 3.0], "law": "pid", "seed": 2, "whole": False, "y": 2},
]  # fmt: skip
LISTS = [{"path": "a", "e": None}, {"path": "b", "e": [1.0]}]
NOMINAL = [
    {"plant.modelling_error": 0.2},
    {"plant.modelling_error": 0.2, "drive.delay_s": 0.001, "nominal.equals_truth": True},
    {"plant.modelling_error": 0.0, "plant.coulomb_Nm": (0.002, 0.002, 0.003), "nominal.torque_scale": 1.1,
     "drive.delay_s": 0.001},
]  # fmt: skip


def differences() -> str:
    """Fields and figures in which runs differ, conditions on which they agree, labels and nominal errors."""
    lines = [f"{review.scenario_differences(pair)} | {review.common_conditions(pair)}" for pair in PAIRS]
    lines += [
        str(review.common_conditions([BASE])),
        f"{review.differences(FIGURES_OF_RUNS)} {review.differences(LISTS)}",
    ]
    runs_of_laws = []
    for name, law in {"pd": "pd", "first": "./laws/mine.py:Mine", "second": "/a/new/mine.py:Mine"}.items():
        run = named(made_of([[0.0, 0.0]]), f"/b/{name}.parquet")
        record = replace(run.record, scenario=but(controller={"law": law}))
        runs_of_laws.append(replace(run, record=record))
    lines += [f"{labels(runs_of_laws)} {labels(runs_of_laws[:2])}"]
    for changes in NOMINAL:
        with session_of("sinusoid", **changes) as session:
            run = replace(made_of([[0.0, 0.0]]), record=record_of(session))
        lines += [str(review.nominal_errors(run))]
    return "\n".join(lines)


CASES: Cases = {
    "review_differences": differences, "review_terminal": reviews, "review_json": review_json,
    "review_page": review_page, "review_merge": review_merge, "review_recover": recoveries,
    "review_exported": exported, "review_faults": fault_texts, "review_simulate": simulations,
    "terminal_tables": terminal, "terminal_many_events": many_events,
}  # fmt: skip


test_content = content_test(CASES)
