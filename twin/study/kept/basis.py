"""What the results of a study stand on: the study, its files, the sources, the versions; each by a digest."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator
from typing import Any

from spheretwin.models.base.cache import sources_digest
from spheretwin.models.base.user_code import file_of, is_reference
from spheretwin.models.telemetry.versions import versions
from spheretwin.twin.records import facts
from spheretwin.twin.scenario import reading
from spheretwin.twin.study.row import Rows


def basis_of(rows: Rows) -> dict[str, str]:
    """Digests of study, files and sources, and the version of each package.

    Of a file, what is in it, not where it is: a study may be run from anywhere, and its folder may be moved.
    """
    study = rows.study.model_dump(mode="json", exclude={"description"})
    return {
        "study": _digest(study),
        "files": _digest(list(_contents(rows))),
        "sources": sources_digest(),
        **versions(),
    }


def digest_of(rows: Rows) -> str:
    """Digest of all that results depend on."""
    return _digest(basis_of(rows))


def _digest(told: Any) -> str:
    return hashlib.sha256(json.dumps(told, sort_keys=True).encode()).hexdigest()


def _contents(rows: Rows) -> Iterator[Any]:
    """Values of the base and of what differs from row to row, with the content of each file for its path."""
    study = rows.study
    yield reading.with_files(rows.base.model_dump(mode="json"), _content)
    named = [(axis.field, value) for axis in study.axis for value in getattr(axis, "values", ())]
    named += [("controller", dict(law)) for law in study.law]
    for dotted, value in named:
        if isinstance(value, str | list | dict):  # a number names no file
            found = reading.alone(dotted, reading.value_beside(study.folder, dotted, value))
            yield reading.with_files(found, _content)
    for name in study.metrics:
        if is_reference(name):
            yield _content(study.beside(name), "metrics")


def _content(path: str, dotted: str) -> str:
    if is_reference(path):
        return f"{facts.digest(dotted, file_of(path))}:{path.rpartition(':')[2]}"
    return str(facts.digest(dotted, path))
