"""The columns of a run as a file of their own, bit for bit: CSV or Parquet."""

from __future__ import annotations

import csv
from pathlib import Path

from spheretwin.models.base.errors import InputError
from spheretwin.models.base.files import whole_file
from spheretwin.models.base.wording import shown
from spheretwin.models.telemetry.signals import Signal
from spheretwin.twin.review.run import Reviewed

KINDS = (".csv", ".parquet")


def check(path: Path) -> None:
    """Refuse a file of another kind.

    Raises
    ------
    InputError
        Its name does not end in one that is known.
    """
    if path.suffix not in KINDS:
        raise InputError(
            f"command line: expected --export FILE.csv or FILE.parquet, received {shown(str(path))}"
        )


def export(run: Reviewed, path: Path) -> None:
    """Write all columns of a run; each number in CSV as Python writes it, which no bit is lost by.

    Raises
    ------
    InputError, SpheretwinError
        The file cannot be written; what was there before is untouched.
    """
    if path.suffix == ".parquet":
        run.table.write_parquet(path, run.metadata)
        return
    with whole_file(path) as temporary, temporary.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow([name for signal in run.table.signals for name in headings(signal)])
        writer.writerows(map(repr, row) for row in run.table.values.tolist())


def headings(signal: Signal) -> list[str]:
    """Heading of each entry of a signal: its name, which ends in its unit, and its label or place."""
    if signal.size == 1:
        return [signal.name]
    labels = signal.labels or tuple(map(str, range(signal.size)))
    return [f"{signal.name}[{label}]" for label in labels]
