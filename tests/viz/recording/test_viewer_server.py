"""Server of the viewer: its files, its refusals, and its end with the process."""

import http.client
import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from spheretwin.models.base.errors import SpheretwinError
from spheretwin.viz import rerun_internals
from spheretwin.viz.recording.live import RECORDING, Broadcast, ViewerServer
from spheretwin.viz.rerun_internals import FILES, HOST, INDEX
from tests.waiting import wait_for


@pytest.fixture(scope="module")
def home(tmp_path_factory):
    """A home folder in which nothing was ever kept."""
    return tmp_path_factory.mktemp("home")


@pytest.fixture(scope="module")
def served(home):
    patch = pytest.MonkeyPatch()
    patch.setenv("HOME", str(home))
    broadcast = Broadcast()
    broadcast.begin(b"RRF2")
    broadcast.send(b"more")
    broadcast.end()
    server = ViewerServer(broadcast)
    yield int(server.address.split(":")[2].strip("/"))
    server.close()
    patch.undo()


def asked(port, path, host=None):
    connection = http.client.HTTPConnection(HOST, port)
    connection.request("GET", path, headers={"Host": host} if host else {})
    answer = connection.getresponse()
    content = answer.read()
    connection.close()
    return answer, content


def test_every_file_is_served_and_its_page_names_no_other_host(served):
    for path in FILES:
        answer, content = asked(served, path)
        assert answer.status == 200
        assert content
    page = asked(served, INDEX)[1].decode()
    head = page[: page.index("<style>")]
    assert "re_viewer.js" in page
    assert "https://" not in head
    assert "window.fetch" in page[: page.index("re_viewer.js")]


def test_the_address_leads_to_the_page_with_its_recording(served):
    answer, _ = asked(served, "/")
    assert answer.status == 302
    assert answer.headers["Location"].endswith(f"%2F%2F{HOST}%3A{served}{RECORDING.replace('/', '%2F')}")
    assert asked(served, answer.headers["Location"])[0].status == 200
    assert asked(served, RECORDING)[1] == b"RRF2more"


def test_the_browser_is_told_to_refuse_other_hosts(served):
    policy = asked(served, INDEX)[0].headers["Content-Security-Policy"]
    sources = {source for part in policy.split(";") for source in part.split()[1:]}
    keywords = {"'none'", "'self'", "'unsafe-inline'", "'wasm-unsafe-eval'", "data:", "blob:"}
    assert sources <= keywords


def test_unknown_paths_and_host_names_are_refused(served):
    assert asked(served, "/../assets.py")[0].status == 404
    assert asked(served, "/re_viewer.js", host="elsewhere.example")[0].status == 403


def test_the_program_that_holds_the_files_keeps_nothing_of_its_own(served, home):
    assert list(home.rglob("*")) == []


@pytest.mark.parametrize(
    ("text", "complaint"),
    [(None, "Rerun's viewer at"), ("#!/bin/sh\nexit 1\n", "the files of Rerun's viewer")],
)
def test_a_program_that_is_missing_or_ends_at_once_is_reported(monkeypatch, tmp_path, text, complaint):
    monkeypatch.setattr(rerun_internals, "PROGRAM", program := tmp_path / "rerun")
    if text:
        program.write_text(text)
        program.chmod(0o755)
    with pytest.raises(SpheretwinError, match=f"expected {complaint}"):
        rerun_internals.read_assets()


KILLED = """
import subprocess, sys
from spheretwin.viz.rerun_internals import _SUPERVISED
sleeper = [sys.executable, "-c", "import os, time; print(os.getpid(), flush=True); time.sleep(1000)"]
subprocess.Popen([sys.executable, "-I", "-S", "-c", _SUPERVISED, *sleeper], stdin=subprocess.PIPE).wait()
"""


def test_the_program_ends_with_a_process_that_is_killed():
    process = subprocess.Popen([sys.executable, "-c", KILLED], stdout=subprocess.PIPE, text=True)
    program = Path(f"/proc/{int(process.stdout.readline())}")
    assert program.exists()
    os.kill(process.pid, signal.SIGKILL)
    process.communicate()
    wait_for(lambda: not program.exists())
