"""Example gallery: files of ten programs are read with the column maps of the page, and accepted."""

import re
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from spheretwin import machine
from tests.twin.machine.log_formats import FORMATS, excerpt
from tests.twin.machine.logs import multisine

PAGE = Path(__file__).parents[3] / "docs" / "how-to" / "log_formats.md"
SECTIONS = dict(re.findall(r"^## (.+?)\n(.*?)(?=^## |\Z)", PAGE.read_text(encoding="utf-8"), re.M | re.S))


def block(name, language):
    """Content of the block of a section in a language."""
    return re.search(rf"```{language}\n(.*?)```", SECTIONS[name], re.S)[1]


@pytest.fixture(scope="module")
def log():
    run = multisine()
    return replace(run, t_s=np.round(run.t_s, 9))


def test_the_page_has_all_formats():
    assert set(FORMATS) <= set(SECTIONS)


@pytest.mark.parametrize("name", FORMATS)
def test_a_file_of_another_program_is_the_log(name, log, tmp_path):
    write, file = FORMATS[name]
    write(log, path := tmp_path / file)
    assert excerpt(path) == block(name, "text")
    assert f"`{file}`" in SECTIONS[name]
    read = machine.read(path, tomllib.loads(block(name, "toml")))
    assert read.t_s - read.t_s[0] == pytest.approx(log.t_s, abs=3e-7)
    # The coarsest have counts of 0.08 mrad and of 0.38 mrad.
    assert np.abs(read.angle_rad - log.angle_rad).max(axis=0) == pytest.approx(0, abs=2.1e-4)
    share = {"ROS 2 bag": 0.2, "PlotJuggler": 0.4}.get(name, 0.0)  # currents that are late by this share
    before = np.vstack([log.current_A[:1], log.current_A[:-1]])
    assert read.current_A == pytest.approx(share * before + (1 - share) * log.current_A, abs=6e-5)
    assert machine.check(read, "hold").accepted
