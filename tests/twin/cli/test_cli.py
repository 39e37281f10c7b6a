"""The command as its users meet it: a process, its exit code, its two streams."""

import contextlib
import json
import os
import re
import signal
import socket
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from spheretwin import cli
from spheretwin.models.base import cache
from spheretwin.models.telemetry.table import read_parquet

COMMAND = [sys.executable, "-m", "spheretwin"]


def run_command(*arguments):
    return subprocess.run([*COMMAND, *map(str, arguments)], capture_output=True, text=True)


def called(capfd, *arguments):
    """Run the command in this process; return its exit code and what it wrote to its two streams."""
    try:
        code = cli.main([*map(str, arguments)])
    except SystemExit as ended:  # --help ends in argparse
        code = ended.code
    return code, *capfd.readouterr()


def started(*arguments):
    command, pipe = [*COMMAND, *map(str, arguments)], subprocess.PIPE
    return subprocess.Popen(command, stdout=pipe, stderr=pipe, text=True, preexec_fn=_heed_ctrl_c)


def _heed_ctrl_c():
    """As from a terminal, although tests that a shell runs in the background are told to ignore it."""
    signal.signal(signal.SIGINT, signal.default_int_handler)


def one_line(stderr):
    """The single line of a refused call."""
    (line,) = stderr.splitlines()
    assert line.startswith("spheretwin: ")
    return line


def test_run_prints_a_table_and_writes_its_files(tmp_path):
    done = run_command(
        "simulate", "nutation", "--duration", "0.5", "--telemetry", tmp_path / "n.parquet", "--record",
        tmp_path / "n.rrd",
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    assert "nutation under afsm, ideal hardware: completed" in done.stdout
    assert "rerun" in done.stdout
    table, metadata = read_parquet(tmp_path / "n.parquet")
    assert len(table) == 500
    assert json.loads(metadata["scenario"])["duration"] == 0.5
    assert (tmp_path / "n.rrd").stat().st_size > 100_000
    assert sorted(path.name for path in tmp_path.iterdir()) == ["n.parquet", "n.rrd"]


def test_json_stands_alone_on_stdout(capfd):
    code, stdout, _ = called(
        capfd, "simulate", "hold", "--json", "--controller.law", "pd", "--duration", "0.2"
    )
    assert code == 0
    figures = json.loads(stdout)
    assert figures["status"] == "completed"
    assert figures["scenario"]["controller"]["law"] == "pd"
    for name in ("max_abs_error_rad", "rms_error_rad", "tail_rms_error_rad"):
        assert len(figures[name]) == 3
    for name in ("max_abs_current_A", "saturated_fraction", "wall_s", "realtime_factor", "versions"):
        assert name in figures


def test_same_command_same_bytes_other_seed_other_bytes(tmp_path):
    def written(run, name, seed):
        path = tmp_path / name
        run(["simulate", "nutation", "--duration", "0.3", "--telemetry", str(path), "--seed", seed])
        return path.read_bytes()

    first = written(cli.main, "a.parquet", "1")
    assert written(lambda arguments: run_command(*arguments), "b.parquet", "1") == first  # another process
    assert written(cli.main, "c.parquet", "2") != first


def test_left_workspace_exits_1_and_keeps_the_run(tmp_path, capfd):
    path = tmp_path / "run.parquet"
    flags = ["--controller.law", "pd", "--disturbance.load", "5", "--telemetry", path, "--json"]
    code, stdout, stderr = called(capfd, "simulate", "sinusoid", *flags)
    assert code == 1
    assert json.loads(stdout)["status"] == "left_workspace"
    # The constant load turns α fastest: it reaches its range first.
    assert "left_workspace, α reached the end of its range, -80° to 80° (α -80." in one_line(stderr)
    assert len(read_parquet(path)[0]) > 100


TALKING = """
import sys


def talking(t, reference, measurement, parameters, state, torque):
    torque[:] = -0.5 * (measurement[0] - reference[0]) - 0.03 * measurement[1]
    if t > 0.1 and not TOLD:
        TOLD.append(t)
        print("it runs", file=sys.stderr, flush=True)


TOLD = []
"""


@contextlib.contextmanager
def running(folder, *arguments):
    """Start a run of a minute at the pace of the clock; wait until some ticks are done."""
    (folder / "law.py").write_text(TALKING)
    law = ["--controller.law", folder / "law.py:talking", "--plant.engine", "lagrangian"]
    with started("simulate", "hold", "--live", "--duration", "60", *law, *arguments) as process:
        try:
            assert any("it runs" in line for line in process.stderr)
            yield process
        finally:
            process.kill()


def test_ctrl_c_keeps_the_run(tmp_path):
    telemetry, recording = tmp_path / "run.parquet", tmp_path / "run.rrd"
    with running(tmp_path, "--telemetry", telemetry, "--record", recording, "--json") as process:
        process.send_signal(signal.SIGINT)
        stdout, stderr = process.communicate()
    assert process.returncode == 1
    assert json.loads(stdout)["status"] == "interrupted"
    assert "Traceback" not in stderr
    assert 100 < len(read_parquet(telemetry)[0]) < 60_000
    assert recording.exists()


@pytest.mark.release("a process of 1.3 s; test_ctrl_c_keeps_the_run has the same ending")
def test_termination_keeps_the_run_too(tmp_path):
    telemetry = tmp_path / "run.parquet"
    with running(tmp_path, "--telemetry", telemetry) as process:
        process.send_signal(signal.SIGTERM)
        process.communicate()
    assert process.returncode == 1
    assert 100 < len(read_parquet(telemetry)[0]) < 60_000


@pytest.mark.release("a viewer's server in a process of 1.3 s; test_viewer_server.py has its addresses")
def test_live_serves_on_this_machine_alone_and_answers_when_it_tells_where():
    process = started("simulate", "hold", "--live", "--duration", "20")
    try:
        line = process.stderr.readline()
        page = re.fullmatch(r"watch: http://127\.0\.0\.1:(\d+)/\n", line)
        assert page, line
        assert _answers("127.0.0.1", int(page[1]))
        assert _listening_hosts(int(page[1])) == {"127.0.0.1"}
        assert _ports_of(process.pid) == {int(page[1])}
    finally:
        process.send_signal(signal.SIGINT)
        process.communicate()


def _ports_of(pid):
    """Ports on which a process listens, from the kernel's tables."""
    own = set()
    for link in Path(f"/proc/{pid}/fd").iterdir():
        with contextlib.suppress(FileNotFoundError):  # it has closed it
            own.add(os.readlink(link))
    tables = [Path("/proc/net", name).read_text().splitlines()[1:] for name in ("tcp", "tcp6")]
    rows = [row.split() for table in tables for row in table]
    return {int(row[1].split(":")[1], 16) for row in rows if row[3] == "0A" and f"socket:[{row[9]}]" in own}


def _listening_hosts(port):
    """Addresses on which some process listens at a port, from the kernel's table."""
    hosts = set()
    for table in ("tcp", "tcp6"):
        for row in Path("/proc/net", table).read_text().splitlines()[1:]:
            address, state = row.split()[1], row.split()[3]
            host, hexadecimal = address.split(":")
            if state == "0A" and int(hexadecimal, 16) == port:
                hosts.add("127.0.0.1" if host == "0100007F" else host)
    return hosts


def _answers(host, port):
    with socket.socket() as probe:
        probe.settimeout(None)
        return probe.connect_ex((host, port)) == 0


INSTALLED = [str(Path(sys.executable).with_name("spheretwin"))]


@pytest.mark.parametrize(
    ("command", "arguments"),
    [(COMMAND, ["fly"]), (INSTALLED, ["simulate", "hold", "--plant.mjcf", "missing.xml"])],
    ids=["module", "installed"],
)
def test_a_refused_process_says_so_on_one_line_and_exits_2(command, arguments):
    done = subprocess.run([*command, *arguments], capture_output=True, text=True)
    assert done.returncode == 2
    assert done.stdout == ""
    assert arguments[-1] in one_line(done.stderr)


def help_of(capfd, *arguments):
    code, stdout, stderr = called(capfd, *arguments, "--help")
    assert (code, stderr) == (0, "")
    return stdout


def test_help_lists_verbs_options_and_fields(capfd):
    assert "simulate" in help_of(capfd)
    assert "--out" in help_of(capfd, "magnetics", "curve")
    code, fields, _ = called(capfd, "simulate", "tilt", "--help", "all")
    assert code == 0
    for flag in ("--description", "--controller.law", "--plant.modelling-error", "--trajectory.rate-rad-s"):
        assert flag in fields


def test_reader_that_leaves_is_no_error():
    process = started("simulate", "hold", "--json", "--duration", "0.1")
    with process:
        process.stdout.close()
        assert process.stderr.read() == ""
    assert process.returncode == 1


def test_console_script_is_this_command():
    project = tomllib.loads((Path(__file__).parents[3] / "pyproject.toml").read_text())["project"]
    assert project["scripts"] == {"spheretwin": "spheretwin.cli:main"}


# Prints the entries of the compile cache that one run compiles or loads.
ENTRIES_OF_A_RUN = """
import sys
from spheretwin import cli
from spheretwin.models.base import cache

folder, opened = str(cache.cache_folder()), set()
sys.addaudithook(lambda event, given: event == "open" and opened.add(str(given[0])))
cli.main(["simulate", "hold", "--duration", "0.01", "--json"])
sys.stderr.write("\\n".join(path for path in sorted(opened) if path.startswith(folder)))
"""


def test_what_is_not_chosen_is_not_compiled(tmp_path):
    """The bounded allocation alone would take longer to compile than all the rest.

    An entry names the modules of all functions in it, also of those that it contains.
    """
    usual = cache.cache_folder()
    environment = {**os.environ, "SPHERETWIN_CACHE_DIR": str(usual.parent if usual else tmp_path)}
    command = [sys.executable, "-c", ENTRIES_OF_A_RUN]
    run = subprocess.run(command, env=environment, capture_output=True, text=True, check=True)
    entries = [path.read_bytes() for path in map(Path, run.stderr.splitlines()) if path.is_file()]
    for module in ("loop", "control.allocation.least_norm", "plant.mujoco_rotor"):
        assert any(f"spheretwin.{module}".encode() in entry for entry in entries), module
    for module in ("control.allocation.bounded", "control.allocation.simplex", "plant.lagrangian_rotor"):
        assert not any(f"spheretwin.{module}".encode() in entry for entry in entries), module


# What comes with an extra, and what takes long to import though a run needs nothing of it.
NOT_FOR_A_RUN = (
    "matplotlib magpylib manifold3d trimesh ray optuna pinocchio control scipy.ndimage scipy.linalg rerun"
    " viser websockets spheretwin.paper spheretwin.study spheretwin.analysis spheretwin.crosscheck"
    " spheretwin.bench spheretwin.viz.bench spheretwin.viz.recording spheretwin.viz.comparison"
)


def test_a_run_imports_nothing_that_it_does_not_need():
    script = (
        "import sys; from spheretwin import cli;"
        "code = cli.main(['simulate', 'hold', '--duration', '0.01', '--json']);"
        f"imported = sorted(set({NOT_FOR_A_RUN.split()!r}) & set(sys.modules));"
        "sys.exit(f'{code} {imported}')"
    )
    # The first run may have to compile, and the compiler imports more.
    command, last_lines = [sys.executable, "-c", script], []
    while "0 []" not in last_lines and len(last_lines) < 2:
        done = subprocess.run(command, capture_output=True, text=True, cwd="/", check=False)
        last_lines.append(done.stderr.splitlines()[-1])
    assert last_lines[-1] == "0 []"


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


def test_every_verb_has_help_and_a_description(capfd):
    for verb in cli.VERBS:
        assert help_of(capfd, verb).startswith(f"usage: spheretwin {verb}")
