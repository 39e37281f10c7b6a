"""Study file of an experiment: its cases as crossed levels, and the words of its page."""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from importlib import resources
from itertools import product
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

from spheretwin.metrics import METRICS
from spheretwin.paper.cells import (
    ERRORS,
    Cell,
    Numbers,
    figures_named,
    hinges,
    statuses_text,
    table,
)
from spheretwin.paper.experiment import (
    SEEDS,
    STATUSES,
    Case,
    Experiment,
    ExperimentSection,
    Outcomes,
    RunOutcome,
)
from spheretwin.viz.pages.markdown import Drawing, ResultTable

if TYPE_CHECKING:
    from matplotlib.figure import Figure


class ComparedLaw(NamedTuple):
    """Law of the figures; its gains are its defaults."""

    law: str
    label: str
    gains: str
    """Origin of the gains."""
    of_paper: bool = False
    in_figures: bool = False
    """Whether the figures show it next to the paper's; the tables and the JSON contain all."""


_CONTENT = tomllib.loads((resources.files("spheretwin.paper") / "laws.toml").read_text(encoding="utf-8"))
COMPARED_LAWS = tuple(ComparedLaw(**law) for law in _CONTENT["law"])
BY_LAW = {law.law: law for law in COMPARED_LAWS}
PAPER_LAWS = tuple(law for law in COMPARED_LAWS if law.of_paper)

TABLES: Mapping[str, Any] = _CONTENT["table"]
"""Tables that several experiments have."""

Three = tuple[float, float, float]

PRINTED_rad: Mapping[tuple[float, float], Mapping[str, Three]] = {
    (condition["m"], condition["L"]): {law: tuple(errors) for law, errors in condition["error_rad"].items()}
    for condition in _CONTENT["printed"]
}
"""By m and L, and by law; of α, β and γ."""


def printed_rad(law: str, m: float, L: float) -> Three | None:
    """Largest errors that the paper prints of a law under a condition; None if it prints none."""
    return PRINTED_rad.get((round(m, 6), round(L, 6)), {}).get(law)


FOLDER = resources.files("spheretwin.paper")

T = TypeVar("T")


@dataclass(frozen=True)
class CaseRuns:
    """Case with its runs; an item is a column of the case, an error or a metric, the status, or the data."""

    case: Case
    runs: Sequence[RunOutcome]

    def __getitem__(self, name: str) -> Any:
        if name in ERRORS:
            return hinges(map(ERRORS[name], self.runs))
        if name in METRICS:
            return Numbers(figures_named(self.runs, name))
        if name == "status":
            return statuses_text(self.runs)
        return self.runs[0].data if name == "data" else self.case.columns[name]


class ExperimentFile:
    """Study file of an experiment.

    Each ``[[case]]``, with the entries of ``[every_case]``, crosses the lists of the file that ``cross``
    names, the last fastest; the list ``law`` is that of `COMPARED_LAWS` unless the file has one. The entries
    of a list are columns of the case: ``name`` is formatted with them, ``set`` has the columns that are
    fields of the scenario, ``details`` those of its row in the JSON. An entry, and the case, may have further
    ``fields``. ``expected`` are statuses that are no failure, of all cases or by law. An entry of another
    list that names a law has the columns and the fields of the law too.

    Parameters
    ----------
    name : str
        Of the file.
    part : str, optional
        Table of the file whose entries replace those of the file, if several experiments share one.
    **lists
        Lists that the file does not have.
    """

    def __init__(self, name: str, part: str = "", **lists: Sequence[Mapping[str, Any]]) -> None:
        content = tomllib.loads((FOLDER / f"{name}.toml").read_text(encoding="utf-8"))
        self._content: dict[str, Any] = {"law": [law._asdict() for law in COMPARED_LAWS]}
        self._content |= content | content.get(part, {}) | lists
        self._tables = TABLES | self._content.get("table", {})
        self._laws = {law["law"]: law for law in self["law"]}

    def __getitem__(self, entry: str) -> Any:
        return self._content[entry]

    @property
    def cases(self) -> list[Case]:
        """All cases, block by block, each once."""
        return list({case.name: case for case in self._cases}.values())

    @cached_property
    def _cases(self) -> list[Case]:
        """All cases; one that belongs to several entries of a list has the columns of each."""
        common = self._content.get("every_case", {})
        return [case for block in self["case"] for case in self._block(common | block)]

    def case(self, **columns: Any) -> Case:
        """Return the first case with some columns."""
        return self._with(columns)[0]

    def runs(self, outcomes: Outcomes, **columns: Any) -> list[CaseRuns]:
        """Return the cases with some columns that were run, with their runs."""
        return [CaseRuns(case, runs) for case in self._with(columns) if (runs := outcomes.runs(case))]

    def section(
        self,
        key: str,
        tables: Sequence[ResultTable] = (),
        drawings: Sequence[Callable[[], Drawing]] = (),
        more: str = "",
        **values: Any,
    ) -> ExperimentSection:
        """Section of the page with the title and the text of the file, and more text behind it."""
        title, text = (self[key][entry].format(**values) for entry in ("title", "text"))
        return ExperimentSection(title, text + more, tables, drawings)

    def drawing(self, key: str, figure: Figure, **values: Any) -> Drawing:
        """Figure with the file name and the caption of the file."""
        file, caption = (self[key][entry].format(**values) for entry in ("file", "caption"))
        return Drawing(file, caption, figure)

    def table(
        self,
        key: str,
        items: Iterable[T],
        before: Mapping[str, Cell[T]] | None = None,
        /,
        **measures: Callable[[T], Any],
    ) -> ResultTable:
        """Table of the file with a row for each item; some cells may be before those of the file."""
        of_file = self._tables[key]
        cells = {**(before or {}), **of_file["cells"]}
        texts = of_file.get("texts", 1) + len(before or {})
        return table(of_file["title"], items, cells, texts, **measures)

    def experiment(self, **functions: Any) -> Experiment:
        """Experiment with the name, title and summary of the file."""
        name, title, summary = (self[entry] for entry in ("name", "title", "summary"))
        functions.setdefault("cases", lambda: self.cases)
        return Experiment(name, title, summary, **functions)

    def _with(self, columns: Mapping[str, Any]) -> list[Case]:
        return [case for case in self._cases if columns.items() <= case.columns.items()]

    def _block(self, block: Mapping[str, Any]) -> list[Case]:
        levels = (self[name] for name in block["cross"])
        return [self._case(block, entries) for entries in product(*levels)]

    def _case(self, block: Mapping[str, Any], entries: Sequence[Mapping[str, Any]]) -> Case:
        columns: dict[str, Any] = {}
        if named := [entry["law"] for entry in entries if "law" in entry]:
            entries = [self._laws[named[0]], *entries]
        for entry in entries:
            columns |= entry
        if {"law", "m", "L"} <= columns.keys():
            printed = printed_rad(columns["law"], columns["m"], columns["L"])
            columns["paper"] = printed and list(printed)
        fields = {field: columns[column] for field, column in block.get("set", {}).items()}
        for entry in (*entries, block):
            fields |= entry.get("fields", {})
        option = {**block, **columns}
        expected = block.get("expected", {})
        statuses = expected.get(columns.get("law"), ["completed"]) if isinstance(expected, dict) else expected
        details = block.get("details", {}).items()
        return Case(
            name=block["name"].format(**columns),
            scenario=option["scenario"],
            fields=fields,
            details={name: columns[column] for name, column in details if column in columns},
            is_random=option.get("is_random", True),
            single_run=option.get("single_run", False),
            expected_statuses=tuple(STATUSES[status] for status in statuses),
            comparable=option.get("comparable", True),
            seeds=option.get("seeds", SEEDS),
            columns=columns,
        )
