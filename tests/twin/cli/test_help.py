"""Help on one screen, sections on request, and hints at misspelt names."""

import pytest

from spheretwin import cli
from spheretwin.scenario import load, reading

SCREEN = 40


@pytest.fixture(autouse=True)
def narrow(monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")


def printed(capsys, *arguments):
    assert cli.main(list(arguments)) == cli.DONE
    out, err = capsys.readouterr()
    assert err == ""
    lines = out.splitlines()
    assert max(map(len, lines)) <= 80
    return lines


def flags(lines):
    return [line.split()[0] for line in lines if line.startswith("  --")]


def test_help_fits_one_screen_and_names_options_common_fields_and_sections(capsys):
    lines = printed(capsys, "simulate", "--help")
    assert 24 <= len(lines) <= SCREEN
    common = {"--record", "--telemetry", "--live", "--controller.law", "--hardware", "--disturbance.load"}
    assert common <= set(flags(lines))
    text = " ".join(lines)
    for section in ("run", "controller", "plant", "fault", "watchdog"):
        assert section in text.partition("sections:")[2]
    assert "  --duration 5 " in "\n".join(lines)


def test_values_are_those_of_the_scenario_and_of_the_flags(capsys):
    lines = printed(capsys, "simulate", "hold", "--controller.law", "pid", "-h")
    assert any(line.startswith(f"  --duration {load('hold').duration:g} ") for line in lines)
    assert any(line.startswith("  --controller.law pid ") for line in lines)


def test_a_section_has_all_of_its_fields_and_no_other(capsys):
    every = [flag for flag, *_ in reading.field_descriptions(load("tilt"))]
    plant = flags(printed(capsys, "simulate", "tilt", "--help", "plant"))
    assert plant == [flag for flag in every if flag.startswith("--plant.")]
    top = flags(printed(capsys, "simulate", "tilt", "--help", "run"))
    assert top == ["--name", "--description", "--duration", "--seed", "--allocation", "--hardware"]
    part = flags(printed(capsys, "simulate", "tilt", "--help", "controller.governor"))
    assert part == [flag for flag in every if flag.startswith("--controller.governor.")]
    assert {"--fault.0.target", "--fault.0.mode"} <= set(flags(printed(capsys, "simulate", "-h", "fault")))


def test_all_has_every_field(capsys):
    every = {flag for flag, *_ in reading.field_descriptions(load("tilt"))}
    assert every <= set(flags(printed(capsys, "simulate", "tilt", "--help", "all")))


def test_the_bench_has_the_same_help(capsys):
    lines = printed(capsys, "bench", "--help")
    assert len(lines) <= SCREEN
    assert {"--port", "--controller.law"} <= set(flags(lines))
    assert flags(printed(capsys, "bench", "--help", "watchdog"))[0].startswith("--watchdog.")
