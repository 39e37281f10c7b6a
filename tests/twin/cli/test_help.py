"""Help on one screen, and the fields of a section on request."""

import pytest

from spheretwin.scenario import load, reading
from tests.twin.cli.calls import succeeded

SCREEN = 40
EVERY = [flag for flag, *_ in reading.field_descriptions(load("tilt"))]


@pytest.fixture(autouse=True)
def narrow(monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")


def printed(*arguments):
    lines = succeeded(*arguments).splitlines()
    assert max(map(len, lines)) <= 80
    return lines


def flags(*arguments):
    return [line.split()[0] for line in printed(*arguments) if line.startswith("  --")]


@pytest.mark.parametrize("verb", ["simulate", "bench"])
def test_help_of_a_verb_with_fields_fits_one_screen(verb):
    assert 24 <= len(printed(verb, "--help")) <= SCREEN


def test_values_are_those_of_the_scenario_and_of_the_flags():
    lines = printed("simulate", "hold", "--controller.law", "pid", "-h")
    assert any(line.startswith(f"  --duration {load('hold').duration:g} ") for line in lines)
    assert any(line.startswith("  --controller.law pid ") for line in lines)


def test_a_section_has_all_of_its_fields_and_no_other():
    for section in ("plant", "controller.governor", "watchdog"):
        expected = [flag for flag in EVERY if flag.startswith(f"--{section}.")]
        assert flags("simulate", "tilt", "--help", section) == expected
    top = ["--name", "--description", "--duration", "--seed", "--allocation", "--hardware"]
    assert flags("simulate", "tilt", "--help", "run") == top
    assert set(EVERY) <= set(flags("simulate", "tilt", "--help", "all"))
