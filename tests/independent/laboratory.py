"""Logs of the independent machine in C, with its sensors as the data sheet `electronics` has them."""

import subprocess
from functools import cache
from pathlib import Path
from tempfile import mkdtemp

from spheretwin import machine
from spheretwin.machine.workflow import NOMINAL
from tests.requirements import C_COMPILER

HERE, ROOT = Path(__file__).parent, Path(__file__).parents[2]
CURVE = ROOT / "models" / "torque_curve.csv"

SCENARIO, DATA_SHEET = "sinusoid", NOMINAL
COUNT_rad = 0.0031415926535897933
SHEET = (
    "viscous=1e-4", "coulomb=2e-3", "lag=8e-5", "noise=3.588e-4,3.588e-4,0", f"count=0,0,{COUNT_rad}",
)  # fmt: skip
"""Settings of a machine that is as its data sheet; later settings replace them."""

COLUMN_MAP = {
    "time": {"column": "micros", "unit": "us", "wrap": 4294967296},
    "angles": {
        "columns": ["pot_a", "pot_b", "count"],
        "unit": ["deg", "deg", "rad"],
        "scale": [1.0, 1.0, COUNT_rad],
    },
    "currents": {"columns": ["i*"], "unit": "mA", "kind": "commanded"},
}


def built(source, folder):
    """Program of a file of C."""
    program = folder / source.stem
    options = ["-std=c99", "-O2", "-Wall", "-Wextra", "-pedantic", "-Werror"]
    subprocess.run([*C_COMPILER, *options, "-o", program, source, "-lm"], check=True)
    return program


@cache
def program():
    """Program that writes logs."""
    return built(HERE / "laboratory.c", Path(mkdtemp()))


def write_log(path, duration_s, *settings):
    """Write the CSV of a machine."""
    command = [program(), CURVE, str(duration_s), *SHEET, *settings]
    with path.open("wb") as file:
        subprocess.run(command, stdout=file, check=True)


def read_log(path, duration_s, *settings, conditions=None):
    """Log of a machine, read from its CSV with its column map."""
    write_log(path, duration_s, *settings)
    return machine.read(path, COLUMN_MAP | ({"conditions": conditions} if conditions else {}))
