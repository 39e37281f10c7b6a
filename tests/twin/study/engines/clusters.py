"""A study, and sweeps of it on a Ray cluster."""

import subprocess
import sys

from spheretwin.study import journal, runner
from tests.twin.study.cases import rows_of
from tests.waiting import wait_for

STUDY = """
name = "small"
scenario = "sinusoid"
samples = 120
telemetry = [7]
fields = { duration = 0.1, hardware = "electronics" }
axis = [
    { field = "plant.modelling_error", kind = "uniform", low = -0.2, high = 0.5 },
    { field = "disturbance.load", kind = "values", values = [0.0, 1.0] },
]
"""

ROWS = 240


def run(study, folder, machines, **options):
    return runner.run(study, folder, engine="ray", address=machines.address, **options)


LIMIT = 60
LONG_STUDY = STUDY.replace("samples = 120", "samples = 100_000")  # it does not end before it is stopped


def started(source, folder, *options):
    """The command line in a process of its own, when ten rows are in its journal."""
    program = "import sys; from spheretwin.cli import main; sys.exit(main(sys.argv[1:]))"
    command = [sys.executable, "-c", program, "sweep", str(source), "--out", str(folder), "--engine", "ray"]
    going = subprocess.Popen([*command, *options], stderr=subprocess.PIPE, text=True, start_new_session=True)
    path = folder / journal.NAME
    wait_for(lambda: path.exists() and path.read_bytes().count(b"\n") > 10, while_alive=going)
    return going


def goes_on_locally(source, folder, before):
    """Run the first rows of a study that was stopped: its results are kept, and the others are added."""
    result = runner.run(str(source), folder / "out", limit=LIMIT)
    assert result.resumed >= 10
    assert (folder / "out" / journal.NAME).read_bytes().startswith(before)
    runner.run(str(source), folder / "local", limit=LIMIT)
    assert rows_of(folder / "out")[:LIMIT] == rows_of(folder / "local")
