"""Row of a study: its scenario, its run and its figures."""

from __future__ import annotations

import copy
import json
import shlex
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

from spheretwin.config.active_config import fill_defaults
from spheretwin.loop.block import RunBlock
from spheretwin.loop.channels import CHANNELS
from spheretwin.metrics import METRICS
from spheretwin.metrics.figures import Figures
from spheretwin.metrics.reduction import PlannedRun
from spheretwin.metrics.user_metrics import UserMetric, load_metrics, own_values
from spheretwin.models.base.columns import MixedRowsError
from spheretwin.models.base.errors import (
    InputError,
    LawError,
    SpheretwinError,
    did_you_mean,
    exception_text,
    shown,
)
from spheretwin.models.base.turns import outside_turn
from spheretwin.models.base.user_code import is_reference
from spheretwin.models.telemetry.parquet import TelemetryFile
from spheretwin.models.telemetry.table import Sink, TelemetryBuffer
from spheretwin.records.provenance import record_of
from spheretwin.run import Run
from spheretwin.scenario import reading
from spheretwin.scenario.changes import check_events, fields_with, is_tag
from spheretwin.scenario.fields import INDEX, every_field, flat, new_name, without_indices
from spheretwin.scenario.files import FilesCache
from spheretwin.scenario.sections import Scenario, scenario_with
from spheretwin.scenario.writing import command_words
from spheretwin.session import Session
from spheretwin.simulation import follow
from spheretwin.study.axes import Axis, DrawnAxis
from spheretwin.study.grid import Row
from spheretwin.study.study import FAST, Study, fast_engine
from spheretwin.study.template import Template, is_number, template_of

ENGINE = "plant.engine"

MOST_TEMPLATES = 512
"""Largest number of templates in memory: rows of one shape follow each other."""

REFUSED = "refused"
"""Status of a row whose values make no scenario."""

FAILED = "failed"
"""Status of a row in which user code raised an exception."""


class RowResult(NamedTuple):
    """Result of a row in JSON types; it does not depend on where and when the row runs."""

    status: str
    reason: str | None
    error: str | None
    figures: dict[str, Any]


class Rows:
    """Runs rows of a study.

    Parameters
    ----------
    study : Study
    telemetry : Path, optional
        Folder for the telemetry of chosen rows.
    own : mapping of callable, optional
        Functions of a run by the names of their figures, instead of those that the study names.

    Raises
    ------
    InputError
        The scenario cannot be read, an axis names no field, or a user metric cannot be loaded.
    """

    def __init__(
        self, study: Study, telemetry: Path | None = None, own: Mapping[str, UserMetric] | None = None
    ) -> None:
        self.study = study
        self._telemetry = telemetry
        self._files = FilesCache()
        self._templates: dict[tuple[Any, ...], Template | None] = {}
        self._fields = fields_with(study.source, self._resolve(study.fields))
        self._names_files = True
        self.base = self._validated(copy.deepcopy(self._fields))
        self._names_files = bool(study.law) or not all(map(_is_of_numbers, study.axis))
        self._defaults = flat(self.base.model_dump(mode="json"))
        chosen = [name for name in study.metrics if name in METRICS]
        self._check_axes()
        self.metrics = tuple(METRICS) if not study.metrics else tuple(chosen)
        self._references = [study.path(name) for name in study.metrics if is_reference(name)]
        self._own = load_metrics(self._references) if own is None else own
        self.chooses_plant = study.fast and not self._names_engine()
        self.block = RunBlock

    @property
    def own_metrics(self) -> tuple[str, ...]:
        """Names of the user metrics."""
        return tuple(self._own)

    def with_block(self, block: type[RunBlock]) -> Rows:
        """Return these rows, of which another kind of block runs those on the fast plant."""
        other = copy.copy(self)
        other.block = block
        return other

    def with_metrics(self, names: Sequence[str]) -> Rows:
        """These rows with other figures, without metrics of the user and without telemetry."""
        other = copy.copy(self)
        other.metrics, other._own, other._telemetry = tuple(names), {}, None
        return other

    def scenario(self, row: Row, engine: str | None = None) -> Scenario:
        """Scenario of a row.

        Parameters
        ----------
        row : Row
        engine : str, optional
            Plant; the fast one if the model allows it, unless given.

        Raises
        ------
        InputError
            Its values are out of range, or do not fit each other.
        """
        return self._scenario(row, self._shape(row, engine), engine)

    def _scenario(self, row: Row, shape: tuple[Any, ...], engine: str | None) -> Scenario:
        if shape not in self._templates:
            if len(self._templates) >= MOST_TEMPLATES:
                self._templates.clear()
            fields = self._whole(self._fields_of(row, engine))
            self._templates[shape] = template_of(fields, ("seed", *shape[1]), self.study.scenario)
        if template := self._templates[shape]:
            return template.scenario((row.seed, *(row.values[name] for name in shape[1])))
        return self._validated(self._fields_of(row, engine))

    def _shape(self, row: Row, engine: str | None) -> tuple[Any, ...]:
        """Return what rows that differ in numbers alone have in common: texts, names of numbers, plant."""
        others = {name: value for name, value in row.values.items() if not is_number(value)}
        numbers = tuple(name for name in row.values if name not in others)
        return json.dumps([row.law, others]), numbers, engine

    def run(self, rows: Sequence[Row], engine: str | None = None) -> list[RowResult]:
        """Run rows; an error of a row is its result.

        Rows that differ in numbers run as a block. A row with events, a law, metric or trajectory of the
        user, or telemetry to be stored, runs alone.
        """
        results: dict[int, RowResult | None] = {}
        for places, block in self._blocks(rows, engine):
            results |= zip(places, block, strict=True)
        return [results.get(place) or self._alone(row, engine) for place, row in enumerate(rows)]

    def _blocks(
        self, rows: Sequence[Row], engine: str | None
    ) -> Iterator[tuple[list[int], list[RowResult | None]]]:
        """Yield the places of rows that run together with their results, None for a row that runs alone."""
        if self._own or len(rows) == 1:
            return
        together: dict[Any, list[tuple[int, Scenario]]] = {}
        for place, row in enumerate(rows):
            with suppress(InputError):  # the row alone is refused with its reason
                shape = self._shape(row, engine)
                scenario = self._without_unread(self._scenario(row, shape, engine))
                if kind := self._kind_of_block(row, scenario, shape):
                    together.setdefault(kind, []).append((place, scenario))
        pending = list(together.values())
        while pending:
            members = pending.pop()
            if len(members) == 1:  # its session starts in half of the time
                continue
            places, scenarios = zip(*members, strict=True)
            try:
                results = self._run_block(scenarios)
            except (InputError, MixedRowsError):  # of one row or another: the others run together
                middle = len(members) // 2
                pending += [members[:middle], members[middle:]]
            else:
                yield list(places), results

    def _kind_of_block(self, row: Row, scenario: Scenario, shape: tuple[Any, ...]) -> Any:
        """Return what the scenarios of a block have in common; None for a row that runs alone."""
        stored = self._telemetry is not None and row.number in self.study.telemetry
        alone = is_reference(scenario.controller.law) and not self.block.takes_user_laws
        if stored or scenario.event or alone:
            return None
        clocks = scenario.controller.period_s, scenario.plant.step_s, scenario.ticks
        logged = tuple(bool(channel.logged(scenario)) for channel in CHANNELS)
        return *shape, scenario.plant.engine, clocks, logged, id(self._files.files_of(scenario))

    def _run_block(self, scenarios: Sequence[Scenario]) -> list[RowResult | None]:
        files = self._files.files_of(scenarios[0])
        resolved = [fill_defaults(scenario, files, None, None) for scenario in scenarios]
        kind = self.block if scenarios[0].plant.engine == FAST else RunBlock
        block = kind(resolved, files, self.metrics)
        with outside_turn:  # little of it is Python
            endings = block.run()
        return [
            ending
            and RowResult(
                str(ending.status), ending.reason.text if ending.reason else None, None, ending.figures
            )
            for ending in endings
        ]

    def _alone(self, row: Row, engine: str | None) -> RowResult:
        try:
            scenario = self.scenario(row, engine)
            with self.session(scenario) as session:
                return self._follow(row, scenario, session)
        except InputError as error:
            return RowResult(REFUSED, None, str(error), {})
        except LawError as error:
            return RowResult(FAILED, None, str(error), {})
        except SpheretwinError:  # not of the row: a full disk
            raise
        except Exception as error:  # user code may raise anything
            return RowResult(FAILED, None, exception_text(error), {})

    def session(self, scenario: Scenario) -> Session:
        """Session of a row's scenario without unread sensors; its files are read once for a study."""
        return Session(self._without_unread(scenario), files=self._files.files_of(scenario))

    def _without_unread(self, scenario: Scenario) -> Scenario:
        """Scenario without the noise of current sensors if neither detector nor telemetry has their currents.

        No other number depends on it, and it is most of a row's random numbers.
        """
        sensors = scenario.sensors
        is_read = scenario.detects or sensors.hall.on or scenario.event or self.study.telemetry or self._own
        if is_read or not sensors.current.noise_A:
            return scenario
        current = sensors.current.model_copy(update={"noise_A": 0.0})
        return scenario.model_copy(update={"sensors": sensors.model_copy(update={"current": current})})

    def command(self, row: Row) -> str:
        """Command line that runs a row alone; with the values of the row if they make no scenario."""
        law = {"controller": {**_period(self._fields), **row.law}} if row.law is not None else {}
        named = self._resolve({**self.study.fields, **law, **row.values})
        named["seed"] = row.seed
        try:
            scenario = self.scenario(row)
        except InputError:
            values: dict[str, Any] = {}
        else:
            values = flat(scenario.model_dump(mode="json"))
            if self.chooses_plant:
                named[ENGINE] = scenario.plant.engine
        lists = {dotted: value for dotted, value in values.items() if isinstance(value, list)}
        complete = {(name := _list_of(dotted)): lists.get(name, value) for dotted, value in named.items()}
        words = command_words(self.study.source, complete)
        for reference in self._references:
            words += ["--metric", reference]
        return shlex.join(words)

    def _fields_of(self, row: Row, engine: str | None) -> dict[str, Any]:
        """Fields of a row by section."""
        fields = self._fields_under(row.values)
        if row.law is not None:
            law = self._resolve({"controller": dict(row.law)})["controller"]
            fields["controller"] = {**_period(fields), **law}
        for dotted, value in self._resolve(row.values).items():
            self._fill_list(fields, dotted)
            reading.override(fields, dotted, value)
        fields["seed"] = row.seed
        if engine or (self.chooses_plant and ENGINE not in row.values):
            reading.override(fields, ENGINE, engine or self._fast_engine(fields))
        return fields

    def _fields_under(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """Fields that all rows have; read anew if a row chooses another member of a family."""
        members = {name: value for name, value in values.items() if is_tag(name)}
        if not members:
            return copy.deepcopy(self._fields)
        return fields_with(self.study.source, self._resolve({**self.study.fields, **members}))

    def _resolve(self, values: Mapping[str, Any]) -> dict[str, Any]:
        """Values by dotted name, with paths relative to the folder of the study."""
        return {dotted: self._resolve_value(dotted, value) for dotted, value in values.items()}

    def _resolve_value(self, dotted: str, value: Any) -> Any:
        if not isinstance(value, str | list | tuple | dict):  # a number names no file
            return value
        return reading.resolve_value_paths(self.study.folder, dotted, value)

    def _names_engine(self) -> bool:
        """True if the study or the scenario names the plant."""
        plant = self._fields.get("plant")
        chosen = isinstance(plant, Mapping) and "engine" in plant
        return chosen or any(axis.field in ("plant", ENGINE) for axis in self.study.axis)

    def _follow(self, row: Row, scenario: Scenario, session: Session) -> RowResult:
        planned = PlannedRun(session.initial_scenario, session.actuator, scenario.ticks)
        gathered = Figures(planned, self.metrics)
        sinks: list[Sink] = [gathered]
        buffer = TelemetryBuffer(session.signals, scenario.ticks) if self._own else None
        file = self._file(row, session)
        sinks += [sink for sink in (buffer, file) if sink]
        try:
            status = follow(session, scenario.ticks, sinks)
        finally:
            if file:
                file.close(record_of(session).metadata())
        if session.law_error:
            raise session.law_error
        figures = gathered.values()
        complaints: list[str] = []
        if buffer:
            run = Run(session.initial_scenario, status, buffer.table, session.loop_s, session.actuator)
            with outside_turn:
                own, complaints = own_values(self._own, run)
            figures |= own
        reason = session.reason.text if session.reason else None
        return RowResult(str(status), reason, "; ".join(complaints) or None, figures)

    def _file(self, row: Row, session: Session) -> TelemetryFile | None:
        if self._telemetry is None or row.number not in self.study.telemetry:
            return None
        path = self._telemetry / f"{row.key}.parquet"
        return TelemetryFile(path, session.signals, record_of(session).metadata())

    def _validated(self, fields: dict[str, Any]) -> Scenario:
        source = self.study.scenario
        return check_events(reading.validated(self._whole(fields), source), source)

    def _whole(self, fields: dict[str, Any]) -> dict[str, Any]:
        """Fields with the defaults of their hardware, and with resolved paths."""
        reading.fill_hardware(fields)
        return reading.resolve_paths("", fields) if self._names_files else fields

    def _check_axes(self) -> None:
        """Check before the first row that each axis names a field."""
        known = dict(every_field(type(self.base)))
        for law in self.study.law:
            name = self._resolve({"controller.law": law["law"]})["controller.law"]
            known |= dict(every_field(scenario_with(name)))
        for axis in self.study.axis:
            name = without_indices(axis.field)
            if name.removesuffix(f".{INDEX}") not in known:
                raise InputError(
                    f"study {self.study.name}: expected an axis over a field of a scenario,"
                    f" received {shown(axis.field)}{new_name(name, known) or did_you_mean(axis.field, known)}"
                )

    def _fill_list(self, fields: dict[str, Any], dotted: str) -> None:
        """Fill a list with its defaults if the name is of an entry and the scenario leaves the list open."""
        name = _list_of(dotted)
        default = self._defaults.get(name)
        if name != dotted and isinstance(default, list) and not isinstance(flat(fields).get(name), list):
            reading.override(fields, name, list(default))

    def _fast_engine(self, fields: Mapping[str, Any]) -> str:
        plant = fields.get("plant")
        section = plant if isinstance(plant, Mapping) else {}
        named = section.get("mjcf")
        return fast_engine(named if isinstance(named, str) else None, section.get("integrator", "RK4"))


def _period(fields: Mapping[str, Any]) -> dict[str, Any]:
    """Control period of the base scenario, which holds for all laws."""
    controller = fields.get("controller")
    if isinstance(controller, Mapping) and "period_s" in controller:
        return {"period_s": controller["period_s"]}
    return {}


def _is_of_numbers(axis: Axis) -> bool:
    """True if no value of an axis can name a file."""
    return isinstance(axis, DrawnAxis) or all(
        isinstance(value, int | float) for value in getattr(axis, "values", ())
    )


def _list_of(dotted: str) -> str:
    """Name of the list if a name is of an entry: a command line sets complete lists."""
    above, _, last = dotted.rpartition(".")
    return above if last.isdecimal() else dotted
