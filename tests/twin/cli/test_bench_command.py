"""The verb `bench`: where it is served, what it refuses, and how it ends."""

import os
import re
import signal
import stat
import subprocess
import sys
import urllib.error
import urllib.request
from pathlib import Path
from types import SimpleNamespace
from unittest.mock import Mock

import pytest

from spheretwin import cli
from spheretwin.bench.operators import Operators
from spheretwin.cli import bench
from spheretwin.models.base.extras import install_command
from spheretwin.models.telemetry.table import read_parquet
from spheretwin.viz.bench.page import Page
from tests.twin.cli.calls import call, refusal, started

BENCH = ("bench", "hold", "--plant.engine", "lagrangian")


def test_ctrl_c_ends_it_and_what_was_recorded_is_kept(tmp_path):
    recording = tmp_path / "bench.rrd"
    environment = {**os.environ, "PYTHONWARNINGS": "error"}
    arguments = [*BENCH, "--no-browser", "--port", "0", "--record", recording]
    with started(*arguments, env=environment) as process:
        address = process.stdout.readline().split()[1]
        assert address.startswith("http://127.0.0.1:")
        with pytest.raises(urllib.error.HTTPError) as unauthorised:
            urllib.request.urlopen(address.partition("?")[0])
        with unauthorised.value:  # the answer, with its connection
            assert unauthorised.value.code == 403
        browser = urllib.request.build_opener(urllib.request.HTTPCookieProcessor())
        with browser.open(address) as answer:  # it is said once the page answers
            assert answer.status == 200
        again = process.stdout.readline()
        assert again.startswith("bench: for another browser: http://127.0.0.1:")
        assert again.split()[-1] != address
        process.send_signal(signal.SIGINT)
        out, err = process.communicate()
    # On a busy machine the end takes a while, and a line says what a second Ctrl-C would do.
    lines = [line for line in err.splitlines() if "a second Ctrl-C" not in line]
    assert (process.returncode, lines) == (0, ["bench: preparing hold"])
    assert out.split() == ["written", str(recording)]
    assert recording.stat().st_size > 0


def test_without_viser_it_says_what_brings_it(monkeypatch):
    monkeypatch.setattr(bench, "find_spec", lambda name: None)
    assert install_command("bench") in refusal("bench", "hold", "--no-browser")


def redirection(file):
    """Address and permissions of the file that the browser opens; a command line is visible to everybody."""
    path = Path(file.removeprefix("file://"))
    return re.search('url=(.+)"', path.read_text())[1], stat.S_IMODE(path.stat().st_mode)


@pytest.mark.parametrize("flags", [[], ["--no-browser", "--hold-after", "7"]], ids=["browser", "none"])
def test_a_browser_is_opened_at_the_printed_address_unless_it_is_not_to(monkeypatch, tmp_path, flags):
    opened, operators = [], Mock(wraps=Operators)
    monkeypatch.setattr(bench, "Operators", operators)
    monkeypatch.setattr(Page, "show", lambda page, ended: None)
    monkeypatch.setattr(bench.webbrowser, "open", lambda file: opened.append(redirection(file)))
    monkeypatch.setattr(Path, "home", lambda: tmp_path)
    code, out, err = call(*BENCH, "--port", "0", *flags)
    address = re.fullmatch(r"bench: (http://127\.0\.0\.1:\d+/\?token=[\w-]+) \(Ctrl-C ends it\)\n", out)[1]
    assert {path.name for path in tmp_path.iterdir()} <= {".cache"}  # compiled loops
    assert opened == ([] if flags else [(address, 0o600)])
    operators.assert_called_once_with(7.0 if flags else 2.0)
    assert (code, err) == (cli.DONE, "bench: preparing hold\n")


@pytest.mark.parametrize(("recording", "line"), [((), ""), (("c", "d"), "spheretwin: not completed: c, d\n")])
def test_recordings_that_are_not_complete_fail_the_bench(capsys, recording, line):
    state = SimpleNamespace(completed_files=("a", "b"), recording=recording)
    assert bench._report(SimpleNamespace(state=lambda: state, stalled=False)) == (not recording)
    assert capsys.readouterr() == ("written  a\nwritten  b\n", line)


LAW = """
import numba

@numba.njit
def hangs(t, reference, measurement, parameters, state, torque):
    torque[0] = torque[1] = torque[2] = 0.0
    while t > 0.05:
        torque[0] += 1e-9
"""


@pytest.mark.release(
    "a process of 3 s; test_ctrl_c_ends_it_and_what_was_recorded_is_kept interrupts a bench in less"
)
def test_a_compiled_law_that_never_returns_ends_by_one_ctrl_c_with_complete_files(tmp_path):
    """The compiled loop cannot be interrupted: the process ends around it."""
    (tmp_path / "law.py").write_text(LAW)
    driver = tmp_path / "driver.py"
    driver.write_text(DRIVER)
    with subprocess.Popen(
        [sys.executable, str(driver), "--folder", str(tmp_path)],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    ) as process:  # fmt: skip
        try:
            assert process.stdout.readline().startswith("bench: http://127.0.0.1:")
            assert process.stdout.readline() == "stalled\n"
            process.send_signal(signal.SIGINT)
            out, err = process.communicate()
        finally:
            process.kill()
    assert process.returncode == 1
    assert out.split() == ["written", str(tmp_path / "run.parquet")]
    assert f"LOOP STALLED: the law {tmp_path / 'law.py'}:hangs has not returned" in err
    assert len(read_parquet(tmp_path / "run.parquet")[0]) > 0


# The verb, with a script in place of a page.
DRIVER = """
import sys
import threading

from spheretwin import bench, cli
from spheretwin.cli import bench as verb


class Scripted(bench.Bench):
    def begin(self):
        super().begin()
        threading.Thread(target=self._script, daemon=True).start()

    def _script(self):
        for name, arguments in (
            ("set", {"name": "controller.law", "value": "law.py:hangs"}),
            ("record", {"telemetry": "run.parquet"}),
            ("start", {}),
        ):
            ticket = self.command(name, **arguments)
            if ticket.wait(None) != "done":  # in a thread an error would leave the bench running for ever
                print(name, "refused:", ticket.refused, flush=True)
                return
        while not self.state().completed_files:
            pass
        assert self.state().reason.startswith("LOOP STALLED")
        print("stalled", flush=True)


verb.Bench = Scripted
arguments = ["bench", "hold", "--plant.engine", "lagrangian", "--no-browser", "--port", "0"]
sys.exit(cli.main([*arguments, *sys.argv[1:]]))
"""
