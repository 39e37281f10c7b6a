"""Rows of a study: values, law and seed of each row follow from its number.

Axes that are zipped go together, all other axes are crossed, and so are the points of the random ones, the
laws and the seeds. The last of them changes fastest. Rows are not listed, so that a study of millions takes
no memory.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.base.errors import InputError, shown
from spheretwin.study.axes import ListedAxis
from spheretwin.study.study import Study, repeated

KEY_LENGTH = 16

# At a millisecond a row, beyond this a study takes more than a day.
MOST_ROWS = 10**8

# Separates the random points of the axes from other random numbers with the same seed.
STAGE = 301


class Row(NamedTuple):
    """One run of a study."""

    number: int
    key: str
    """Digest of its values, its law and its repeat."""
    seed: int
    values: Mapping[str, Any]
    """Value of each axis by its field."""
    law: Mapping[str, Any] | None
    repeat: int


class Grid:
    """All rows of a study.

    Parameters
    ----------
    study : Study

    Raises
    ------
    InputError
        Zipped axes are not equally long, or there are too many rows.
    """

    def __init__(self, study: Study) -> None:
        self._study = study
        self._groups = list(_groups(study).values())
        for group in self._groups:
            _check_lengths(study, group)
        self._points = _points(study)
        self._drawn = [axis.field for axis in study.drawn_axes]
        self._fields = [axis.field for axis in study.axis]
        self._laws: Sequence[Mapping[str, Any] | None] = study.law or (None,)
        self._sizes = [
            *(len(group[next(iter(group))]) for group in self._groups),
            len(self._points),
            len(self._laws),
            study.seeds,
        ]
        self._rows = 1
        for size in self._sizes:
            self._rows *= size
        if self._rows > MOST_ROWS:
            raise InputError(f"study {study.name}: expected at most {MOST_ROWS} rows, received {self._rows}")
        for group in self._groups:
            _check_values(study, group)

    def __len__(self) -> int:
        return self._rows

    def __iter__(self) -> Iterator[Row]:
        return (self[number] for number in range(len(self)))

    def __getitem__(self, number: int) -> Row:
        return self.row(number)

    def row(self, number: int, key: str | None = None) -> Row:
        """Row of a number; a known key need not be computed again."""
        if not 0 <= number < self._rows:
            raise IndexError(number)
        *places, point, law, repeat = _mixed(number, self._sizes)
        values: dict[str, Any] = {}
        for group, place in zip(self._groups, places, strict=True):
            values |= {field: listed[place] for field, listed in group.items()}
        values |= zip(self._drawn, self._points[point].tolist(), strict=True)
        ordered = {field: values[field] for field in self._fields}
        key = key or _key(ordered, self._laws[law], repeat)
        drawn_from = f"repeat {repeat}" if self._study.common_seeds else key
        return Row(number, key, _seed(self._study.seed, drawn_from), ordered, self._laws[law], repeat)

    def values(self, field: str) -> list[Any] | None:
        """All values of a listed axis; None for a random axis."""
        return next((group[field] for group in self._groups if field in group), None)

    def of_law(self, law: int, most: int) -> Iterator[Row]:
        """Some rows of a law, evenly spaced from its first to its last."""
        outer = self._rows // (len(self._laws) * self._study.seeds)
        for place in dict.fromkeys(np.linspace(0, outer - 1, min(most, outer)).round().astype(int).tolist()):
            yield self[(place * len(self._laws) + law) * self._study.seeds]

    @property
    def laws(self) -> int:
        """Number of laws; 1 for the law of the scenario alone."""
        return len(self._laws)

    def of(self, key: str) -> Row:
        """Row of a key.

        Raises
        ------
        InputError
            There is no such row.
        """
        for row in self:
            if row.key == key:
                return row
        raise InputError(f"study {self._study.name}: expected the key of one of its rows, received {key}")


def _groups(study: Study) -> dict[str, dict[str, list[Any]]]:
    """Zipped axes: values by field, by the name of the group."""
    groups: dict[str, dict[str, list[Any]]] = {}
    for place, axis in enumerate(study.axis):
        if isinstance(axis, ListedAxis):
            name = f"zip {axis.zip}" if axis.zip is not None else f"axis {place}"
            groups.setdefault(name, {})[axis.field] = axis.listed()
    return groups


def _check_lengths(study: Study, group: Mapping[str, list[Any]]) -> None:
    """Check that zipped axes have equal lengths."""
    lengths = {field: len(values) for field, values in group.items()}
    if len(set(lengths.values())) > 1:
        listed = ", ".join(f"{length} of {field}" for field, length in lengths.items())
        raise InputError(f"study {study.name}: expected zipped axes of equal length, received {listed}")


def _check_values(study: Study, group: Mapping[str, list[Any]]) -> None:
    """Check that no two values are equal, as their rows would be equal too."""
    if twice := repeated(zip(*group.values(), strict=True)):
        listed = ", ".join(map(shown, twice[0]))
        raise InputError(
            f"study {study.name}: expected different values of {', '.join(group)}, received {listed} twice"
        )


def _points(study: Study) -> NDArray[np.float64]:
    """Values of the random axes, (samples, axes); one empty point without such axes."""
    axes = study.drawn_axes
    if not axes:
        return np.empty((1, 0))
    points = _uniform(study, len(axes), study.samples or 1)
    for place, axis in enumerate(axes):  # in place: a million rows take 8 MB an axis
        points[:, place] = axis.quantile(points[:, place])
    return points


def _uniform(study: Study, axes: int, samples: int) -> NDArray[np.float64]:
    """Points in the unit cube, (samples, axes), none on its faces."""
    generator = np.random.default_rng([study.seed, STAGE])
    if study.design == "random":
        points = generator.random((samples, axes))
    elif study.design == "sobol":
        from scipy.stats import qmc  # slow to import

        # A power of two of points is generated: a longer study begins with the same points.
        points = qmc.Sobol(axes, rng=generator).random_base2((samples - 1).bit_length())[:samples]
    else:
        points = _latin_hypercube(generator, axes, samples)
    return np.clip(points, np.finfo(float).eps, 1 - np.finfo(float).eps, out=points)


def _latin_hypercube(generator: np.random.Generator, axes: int, samples: int) -> NDArray[np.float64]:
    """Points (samples, axes) of which each axis has one in each of `samples` equal intervals.

    They are those of ``scipy.stats.qmc.LatinHypercube``, whose import takes as long as 150 rows.
    """
    generator = generator.spawn(1)[0]
    points = generator.random((samples, axes))
    for axis in range(axes):
        places = np.arange(1, samples + 1)
        generator.shuffle(places)
        points[:, axis] = (places - points[:, axis]) / samples
    return points


def _mixed(number: int, sizes: Sequence[int]) -> list[int]:
    """Digits of a number to mixed bases, the last one fastest."""
    places: list[int] = []
    for size in reversed(sizes):
        number, place = divmod(number, size)
        places.append(place)
    return places[::-1]


def _key(values: Mapping[str, Any], law: Mapping[str, Any] | None, repeat: int) -> str:
    text = json.dumps([values, law, repeat], sort_keys=True)
    return hashlib.sha256(text.encode()).hexdigest()[:KEY_LENGTH]


def _seed(study_seed: int, key: str) -> int:
    """Seed of a row, from the study's and a key; below 2**53, so that JSON keeps it whole."""
    digest = hashlib.sha256(f"{study_seed} {key}".encode()).digest()
    return int.from_bytes(digest[:8], "big") >> 11
