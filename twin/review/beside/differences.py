"""How far the figures of runs are from those of the first."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

# Numbers that count nothing.
NAMES_ONLY = ("seed",)


def differences(told: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Of each run but the first, every number that a review tells of both, less that of the first.

    Axis by axis where there is one for each; None where one of the two has none.

    Parameters
    ----------
    told : sequence of mapping
        What a review tells of each run.
    """
    first, *others = told
    return [
        {
            "path": other["path"],
            **{
                name: _difference(first[name], value)
                for name, value in other.items()
                if name in first and name not in NAMES_ONLY and _counts(first[name], value)
            },
        }
        for other in others
    ]


def _counts(first: Any, value: Any) -> bool:
    """Whether both are numbers, lists of numbers as long as each other, or one of these and nothing."""
    if isinstance(first, list) and isinstance(value, list):
        return len(first) == len(value) and all(map(_counts, first, value))
    numbers = [each for each in (first, value) if each is not None]
    of_lists = all(isinstance(each, list) and all(_is_number(entry) for entry in each) for each in numbers)
    return bool(numbers) and (all(map(_is_number, numbers)) or (len(numbers) == 1 and of_lists))


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _difference(first: Any, value: Any) -> Any:
    if first is None or value is None:
        return None
    if isinstance(first, list):
        return [_difference(*pair) for pair in zip(first, value, strict=True)]
    return value - first
