"""What is told of the fronts: each law's best within a variation, and how far it is behind all."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence

import numpy as np

from spheretwin.twin.reproduce.experiment import Finding, Outcomes, Table
from spheretwin.twin.reproduce.laws import BY_LAW, OF_PAPER
from spheretwin.twin.reproduce.rivals.conditions import SETTINGS, Setting
from spheretwin.twin.reproduce.rivals.families import FAMILIES
from spheretwin.twin.reproduce.rivals.fronts import (
    LARGEST,
    TAIL,
    Point,
    beaten,
    behind,
    best,
    on_front,
    points,
)

NAMED = {LARGEST: "largest error", TAIL: "tail RMS"}
NONE = "–"


def families() -> Table:
    """The number of each law, and its settings."""
    rows: list[tuple[str, ...]] = [
        (
            BY_LAW[family.law].label,
            f"{family.symbol}, {family.unit}".removesuffix(", "),
            family.aside or NONE,
            f"{family.shipped:g}",
            f"{family.shipped * family.ratios[0]:.3g} to {family.shipped * family.ratios[-1]:.3g}",
        )
        for family in FAMILIES
    ]
    return Table("Families of gains", ("law", "number", "with it", "as shipped", "from … to"), rows, 3)


def table(setting: Setting, outcomes: Outcomes) -> Table:
    """Each law as shipped, and at its least error within either variation."""
    of = points(setting, outcomes)
    unit = "degrees" if setting.prototype else "mrad"
    bounds = tuple(f"least within {bound:g} A/s" for bound in setting.bounds_A_s)
    rows = [
        (
            BY_LAW[law].label,
            *(_cell(setting, point) for point in _chosen(setting, [each for each in of if each.law == law])),
            *(_ratio(behind(law, of, setting.bounds_A_s[1], error)) for error in NAMED),
        )
        for law in setting.laws
        if any(each.law == law for each in of)
    ]
    head = ("law", "as its family begins", *bounds, *(f"behind there, {name}" for name in NAMED.values()))
    return Table(f"{setting.title}: largest / tail RMS in {unit}, at A/s", head, rows, 2 + len(bounds))


def _chosen(setting: Setting, of: Sequence[Point]) -> list[Point | None]:
    shipped = next((each for each in of if each.shipped), None)
    return [shipped, *(best(of, bound) for bound in setting.bounds_A_s)]


def _cell(setting: Setting, point: Point | None) -> str:
    if point is None:
        return NONE
    if not np.isfinite(point.variation_A_s):
        return "lost"
    errors = (point.largest_rad, point.tail_rad)
    told = [f"{np.degrees(each):.3f}" if setting.prototype else f"{1e3 * each:.3g}" for each in errors]
    return f"{' / '.join(told)} at {point.variation_A_s:.3g} ({point.gain})"


def _ratio(value: float | None) -> str:
    return NONE if value is None else f"{value:.2f}"


def findings(outcomes: Outcomes) -> list[Finding]:
    """Whose points the common fronts of the largest error are, and where the paper's laws are."""
    return [found for setting in SETTINGS if (found := _of_front(setting, points(setting, outcomes)))]


def _of_front(setting: Setting, of: Sequence[Point]) -> Finding | None:
    on = Counter(each.law for each in on_front(of, LARGEST))
    if not on:
        return None
    whose = ", ".join(f"{BY_LAW[law].label} {count}" for law, count in on.most_common())
    said = f"{setting.title}: the common front of largest error and variation has points of {whose}"
    return Finding(None, "; ".join([said, *_of_paper(setting, of)]))


def _of_paper(setting: Setting, of: Sequence[Point]) -> Iterator[str]:
    """How far its laws are behind, and what the switching of AFSM is worth beside adaptive fuzzy."""
    bound = setting.bounds_A_s[1]
    ratios = {law.label: behind(law.law, of, bound, LARGEST) for law in OF_PAPER}
    told = ", ".join(f"{label} {ratio:.1f}" for label, ratio in ratios.items() if ratio)
    if told:
        yield f"within {bound:g} A/s the paper's laws leave {told} times the least error of all"
    afsm, fuzzy = ([each for each in of if each.law == law] for law in ("afsm", "adaptive_fuzzy"))
    front = on_front(afsm, LARGEST)
    if front and fuzzy:
        beats = beaten(front, fuzzy, LARGEST)
        yield f"adaptive fuzzy has less of both than {beats} of the {len(front)} points of AFSM's front"
