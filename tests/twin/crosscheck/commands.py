"""The command of the cross-check, its rows, which of its checks fail, and other machines."""

import json
from contextlib import redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path

from spheretwin import cli
from spheretwin import scenario as scenario_files
from spheretwin.loop import assembly
from tests.models.model_files import edited

fill_plant = assembly.fill_plant

FEW = 50
"""States with which most tests check."""
ROWS = json.loads(Path(__file__).with_name("rows.json").read_text(encoding="utf-8"))

GENERAL = {
    "centre": [('<inertial pos="0 0 0" mass="1.6"', '<inertial pos="0.001 -0.002 0.004" mass="1.6"')],
    "rings": [("mass=\"2.3e-12\" diaginertia=\"1.1e-15 1.1e-15 1.1e-15\"",
               "mass=\"0.15\" diaginertia=\"2e-4 2.5e-4 3e-4\"")],
    "light rings": [("1.1e-15", "4e-10")],
    "tilted": [('class="tilt_hinge" axis="1 0 0"', 'class="tilt_hinge" axis="1 0.02 0.01" pos="0 0.0002 0"')],
    "products": [("diaginertia=\"2.219e-3 2.176e-3 2.256e-3\"",
                  "fullinertia=\"2.219e-3 2.176e-3 2.256e-3 3e-5 -4e-5 2e-5\"")],
    "tiny": [("2.219e-3 2.176e-3 2.256e-3", "2.219e-6 2.176e-6 2.256e-6")],
    "uneven": [("2.219e-3 2.176e-3 2.256e-3", "1.2e-3 2.6e-3 3.1e-3")],
    "big, short range": [("2.219e-3 2.176e-3 2.256e-3", "2.2 2.1 2.3"), ('range="-80 80"', 'range="-5 20"')],
}  # fmt: skip
VENTUSFF = Path(scenario_files.__file__).parent / "shipped" / "ventusff" / "actuator.xml"
MACHINES = ("ventusff", "centre", "rings", "big, short range")


def crosscheck(*arguments):
    """Run the command; return its exit code, stdout and stderr."""
    with redirect_stdout(StringIO()) as out, redirect_stderr(StringIO()) as err:
        code = cli.main(["crosscheck", *map(str, arguments)])
    return code, out.getvalue(), err.getvalue()


def broken(checks):
    return {check.name for check in checks if not check.ok}


def machine(kind, folder):
    """Return the model file of a machine."""
    return VENTUSFF if kind == "ventusff" else edited(folder, *GENERAL[kind])


def fill_lagging(rows, *arguments):
    """The plant with its torque matrix taken at the start of each step, as if a step had no middle."""
    fill_plant(rows, *arguments)
    rows["step_s"] = 0.0
