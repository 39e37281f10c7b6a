"""Help on one screen, and the fields of a section on request."""

import pytest

from spheretwin.scenario import load, reading
from tests.twin.cli.calls import succeeded

SCREEN = 40


@pytest.fixture(autouse=True)
def narrow(monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")


def printed(*arguments):
    lines = succeeded(*arguments).splitlines()
    assert max(map(len, lines)) <= 80
    return lines


@pytest.mark.parametrize("verb", ["simulate", "bench"])
def test_help_of_a_verb_with_fields_fits_one_screen(verb):
    assert 24 <= len(printed(verb, "--help")) <= SCREEN


def test_all_fields_are_shown_on_request():
    every = [flag for flag, *_ in reading.field_descriptions(load("tilt"))]
    lines = printed("simulate", "tilt", "--help", "all")
    assert set(every) <= {line.split()[0] for line in lines if line.startswith("  --")}
