"""Content of what the verbs print: help, tables, JSON, pages, and messages about what is refused."""

import functools
import json
import re

import numpy as np

from spheretwin import cli, machine
from tests.content.content import command, content_test, scratch
from tests.content.values import tree

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


HELP = [
    "--help", *(f"{verb} --help" for verb in cli.VERBS), "magnetics curve --help", "magnetics check --help",
    "magnetics map --help", "log check --help", "simulate tilt --help run",
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
            f"simulate hold --duration 0.02 --json {lagrangian} {own}highest {own}broken",
            f"simulate hold --duration 0.02 {lagrangian} {own}strange {own}highest",
            f"simulate hold --duration 0.02 --json {lagrangian} {own}highest {own}highest",
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
    return several(
        [
            f"sweep {study} --limit 2 --threads 1 --out {folder}/sweep --json",
            f"sweep {study} --threads 1 --out {folder}/sweep --json",
            f"sweep {study} --threads 1 --out {folder}/sweep",
            f"sweep {study} --row {{}}".format("0" * 16),
        ]
    )


def magnetics():
    folder = recorded()
    return several(
        [
            f"magnetics map --largest-tilt 10 --need 0.1 --verbose --out {folder}/map",
        ]
    ) + "\n".join(path.read_text(encoding="utf-8") for path in sorted(folder.glob("map/*.md")))


CASES = {
    "command_help": lambda: several(HELP), "command_explain": lambda: several(EXPLAIN),
    "command_runs": runs, "command_reviews": reviews, "command_sweeps": sweeps,
    "command_logs": logs, "command_magnetics": magnetics,
}  # fmt: skip


test_content = content_test(CASES)
