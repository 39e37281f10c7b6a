"""Content of studies: rows of each grid, table, journal and page of a study, trials and page of a tuning."""

import json

import pyarrow.parquet as parquet

from spheretwin.study import report, statistics
from spheretwin.study import study as studies
from spheretwin.study.grid import Grid
from spheretwin.study.row import Rows
from spheretwin.study.runner import run
from spheretwin.study.tuning import report as tuning_page
from spheretwin.study.tuning.gains import section_of
from spheretwin.study.tuning.sampler import warnings_only
from spheretwin.study.tuning.tuning import tune
from tests.content.content import content_test, refusal, scratch
from tests.content.values import lines
from tests.twin.study.cases import LOADS, SHORT, study, values
from tests.twin.study.tuning import cases as tuning


def rows_of_shipped_studies():
    """Size of each shipped study, and its first, second, middle and last row, complete."""
    content = {}
    for name in studies.shipped():
        chosen = studies.load(name)
        grid, rows = Grid(chosen), Rows(chosen)
        places = sorted({0, 1, len(grid) // 2, len(grid) - 1})
        content[name] = {
            "rows": len(grid),
            "laws": grid.laws,
            "listed": {axis.field: grid.values(axis.field) for axis in chosen.axis},
            "rows of the last law": [row.number for row in grid.of_law(grid.laws - 1, 4)],
            **{
                f"row {place}": {
                    **row_facts(grid[place]),
                    "key": grid[place].key if not chosen.drawn_axes else "drawn",
                    "seed": grid[place].seed if chosen.common_seeds or not chosen.drawn_axes else "drawn",
                    "command": rows.command(grid[place]),
                }
                for place in places
            },
        }
    return lines(content)


AXES = [
    {"field": "disturbance.load", "kind": "linspace", "first": -1.0, "last": 2.0, "count": 4},
    {"field": "plant.payload_kg", "kind": "logspace", "first": 0.001, "last": 0.1, "count": 3},
    {"field": "drive.current_limit_A", "kind": "values", "values": [8.0, 4.0], "zip": "a"},
    {"field": "drive.time_constant_s", "kind": "values", "values": [0.001, 0.0], "zip": "a"},
    {"field": "plant.modelling_error", "kind": "uniform", "low": -0.1, "high": 0.4},
    {"field": "disturbance.random_bound_Nm", "kind": "normal", "mean": 0.02, "deviation": 0.001},
    {"field": "plant.viscous_Nm_s", "kind": "normal", "mean": 3.0, "deviation": 1.0, "most_deviations": 0.5},
]
LAWS = [{"law": "pd"}, {"law": "pid", "integral": [1.0, 2.0, 3.0]}]


def row_facts(row):
    return {
        "number": row.number, "seed": row.seed, "values": dict(row.values), "law": dict(row.law or {}),
        "repeat": row.repeat,
    }  # fmt: skip


def rows_of_a_grid():
    """Some rows of axes of every kind. Keys are digests of drawn values, whose last bits vary by machine."""
    content = {}
    for design in ("random", "latin_hypercube", "sobol"):
        grid = Grid(study(*AXES, samples=5, seeds=2, law=LAWS, design=design, common_seeds=True, seed=7))
        content[design] = {f"of {len(grid)}": [row_facts(grid[place]) for place in (0, 1, 2, 23, 477, 479)]}
    listed = Grid(study(*AXES[:4], seeds=2, law=LAWS))
    content["listed"] = [{"key": row.key, **row_facts(row)} for row in (listed[0], listed[50], listed[95])]
    return lines(content)


def table_of_a_study():
    """Rows of 20 ticks, some refused, and journal and metadata of their table."""
    folder = scratch("study_table")
    axes, laws = (LOADS[0], values("plant.payload_kg", 0.0, -1.0)), [{"law": "pd"}, {"law": "afsm"}]
    run(study(*axes, seeds=2, law=laws), folder, threads=1)
    table = parquet.read_table(folder / "table.parquet")
    metadata = {
        key.decode(): json.loads(value)
        for key, value in table.schema.metadata.items()
        if key in (b"study", b"scenario")
    }
    rows = statistics.read(folder / "table.parquet")
    facts = {
        "columns": {field.name: str(field.type) for field in table.schema},
        "rows": [dict(row.items()) for row in table.to_pylist()], "failures": rows.failures.tolist(),
        "complaints": rows.complaints.tolist(), "laws": rows.laws.tolist(), "main": rows.main,
        "summary": statistics.summary(rows), "metadata": metadata,
    }  # fmt: skip
    markdown, _ = report.write(folder, rows, statistics.summary(rows), (len(table), 30), "my study.toml")
    return lines(facts) + "\n" + markdown.read_text(encoding="utf-8")


def trials_of_a_tuning():
    """Trials, best gains and page of a tuning with two objectives, limits and further seeds."""
    folder = scratch("trials")
    chosen = tuning.study(folder, **tuning.TWO, fresh=2, trials=12, together=4)
    with warnings_only():
        outcome = tune(chosen, folder / "out", threads=1)
    section = section_of(chosen)
    tuning_page.write(folder / "out", chosen, outcome, "spheretwin sweep known --optimise")
    printed = tuning_page.summary(outcome, section.objective)
    del printed["wall_s"]
    table = parquet.read_table(outcome.table)
    columns = {field.name: str(field.type) for field in table.schema}
    page, gains = (
        (folder / "out" / name).read_text(encoding="utf-8") for name in ("tuning.md", "gains.json")
    )
    trials = lines({"columns": columns, "trials": table.to_pylist()})
    return "\n".join([lines(printed), trials, page, lines(json.loads(gains))])


def trials_of_each_sampler():
    """Trials of each method, one objective, with an optional gain, a factor and a power."""
    content = []
    samplers = {
        "tpe": {"trials": 12}, "nsga2": {"trials": 12}, "random": {"trials": 4, "prune": False},
        "local": {"draws": 4, "perturbations": 2},
    }  # fmt: skip
    both = {
        "name": "both", "low": 1.0, "high": 4.0, "optional": True,
        "sets": [{"field": "controller.damping", "factor": 2.0, "power": 0.5}], "start": 2.0,
    }  # fmt: skip
    objectives, gains = ("miss", {"metric": "slowness", "over": "median"}), (tuning.gain(start=100.0), both)
    for sampler, more in samplers.items():
        folder = scratch(f"trials_{sampler}")
        chosen = tuning.study(folder, objectives, gains, seeds=2, together=2, sampler=sampler, **more)
        outcome = tune(chosen, folder / "out", threads=1)
        table = parquet.read_table(outcome.table).to_pylist()
        content.append(f"{sampler}\n{lines(table)}")
    return "\n".join(content)


LOAD, PD = "disturbance.load", [{"law": "pd"}]


def of_load(kind, **fields):
    return [{"field": LOAD, "kind": kind, **fields}]


REFUSED_AXES = [
    of_load("gauss"), of_load("linspace", first=0, last=1, count=10**9), [values(LOAD, 1.0, 1)],
    of_load("linspace", first=1, last=1, count=2), [values(LOAD, 1.0, zip="a")], [values(LOAD, "1.0", "2")],
    [values(LOAD, 1.0, 2.0, zip="a"), values("plant.modelling_error", 0.1, zip="a")],
    [values("disturbance.laod", 1.0)], [values("plant.modelling_error.3", 1.0)],
    [values("plant.payload_kg", -1.0, -2.0)],
]  # fmt: skip
REFUSED_STUDIES = [
    {"axis": of_load("normal", mean=0, deviation=0), "samples": 3},
    {"axis": of_load("uniform", low=0, high=1, zip="a"), "samples": 3},
    {"axis": [LOADS[0]], "fields": {LOAD: 1.0}}, {"fields": {"seed": 1}}, {"fields": {"": 1}},
    {"law": PD, "fields": {"controller.stiffness": [1.0]}}, {"law": [{"law": "pdd"}]},
    {"law": [{"law": "pd", "wobble": 1.0}]}, {"law": [*PD, {"law": "afsm", "wobble": 1.0}]},
    {"law": [{"law": "nothing.py:step"}]}, {"metrics": ["rms_error_rad"] * 2},
    {"metrics": ["a.py:one", "b.py:one"]}, {"metrics": ["nothing.py:one"]}, {"metrics": ["mine.py:key"]},
    {"telemetry": [1]}, {"scenario": "sinsoid"},
]  # fmt: skip
STUDY_FILES = [
    "name = ", "", 'name = "a"\nscenario = "sinusoid"\naxis = 3\n',
    'name = "a"\nscenario = "nothing.toml"\n', "a" * 10 + "[" * 2000,
]  # fmt: skip
STIFFNESS, DAMPING = "controller.stiffness", "controller.damping"
REFUSED_TUNINGS = [
    {"gains": (tuning.gain(step=1.0),)}, {"gains": (tuning.gain(low=float("nan")),)}, {"draws": 20},
    {"objectives": [{"metric": "exact", "direction": "down"}]}, {"objectives": ["exact", "exact"]},
    {"sampler": "local", "trials": 20},
]  # fmt: skip
CHANGED_TUNINGS = [
    {"optimise": None}, {"fields": {"controller.law": "pd", STIFFNESS: 5.0}},
    {"axis": [values(DAMPING, 1.0, 2.0)]}, {"fields": {}, "law": [{"law": "pd", "damping": 9.0}]},
    *({"optimise": {"gain": gains}} for gains in (
        [tuning.gain("stifness")], [tuning.gain(), tuning.gain("damping", law="pdd")],
        [tuning.gain(law="afsm")],
        [tuning.gain(), tuning.gain()], [tuning.gain(start=50.0), tuning.gain("damping")],
        [tuning.gain(low=1e12, high=1e13)],
    )),
    {"optimise": {"objective": [{"metric": "rms_error"}]}},
]  # fmt: skip


def messages_before_the_first_row():
    """Messages about studies and tunings that cannot be run; no file is written."""
    folder = scratch("refused_studies")
    (folder / "mine.py").write_text("def key(run): return 1\n")
    base = tuning.study(folder, **tuning.TWO)
    dumped, section = base.model_dump(mode="json"), base.optimise.model_dump(mode="json")

    def change(fields):
        own = fields.get("optimise", {})
        return {**dumped, **fields, "optimise": own if own is None else {**section, **own}}

    def swept(fields):
        given = {"name": "a", "scenario": "sinusoid", "fields": SHORT, "folder": str(folder)}
        run(studies.made({**given, **fields}, "a"), folder / "swept")

    def swept_file(text):
        (path := folder / "study.toml").write_text(text)
        run(str(path), folder / "swept")

    calls = {
        swept: [*({"axis": axes} for axes in REFUSED_AXES), *REFUSED_STUDIES], swept_file: STUDY_FILES,
        lambda given: tune(tuning.study(folder, **given), folder / "tuned"): REFUSED_TUNINGS,
        lambda given: tune(studies.made(change(given), "known"), folder / "tuned"): CHANGED_TUNINGS,
    }  # fmt: skip
    lines = [
        f"{str(given)[:300]}: {refusal(call, given)}" for call, inputs in calls.items() for given in inputs
    ]
    return "\n".join([*lines, f"files: {sorted(path.name for path in folder.rglob('*'))}"])


CASES = {
    "study_refusals": messages_before_the_first_row,
    "study_tuning": trials_of_a_tuning,
    "study_samplers": trials_of_each_sampler,
    "study_shipped_rows": rows_of_shipped_studies,
    "study_grid_rows": rows_of_a_grid,
    "study_table": table_of_a_study,
}


test_content = content_test(CASES)
