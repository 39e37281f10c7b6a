"""Help of the verbs that run a scenario: options and common fields on one screen, sections on request."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence

from spheretwin import scenario as scenarios
from spheretwin.models.base.errors import unknown_name
from spheretwin.scenario import reading
from spheretwin.scenario.fields import INDEX, every_field, fields_of, kind_of
from spheretwin.scenario.sections import Scenario
from spheretwin.viz.terminal.texts import FieldText, print_fields, print_sections

EXAMPLE = "nutation"

ALL, TOP = "all", "run"
"""Every section; name of the fields outside any section."""

COMMON = {
    "duration": "length of the run, s",
    "hardware": "ideal, electronics (sensors, drive, bearings) or prototype (and imperfections)",
    "controller.law": "control law",
    "trajectory.shape": "kind of trajectory",
    "disturbance.load": "constant load L, in 0.05 N·m on each axis",
    "plant.modelling_error": "relative error m of the nominal inertia",
    "plant.engine": "mujoco, or lagrangian (faster)",
    "seed": "seed of all random numbers",
}
"""Fields on the first screen, with short descriptions."""


def print_help(options: argparse.Namespace) -> None:
    """Print the options of a verb with the common fields, or the fields of the requested section.

    Raises
    ------
    InputError
        The scenario is invalid, or there is no such section.
    """
    scenario = scenarios.load(options.scenario or EXAMPLE, reading.overrides(options.fields))
    rows = list(_rows(scenario))
    sections = list(dict.fromkeys(_section(row) for row in rows))
    if options.help == ALL:
        print_fields(f"every field, with the values of {scenario.name}", rows)
    elif options.help:
        requested = _requested(options.help, rows, sections)
        print_fields(f"fields of {options.help}, with the values of {scenario.name}", requested)
    else:
        options.parser.print_help()
        values = {row.flag: row.value for row in rows}
        common = [FieldText(_flag(name), values[_flag(name)], text) for name, text in COMMON.items()]
        print_fields(f"common fields, with the values of {scenario.name}", common)
        print_sections(sections)


def _requested(name: str, rows: Sequence[FieldText], sections: Sequence[str]) -> list[FieldText]:
    """Return the fields of a section, or of a part of one such as ``controller.governor``."""
    flag = _flag(name)
    requested = [row for row in rows if _section(row) == name or f"{row.flag}.".startswith(f"{flag}.")]
    if requested:
        return requested
    raise unknown_name("command line", name, [*sections, ALL], "--help {}")


def _rows(scenario: Scenario) -> Iterator[FieldText]:
    """Yield every field; for an empty list of tables the fields of its first entry."""
    empty = [
        name
        for name, value, field in fields_of(scenario)
        if value == () and (kind := kind_of(field)) and kind.is_list
    ]
    entries = [
        FieldText(_flag(name.replace(f".{INDEX}.", ".0.")), "", field.description or "")
        for name, field in every_field(type(scenario))
        if any(name.startswith(f"{listed}.{INDEX}.") for listed in empty)
    ]
    for flag, value, meaning in reading.field_descriptions(scenario):
        yield FieldText(flag, value, meaning)
        yield from dict.fromkeys(entry for entry in entries if entry.flag.startswith(f"{flag}."))


def _section(row: FieldText) -> str:
    section, dot, _ = row.flag.removeprefix("--").partition(".")
    return section.replace("-", "_") if dot or row.flag in ("--fault", "--event") else TOP


def _flag(name: str) -> str:
    return "--" + name.replace("_", "-")
