"""Outcomes of earlier runs, in the cache of the package: what was computed already is not run again.

The cache's folder is named by a digest of the sources and of what they are compiled with, so that an edit of
the package forgets them all. An outcome is known by all else that it depends on: the scenario with its seed
and its plant, and the contents of every file that it names.
"""

from __future__ import annotations

import hashlib
import json
import pickle
import time
from collections.abc import Mapping
from functools import cache

from spheretwin.models import mjcf
from spheretwin.models.actuator import MJCF_PATH, TORQUE_CURVE_PATH
from spheretwin.models.base.cache import keep, kept
from spheretwin.models.telemetry.versions import versions
from spheretwin.twin.records.facts import digest
from spheretwin.twin.reproduce.experiment import Outcome
from spheretwin.twin.scenario.reading import named_files
from spheretwin.twin.scenario.sections import Scenario

EVERY_s = 30.0
"""What a killed process loses at most."""


class Memory:
    """Outcomes of an experiment's runs by their keys; told to by one thread, asked by any.

    Parameters
    ----------
    name : str
        Of the experiment, which keeps things of its own of each run.
    keys : mapping
        `key_of` of each case, by its name.
    """

    def __init__(self, name: str, keys: Mapping[str, str]) -> None:
        self._keys = keys
        self._entry = f"reproduce_{name}.pickle"
        content = kept(self._entry)
        # What lies there beside it is machine code: the folder is trusted.
        self._outcomes: dict[str, Outcome] = pickle.loads(content) if content else {}
        self._saved_s, self._new = time.monotonic(), 0

    def find(self, case: str, plant: str | None, seed: int) -> Outcome | None:
        """Outcome of an earlier run; None where there was none."""
        return self._outcomes.get(self._key(case, plant, seed))

    def add(self, case: str, plant: str | None, seed: int, outcome: Outcome) -> None:
        """Take an outcome, and save all now and then."""
        self._outcomes[self._key(case, plant, seed)] = outcome
        self._new += 1
        if time.monotonic() - self._saved_s > EVERY_s:
            self.save()

    def save(self) -> None:
        """Save what is new, unless the cache cannot take it."""
        if self._new:
            keep(self._entry, pickle.dumps(self._outcomes))
            self._saved_s, self._new = time.monotonic(), 0

    def _key(self, case: str, plant: str | None, seed: int) -> str:
        return f"{self._keys[case]} {plant} {seed}"


def key_of(scenario: Scenario) -> str:
    """What tells a scenario from any other but for plant and seed, as long as the sources are the same."""
    fields = scenario.model_dump(mode="json", exclude={"seed": True, "plant": {"engine"}})
    files = {path: digest(dotted, path) for path, dotted in named_files(fields)}
    told = json.dumps([fields, files, _shipped(), versions()], sort_keys=True)
    return hashlib.sha256(told.encode()).hexdigest()[:32]


@cache
def _shipped() -> tuple[str | None, ...]:
    """Digests of the model and the curve that are used where no other is named."""
    return mjcf.contents_digest(MJCF_PATH), digest("plant.torque_curve", str(TORQUE_CURVE_PATH))
