"""Reuse of results for arguments that are the same objects: rows of a study share most of a scenario."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any, TypeVar, cast

from spheretwin.models.base.columns import Columns

F = TypeVar("F", bound=Callable[..., Any])

MOST_RESULTS = 64


def reused(function: F) -> F:
    """Store the results of a function of immutable objects; comparing the objects would cost more.

    The result must not be changed by its users.
    """
    results: dict[tuple[int, ...], tuple[tuple[Any, ...], Any]] = {}

    @wraps(function)
    def call(*arguments: Any) -> Any:
        if any(isinstance(argument, Columns) for argument in arguments):
            return function(*arguments)  # of one block alone
        key = tuple(map(id, arguments))
        stored = results.get(key)
        if stored is None:
            if len(results) >= MOST_RESULTS:
                results.clear()
            # With its arguments: the identity of an object that is gone could be that of another one.
            stored = results[key] = arguments, function(*arguments)
        return stored[1]

    return cast("F", call)
