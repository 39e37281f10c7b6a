"""State of an installation, on this system and on simulated ones."""

import json
import os
import socket
import sys

import pytest

from spheretwin import cli
from spheretwin.cli import doctor
from spheretwin.models.base.extras import PURPOSES, install_command


def test_the_report_has_every_group_and_every_extra(monkeypatch, capsys):
    findings = doctor.report()  # once: the port and the compile cache change while other tests run
    monkeypatch.setattr(doctor, "report", lambda: findings)
    assert cli.main(["doctor", "--json"]) == cli.DONE
    groups = json.loads(capsys.readouterr().out)
    assert [finding["name"] for finding in groups["extras"]] == list(PURPOSES)
    assert all(finding["ok"] for finding in groups["needed"])
    assert cli.main(["doctor"]) == cli.DONE
    out = capsys.readouterr().out
    assert all(finding["value"] in out for group in groups.values() for finding in group)


def test_a_missing_extra_has_its_command(monkeypatch):
    monkeypatch.setattr(doctor, "missing_packages", lambda extra: ["viser"] if extra == "bench" else [])
    advice = {finding.name: finding.advice for finding in doctor.extras()}
    assert advice.pop("bench") == install_command("bench")
    assert not any(advice.values())


@pytest.mark.parametrize("platform", ["darwin", "win32"])
def test_other_systems_have_a_graphics_driver_and_a_browser_of_their_own(platform, monkeypatch):
    monkeypatch.setattr(sys, "platform", platform)
    monkeypatch.setattr(doctor.shutil, "which", lambda name: None)
    assert doctor.graphics().ok
    assert doctor.browser().ok


def test_without_affinity_all_cores_count(monkeypatch):
    monkeypatch.delattr(os, "sched_getaffinity", raising=False)
    assert doctor.usable_cores() == os.cpu_count()


def test_a_port_in_use_is_reported(monkeypatch):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        monkeypatch.setattr(doctor, "PORT", taken.getsockname()[1])
        assert not doctor.bench_port().ok


def test_linux_without_a_driver_says_what_to_install(monkeypatch, tmp_path):
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.setattr(doctor, "VULKAN_FOLDERS", (str(tmp_path),))
    assert "mesa-vulkan-drivers" in doctor.graphics().advice
