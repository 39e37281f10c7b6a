"""Content of what the verbs print: help, tables, JSON, pages, and messages about what is refused."""

import argparse
import functools
import json
import re
from pathlib import Path
from unittest.mock import patch

import numpy as np

from spheretwin import cli, machine
from spheretwin.cli import reproduce
from spheretwin.paper.experiment import Case, Statement
from spheretwin.study.grid import Grid
from spheretwin.study.optimise import Objective
from spheretwin.study.study import load
from spheretwin.study.tuning import report
from tests.content.content import command, content_test, scratch
from tests.content.values import tree
from tests.twin.paper.cases import LOST, experiment
from tests.twin.study.tuning.cases import FIGURES, STUDY

TIMES = re.compile(
    r'(?<="wall_s": )[^,}]+|(?<="startup_s": )[^,}]+|(?<="realtime_factor": )[^,}]+|(?<= simulated in ).*'
    r"|(?<= object at )0x[0-9a-f]+"
)
VERSIONS = re.compile(r'(?<="versions": )\{[^}]*\}')


def stated(*arguments):
    """What a call prints, without the times that it took; JSON as lines."""
    text = command(*arguments)
    text = VERSIONS.sub('"VERSIONS"', TIMES.sub("0", text))
    head, marker, rest = text.partition("stdout:\n{")
    if not marker:
        return text
    line, _, more = rest.partition("\n")
    return "\n".join([head, *tree(json.loads("{" + line)), more])


def several(calls):
    return "\n\n".join(stated(*call.split()) if isinstance(call, str) else stated(*call) for call in calls)


PARTS = [
    "magnetics curve",
    "magnetics field",
    "magnetics check",
    "magnetics map",
    "log check",
    "export fmu",
    "export c",
]

HELP = [
    "--help", *(f"{verb} --help" for verb in cli.VERBS), *(f"{part} --help" for part in PARTS),
    "simulate tilt --help run",
    "simulate hold --help controller.governor", "bench --help watchdog", "simulate hold --help fault",
    "simulate --help trajectory --controller.law pid", "simulate hold --help controler",
]  # fmt: skip

EXPLAIN = [
    "explain hardware prototype --json", "explain hardware electronics", "explain hardware x",
    "explain scenario nutation", "explain scenario tilt --all --json", "explain plant.coulomb_Nm",
    "explain drive --json", "explain plant.coulomb", "explain hardware ideal x", "explain trajectory",
    "explain scenario x", "simulate",
]  # fmt: skip


FAULTS = '[{"target": "coil.07", "mode": "open", "start_s": 0.02, "detection": true}]'


@functools.cache
def recorded():
    """Folder with three short runs, one of which ended early, and a user metric."""
    folder = scratch("commands")
    (folder / "own.py").write_text(
        "def highest(run):\n    return run.telemetry['error_rad'].max(axis=0)\n"
        "def broken(run):\n    return 1 / 0\ndef strange(run):\n    return object()\n"
    )
    calls = {
        "a": "nutation --duration 0.06 --plant.engine lagrangian",
        "b": "nutation --duration 0.06 --plant.engine lagrangian --controller.law pd --seed 4"
        " --event.0.t_s 0.03 --event.0.set disturbance.load --event.0.value 1.5",
        "c": "sinusoid --duration 2 --plant.engine lagrangian --controller.law pd --disturbance.load 900",
    }
    for name, call in calls.items():
        command("simulate", *call.split(), "--telemetry", folder / f"{name}.parquet")
    return folder


def runs():
    """Tables and JSON of runs, of a complete one, one with faults, and one that leaves the workspace."""
    folder = recorded()
    lagrangian, own = "--plant.engine lagrangian", f"--metric {folder}/own.py:"
    hold = "simulate hold --controller.law pid --duration 0.02"
    return several(
        [
            f"simulate nutation --duration 0.05 --json {lagrangian}",
            f"simulate nutation --duration 0.05 {lagrangian}",
            [
                "simulate", "nutation", "--duration", "0.05", "--plant.engine", "lagrangian", "--fault",
                FAULTS, "--json",
            ],
            f"simulate sinusoid --controller.law pd --disturbance.load 900 --json {lagrangian}",
            f"simulate sinusoid --controller.law pd --disturbance.load 900 {lagrangian}",
            f"{hold} --json {lagrangian} {own}highest {own}broken",
            f"{hold} {lagrangian} {own}strange {own}highest",
            f"{hold} --json {lagrangian} {own}highest {own}highest",
            f"simulate --replay {folder}/b.parquet --json",
            f"simulate --replay {folder}/c.parquet",
            f"simulate --replay {folder}/b.parquet --seed 3",
        ]
    )  # fmt: skip


def reviews():
    folder = recorded()
    a, b, c = (f"{folder}/{name}.parquet" for name in "abc")
    (folder / "narrow.toml").write_text(
        "[signals.q_rad]\nabsolute = 1e-9\n[signals.current_A]\nabsolute = 0.5\ntime_s = 0.002\n"
    )
    text = several(
        [
            f"review {a}", f"review {a} --json", f"review {a} {b}", f"review {a} {b} {c} --json",
            f"review {a} {b} --tolerance {folder}/narrow.toml",
            f"review {a} {b} --tolerance {folder}/narrow.toml --json",
            f"review {a} {a} --tolerance {folder}/narrow.toml", f"review {c}",
            f"review {a} --export {folder}/a.csv", f"review {a} {b} --figures {folder}/figures",
            f"review {a} {b} --merge {folder}/{{}}.rrd".format("merged"),
            f"recover {a} --out {folder}/again.parquet",
        ]
    )  # fmt: skip
    (folder / "merged.rrd").unlink()
    page = re.sub(
        r"(?s)<(script|style)\b.*?</\1>", "", (folder / "figures" / "review.html").read_text(encoding="utf-8")
    )
    words = re.sub(r"\s*\n\s*", "\n", re.sub(r"<[^>]+>", "\n", re.sub(r"(?s)<svg.*?</svg>", "", page)))
    csv = (folder / "a.csv").read_text().splitlines()
    return "\n".join([text, *csv[:3], *csv[-2:], f"{len(csv)} lines", words])


def logs():
    """Exported files of a run, and verdicts on its log and on a log with wrong units and a gap."""
    folder, call = recorded(), "simulate nutation --duration 1 --plant.engine lagrangian"
    text = several(
        [
            f"{call} --export-log {folder}/log.parquet --export-truth {folder}/truth.json",
            f"log check {folder}/log.parquet --scenario nutation",
            f"log check {folder}/log.parquet --json",
        ]
    )
    log = machine.read(folder / "log.parquet")
    rows = np.delete(np.arange(len(log)), np.s_[300:400])
    wrong = machine.Log(log.t_s[rows], 1e3 * log.current_A[rows], log.angle_rad[rows][:, [1, 0, 2]])
    machine.write(wrong, folder / "wrong.csv")
    return "\n\n".join([text, stated("log", "check", f"{folder}/wrong.csv", "--accept", "current-unit")])


def sweeps():
    folder = recorded()
    (folder / "mine.toml").write_text(
        'name = "mine"\nscenario = "hold"\n[fields]\nduration = 0.01\n"plant.engine" = "lagrangian"\n'
        '[[axis]]\nfield = "disturbance.load"\nkind = "values"\nvalues = [0.0, 1.0, 2000.0]\n'
        '[[law]]\nlaw = "pd"\n[[law]]\nlaw = "pid"\n'
    )
    study = f"{folder}/mine.toml"
    rows = Grid(load(study))
    return several(
        [
            f"sweep {study} --limit 2 --threads 1 --out {folder}/sweep --json",
            f"sweep {study} --threads 1 --out {folder}/sweep --json",
            f"sweep {study} --threads 1 --out {folder}/sweep",
            f"sweep {study} --row {'0' * 16}",
            f"sweep {study} --row {rows[2].key} --json",
            *(f"sweep {study} --row {rows[5].key}{more}" for more in ("", " --json")),
        ]
    )


LIMITED = """
name = "limited"
scenario = "hold"
metrics = ["figures.py:miss", "figures.py:slowness"]
fields = { duration = 0.005, "controller.law" = "pd" }

[optimise]
sampler = "local"
draws = 12
perturbations = 4
objective = [{ metric = "miss" }, { metric = "slowness", limits = [0.01, 0.7, 9.0] }]
gain = [
    { field = "controller.stiffness", low = 30.0, high = 3000.0, log = true, reason = "about 300" },
    { field = "controller.damping", low = 5.0, high = 500.0, log = true, optional = true },
]
"""


OBJECTIVES = [
    ("max_abs_error_rad", {}), ("max_abs_error_rad", {"of": ("alpha", "beta")}), ("slowness", {}),
    ("current_variation_A_s", {"over": "median"}), ("rms_torque_Nm", {"over": "geometric_mean"}),
]  # fmt: skip


def tunings():
    """Tuning with a front, with one objective, and with the best trial within each limit."""
    folder = scratch("tunings")
    (folder / "figures.py").write_text(FIGURES)
    single = STUDY.replace(', { metric = "slowness" }', "")
    studies = {"small": (STUDY, "--json"), "single": (single, "--trials 3"), "limited": (LIMITED, "")}
    for name, (study, _) in studies.items():
        (folder / f"{name}.toml").write_text(study)
    calls = [f"sweep {folder}/{name}.toml --optimise --threads 1 --out {folder}/{name} {more}"
             for name, (_, more) in studies.items()]  # fmt: skip
    text = several([*calls, calls[0].removesuffix("--json")])
    gains = (folder / "limited" / "gains.json").read_text()
    page = (folder / "limited" / "tuning.md").read_text(encoding="utf-8")
    files = sorted(str(path.relative_to(folder)) for path in folder.glob("*/*"))
    trial = {"trial": 1, "gains": {}, "fields": {"controller.damping": 1.0}, "ended": "completed"}
    for name, more in OBJECTIVES:
        made = Objective(metric=name, **more)
        trial |= {"values": {made.called: 2.0}, "fresh": None, "fresh_reason": None}
        files.append(str(report.chosen({"start": None, "best": [trial]}).head))
    return "\n".join([text, *tree(json.loads(gains)), page, *files])


def reproductions():
    """Experiments by name, all of them, one that ends early, and one with what its law does not have."""
    folder = scratch("reproductions")
    good, bad = (
        Statement(True, "the order holds" + " under every condition" * 9),
        Statement(False, "it is 0.36"),
    )
    case = Case("ideal", "hold", {"duration": 0.05}, is_random=False)
    made = {f"figure{number}": experiment(case, findings=lambda _: [good, bad]) for number in range(10)}
    made |= {"lost": experiment(case, LOST), "engine": experiment(case)}
    own = case._replace(fields={"controller.law": "pd", "controller.surface_slope": 5.0})
    made |= {"own": experiment(own), "none": experiment(case, findings=lambda _: [])}
    made["bad"] = experiment(case, findings=lambda _: [bad])
    made = {name: each._replace(name=name) for name, each in made.items()}
    with patch.object(reproduce, "EXPERIMENTS", made):
        calls = ["lost --json", f"own --out {folder}/own", "figure1 engine figure1 --seeds 1 --json",
                 "engine --plant mujoco --json", "figure3 --seeds 1", "none --seeds 1 --verbose",
                 f"engine --seeds 1 --limit 3 --plant lagrangian --out {folder}/page"]  # fmt: skip
        text = several([f"reproduce {call}" for call in calls])
        del made["own"], made["lost"]
        text += several(["reproduce all --seeds 1"])
    page = (folder / "page" / "reproduce.md").read_text(encoding="utf-8")
    return "\n".join([text, page, *sorted(path.name for path in folder.glob("*/*"))])


def magnetics():
    folder = recorded()
    return several([f"magnetics map --largest-tilt 10 --need 0.1 --verbose --out {folder}/map"]) + "\n".join(
        path.read_text(encoding="utf-8") for path in sorted(folder.glob("map/*.md"))
    )


def read_texts(action, parser):
    """How an option reads texts: a word, those that are no finite number, and the ends of its range."""

    def outcome(text):
        try:
            value = parser._get_value(action, text)
        except argparse.ArgumentError as error:
            return error.message
        return f"{text}: a path" if isinstance(value, Path) else f"{text}: {value!r}"

    expected = outcome("x").partition(", received")[0]
    ends = [float(end) for end in re.findall(r"\d+(?:\.\d+)?", expected)]
    near = [f"{end + step:.15g}" for end in ends for step in (-1, 0, 1)]
    return map(
        outcome, ["x", *(["nan", "inf", "²", "-1", "0", "0.5", *near] if "expected" in expected else [])]
    )


def options():
    """Every option: kind, number of values, default, valid values, and how it reads texts."""
    lines = []
    for verb in cli.VERBS:
        for title, parser in cli.parsers_of(verb).items():
            lines.append(f"## {title}")
            for action in parser._actions:
                default = parser.get_default(action.dest)
                if isinstance(default, str):
                    default = parser._get_value(action, default)
                name = ", ".join(action.option_strings) or action.metavar
                kind = type(action).__name__.strip("_")
                lines.append(f"{name} ({action.dest}): {kind}, {action.nargs}, {default}, {action.required}")
                if action.choices:
                    lines.append(f"    {', '.join(map(str, action.choices))}")
                elif action.nargs != 0:
                    lines += [f"    {text}" for text in read_texts(action, parser)]
    return "\n".join(lines)


CASES = {
    "command_options": options,
    "command_help": lambda: several(HELP), "command_explain": lambda: several(EXPLAIN),
    "command_runs": runs, "command_reviews": reviews, "command_sweeps": sweeps,
    "command_tunings": tunings, "command_reproductions": reproductions,
    "command_logs": logs, "command_magnetics": magnetics,
}  # fmt: skip


test_content = content_test(CASES)
