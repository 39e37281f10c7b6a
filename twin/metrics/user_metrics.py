"""Metrics of the user: functions of a complete run."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from spheretwin.metrics import METRICS
from spheretwin.models.base.errors import InputError, exception_text, shown
from spheretwin.models.base.user_code import load_function

UserMetric = Callable[[Any], Any]
"""User function from a complete `Run` to a value in JSON types."""

# Keys of the JSON of a run that are not metrics.
OTHER_KEYS = (
    "scenario",
    "status",
    "reason",
    "simulated_s",
    "wall_s",
    "realtime_factor",
    "versions",
    "notes",
    "warnings",
)


def check_names(own: Mapping[str, UserMetric]) -> None:
    """Check that user functions have new names.

    Raises
    ------
    InputError
        A function has the name of another figure.
    """
    for name in own:
        if name in METRICS or name in OTHER_KEYS:
            taken = ", ".join([*METRICS, *OTHER_KEYS])
            raise InputError(f"metric: expected another name than {taken}, received {name}")


def load_metrics(references: Sequence[str]) -> dict[str, UserMetric]:
    """Return user functions by the names of their figures.

    Parameters
    ----------
    references : sequence of str
        Each ``path/to/file.py:name``; the name is also the name of the figure.

    Raises
    ------
    InputError
        A function cannot be loaded, or has the name of another figure.
    """
    own: dict[str, UserMetric] = {}
    for reference in references:
        name = reference.rpartition(":")[2]
        if name in own:
            raise InputError(f"metric: expected a different name for each function, received {name} twice")
        own[name] = load_function(reference, f"metric {name}")
    check_names(own)
    return own


def own_values(own: Mapping[str, UserMetric], run: Any) -> tuple[dict[str, Any], list[str]]:
    """Return the values of user functions, and a line for each that failed; the others are not lost."""
    values: dict[str, Any] = dict.fromkeys(own)
    faults: list[str] = []
    for name, metric in own.items():
        try:
            values[name] = own_value(name, metric, run)
        except InputError as error:
            faults.append(str(error))
    return values, faults


def own_value(name: str, metric: UserMetric, run: Any) -> Any:
    """Return the value of a user function for a run, in JSON types.

    Raises
    ------
    InputError
        The function raises, or returns a value that is not in JSON types.
    """
    try:
        value = metric(run)
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # the user's code may raise anything
        raise InputError(f"metric {name}: expected a figure, it raised {exception_text(error)}") from error
    try:
        return json.loads(json.dumps(value, default=_as_plain))
    except KeyboardInterrupt:
        raise
    except BaseException:  # not JSON, or an object of the user that raises when it is read
        raise InputError(f"metric {name}: expected a value in JSON types, received {shown(value)}") from None


def _as_plain(value: object) -> Any:
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    raise TypeError
