"""``spheretwin explain``: value, unit, distribution and origin of the fields of a run."""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from spheretwin import scenario as scenarios
from spheretwin.cli.common import print_json
from spheretwin.cli.options import verb
from spheretwin.config.active_config import initial_config
from spheretwin.models.actuator import Actuator
from spheretwin.models.base.errors import InputError, shown, unknown_name
from spheretwin.scenario import reading
from spheretwin.scenario.fields import every_field, unit_of
from spheretwin.scenario.hardware import HARDWARE, MACHINE, MODEL_FILE, ORIGINS, Origin, stated_value
from spheretwin.scenario.sections import Scenario
from spheretwin.viz.terminal.texts import print_facts

DEFAULT = "default"


class FieldFacts(NamedTuple):
    """Facts of one field."""

    field: str
    value: Any
    unit: str
    distribution: str
    """Distribution of the quantity that the value describes; empty for a constant."""
    origin: str
    meaning: str


@verb("""
    SUBJECT...  hardware NAME, scenario NAME or FILE, or a field
    --all       of a scenario also the fields that have their defaults
    --json      print the result as JSON, alone on stdout
    """)
def run(options: argparse.Namespace) -> bool:
    """Print value, unit, distribution and origin of fields.

    They are those of a hardware set (explain hardware prototype), those that a scenario sets (explain
    scenario nutation), or those of a field (explain plant.coulomb_Nm).
    """
    facts = list(_facts(options.subjects, options.all))
    if options.json:
        print_json({"fields": [fact._asdict() for fact in facts]})
    else:
        print_facts(
            " ".join(options.subjects),
            [(*fact[:1], reading.value_text(fact.value), *fact[2:]) for fact in facts],
        )
    return True


def _facts(subject: list[str], everything: bool) -> Iterator[FieldFacts]:
    match subject:
        case ["hardware", name]:
            return _of_hardware(name)
        case ["scenario", source]:
            return _of_scenario(source, everything)
        case [name]:
            return _of_field(name)
    raise InputError(
        f"command line: expected hardware NAME, scenario NAME or a field, received {shown(' '.join(subject))}"
    )


def _of_hardware(name: str) -> Iterator[FieldFacts]:
    if name not in HARDWARE:
        raise unknown_name("explain", name, HARDWARE, "a hardware set of {}")
    fields = dict(every_field(Scenario))
    for dotted, value in HARDWARE[name].items():
        yield _fact(dotted, value, fields[dotted], ORIGINS[name][dotted])
    for dotted, assumed in MACHINE[name].items():
        yield _fact(dotted, assumed.value, fields[dotted], _unless_stated(dotted, assumed))


def _unless_stated(dotted: str, assumed: Origin) -> str:
    stated = "a smaller limit" if dotted.endswith("limit_A") else "a value"
    return f"{assumed.origin}; {stated} of the model file holds"


def _of_scenario(source: str, everything: bool) -> Iterator[FieldFacts]:
    config = initial_config(scenarios.load(source), None, None)
    scenario = config.scenario
    given, stated = set(_flat(reading.read(source))), ORIGINS[scenario.hardware]
    for dotted, value, field in reading.described_fields(scenario):
        if dotted in given:
            origin = f"scenario {scenario.name}"
        elif dotted in stated:
            origin = f"hardware {scenario.hardware}: {stated[dotted]}"
        elif value == field.default:
            origin = DEFAULT
        else:
            origin = _of_machine(dotted, scenario, config.files.actuator)
        if everything or not origin.startswith(DEFAULT):
            yield _fact(dotted, value, field, origin)


def _of_machine(dotted: str, scenario: Scenario, actuator: Actuator) -> str:
    """Return the origin of a value that neither the scenario nor the hardware set states.

    Parameters
    ----------
    dotted : str
    scenario : Scenario
    actuator : Actuator
        Data of the model file.
    """
    section, _, name = dotted.rpartition(".")
    if dotted not in MODEL_FILE or (section == "nominal" and scenario.nominal.equals_truth):
        return "computed from the model file and other fields"
    of_the_drive = dotted.replace("nominal.", "drive.")
    assumed, limit_A = MACHINE[scenario.hardware].get(of_the_drive), actuator.group.current_limit_A
    if assumed and stated_value(actuator, dotted) is None:
        of_any = MACHINE["ideal"].get(of_the_drive) == assumed
        return f"{DEFAULT if of_any else f'hardware {scenario.hardware}'}: {assumed.origin}"
    if assumed and name == "current_limit_A" and assumed.value < limit_A:
        return f"hardware {scenario.hardware}: {assumed.origin}, below {limit_A:.10g} A of the model file"
    return f"model file: {MODEL_FILE[dotted]}"


def _of_field(name: str) -> Iterator[FieldFacts]:
    """Yield the default of a field, or of every field of a section, and its values in the hardware sets."""
    fields = dict(every_field(Scenario))
    wanted = [dotted for dotted in fields if dotted == name or dotted.startswith(f"{name}.")]
    if not wanted:
        raise unknown_name("explain", name, fields, "a field, such as plant.coulomb_Nm")
    for dotted in wanted:
        field = fields[dotted]
        if field.description:
            yield _fact(dotted, None if field.is_required() else field.default, field, DEFAULT)
        for hardware, values in HARDWARE.items():
            if dotted in values:
                origin = f"hardware {hardware}: {ORIGINS[hardware][dotted]}"
                yield _fact(dotted, values[dotted], field, origin)
            elif assumed := MACHINE[hardware].get(dotted):
                origin = f"hardware {hardware}: {_unless_stated(dotted, assumed)}"
                yield _fact(dotted, assumed.value, field, origin)


def _fact(dotted: str, value: Any, field: Any, origin: str) -> FieldFacts:
    extra = field.json_schema_extra if isinstance(field.json_schema_extra, dict) else {}
    distribution = str(extra.get("distribution", ""))
    return FieldFacts(dotted, value, unit_of(dotted), distribution, origin, field.description or "")


def _flat(fields: Mapping[str, Any], prefix: str = "") -> Iterator[str]:
    """Yield the dotted names of the values of a scenario file; lists of tables have their indices."""
    for name, value in fields.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{prefix}{name}.")
        elif isinstance(value, list) and value and isinstance(value[0], Mapping):
            for index, entry in enumerate(value):
                yield from _flat(entry, f"{prefix}{name}.{index}.")
        else:
            yield prefix + name
