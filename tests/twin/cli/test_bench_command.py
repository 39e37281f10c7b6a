"""The verb `bench`: where it is served, what it refuses, and how it ends."""

import os
import re
import signal
import stat
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


@pytest.mark.parametrize(
    ("recording", "stalled", "line"),
    [
        ((), False, ""),
        (("c", "d"), False, "spheretwin: not completed: c, d\n"),
        ((), True, "spheretwin: why\n"),
    ],
)
def test_recordings_that_are_not_complete_and_a_stall_fail_the_bench(capsys, recording, stalled, line):
    state = SimpleNamespace(completed_files=("a", "b"), recording=recording, reason="why")
    assert bench._report(SimpleNamespace(state=lambda: state, stalled=stalled)) == (not line)
    assert capsys.readouterr() == ("written  a\nwritten  b\n", line)
