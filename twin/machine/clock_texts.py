"""Times as texts: dates and clock times of spreadsheets and loggers, and durations with a unit."""

from __future__ import annotations

import re
from collections.abc import Sequence
from datetime import UTC, datetime
from functools import lru_cache

import numpy as np

from spheretwin.models.base.arrays import Array

_UNITS_us = {"s": 1e6, "sec": 1e6, "seconds": 1e6, "ms": 1e3, "msec": 1e3, "us": 1.0, "µs": 1.0, "ns": 1e-3}

# 14:17:33.001, also with a day, a date in any order, a decimal comma, a zone.
_CLOCK = re.compile(
    r"(?:(?P<date>\d{1,4}[-./]\d{1,2}[-./]\d{1,4}),?[ T]+)?"
    r"(?P<hour>\d{1,4}):(?P<minute>\d{2})(?::(?P<second>\d{2}(?:[.,:]\d+)?))?"
    r"(?: ?(?P<half>[AaPp])\.?[Mm]\.?)?(?: ?(?P<zone>Z|[+-]\d{2}:?\d{2}|UTC|GMT))?$"
)
_DURATION = re.compile(r"([+-]?\d+(?:[.,]\d*)?(?:[eE][+-]?\d+)?) ?([a-zµ]+)$")


def seconds_of_texts(texts: Sequence[str | None]) -> tuple[Array, int | None, bool]:
    """Return times in µs, the first row that is no time or None, and True for a clock without a date."""
    values = np.full(len(texts), np.nan)
    is_clock = False
    for row, text in enumerate(texts):
        if text is None:
            continue
        value, without_date = _microseconds(text)
        if value is None:
            return values, row, False
        values[row] = value
        is_clock = is_clock or without_date
    return values, None, is_clock


def _microseconds(text: str) -> tuple[float | None, bool]:
    if match := _DURATION.match(text):
        factor = _UNITS_us.get(match[2])
        return (None if factor is None else factor * float(match[1].replace(",", "."))), False
    match = _CLOCK.match(text)
    if match is None:
        return None, False
    whole, _, fraction = re.sub("[,:]", ".", match["second"] or "0").partition(".")
    hour = int(match["hour"])
    if match["half"]:
        hour = hour % 12 + 12 * (match["half"] in "Pp")
    clock_us = 1e6 * (60 * (60 * hour + int(match["minute"])) + int(whole))
    clock_us += float(f"0.{fraction or 0}") * 1e6
    if not match["date"]:
        return clock_us, True
    day_s = _day(match["date"])
    return (None if day_s is None else 1e6 * day_s + clock_us), False


@lru_cache
def _day(text: str) -> float | None:
    """Return a date, s since 1970; its order matters only for the date of the first row."""
    mark = next(mark for mark in "-./" if mark in text)
    orders = ("%Y{0}%m{0}%d", "%d{0}%m{0}%Y", "%m{0}%d{0}%Y", "%d{0}%m{0}%y")
    for order in orders if mark != "/" else (orders[0], orders[2], orders[1], "%m{0}%d{0}%y"):
        try:
            return datetime.strptime(text, order.format(mark)).replace(tzinfo=UTC).timestamp()
        except ValueError:
            continue
    return None
