"""The command as its users meet it: a process, its exit code, its two streams."""

import contextlib
import json
import os
import re
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from spheretwin.models.base import cache
from spheretwin.models.telemetry.table import read_parquet
from tests.twin.cli.calls import COMMAND, call, started, under_law

INSTALLED = str(Path(sys.executable).with_name("spheretwin"))


def test_a_process_prints_a_table_and_writes_the_bytes_of_a_call(tmp_path):
    def run(start, name, seed, *more):
        path = tmp_path / name
        start(["simulate", "nutation", "--duration", "0.3", "--seed", seed, "--telemetry", path, *more])
        return path.read_bytes()

    def process(arguments):
        done = subprocess.run([INSTALLED, *map(str, arguments)], capture_output=True, text=True)
        assert (done.returncode, done.stderr) == (0, "")
        assert "nutation under afsm, ideal hardware: completed" in done.stdout
        assert "rerun" in done.stdout

    first = run(process, "a.parquet", "1", "--record", tmp_path / "a.rrd")
    assert run(lambda arguments: call(*arguments), "b.parquet", "1") == first
    assert run(lambda arguments: call(*arguments), "c.parquet", "2") != first
    assert (tmp_path / "a.rrd").stat().st_size > 100_000
    names = ["a.parquet", "a.rrd", "b.parquet", "c.parquet"]
    assert sorted(path.name for path in tmp_path.iterdir()) == names


def test_a_refused_process_says_so_on_one_line_and_exits_2():
    done = subprocess.run([*COMMAND, "fly"], capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1)
    assert done.stderr.startswith("spheretwin: ")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_ends_a_run_and_keeps_its_rows(tmp_path, number):
    telemetry, recording = tmp_path / "run.parquet", tmp_path / "run.rrd"
    flags = under_law(tmp_path, f"if round(t / 1e-3) == 100: os.kill(os.getpid(), {int(number)})")
    result = call(*flags, "--duration", "60", "--telemetry", telemetry, "--record", recording, "--json")
    assert (result.code, result.json["status"]) == (1, "interrupted")
    assert 100 < len(read_parquet(telemetry)[0]) < 60_000
    assert recording.exists()


@pytest.mark.release("a viewer's server in a process of 1.3 s; test_viewer_server.py has its addresses")
def test_live_serves_on_this_machine_alone_at_the_printed_address():
    process = started("simulate", "hold", "--live", "--duration", "20")
    try:
        line = process.stderr.readline()
        page = re.fullmatch(r"watch: http://127\.0\.0\.1:(\d+)/\n", line)
        assert page, line
        assert _addresses_of(process.pid) == {("0100007F", int(page[1]))}  # 127.0.0.1, in network order
    finally:
        process.send_signal(signal.SIGINT)
        process.communicate()


def _addresses_of(pid):
    """Hexadecimal hosts and ports on which a process listens, from the kernel's tables."""
    own = set()
    for link in Path(f"/proc/{pid}/fd").iterdir():
        with contextlib.suppress(FileNotFoundError):  # it has closed it
            own.add(os.readlink(link))
    tables = [Path("/proc/net", name).read_text().splitlines()[1:] for name in ("tcp", "tcp6")]
    rows = [row.split() for table in tables for row in table]
    listening = [row[1].split(":") for row in rows if row[3] == "0A" and f"socket:[{row[9]}]" in own]
    return {(host, int(port, 16)) for host, port in listening}


def test_reader_that_leaves_is_no_error():
    process = started("simulate", "hold", "--json", "--duration", "0.1")
    with process:
        process.stdout.close()
        assert process.stderr.read() == ""
    assert process.returncode == 1


# What comes with an extra, and what takes long to import though a run needs nothing of it.
NOT_FOR_A_RUN = (
    "matplotlib magpylib manifold3d trimesh ray optuna pinocchio control scipy.ndimage scipy.signal"
    " scipy.linalg rerun viser websockets spheretwin.paper spheretwin.study spheretwin.analysis"
    " spheretwin.crosscheck spheretwin.bench spheretwin.viz.bench spheretwin.viz.recording"
    " spheretwin.viz.comparison"
)

# Prints the modules that one run imports, and the entries of the compile cache that it compiles or loads.
ONE_RUN = """
import json, sys
from spheretwin import cli
from spheretwin.models.base import cache

folder, opened = str(cache.cache_folder()), set()
sys.addaudithook(lambda event, given: event == "open" and opened.add(str(given[0])))
assert cli.main(["simulate", "hold", "--duration", "0.01", "--json"]) == 0
entries = [path for path in sorted(opened) if path.startswith(folder)]
print(json.dumps([sorted(sys.modules), entries]))
"""


def test_a_run_imports_and_compiles_nothing_that_it_does_not_need(tmp_path):
    """The bounded allocation alone would take longer to compile than all the rest.

    An entry names the modules of all functions in it, also of those that it contains.
    """
    usual, unneeded = cache.cache_folder(), set(NOT_FOR_A_RUN.split())
    environment = {**os.environ, "SPHERETWIN_CACHE_DIR": str(usual.parent if usual else tmp_path)}
    for _ in range(2):  # the first run may have to compile, and the compiler imports more
        command = [sys.executable, "-c", ONE_RUN]
        run = subprocess.run(command, env=environment, cwd="/", capture_output=True, text=True, check=True)
        modules, paths = json.loads(run.stdout.splitlines()[-1])
        if not unneeded & set(modules):
            break
    assert not unneeded & set(modules)
    entries = [path.read_bytes() for path in map(Path, paths) if path.is_file()]
    for module in ("loop", "control.allocation.least_norm", "plant.mujoco_rotor"):
        assert any(f"spheretwin.{module}".encode() in entry for entry in entries), module
    for module in ("control.allocation.bounded", "control.allocation.simplex", "plant.lagrangian_rotor"):
        assert not any(f"spheretwin.{module}".encode() in entry for entry in entries), module


@pytest.mark.parametrize("option", ["--help", "--version"])
def test_the_command_alone_imports_no_verb(option):
    script = (
        "import sys; from spheretwin import cli;"
        "\ntry: cli.main([sys.argv[1]])"
        "\nexcept SystemExit: pass"
        "\nverbs = {f'spheretwin.cli.{verb}' for verb in cli.VERBS};"
        "\nsys.exit(str(sorted(({'numba', 'mujoco', 'pydantic'} | verbs) & set(sys.modules))))"
    )
    process = subprocess.run(
        [sys.executable, "-c", script, option], capture_output=True, text=True, check=False
    )
    assert process.stderr == "[]\n"
    assert "spheretwin" in process.stdout
