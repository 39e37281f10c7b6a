"""The readings that are tried, and the cases of each: the laws and conditions of the printed numbers."""

from __future__ import annotations

from typing import Any, NamedTuple

from spheretwin.models.telemetry.status import Status
from spheretwin.twin.reproduce.experiment import Case
from spheretwin.twin.reproduce.laws import OF_PAPER, Compared
from spheretwin.twin.reproduce.printed import PRINTED_rad, printed_rad

SCENARIO = "sinusoid"

STEP_s = 5e-4
"""Physics step of the other figures; at shorter control periods there is one a period."""

# A reading may be wrong enough to lose the rotor: that is what is asked.
ENDS = (Status.COMPLETED, Status.LEFT_WORKSPACE, Status.DIVERGED)


class Reading(NamedTuple):
    """One way to read the law and its gains."""

    name: str
    rate_Hz: float
    level: str
    surface_slope: float | None = None
    """λ of the laws that have one; the printed 50 1/s unless given."""

    @property
    def label(self) -> str:
        """With its control rate."""
        return f"{self.name}, {self.rate_Hz / 1e3:g} kHz"


ACCELERATION, TORQUE = "acceleration", "torque"
RATES_Hz = (1e3, 5e3, 10e3, 20e3)

READINGS = (
    *(Reading("as an acceleration", rate_Hz, ACCELERATION) for rate_Hz in RATES_Hz),
    *(Reading("as a torque", rate_Hz, TORQUE) for rate_Hz in RATES_Hz),
    Reading("as an acceleration, λ = 5", 1e3, ACCELERATION, 5.0),
)
AS_SHIPPED = READINGS[0]


def cases() -> list[Case]:
    """Every reading under every law and condition of which a number is printed."""
    every = (case(reading, law, *at) for reading in READINGS for at in PRINTED_rad for law in OF_PAPER)
    return list({each.name: each for each in every}.values())


def case(reading: Reading, compared: Compared, m: float, L: float) -> Case:
    """A law under a reading and a condition; what has no λ is the same as shipped."""
    if reading.surface_slope is not None and compared.law == "pd":
        return case(AS_SHIPPED, compared, m, L)
    fields: dict[str, Any] = {
        "controller.law": compared.law,
        "controller.level": reading.level,
        "controller.period_s": 1 / reading.rate_Hz,
        "plant.step_s": min(STEP_s, 1 / reading.rate_Hz),
        "plant.modelling_error": m,
        "disturbance.load": L,
    }
    if reading.surface_slope is not None:
        fields["controller.surface_slope"] = reading.surface_slope
    return Case(
        name=f"{reading.label}, {compared.law}: m {m:g}, L {L:g}",
        scenario=SCENARIO,
        fields=fields,
        told={"reading": reading.label, "paper": printed_rad(compared.law, m, L)},
        once=True,
        ends=ENDS,
    )
