"""File of a twin: the parameters that logs have given, their covariance, their origin and their history."""

from __future__ import annotations

import hashlib
import json
import re
import tomllib
from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from spheretwin.machine.intervals import Uncertainty
from spheretwin.machine.log import Log
from spheretwin.models.base.arrays import Array
from spheretwin.models.base.errors import InputError, shown, without_breaks
from spheretwin.models.base.files import regular_file, whole_file

if TYPE_CHECKING:
    from spheretwin.machine.identification import Identified


from typing import NamedTuple

from spheretwin.machine.intervals import Z95
from spheretwin.viz.pages.markdown import Drawing

DAY_s = 86_400.0
MOST_PANELS = 4
"""Parameters in the figure of a history: those that have changed most."""


class Identification(NamedTuple):
    """Result of an identification."""

    date: datetime
    values: dict[str, tuple[float, float, float]]
    """Value and 95 % interval of each parameter."""


class ParameterDrift(NamedTuple):
    """Drift of a parameter: slope of the line through its values, weighted by their intervals."""

    per_day: float
    half_width: float
    """Of the 95 % interval."""
    unit: str

    @property
    def is_clear(self) -> bool:
        """True if the interval does not contain 0."""
        return abs(self.per_day) > self.half_width

    def text(self) -> str:
        """Return the drift as words."""
        unit = "/day" if self.unit == "1" else f" {self.unit}/day"
        return f"{self.per_day:+.2g} ± {self.half_width:.2g}{unit}"


def history_of(content: Mapping[str, Any], path: Path) -> list[Identification]:
    """Return the identifications of the content of a twin's file, in order of time.

    Raises
    ------
    InputError
        The history is not one.
    """
    try:
        entries = [
            Identification(
                datetime.fromisoformat(one["date"]),
                {name: (float(v), float(low), float(high)) for name, (v, low, high) in one["values"].items()},
            )
            for one in content.get("history", ())
        ]
        return sorted(entries, key=lambda one: one.date)
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise InputError(
            f"twin {path}: expected [[history]] with a date and values of three numbers, received others"
            f" ({without_breaks(error)})"
        ) from None


def drifts(history: Sequence[Identification], units: Mapping[str, str]) -> dict[str, ParameterDrift]:
    """Return the drift of each parameter that was identified at two times or more.

    Parameters
    ----------
    history : sequence of Identification
    units : mapping
        Unit of each parameter by name.
    """
    found = {}
    for name, unit in units.items():
        rows = [(one.date.timestamp(), *one.values[name]) for one in history if name in one.values]
        if len({row[0] for row in rows}) < 2:
            continue
        times, values, low, high = np.array(rows).T
        days, weights = (times - times[0]) / DAY_s, (2 * Z95 / (high - low)) ** 2
        days = days - np.average(days, weights=weights)
        spread = float(weights @ days**2)
        found[name] = ParameterDrift(float(weights @ (days * values)) / spread, Z95 / spread**0.5, unit)
    return found


def history_drawing(history: Sequence[Identification]) -> Drawing:
    """Return the figure of the changes since the first identification, in half widths of the intervals."""
    from spheretwin.viz.figures import twin  # Matplotlib is optional

    changes = {}
    for name in history[-1].values:
        rows = [(one.date.timestamp(), *one.values[name]) for one in history if name in one.values]
        times, values, low, high = np.array(rows).T
        changes[name] = (times - times[0]) / DAY_s, (values - values[0]) / (0.5 * (high - low).mean())
    largest = sorted(changes, key=lambda name: -np.abs(changes[name][1]).max())[:MOST_PANELS]
    title = "History of the twin"
    panels = {name: {"identified": changes[name]} for name in largest}
    figure = twin.residuals(panels, "days", "change, half widths of the interval", title)
    caption = f"{title}: change of the parameters since the first identification over half of the 95 % width."
    return Drawing("history.svg", caption, figure)


FORMAT = 1
LEARNED_FILE = "plant.learned_torque.file"
UNCHECKED = "unchecked"
"""Digest of a file that was written or edited by hand."""
UNSIGNED = f'sha256 = "{UNCHECKED}"'


def write_twin(
    path: Path,
    result: Identified,
    scenario: str,
    changes: Mapping[str, Any],
    logs: Sequence[Log],
    now: datetime | None = None,
) -> None:
    """Write the file of a twin, completely or not at all; the history of a twin in its place goes on.

    Parameters
    ----------
    path : Path
    result : Identified
        Accepted.
    scenario : str
        Name or file of the scenario that was identified.
    changes : mapping
        Its fields that were known.
    logs : sequence of Log
    now : datetime, optional
        Date of the identification; the present by default.

    Raises
    ------
    InputError
        The result is not accepted, or no file can be made there.
    """
    if not result.accepted or result.covariance is None or result.held_out is None:
        raise InputError(f"twin {path}: expected an accepted identification, received {result.reasons[0]}")
    date, fields = now or datetime.now(UTC), {**changes, **result.fields}
    if learned := fields.get(LEARNED_FILE):
        beside = path.with_suffix(".learned.npz")
        beside.write_bytes(Path(learned).read_bytes())
        fields[LEARNED_FILE] = beside.name
    values = {name: (one.value, *one.interval) for name, one in result.parameters.items()}
    history = [*read_history(path), Identification(date, values)]
    lines = [
        f"format = {FORMAT}",
        UNSIGNED,
        f"scenario = {_text(scenario)}",
        f"versions = {_text({name: version(name) for name in ('spheretwin', 'numpy', 'scipy')})}",
        f"held_out_chi2 = {result.held_out.chi2!r}",
        f"improvement = {result.improvement!r}",
        "",
        "# Fields of the scenario with the values that were found, after those that were known.",
        "[fields]",
        *(f"{_text(name)} = {_text(value)}" for name, value in fields.items()),
        "",
        "# 95 % intervals, and their widths over those that noise alone gives.",
        *(
            f"[parameters.{_text(name)}]\nvalue = {one.value!r}\ninterval = {_text(list(one.interval))}\n"
            f"unit = {_text(one.unit)}\nwidening = {one.widening!r}\n"
            for name, one in result.parameters.items()
        ),
        "# Rows in the order of the parameters.",
        "[covariance]",
        f"matrix = {_text(result.covariance.tolist())}",
        "",
        *(
            f"[[log]]\nname = {_text(log.name)}\nsha256 = {_text(log.digest)}\n"
            f"conditions = {_text(dict(log.conditions))}\naccepted = {_text(list(log.accepted))}\n"
            for log in logs
        ),
        "# Value and interval of the parameters at each identification.",
        *(
            f"[[history]]\ndate = {_text(one.date.isoformat(timespec='seconds'))}\n"
            f"values = {_text({name: list(numbers) for name, numbers in one.values.items()})}\n"
            for one in history
        ),
    ]
    text = "\n".join(lines)
    with whole_file(path) as temporary:
        temporary.write_text(text.replace(UNSIGNED, f'sha256 = "{_digest(text)}"', 1), encoding="utf-8")


def read_twin(path: Path) -> dict[str, Any]:
    """Return the fields of a scenario that a twin states, by dotted name.

    Raises
    ------
    InputError
        The file cannot be read or is not that of a twin.
    """
    fields: dict[str, Any] = _content(path)["fields"]
    if learned := fields.get(LEARNED_FILE):  # it is next to the twin
        fields[LEARNED_FILE] = str(path.parent / learned)
    return fields


def read_history(path: Path) -> list[Identification]:
    """Return the identifications of a twin in order of time; none if there is no file of a twin.

    Raises
    ------
    InputError
        The history is not one.
    """
    try:
        content = _content(path)
    except InputError:  # what is no twin has no history, and is overwritten
        return []
    return history_of(content, path)


def read_drifts(path: Path) -> dict[str, ParameterDrift]:
    """Return the drift of each parameter of a twin that was identified at two times or more.

    Raises
    ------
    InputError
        The file cannot be read or is not that of a twin.
    """
    content = _content(path)
    units = {name: str(one.get("unit", "1")) for name, one in content.get("parameters", {}).items()}
    return drifts(history_of(content, path), units)


def read_uncertainty(path: Path) -> Uncertainty:
    """Return the uncertainty of the identified parameters of a twin.

    Raises
    ------
    InputError
        The file cannot be read or is not that of a twin.
    """
    _, values, covariance = _identified(path)
    return Uncertainty.of(values, covariance)


def draw_fields(path: Path, count: int, seed: int = 0) -> dict[str, list[Any]]:
    """Return fields of machines that the logs of a twin allow: values of each field, drawn together.

    Parameters
    ----------
    path : Path
        File of a twin.
    count : int
        Machines: normal draws with mean and covariance of the identified parameters, within their ranges.
    seed : int

    Raises
    ------
    InputError
        The file cannot be read or is not that of a twin, or its scenario cannot be used.
    """
    from spheretwin.machine.parameters import Machine, selected  # loads the magnetics of the actuator

    fields = read_twin(path)
    scenario, values, covariance = _identified(path)
    names, mean = list(values), np.array(list(values.values()))
    drawn = np.random.default_rng(seed).multivariate_normal(mean, covariance, count)
    if "torque_scale" in names:  # a part of the gains, which are drawn with it
        scale = mean[names.index("torque_scale")]
        fields["plant.group_gain"] = [gain / scale for gain in fields["plant.group_gain"]]
    machine = Machine(scenario, fields)
    parameters = selected(names, machine.model.actuator)
    bounds = [[getattr(one.kind, end) for one in parameters] for end in ("least", "most")]
    drawn = np.clip(drawn, bounds[0], bounds[1])
    machines = [machine.fields(parameters, row.tolist()) for row in drawn]
    return {name: [one[name] for one in machines] for name in machines[0]}


def _identified(path: Path) -> tuple[str, dict[str, float], Array]:
    """Return scenario, identified values by name, and their covariance."""
    content = _content(path)
    try:
        scenario = str(content["scenario"])
        values = {name: float(one["value"]) for name, one in content["parameters"].items()}
        covariance = np.array(content["covariance"]["matrix"], np.float64)
        if covariance.shape != (len(values), len(values)):
            raise ValueError(f"{len(values)} parameters, covariance of shape {covariance.shape}")
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        raise InputError(
            f"twin {path}: expected scenario, parameters and a covariance of them, received others"
            f" ({without_breaks(error)})"
        ) from None
    return scenario, values, covariance


def _content(path: Path) -> dict[str, Any]:
    try:
        text = regular_file(path).read_text(encoding="utf-8-sig")
        content = tomllib.loads(text)
    except (OSError, ValueError, RecursionError) as error:
        raise InputError(f"twin {path}: expected a readable TOML file, {without_breaks(error)}") from None
    if content.get("format") != FORMAT or not isinstance(content.get("fields"), dict):
        raise InputError(
            f"twin {path}: expected format = {FORMAT} and a table [fields], received format"
            f" {content.get('format', 'none')!r} and fields {shown(content.get('fields', 'none'))}"
        )
    digest = content.get("sha256")
    if digest not in (UNCHECKED, _digest(text)):
        received = "none" if digest is None else "one of another content: the file is damaged, or was edited"
        raise InputError(
            f"twin {path}: expected sha256 with the digest that `identify` wrote, received {received}; the"
            f" line {UNSIGNED} accepts a file as it is, also one of an earlier version"
        )
    return content


def _digest(text: str) -> str:
    """Return the digest of the text of a twin, without its first digest and the line breaks at its end."""
    unsigned = re.sub(r"^sha256 = .*$", "", text.rstrip("\n"), count=1, flags=re.MULTILINE)
    return hashlib.sha256(unsigned.encode()).hexdigest()


def _text(value: Any) -> str:
    """Return the text of a value in TOML, which is that of JSON but for mappings."""
    if isinstance(value, Mapping):
        return f"{{{', '.join(f'{_text(name)} = {_text(entry)}' for name, entry in value.items())}}}"
    return json.dumps(value, ensure_ascii=False)
