"""Results of earlier runs of an experiment, and what a run depends on."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from contextlib import suppress
from functools import cache
from typing import TYPE_CHECKING

from spheretwin.models import mjcf
from spheretwin.models.actuator import MJCF_PATH, TORQUE_CURVE_PATH
from spheretwin.models.base.cache import cache_folder
from spheretwin.models.base.errors import SpheretwinError
from spheretwin.models.telemetry.run_record import versions
from spheretwin.records.provenance import digest
from spheretwin.scenario.reading import named_files
from spheretwin.scenario.sections import Scenario
from spheretwin.study.journal import Journal
from spheretwin.study.row import RowResult

if TYPE_CHECKING:
    from spheretwin.paper.runner import CaseRun

MOST_RUNS = 1_000_000
"""Largest number of runs of an experiment that are cached."""


def key_of(scenario: Scenario) -> str:
    """Digest of everything that a run depends on, except plant, seed and sources."""
    fields = scenario.model_dump(mode="json", exclude={"seed": True, "plant": {"engine"}})
    files = {path: digest(dotted, path) for path, dotted in named_files(fields)}
    content = json.dumps([fields, files, _shipped(), versions()], sort_keys=True)
    return hashlib.sha256(content.encode()).hexdigest()[:32]


@cache
def _shipped() -> tuple[str | None, ...]:
    """Digests of the shipped model and torque curve."""
    return mjcf.contents_digest(MJCF_PATH), digest("plant.torque_curve", str(TORQUE_CURVE_PATH))


class EarlierRuns:
    """Results of earlier runs of an experiment, in a journal of the cache folder.

    Nothing is kept if there is no such folder, or if another process writes the journal.

    Parameters
    ----------
    experiment : str
        Its name.
    keys : mapping of str
        `key_of` the scenario of each case by its name.
    """

    def __init__(self, experiment: str, keys: Mapping[str, str]) -> None:
        self._keys, self._results = keys, dict[str, RowResult]()
        self._journal: Journal | None = None
        if folder := cache_folder():
            with suppress(SpheretwinError):
                self._journal = Journal(folder / f"reproduce_{experiment}.jsonl", "", MOST_RUNS)
                self._results = {key: RowResult(*rest) for _, (key, *rest) in self._journal.records()}

    def __enter__(self) -> EarlierRuns:
        return self

    def __exit__(self, *_: object) -> None:
        if self._journal:
            self._journal.close()

    def find(self, job: CaseRun) -> RowResult | None:
        """Result of an earlier run; None if there is none."""
        return self._results.get(self._key(job))

    def add(self, job: CaseRun, result: RowResult) -> None:
        """Store a result if the journal can be written."""
        self._results[self._key(job)] = result
        if self._journal and self._journal.done() < MOST_RUNS:
            with suppress(SpheretwinError):  # a full disk
                self._journal.append(self._journal.done(), [self._key(job), *result])

    def _key(self, job: CaseRun) -> str:
        return f"{self._keys[job.case.name]} {job.plant} {job.seed}"
