"""Faults of what an amplifier is asked for: one line, ``gain · asked + offset + noise``, or a held value.

Several on one group act one behind the other: those of the converter, then those of the amplifier, each in
the order of the plan.
"""

from __future__ import annotations

from spheretwin.twin.electronics.driving.faulty import DriveFaults
from spheretwin.twin.faults.target import Strike, is_held


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
