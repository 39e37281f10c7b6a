"""Faults of what an amplifier is asked for: one line, ``gain · asked + offset + noise``, or a held value.

Several on one group act one behind the other: those of the converter, then those of the amplifier, each in
the order of the plan.
"""

from __future__ import annotations

from collections.abc import Callable

from spheretwin.twin.electronics.driving.faulty import DriveFaults
from spheretwin.twin.faults import target
from spheretwin.twin.faults.target import Effects, Mode, Strike, is_held


def modes(
    source: int, unit: str, ampere: Callable[[Effects], float] = lambda effects: 1.0
) -> dict[str, Mode]:
    """Ways in which what is asked for can be wrong.

    Parameters
    ----------
    source : int
        Of noise: converter or amplifier.
    unit : str
        That a fault's value is told in.
    ampere : callable
        What one of it is, A.
    """

    def stuck(effects: Effects, strike: Strike) -> None:
        hold(effects.drive, strike, ampere(effects))

    def offset(effects: Effects, strike: Strike) -> None:
        shift(effects.drive, strike, ampere(effects))

    def gain(effects: Effects, strike: Strike) -> None:
        scale(effects.drive, strike)

    def noise(effects: Effects, strike: Strike) -> None:
        add_noise(effects.drive, strike, source, ampere(effects) * strike.value)

    def dropout(effects: Effects, strike: Strike) -> None:
        silence(effects.drive, strike)

    return {
        "stuck": Mode(stuck, target.held(unit)),
        "offset": Mode(offset, target.offset(unit)),
        "gain": Mode(gain, target.GAIN),
        "noise": Mode(noise, target.noise(unit)),
        "dropout": Mode(dropout),
        "intermittent": Mode(dropout, target.STRETCH, intermittent=True),
    }


def hold(drive: DriveFaults, strike: Strike, ampere_per_unit: float) -> None:
    """Let it stay at a value, or at what it was."""
    drive.acts[0] = True
    if is_held(strike.value):
        drive.holds[strike.place] = True
    else:
        silence(drive, strike)
        drive.offset_A[strike.place] = ampere_per_unit * strike.value


def shift(drive: DriveFaults, strike: Strike, ampere_per_unit: float) -> None:
    """Add a value to it."""
    drive.acts[0] = True
    drive.offset_A[strike.place] += ampere_per_unit * strike.value


def scale(drive: DriveFaults, strike: Strike) -> None:
    """Multiply it, and what was added before."""
    drive.acts[0] = True
    drive.gain[strike.place] *= strike.value
    drive.offset_A[strike.place] *= strike.value
    drive.noise_A[strike.place] *= abs(strike.value)


def silence(drive: DriveFaults, strike: Strike) -> None:
    """Make nothing of it."""
    drive.acts[0] = True
    drive.gain[strike.place] = drive.offset_A[strike.place] = 0.0
    drive.noise_A[strike.place] = 0.0


def add_noise(drive: DriveFaults, strike: Strike, source: int, deviation_A: float) -> None:
    """Add noise to it; what several faults of one source add is one noise of their root sum of squares."""
    drive.acts[0] = True
    before = drive.noise_A[strike.place, source]
    drive.noise_A[strike.place, source] = (before * before + deviation_A * deviation_A) ** 0.5
    drive.column[strike.place, source] = strike.column
