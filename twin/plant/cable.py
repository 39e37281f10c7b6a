"""Cable from the stator to the rotor: spring, constant torque and hysteresis on the hinges."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

Size = Annotated[float, Field(ge=0, le=100)]
Signed = Annotated[float, Field(ge=-100, le=100)]


class CableSection(BaseModel):
    """Cable from the stator to the rotor."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    stiffness_Nm_rad: tuple[Size, Size, Size] = Field(
        (0.0, 0.0, 0.0), description="stiffness of the cable about each hinge, N·m/rad"
    )
    neutral_rad: tuple[Signed, Signed, Signed] = Field(
        (0.0, 0.0, 0.0), description="pose in which the spring has no torque, rad"
    )
    torque_Nm: tuple[Signed, Signed, Signed] = Field(
        (0.0, 0.0, 0.0),
        description="constant torque of the cable on each hinge, N·m, towards positive angles",
    )
    hysteresis_Nm: tuple[Size, Size, Size] = Field(
        (0.0, 0.0, 0.0), description="friction in the cable, N·m: half of the difference of both directions"
    )
    hysteresis_rad: Annotated[float, Field(ge=1e-6, le=10)] = Field(
        0.05, description="rotation of the hinge from the unloaded cable until its strands slip, rad"
    )


def acts(section: CableSection) -> bool:
    """True if there is a cable."""
    return any((*section.stiffness_Nm_rad, *section.torque_Nm, *section.hysteresis_Nm))
