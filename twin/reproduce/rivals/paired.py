"""AFSM-ESO's preset for the prototype against rivals at their best settings, seed by seed."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from spheretwin.twin.reproduce.experiment import Finding, Outcomes, Section, Table
from spheretwin.twin.reproduce.laws import BY_LAW
from spheretwin.twin.reproduce.rivals.conditions import (
    FRICTION,
    PAIRED,
    PROTOTYPE,
    GOVERNED_rad_s2,
    Setting,
)
from spheretwin.twin.reproduce.rivals.families import PRESET
from spheretwin.twin.reproduce.rivals.fronts import LARGEST, Point, best, points, worst_rad
from spheretwin.twin.reproduce.rows import figures_named

HOW = (
    f"AFSM-ESO with its preset `{PRESET}` (factor 1) and, where another setting has less error, at that,"
    " against each rival at the setting of its family with the least error, and at the one with the least"
    " error of those that vary the currents no more. Seeds are paired: each draws the same sensors for both."
    f" *Governed* are all of them behind a governor of {GOVERNED_rad_s2:g} rad/s² with {FRICTION:g} of the"
    " friction fed forward. PID leaves out the reference's acceleration, so that a governor alone only holds"
    " it back: its torque is fed forward to it."
)
HEAD = (
    "hardware",
    "rival",
    "its setting",
    "AFSM-ESO's",
    "rival, degrees",
    "at A/s",
    "AFSM-ESO, degrees",
    "at A/s",
    "less error",
    "less variation",
    "less of both",
)


class Pair(NamedTuple):
    """A law against a rival under the same seeds."""

    setting: Setting
    rival: Point
    ours: Point
    less_error: tuple[bool, ...]
    less_variation: tuple[bool, ...]

    @property
    def seeds(self) -> int:
        """How many there are."""
        return len(self.less_error)

    @property
    def both(self) -> int:
        """Under how many of them it is better in both."""
        return sum(a and b for a, b in zip(self.less_error, self.less_variation, strict=True))


def pairs(setting: Setting, outcomes: Outcomes) -> list[Pair]:
    """Every pair that was run, the preset's before those of the law's own best setting."""
    return [_pair(setting, outcomes, ours, rival) for ours, rival in _matches(points(setting, outcomes))]


def _matches(of: Sequence[Point]) -> Iterator[tuple[Point, Point]]:
    own = [each for each in of if each.law == PAIRED[0] and not each.preset]
    preset = next((each for each in own if each.shipped), None)
    for ours in dict.fromkeys(each for each in (preset, best(own)) if each):
        for law in PAIRED[1:]:
            theirs = [each for each in of if each.law == law]
            rivals = (best(theirs), best(theirs, ours.variation_A_s))
            yield from ((ours, each) for each in dict.fromkeys(rivals) if each)


def _pair(setting: Setting, outcomes: Outcomes, ours: Point, rival: Point) -> Pair:
    own, other = outcomes[ours.case], outcomes[rival.case]
    seeds = min(len(own), len(other))
    errors = [worst_rad(setting, runs[:seeds], LARGEST) for runs in (own, other)]
    variations = [figures_named(runs[:seeds], "current_variation_A_s") for runs in (own, other)]
    return Pair(
        setting,
        rival,
        ours,
        tuple((errors[0] < errors[1]).tolist()),
        tuple((variations[0] < variations[1]).tolist()),
    )


def section(outcomes: Outcomes) -> Section:
    """All pairs as a table."""
    title = "Largest true error of α and β, medians; under how many seeds AFSM-ESO has less"
    rows = [_row(pair) for setting in PROTOTYPE for pair in pairs(setting, outcomes)]
    return Section("Paired on the prototype", HOW, [Table(title, HEAD, rows, 4)])


def _row(pair: Pair) -> tuple[str, ...]:
    rival, ours = pair.rival, pair.ours
    return (
        pair.setting.name,
        BY_LAW[rival.law].label,
        rival.gain,
        ours.gain,
        f"{np.degrees(rival.largest_rad):.4f}",
        f"{rival.variation_A_s:.1f}",
        f"{np.degrees(ours.largest_rad):.4f}",
        f"{ours.variation_A_s:.1f}",
        *(f"{sum(each)} of {pair.seeds}" for each in (pair.less_error, pair.less_variation)),
        f"{pair.both} of {pair.seeds}",
    )


def findings(outcomes: Outcomes) -> list[Finding]:
    """Whether the preset has less error and less variation than each rival at its least error."""
    found = []
    for setting in PROTOTYPE:
        of = points(setting, outcomes)
        least = [best([each for each in of if each.law == law]) for law in PAIRED[1:]]
        told = [_said(pair) for pair in pairs(setting, outcomes) if pair.ours.shipped and pair.rival in least]
        if told:
            said = f"{setting.title}, AFSM-ESO's preset `{PRESET}` against rivals at their least error"
            found.append(Finding(None, f"{said}: {'; '.join(told)}"))
    return found


def _said(pair: Pair) -> str:
    ours, rival = (
        f"{np.degrees(each.largest_rad):.3f}° at {each.variation_A_s:.0f} A/s"
        for each in (pair.ours, pair.rival)
    )
    return (
        f"{ours} against {BY_LAW[pair.rival.law].label}'s {rival} ({pair.rival.gain}), less error under"
        f" {sum(pair.less_error)} and less variation under {sum(pair.less_variation)} of {pair.seeds} seeds"
    )
