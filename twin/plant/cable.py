"""Cable to the rotor: spring and constant torque on the hinges; `bristle_friction` has its hysteresis."""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

from spheretwin.models.base.compiled import allocation_free

Stiffness = Annotated[float, Field(ge=0, le=100)]
Torque = Annotated[float, Field(ge=-100, le=100)]
Angle = Annotated[float, Field(ge=-100, le=100)]
Level = Annotated[float, Field(ge=0, le=100)]


class CableSection(BaseModel):
    """Cable from the stator to the rotor."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    stiffness_Nm_rad: tuple[Stiffness, Stiffness, Stiffness] = Field(
        (0.0, 0.0, 0.0), description="stiffness of the cable about each hinge, N·m/rad"
    )
    neutral_rad: tuple[Angle, Angle, Angle] = Field(
        (0.0, 0.0, 0.0), description="pose in which the spring has no torque, rad"
    )
    torque_Nm: tuple[Torque, Torque, Torque] = Field(
        (0.0, 0.0, 0.0),
        description="constant torque of the cable on each hinge, N·m, towards positive angles",
    )
    hysteresis_Nm: tuple[Level, Level, Level] = Field(
        (0.0, 0.0, 0.0),
        description="friction inside the cable about each hinge, N·m: half of the difference of the torques"
        " of both directions",
    )
    hysteresis_rad: Annotated[float, Field(ge=1e-6, le=10)] = Field(
        0.05, description="rotation of the hinge from the unloaded cable until its strands slip, rad"
    )


class Cable(NamedTuple):
    """Cable of a run, for compiled code."""

    on: bool  # false if there is no cable, which then costs no time
    stiffness_Nm_rad: NDArray[np.float64]  # (3,)
    neutral_rad: NDArray[np.float64]  # (3,)
    constant_Nm: NDArray[np.float64]  # (3,)
    torque_q: NDArray[np.float64]  # (3,) N·m on the hinges, in the present physics step
    first_torque_q: NDArray[np.float64]  # (3,) the same in the first one of the control period


def cable(section: CableSection) -> Cable:
    """Return the cable of a section."""
    return Cable(
        acts(section),
        np.array(section.stiffness_Nm_rad),
        np.array(section.neutral_rad),
        np.array(section.torque_Nm),
        np.zeros(3),
        np.zeros(3),
    )


def acts(section: CableSection) -> bool:
    """True if there is a cable."""
    return any((*section.stiffness_Nm_rad, *section.torque_Nm, *section.hysteresis_Nm))


@allocation_free
def pull(cable: Cable, q: NDArray[np.float64], torque_q: NDArray[np.float64]) -> None:
    """Add the torque of spring and constant at a pose (3,) to a torque on the hinges (3,).

    With the pose that is predicted for the middle of a physics step, q + h qdot / 2, and the torque held over
    the step, this is of second order and preserves phase volume: a spring gains and loses no energy on
    average. It is stable for a step below 2 sqrt(J / stiffness).
    """
    for i in range(3):
        cable.torque_q[i] = cable.constant_Nm[i] - cable.stiffness_Nm_rad[i] * (q[i] - cable.neutral_rad[i])
        torque_q[i] += cable.torque_q[i]
