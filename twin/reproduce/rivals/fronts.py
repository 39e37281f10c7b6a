"""Points of the laws, and their fronts: what none of them beats in error and variation at once."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.telemetry.status import Status
from spheretwin.twin.reproduce.experiment import Array, Outcome, Outcomes
from spheretwin.twin.reproduce.rivals.conditions import Setting, case, marked, presets
from spheretwin.twin.reproduce.rows import ERRORS, figures_named

LARGEST, TAIL = "max_abs_error", "tail_rms_error"


class Point(NamedTuple):
    """A law at one setting: what of it are medians over the seeds is no number where any run was lost."""

    law: str
    gain: str
    case: str
    variation_A_s: float
    largest_rad: float
    tail_rad: float
    shipped: bool = False
    """Whether its family begins here."""
    preset: str = ""

    def error_rad(self, error: str) -> float:
        """One of its two errors, by name."""
        return self.largest_rad if error == LARGEST else self.tail_rad


def points(setting: Setting, outcomes: Outcomes) -> list[Point]:
    """All that was run of a setting, law by law."""
    found = []
    for family in setting.families:
        for ratio in family.ratios:
            of = case(setting, family, ratio).name
            if of in outcomes:
                told = _medians(setting, outcomes[of])
                found.append(Point(family.law, family.label(ratio), of, *told, shipped=ratio == 1))
    for preset in presets(setting):
        of = marked(setting, preset).name
        if of in outcomes:
            told = _medians(setting, outcomes[of])
            found.append(Point("afsm_eso", f"preset {preset}", of, *told, preset=preset))
    return found


def worst_rad(setting: Setting, found: Sequence[Outcome], error: str) -> Array:
    """An error of the worst hinge that counts, for each seed."""
    return np.array([ERRORS[error](outcome)[list(setting.hinges)].max() for outcome in found])


def _medians(setting: Setting, found: Sequence[Outcome]) -> tuple[float, float, float]:
    if any(outcome.status != Status.COMPLETED for outcome in found):
        return np.nan, np.nan, np.nan
    variation = np.median(figures_named(found, "current_variation_A_s"))
    largest, tail = (np.median(worst_rad(setting, found, error)) for error in (LARGEST, TAIL))
    return float(variation), float(largest), float(tail)


def plane(of: Sequence[Point], error: str) -> Array:
    """(n, 2) variation in A/s and error in rad."""
    return np.array([(each.variation_A_s, each.error_rad(error)) for each in of]).reshape(-1, 2)


def front(values: Array) -> NDArray[np.bool_]:
    """Which points none is better than in one coordinate and as good in the other.

    Parameters
    ----------
    values : (n, 2) array
        Both to be small; a row without numbers is on no front.

    Returns
    -------
    (n,) bool array
    """
    kept = np.zeros(len(values), dtype=np.bool_)
    lowest, last = np.inf, (np.nan, np.nan)
    for place in np.lexsort((values[:, 1], values[:, 0])):
        x, y = values[place]
        if np.isfinite(x) and (y < lowest or (x, y) == last):
            kept[place], lowest, last = True, y, (x, y)
    return kept


def on_front(of: Sequence[Point], error: str) -> list[Point]:
    """Those of some points that are on their front, by ascending variation."""
    kept = front(plane(of, error))
    return sorted(
        (each for each, is_on in zip(of, kept, strict=True) if is_on), key=lambda each: each.variation_A_s
    )


def best(of: Sequence[Point], bound_A_s: float = np.inf, error: str = LARGEST) -> Point | None:
    """The one with the least error within a variation; None where none is within."""
    within = [each for each in of if each.variation_A_s <= bound_A_s]
    return min(within, key=lambda each: each.error_rad(error), default=None)


def behind(law: str, of: Sequence[Point], bound_A_s: float, error: str) -> float | None:
    """Least error of a law over the least of all, both within a variation; None where it has none within."""
    own, least = (best(some, bound_A_s, error) for some in ([each for each in of if each.law == law], of))
    return own.error_rad(error) / least.error_rad(error) if own and least else None


def beaten(front_of: Sequence[Point], by: Sequence[Point], error: str) -> int:
    """How many of some points another law's are better than in both."""
    return sum(
        any(
            other.variation_A_s < each.variation_A_s and other.error_rad(error) < each.error_rad(error)
            for other in by
        )
        for each in front_of
    )
