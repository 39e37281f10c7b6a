"""Digital-to-analogue converter: each channel's command as one of the voltages that it can set.

All channels are set at once (simultaneous latch). A command i is asked for as the voltage i / k, with the
transconductance k of the amplifier behind; the code is the nearest of ``-2**(bits - 1) .. 2**(bits - 1) - 1``
(mid-tread: one code is 0 V), the ends where the command lies beyond. Set is ``LSB code (1 + gain) + offset +
INL(code)``, and the amplifier is asked for k times that.

Integral nonlinearity is a smooth curve a channel, nothing at both ends of the codes, as INL is told against
the straight line through them: ``sum(a_n sin(p) sin(n p))``, a bow, an S and so on, where the codes run from
one end to the other as cos(p). Each term is a polynomial of the code, so that no sine is computed. It stays
within a_n, with a slope of at most ``2 n a_n`` over half the codes: far too little to turn 16 bits back, so
that the converter stays monotonic, as its sheet says.

Settling (20 µs) and glitches are left out: a few hundredths of a physics step.
"""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from spheretwin.models.base.compiled import allocation_free, part_of_its_caller
from spheretwin.twin.electronics.driving.stage import DriveSetup, DriveStage
from spheretwin.twin.electronics.fault_line import FaultLine, fault_line
from spheretwin.twin.electronics.streams import errors

HARMONICS = 3


class DacSection(DriveStage):
    """Converter of the commands, one channel a group; neutral with 0 bits."""

    stage: ClassVar[str] = "dac"
    dac_bits: Annotated[int, Field(ge=0, le=32)] = Field(
        0,
        description="of a code; with 0 the converter is ideal, without range and errors"
        " (AD5370, from its sheet: 16)",
    )
    dac_range_V: Annotated[float, Field(ge=1e-3, le=1e3)] = Field(
        10.0,
        description="output from -range to range, V (span 20 V at a reference of 5 V from the sheet;"
        " that it is centred on 0, assumed)",
    )
    dac_offset_V: Annotated[float, Field(ge=0, le=10)] = Field(
        0.0, description="largest offset of a channel, drawn from the seed, V (assumed: 2e-3)"
    )
    dac_gain_error: Annotated[float, Field(ge=0, le=0.5)] = Field(
        0.0, description="largest relative gain error of a channel, drawn from the seed (assumed: 1e-3)"
    )
    dac_inl_lsb: Annotated[float, Field(ge=0, le=1e4)] = Field(
        0.0,
        description="largest integral nonlinearity of a channel, a smooth curve drawn from the seed, LSB"
        " (assumed: 4)",
    )

    @staticmethod
    def ideal(section: Any) -> bool:
        """True without a converter."""
        return bool(section.dac_bits == 0)

    @staticmethod
    def build(section: Any, setup: DriveSetup) -> Any:
        """Converter in front of amplifiers of the section's transconductance."""
        made = dac(section, section.transconductance_A_V, setup.groups, setup.seed)
        return DacStage(made.converts or setup.faults, made, fault_line(setup.groups * setup.faults, 0.0))

    @staticmethod
    def convert() -> Any:
        """Compiled conversion of a command."""
        return convert_command


class DacStage(NamedTuple):
    """Converter as a stage of the drive."""

    on: bool
    dac: Dac
    line: FaultLine  # of what the amplifiers are asked for, A


@part_of_its_caller
def convert_command(stage: DacStage, asked: NDArray[np.float64], draws: NDArray[np.float64]) -> None:
    """Convert a command (n,), A, in its place."""
    convert(stage.dac, asked, asked)


class Dac(NamedTuple):
    """Converter of a run as compiled code sees it."""

    converts: bool  # whether it is one; if not, a command passes as it is
    transconductance_A_V: float
    span_A: float  # twice what the range is as a current: beyond every code
    lsb_V: float
    lowest: float  # code
    highest: float
    offset_V: NDArray[np.float64]  # (n,)
    gain: NDArray[np.float64]  # (n,) 1 where there is no error
    inl_lsb: NDArray[np.float64]  # (n, HARMONICS) a_n


def dac(section: DacSection, transconductance_A_V: float, groups: int, seed: int) -> Dac:
    """Converter in front of amplifiers of a transconductance (A/V), a channel a group.

    A channel's errors are drawn uniformly within their bounds, INL such that its curve keeps to its bound
    whatever the code. Each channel has its own stream: no field, group or other stage moves what it draws.
    """
    drawn = np.zeros((groups, 2 + HARMONICS))
    if section.dac_bits:  # errors of no converter are not drawn
        drawn = errors(seed, "drive.dac", groups, 2 + HARMONICS)
    harmonics = drawn[:, 2:] / np.maximum(1.0, np.abs(drawn[:, 2:]).sum(axis=1, keepdims=True))
    codes = 2.0**section.dac_bits
    return Dac(
        converts=section.dac_bits > 0,
        transconductance_A_V=transconductance_A_V,
        span_A=2 * section.dac_range_V * transconductance_A_V,
        lsb_V=2 * section.dac_range_V / codes,
        lowest=-codes / 2,
        highest=codes / 2 - 1,
        offset_V=section.dac_offset_V * drawn[:, 0],
        gain=1 + section.dac_gain_error * drawn[:, 1],
        inl_lsb=section.dac_inl_lsb * harmonics,
    )


@allocation_free
def convert(dac: Dac, command: NDArray[np.float64], asked: NDArray[np.float64]) -> None:
    """Convert a command.

    It depends on nothing but the command: it may be called when a command comes into force, or once when it
    is computed.

    Parameters
    ----------
    dac : Dac
    command : (n,) array, A
        Any number; beyond the range, and infinity, is its end, and what is not a number stays so.
    asked : (n,) array, A
        Result, what the amplifiers are asked for; may be `command` itself.
    """
    if not dac.converts:
        for j in range(command.shape[0]):
            asked[j] = command[j]
        return
    for j in range(command.shape[0]):
        held = min(max(command[j], -dac.span_A), dac.span_A)  # its quotients stay numbers
        code = np.rint(held / dac.transconductance_A_V / dac.lsb_V)
        code = min(max(code, dac.lowest), dac.highest)
        inl = _inl(dac.inl_lsb[j], (2.0 * code + 1.0) / (dac.highest - dac.lowest))
        volts = dac.lsb_V * (code * dac.gain[j] + inl) + dac.offset_V[j]
        asked[j] = dac.transconductance_A_V * volts


@allocation_free
def _inl(amplitudes: NDArray[np.float64], place: float) -> float:
    """``sum(a_n sin(p) sin(n p))`` with cos(p) the place of a code, -1 to 1.

    ``sin(n p) / sin(p)`` is Chebyshev's polynomial of the second kind, here by its recurrence.
    """
    total, before, now = 0.0, 0.0, 1.0
    for n in range(amplitudes.shape[0]):
        total += amplitudes[n] * now
        before, now = now, 2.0 * place * now - before
    return (1.0 - place * place) * total
