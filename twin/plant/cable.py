"""Cable from the stator to the rotor: spring, constant torque and hysteresis on the hinges."""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, ConfigDict, Field

from spheretwin.electronics.random_streams import UNIFORM, Seed, errors

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
    torque_error_Nm: tuple[Size, Size, Size] = Field(
        (0.0, 0.0, 0.0),
        description="largest further constant torque of the cable on each hinge, N·m, drawn from the seed",
        json_schema_extra=UNIFORM,
    )
    hysteresis_Nm: tuple[Size, Size, Size] = Field(
        (0.0, 0.0, 0.0), description="friction in the cable, N·m: half of the difference of both directions"
    )
    hysteresis_rad: Annotated[float, Field(ge=1e-6, le=10)] = Field(
        0.05, description="rotation of the hinge from the unloaded cable until its strands slip, rad"
    )


def acts(section: CableSection) -> Any:
    """True if there is a cable: one entry, or (n, 1) for many sections."""
    sizes = np.abs(section.torque_Nm) + section.torque_error_Nm + section.hysteresis_Nm
    return np.any(sizes + section.stiffness_Nm_rad, axis=-1, keepdims=True)


def constant_torque_Nm(section: CableSection, seed: Seed) -> NDArray[np.float64]:
    """Return the constant torque on the hinges, (3,) or (n, 3) N·m, with the error drawn from the seed."""
    drawn_Nm = errors(seed, "plant.cable", 3, 1)[..., 0] * section.torque_error_Nm
    return drawn_Nm + section.torque_Nm
