"""Signals of a run: named telemetry columns with units."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import accumulate, groupby

from spheretwin.models.base.errors import InputError, shown


@dataclass(frozen=True)
class Signal:
    """One column of telemetry.

    Attributes
    ----------
    name : str
        Name of the column.
    unit : str
        Unit of every entry.
    size : int
        Numbers per row, at least 1.
    meaning : str
        Description for tables and figures.
    labels : tuple of str
        A short name for each entry of a vector, without commas; or none.
    states : tuple of str
        Names of the states if the values 0, 1, 2, ... are states, without commas; or none.

    Raises
    ------
    InputError
        The name is not a text or is empty, the size is not a whole number above 0, the labels do not fit it,
        or a state has no name.
    """

    name: str
    unit: str
    size: int
    meaning: str
    labels: tuple[str, ...] = ()
    states: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        if not _is_text(self.name) or not self.name:
            raise InputError(f"signal: expected a name of printable characters, received {shown(self.name)}")
        for field in ("unit", "meaning"):
            if not _is_text(getattr(self, field)):
                raise InputError(
                    f"signal {self.name}: expected {field} as printable text,"
                    f" received {shown(getattr(self, field))}"
                )
        # With a size below 1 the loop would write outside its rows.
        if not isinstance(self.size, int) or isinstance(self.size, bool) or self.size < 1:
            raise InputError(
                f"signal {self.name}: expected size as a whole number above 0, received {shown(self.size)}"
            )
        for field in ("labels", "states"):
            named = getattr(self, field)
            if not isinstance(named, tuple | list) or not all(map(_is_label, named)):
                raise InputError(
                    f"signal {self.name}: expected {field} as texts without commas, received {shown(named)}"
                )
            object.__setattr__(self, field, tuple(named))
        if len(self.labels) not in (0, self.size):
            raise InputError(
                f"signal {self.name}: expected {self.size} labels or none, received {len(self.labels)}"
            )

    def scalars(self) -> tuple[Signal, ...]:
        """Return a signal for each number of a row, with a plain name such as ``q_rad_alpha``."""
        if self.size == 1:
            return (self,)
        labels = self.labels or tuple(map(str, range(self.size)))
        return tuple(
            Signal(f"{self.name}_{_plain(label)}", self.unit, 1, self.meaning, (label,), self.states)
            for label in labels
        )

    def __hash__(self) -> int:
        """Return the hash of the name, which Python caches: caches by signals are read at every chunk."""
        return hash(self.name)


def _is_text(value: object) -> bool:
    return isinstance(value, str) and value.isprintable()


def _is_label(value: object) -> bool:
    # A file stores the labels in one text, separated by commas.
    return isinstance(value, str) and value.isprintable() and value != "" and "," not in value


def merged(signals: Sequence[Signal]) -> tuple[Signal, ...]:
    """Return the signals of which `Signal.scalars` made these; others stay as they are."""
    runs = [list(run) for _, run in groupby(signals, _origin)]
    return tuple(
        replace(first, name=_origin(first)[0], size=len(run), labels=tuple(s.labels[0] for s in run))
        if (first := run[0]).size == 1 and first.labels
        else first
        for run in runs
    )


def _origin(signal: Signal) -> tuple[str, ...]:
    """Return what the scalars of one vector share; the name alone of any other signal."""
    if signal.size > 1 or not signal.labels:
        return (signal.name,)
    return signal.name.removesuffix(f"_{_plain(signal.labels[0])}"), signal.unit, signal.meaning


def _plain(label: str) -> str:
    """Return a label as part of a name that any program reads."""
    return re.sub(r"\W+", "_", _ASCII.get(label, label.removeprefix("group ")), flags=re.ASCII)


ANGLES = ("α", "β", "γ")
_ASCII = dict(zip(ANGLES, ("alpha", "beta", "gamma"), strict=True))
AXES = ("x", "y", "z")

MOTION_SIGNALS = (
    Signal("t_s", "s", 1, "time of the control tick"),
    Signal("q_rad", "rad", 3, "hinge angles", ANGLES),
    Signal("qdot_rad_s", "rad/s", 3, "hinge rates", ANGLES),
    Signal("q_ref_rad", "rad", 3, "desired hinge angles", ANGLES),
    Signal("qdot_ref_rad_s", "rad/s", 3, "desired hinge rates", ANGLES),
    Signal("error_rad", "rad", 3, "tracking error q - q_ref (28)", ANGLES),
    Signal("torque_command_Nm", "N·m", 3, "generalised torque commanded by the law", ANGLES),
    Signal("torque_Nm", "N·m", 3, "torque of the coils on the rotor, stator frame", AXES),
    Signal("disturbance_Nm", "N·m", 3, "generalised load and random torque, subtracted in (1)", ANGLES),
)
"""First signals of every run, in this order, for any actuator."""


@cache
def common_signals(groups: int) -> tuple[Signal, ...]:
    """Return the signals of every run, in order, for an actuator with a number of coil groups."""
    labels = tuple(f"group {j}" for j in range(groups))
    first_step = "group currents, mean over the first physics step of the tick"
    return (
        *MOTION_SIGNALS,
        Signal("current_command_A", "A", groups, "group currents commanded to the amplifiers", labels),
        Signal("current_A", "A", groups, first_step, labels),
        Signal("mean_current_A", "A", groups, "group currents, mean over the tick", labels),
        Signal("allocation_scale", "1", 1, "share of the commanded torque within the current limit"),
    )


COMMON_NAMES = frozenset(signal.name for signal in common_signals(1))
"""Names of the signals of every run."""


@cache
def offsets(signals: tuple[Signal, ...]) -> dict[str, int]:
    """Return the first column of each signal in a flat row; read-only."""
    ends = accumulate((signal.size for signal in signals), initial=0)
    return dict(zip((signal.name for signal in signals), ends, strict=False))


@cache
def width(signals: tuple[Signal, ...]) -> int:
    """Return the numbers of one flat row."""
    return sum(signal.size for signal in signals)


def with_more(signals: Mapping[str, Signal], added: tuple[Signal, ...]) -> dict[str, Signal]:
    """Return signals by name with added ones; a name has one meaning throughout.

    Raises
    ------
    InputError
        An added signal has the name of another one.
    """
    for signal in added:
        before = signals.get(signal.name, signal)
        if before != signal:
            raise InputError(
                f"session: expected the signal {signal.name} as it was before,"
                f" {before.size} in {before.unit} ({before.meaning}),"
                f" received {signal.size} in {signal.unit} ({signal.meaning})"
            )
    return {**signals, **{signal.name: signal for signal in added}}
