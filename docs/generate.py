"""Reference pages that follow from the sources: fields, columns, commands, statuses, figures, faults.

``python docs/generate.py`` writes them into ``docs/reference/generated``; the build of the site does so too.
"""

from __future__ import annotations

import importlib
import importlib.util
import inspect
import os
import re
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

from pydantic import BaseModel

from spheretwin import cli
from spheretwin.control.law import NominalModel
from spheretwin.control.laws import LAWS
from spheretwin.faults.targets import TARGETS
from spheretwin.loop.assembly import RunData
from spheretwin.loop.channels import CHANNELS
from spheretwin.metrics import METRICS
from spheretwin.models import actuator as actuators
from spheretwin.models.base.record import Record, kinds_of
from spheretwin.models.telemetry.signals import Signal, common_signals
from spheretwin.models.telemetry.status import Status
from spheretwin.scenario.fields import FieldKind, kind_of, unit_of
from spheretwin.scenario.hardware import HARDWARE, ORIGINS
from spheretwin.scenario.reading import value_text
from spheretwin.scenario.sections import Scenario

ROOT = Path(__file__).parents[1]
GROUPS = 18

READMES = {
    "models/README.md": "actuator",
    "twin/electronics/README.md": "electronics",
    "twin/envs/README.md": "environments",
    "twin/faults/README.md": "faults",
    "twin/machine/README.md": "machine",
    "twin/machine/link/README.md": "link",
    "twin/paper/README.md": "paper",
    "twin/study/README.md": "studies",
    "viz/README.md": "recordings",
    "viz/bench/README.md": "bench",
}
"""Pages that stand next to the code, and their names on the site."""

DOCSTRINGS = {
    "afsm_eso": ("AFSM-ESO: law and proof", "spheretwin.control.laws.afsm_eso"),
    "extended_state_observer": (
        "Extended state observer: gains and error bounds",
        "spheretwin.control.law_components.extended_state_observer",
    ),
    "bounded_allocation": ("Bounded allocation", "spheretwin.control.allocation.bounded"),
    "generalised_maxwell_slip": ("Static friction", "spheretwin.plant.bristle_friction"),
    "reference_governor": ("Reference governor", "spheretwin.control.compensators.reference_governor"),
    "delay_prediction": ("Prediction over the delay", "spheretwin.control.compensators.prediction"),
    "fault_detector": ("Fault detector", "spheretwin.control.supervision.fault_detector"),
}
"""Derivations that stand in the docstrings of modules: title and module of the page."""

SOURCES = {
    "models/telemetry/signals.py": "telemetry_columns",
    "models/telemetry/status.py": "statuses",
    "models/base/record.py": "records",
    "twin/cli/__init__.py": "commands",
    "twin/faults/targets.py": "fault_modes",
    "twin/metrics/__init__.py": "metrics",
    "twin/scenario/hardware.py": "hardware",
    "twin/scenario/sections.py": "scenario_fields",
    "control/laws/__init__.py": "laws",
}
"""Sources of tables, and their pages on the site."""

TOP_LEVEL = "run"
"""Heading of the fields outside any section."""

HELP_WIDTH = "96"

GENERATED = "docs/reference/generated"
"""Folder of the pages."""


def write_pages(folder: Path) -> None:
    """Write every page; a page whose text is unchanged keeps its time."""
    folder.mkdir(parents=True, exist_ok=True)
    pages = {
        "scenario_fields": scenario_fields(),
        "laws": laws(),
        "hardware": hardware(),
        "telemetry_columns": telemetry_columns(),
        "commands": commands(),
        "statuses": statuses(),
        "metrics": metrics(),
        "fault_modes": fault_modes(),
        "records": records(),
        **{name: readme(path) for path, name in READMES.items()},
        **{name: docstring(*page) for name, page in DOCSTRINGS.items()},
    }
    for name, text in pages.items():
        path = folder / f"{name}.md"
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")


def scenario_fields() -> str:
    """Return the page of all fields of a scenario, by section."""
    sections: dict[str, list[Sequence[str]]] = {TOP_LEVEL: []}
    for dotted, field in _fields(Scenario):
        section = dotted.partition(".")[0] if "." in dotted else TOP_LEVEL
        sections.setdefault(section, []).append(
            (f"`{dotted}`", unit_of(dotted), _default(field), _cell(field.description or ""))
        )
    lines = [
        "# Scenario fields",
        "",
        "Generated from the models. Each field is a line of a TOML file and a flag:"
        " `plant.coulomb_Nm` is `--plant.coulomb-Nm`. `#` stands for the number of an entry of a list."
        " `spheretwin explain FIELD` prints value, unit, distribution and origin.",
    ]
    for section, rows in sections.items():
        lines += ["", f"## {section}", "", *_table(("field", "unit", "default", "meaning"), rows)]
    return _page(lines)


def _fields(section: type[BaseModel], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Yield dotted name and description of every plain field; parameters of laws have a page of their own."""
    for name, field in section.model_fields.items():
        kind = kind_of(field)
        if kind is None:
            yield prefix + name, field
            continue
        below = f"{prefix}{name}.#." if kind.is_list else f"{prefix}{name}."
        yield from _unique(field for member in _members(name, kind) for field in _fields(member, below))


def _members(name: str, kind: FieldKind) -> Iterable[type[BaseModel]]:
    return [next(iter(kind.members.values()))] if name == "controller" else kind.members.values()


def _unique(fields: Iterable[tuple[str, Any]]) -> Iterator[tuple[str, Any]]:
    """Yield the first field of each name: members of a family share fields."""
    seen: set[str] = set()
    for dotted, field in fields:
        if dotted not in seen:
            seen.add(dotted)
            yield dotted, field


def _default(field: Any) -> str:
    if field.is_required():
        return "required"
    default = field.get_default(call_default_factory=True)
    if default is None:
        return ""
    return f"`{text}`" if (text := value_text(default)) else ""


def laws() -> str:
    """Return the page of the shipped laws with their parameters."""
    common = set.intersection(*(set(kind.model_fields) for kind in LAWS.values()))
    lines = [
        "# Control laws",
        "",
        "Generated from the models: `controller.law` selects a law; its parameters are fields of"
        " `controller`. A gain is one number for all axes, or three.",
    ]
    for name, kind in LAWS.items():
        rows = [
            (f"`{parameter}`", unit_of(parameter), _default(field), _cell(field.description or ""))
            for parameter, field in kind.model_fields.items()
            if parameter not in common
        ]
        lines += ["", f"## {name}", "", _summary(kind), ""]
        lines += _table(("parameter", "unit", "default", "meaning"), rows)
    return _page(lines)


def hardware() -> str:
    """Return the page of the hardware sets."""
    lines = ["# Hardware sets", "", "Generated: the fields that `hardware` sets unless a scenario sets them."]
    for name, values in HARDWARE.items():
        rows = [
            (f"`{dotted}`", f"`{value_text(value)}`", unit_of(dotted), _cell(ORIGINS[name][dotted]))
            for dotted, value in values.items()
        ]
        lines += ["", f"## {name}", ""]
        lines += _table(("field", "value", "unit", "origin"), rows) if rows else ["It sets no field."]
    return _page(lines)


def telemetry_columns() -> str:
    """Return the page of the telemetry columns."""
    conditional = [signal for channel in CHANNELS for signal in channel.signals(GROUPS)]
    known = NominalModel(period_s=1e-3, delay_s=0.0, inertia=actuators.load().inertia)
    own = {signal.name: signal for kind in LAWS.values() for signal in kind().build(known).signals}
    lines = [
        "# Telemetry columns",
        "",
        f"Generated from the channels, for the shipped actuator with {GROUPS} groups."
        " A vector is a list of fixed length, with a number for each label.",
        *("", "## Every run", "", *_signals(common_signals(GROUPS))),
        *("", "## With a stage that is on", "", *_signals(conditional)),
        *("", "## Of the laws that have them", "", *_signals(own.values())),
    ]
    return _page(lines)


def _signals(signals: Iterable[Signal]) -> list[str]:
    rows = [
        (
            f"`{signal.name}`",
            signal.unit,
            f"{signal.size}",
            _cell(signal.meaning + (f" ({', '.join(signal.states)})" if signal.states else "")),
        )
        for signal in signals
    ]
    return _table(("column", "unit", "numbers", "meaning"), rows)


def commands() -> str:
    """Return the page of the commands, with the help of each verb."""
    os.environ["COLUMNS"] = HELP_WIDTH
    lines = [
        "# Commands",
        "",
        "Generated from the parsers. `spheretwin VERB --help` prints the same. Exit codes are listed under"
        " [statuses and exit codes](statuses.md).",
        "",
        *_table(("verb", "purpose"), [(f"[`{verb}`](#{verb})", text) for verb, text in cli.VERBS.items()]),
    ]
    for verb, text in cli.VERBS.items():
        lines += ["", f"## {verb}", "", f"{text[0].upper()}{text[1:]}.", ""]
        for title, parser in cli.parsers_of(verb).items():
            lines += ["", f"### {title}", ""] if title != verb else []
            lines += ["```text", parser.format_help().rstrip(), "```"]
    return _page(lines)


def statuses() -> str:
    """Return the page of statuses and exit codes."""
    endings = [(f"`{status}`", _cell(status.text)) for status in Status]
    codes = [
        ("0", "done: a run completed, every check is within its bound"),
        ("1", "a run ended early (its files are complete up to there), or a check or a file failed"),
        ("2", "bad input, or a damaged file: one line on stderr says what was expected and received"),
        ("130, 143", "a second Ctrl-C or SIGTERM ended the process at once"),
    ]
    return _page(
        [
            "# Statuses and exit codes",
            "",
            "A run has one of these statuses, in telemetry, JSON, studies and `Run.status`.",
            "",
            *_table(("status", "meaning"), endings),
            "",
            "## Exit codes",
            "",
            *_table(("code", "meaning"), codes),
        ]
    )


def metrics() -> str:
    """Return the page of the figures of a run."""
    rows = [
        (f"`{name}`", unit_of(name), ", ".join(kind.labels), _cell(_summary(kind)))
        for name, kind in METRICS.items()
    ]
    return _page(
        [
            "# Figures of a run",
            "",
            "Generated: keys of `simulate --json` and of `Run.figures`, columns of a study.",
            "",
            *_table(("figure", "unit", "entries", "meaning"), rows),
        ]
    )


def fault_modes() -> str:
    """Return the page of the parts that can fail."""
    lines = ["# Fault targets and modes", "", "Generated: `target` and `mode` of a `[[fault]]`."]
    for target in TARGETS.values():
        names = target.names(GROUPS)
        shown = f"`{names[0]}` to `{names[-1]}`" if len(names) > 2 else " and ".join(f"`{n}`" for n in names)
        rows = [
            (f"`{mode}`", _cell(kind.value.meaning if kind.value else "no value"), _value_default(kind.value))
            for mode, kind in target.modes.items()
        ]
        note = " It needs `drive.supply_V`." if target.needs_supply else ""
        lines += ["", f"## {target.name}", "", f"Targets: {shown}.{note}", ""]
        lines += _table(("mode", "value", "default"), rows)
    return _page(lines)


def records() -> str:
    """Return the page of the records of a run: every field of every part."""
    lines = [
        "# Records of a run",
        "",
        "Generated from the declarations. A run is one record, `run`; a nested record has a section of its"
        " own. *Use*: kept, a field of the state, which a snapshot has; faults, a field that faults write.",
    ]
    for place, kind in _records("run", RunData):
        kinds = kinds_of(kind)
        rows = [
            (
                f"`{name}`",
                f"record `{kinds[name].__name__}`" if issubclass(kinds[name], Record) else declared.unit,
                " × ".join(map(str, declared.shape)),
                "kept" if declared.is_state else "faults" if declared.set_by_faults else "",
                _cell(declared.meaning),
            )
            for name, declared in kind.fields().items()
        ]
        lines += ["", f"## {kind.__name__}", "", f"`{place}`. {_summary(kind)}", ""]
        lines += _table(("field", "unit", "shape", "use", "meaning"), rows)
    return _page(lines)


def _records(place: str, kind: type[Record]) -> Iterator[tuple[str, type[Record]]]:
    """Yield the first place and the class of each kind of record."""
    found = {kind: place}
    for name, inner in kinds_of(kind).items():
        if issubclass(inner, Record):
            for below, of_below in _records(f"{place}.{name}", inner):
                found.setdefault(of_below, below)
    yield from ((below, of_below) for of_below, below in found.items())


def _value_default(value: Any) -> str:
    if value is None:
        return ""
    return "required" if value.default is None else f"`{value.default:g}`"


def docstring(title: str, module: str) -> str:
    """Return the docstring of a module as a page: it is plain text with indented formulas, as in Markdown."""
    text = inspect.cleandoc(importlib.import_module(module).__doc__ or "")
    path = f"`{module}`"
    return _page([f"# {title}", "", f"The documentation of the module {path}.", "", text])


def pages_of_files() -> dict[str, str]:
    """Return the pages that follow from a file of the repository, by that file."""
    derived = {_file_of(module): name for name, (_, module) in DOCSTRINGS.items()}
    return {**READMES, **SOURCES, **derived}


def _file_of(module: str) -> str:
    spec = importlib.util.find_spec(module)
    assert spec
    assert spec.origin
    return Path(spec.origin).relative_to(ROOT).as_posix()


def on_site(page: str, text: str) -> str:
    """Return a page of ``docs`` for the site: a link to a file with a page of its own leads to that page.

    In the sources such a link leads to the file: the page exists on the site alone.

    Parameters
    ----------
    page : str
        Path below ``docs``.
    text : str
        Its Markdown.
    """
    folder, pages = (Path("docs") / page).parent, pages_of_files()

    def replaced(match: re.Match[str]) -> str:
        target, mark, anchor = match["target"].partition("#")
        file = os.path.normpath(folder / target).replace(os.sep, "/")
        if match["image"] or "://" in target or file not in pages:
            return match[0]
        path = os.path.relpath(f"{GENERATED}/{pages[file]}.md", folder).replace(os.sep, "/")
        return f"[{match['text']}]({path}{mark}{anchor})"

    return _LINK.sub(replaced, text)


_LINK = re.compile(r"(?P<image>!?)\[(?P<text>[^\]]*)\]\((?P<target>[^)\s]+)\)")


def readme(path: str) -> str:
    """Return the README of a folder as a page: its links lead to pages of the site, or name a file."""
    folder = Path(path).parent

    def replaced(match: re.Match[str]) -> str:
        target, _, anchor = match["target"].partition("#")
        if not target or "://" in target:
            return match[0]
        file = os.path.normpath(folder / target).replace(os.sep, "/")
        if not (ROOT / file).exists():
            raise FileNotFoundError(f"{path}: a link leads to {file}, which does not exist")
        if file in READMES:
            return f"[{match['text']}]({READMES[file]}.md{f'#{anchor}' if anchor else ''})"
        if match["image"]:
            return f"![{match['text']}](../../../{file})"
        if file.startswith("docs/"):
            return f"[{match['text']}](../../{file.removeprefix('docs/')})"
        return match["text"] if file in match["text"] else f"{match['text']} (`{file}`)"

    text = _LINK.sub(replaced, (ROOT / path).read_text(encoding="utf-8"))
    return _one_title(text)


def _one_title(text: str) -> str:
    """Return a page with one title: later headings of the first level move down with all that follow."""
    lines, is_code, is_first, shift = [], False, True, False
    for line in text.splitlines():
        is_code ^= line.startswith("```")
        if line.startswith("#") and not is_code:
            shift = shift or (line.startswith("# ") and not is_first)
            is_first = False
            line = f"#{line}" if shift else line
        lines.append(line)
    return _page(lines)


def _summary(kind: type) -> str:
    return (kind.__doc__ or "").strip().split("\n\n")[0].replace("\n    ", " ")


def _table(headings: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    lines = [f"| {' | '.join(headings)} |", f"|{'---|' * len(headings)}"]
    return [*lines, *(f"| {' | '.join(row)} |" for row in rows)]


def _cell(text: str) -> str:
    """Return a text that is safe in a cell of a table."""
    return (
        " ".join(text.split()).replace("``", "`").replace("|", "\\|").replace("<", "&lt;").replace("*", "\\*")
    )


def _page(lines: Iterable[str]) -> str:
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    write_pages(ROOT / GENERATED)
