"""Values as text: numbers with nine digits, long arrays by what shows lost rows, order and scale."""

import dataclasses
import math
from collections.abc import Callable

import numpy as np

FEW = 6
"""Largest number of values that are written one by one."""

KEYS = 8
"""Keys in a line."""


def number(value: object) -> str:
    """Return a number with nine digits; only whole types are without a point."""
    if isinstance(value, bool | np.bool_ | int | np.integer):
        return str(int(value)) if not isinstance(value, bool | np.bool_) else str(bool(value))
    if value is None or isinstance(value, str):
        return str(value)
    value = float(value)
    if not math.isfinite(value):
        return str(value)
    text = f"{value:.9g}"
    return text if set(text) & set(".e") else f"{text}.0"


def array(values: object) -> str:
    """Return all values of a short array; of a long one ends, range, mean and a sum weighted by the place.

    The weighted sum is the mean of (i + 1) / n times the value: it changes if rows are lost, repeated,
    swapped or reversed. Values below 1e-9 of the largest are rounding noise of sums and are written as zero.
    """
    values = (
        np.ma.filled(np.ma.asarray(values).astype(float), np.nan)
        if np.ma.isMA(values)
        else np.asarray(values)
    )
    if values.dtype.kind in "OUSM":
        return words(values.ravel().tolist())
    if values.size <= FEW and values.ndim == 1:
        return f"[{' '.join(map(number, values.tolist()))}]"
    shape = "×".join(map(str, values.shape))
    whole = values.dtype.kind in "iub"
    flat = values.astype(float).ravel()
    places = (1 + np.arange(flat.size)) / max(1, flat.size)
    there = np.isfinite(flat)
    if values.ndim == 1 and flat.size <= 3 * FEW:
        return f"[{' '.join(map(number, values.tolist()))}]"
    text = f"n={shape}"
    if not np.all(there):
        rest = flat[~there]
        kinds = [("nan", np.isnan(rest)), ("inf", rest == np.inf), ("-inf", rest == -np.inf)]
        text += "".join(f" {name}={np.count_nonzero(which)}" for name, which in kinds if np.any(which))
        text += f" at={number(float(places[~there].sum()))}"
    if not np.any(there):
        return text
    finite = flat[there]
    scale = np.abs(finite).max()
    statistics = {
        "first": finite[0], "last": finite[-1], "min": finite.min(), "max": finite.max(),
        "mean": finite.mean(), "weighted": np.mean(places[there] * finite),
    }  # fmt: skip
    if values.ndim > 1:  # neighbours within a row exchange their places
        columns = 1 + np.arange(values.shape[-1])
        weights = np.broadcast_to(columns / columns[-1] if len(columns) else columns, values.shape).ravel()[
            there
        ]
        statistics["across"] = np.mean(weights * finite)
    for name, value in statistics.items():
        exact = whole and name in ("first", "last", "min", "max")
        noise = abs(value) < 1e-9 * scale
        text += f" {name}={number(int(value) if exact else 0.0 if noise else float(value))}"
    return text


def words(texts: list) -> str:
    """Return a list of texts: few in full, of many the number and the ends."""
    if len(texts) <= 24:
        return repr([str(text) for text in texts])
    distinct = list(dict.fromkeys(map(str, texts)))
    return f"{len(texts)} texts, {len(distinct)} different: {distinct[:12]!r} … {distinct[-4:]!r}"


def plain(value: object, leaf: Callable[[object], object] | None = None) -> object:
    """Return a value as nested keys and values; `leaf` is what becomes of numbers and other objects."""
    if isinstance(value, np.ndarray):
        return array(value)
    if hasattr(value, "_asdict"):
        value = value._asdict()
    elif dataclasses.is_dataclass(value) and not isinstance(value, type):
        value = {field.name: getattr(value, field.name) for field in dataclasses.fields(value)}
    if isinstance(value, dict):
        return {str(name): plain(inside, leaf) for name, inside in value.items()}
    if isinstance(value, list | tuple):
        return [plain(inside, leaf) for inside in value]
    if isinstance(value, str | bool | int | None) or (isinstance(value, float) and not leaf):
        return value
    return (leaf or repr)(value)


def lines(value: object) -> str:
    """Return the lines of nested keys and values as one text."""
    return "\n".join(tree(value))


def tree(value: object, indent: int = 0) -> list[str]:
    """Return the lines of nested keys and values, as JSON holds them; leaves of one level share lines."""
    space = "  " * indent
    if _is_line(value):
        return [f"{space}{line}" for line in _leaf_lines(value)]
    lines = []
    for key, inside in value.items() if isinstance(value, dict) else enumerate(value):
        leaves = _leaf_lines(inside) if _is_line(inside) else []
        if len(leaves) == 1:
            lines.append(f"{space}{key}: {leaves[0]}")
        else:
            lines += [f"{space}{key}:", *tree(inside, indent + 1)]
    return lines


def _leaf_lines(value: object) -> list[str]:
    """Lines of leaves, with a fixed number of keys each: no line break depends on a value."""
    if not isinstance(value, dict):
        return [_leaf(value)]
    texts = [f"{key} {_leaf(inside)}" for key, inside in value.items()]
    return [", ".join(texts[first : first + KEYS]) for first in range(0, len(texts), KEYS)]


def _is_line(value: object) -> bool:
    """True for a leaf, a list of leaves, and keys with leaves or short lists."""
    if isinstance(value, dict):
        return bool(value) and all(_is_flat(inside) for inside in value.values())
    return _is_flat(value)


def _is_flat(value: object) -> bool:
    return not isinstance(value, dict) and not (
        isinstance(value, list | tuple) and any(isinstance(inside, dict | list | tuple) for inside in value)
    )


def _leaf(value: object) -> str:
    if isinstance(value, list | tuple):
        if len(value) > 3 * FEW and all(isinstance(each, int | float) for each in value):
            return array(value)
        return f"[{', '.join(map(_leaf, value))}]"
    return repr(str(value)) if isinstance(value, str) else number(value)
