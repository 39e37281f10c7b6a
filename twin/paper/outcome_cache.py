"""Outcomes of earlier runs of an experiment in the cache folder: lines of a key and its outcome as JSON."""

from __future__ import annotations

import json
import time
from collections.abc import Mapping
from enum import Enum
from types import UnionType
from typing import TYPE_CHECKING, Any, Union, get_args, get_origin, get_type_hints

import numpy as np

from spheretwin.models.base.cache import load_entry, store_entry
from spheretwin.paper.experiment import Outcome

if TYPE_CHECKING:
    from spheretwin.paper.runner import CaseSummary, Job, Plan

SAVE_INTERVAL_s = 30.0
"""Time whose results a killed process loses at most."""


class OutcomeCache:
    """Outcomes of earlier runs of an experiment; only one thread adds.

    Parameters
    ----------
    plan : Plan
    summaries : mapping
        `summarise` of the plan.
    """

    def __init__(self, plan: Plan, summaries: Mapping[str, CaseSummary]) -> None:
        self._summaries, self._entry = summaries, f"reproduce_{plan.experiment.name}.jsonl"
        self._data_type = get_type_hints(plan.experiment.reduce).get("return", Any)
        lines = (load_entry(self._entry) or b"").decode().splitlines()
        self._texts = dict(line.split("\t", 1) for line in lines)
        self._saved_s, self._changed = time.monotonic(), False

    def find(self, job: Job) -> Outcome | None:
        """Outcome of an earlier run; None if there is none."""
        text = self._texts.get(self._key(job))
        if text is None:
            return None
        outcome: Outcome = decoded(Outcome, json.loads(text))
        return outcome._replace(data=decoded(self._data_type, outcome.data))

    def add(self, job: Job, outcome: Outcome) -> None:
        """Add an outcome; save all of them at intervals."""
        self._texts[self._key(job)] = json.dumps(plain(outcome), separators=(",", ":"))
        self._changed = True
        if time.monotonic() - self._saved_s > SAVE_INTERVAL_s:
            self.save()

    def save(self) -> None:
        """Save new outcomes if the cache can be written."""
        if self._changed:
            lines = (f"{key}\t{text}\n" for key, text in self._texts.items())
            store_entry(self._entry, "".join(lines).encode())
            self._saved_s, self._changed = time.monotonic(), False

    def _key(self, job: Job) -> str:
        return f"{self._summaries[job.case.name].key} {job.plant} {job.seed}"


def plain(value: Any) -> Any:
    """Return a value in JSON types; an array becomes its shape and numbers, two for a complex one."""
    if isinstance(value, np.ndarray):
        numbers = np.ascontiguousarray(value).ravel()
        return [value.shape, (numbers.view(np.float64) if np.iscomplexobj(numbers) else numbers).tolist()]
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, Mapping):
        return {key: plain(entry) for key, entry in value.items()}
    return [plain(entry) for entry in value] if isinstance(value, list | tuple) else value


def decoded(kind: Any, value: Any) -> Any:
    """Return a value of a type from its `plain` form; a type that is not declared stays as it is in JSON."""
    origin, kinds = get_origin(kind), get_args(kind)
    if origin in (UnionType, Union):
        (kind,) = (option for option in kinds if option is not type(None))
        return None if value is None else decoded(kind, value)
    if origin is np.ndarray:
        (number,) = get_args(kinds[1])
        shape, numbers = value
        return (
            np.array(numbers, np.float64 if number is np.complex128 else number).view(number).reshape(shape)
        )
    if origin is tuple:
        each = kinds[:1] * len(value) if kinds[1:] == (...,) else kinds
        return tuple(decoded(inner, entry) for inner, entry in zip(each, value, strict=True))
    if isinstance(kind, type) and issubclass(kind, Enum):
        return kind(value)
    if hasattr(kind, "_fields"):
        return kind(*(decoded(inner, entry) for inner, entry in zip(_types(kind), value, strict=True)))
    return value


def _types(kind: Any) -> list[Any]:
    """Return the types of the fields of a named tuple, in its order."""
    hints = get_type_hints(kind)
    return [hints[name] for name in kind._fields]
