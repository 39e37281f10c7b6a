"""Sections of the scatter of poles and coils, and the errors drawn for a machine."""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from spheretwin.electronics.random_streams import UNIFORM, Seed, errors
from spheretwin.models.actuator import Actuator
from spheretwin.models.base.errors import InputError
from spheretwin.models.scatter import PartErrors, Scatter, part_errors

# Within these bounds the torque matrix is within 1 % of the exact field (`magnetics check`).
LARGEST_GAIN_ERROR, LARGEST_ANGLE_rad, LARGEST_DISTANCE_m = 0.2, 0.01, 3e-4

Gain = Annotated[float, Field(ge=-LARGEST_GAIN_ERROR, le=LARGEST_GAIN_ERROR)]
Angle = Annotated[float, Field(ge=-LARGEST_ANGLE_rad, le=LARGEST_ANGLE_rad)]
Distance = Annotated[float, Field(ge=-LARGEST_DISTANCE_m, le=LARGEST_DISTANCE_m)]


class PartScatter(BaseModel):
    """Scatter of the poles, or of the coils: bounds of uniform errors, drawn from the seed for each part."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    gain_error: Annotated[float, Field(ge=0, le=LARGEST_GAIN_ERROR)] = Field(
        0.0,
        description="largest relative error of a pole's remanence, or of a coil's torque per ampere",
        json_schema_extra=UNIFORM,
    )
    angle_error_rad: Annotated[float, Field(ge=0, le=LARGEST_ANGLE_rad)] = Field(
        0.0,
        description="largest placement error to the east and to the north of the axis, rad",
        json_schema_extra=UNIFORM,
    )
    distance_error_m: Annotated[float, Field(ge=0, le=LARGEST_DISTANCE_m)] = Field(
        0.0, description="largest error of the distance from the joint centre, m", json_schema_extra=UNIFORM
    )
    errors: tuple[tuple[Gain, Angle, Angle, Distance], ...] | None = Field(
        None,
        description="error of each part: relative gain, angles to the east and to the north of its axis in"
        " the frame of its body (rad), distance (m); drawn unless given",
    )

    @property
    def acts(self) -> bool:
        """True if a part has an error."""
        return bool(self.errors or self.gain_error or self.angle_error_rad or self.distance_error_m)

    def part_errors(self, seed: Seed, name: str, parts: int) -> PartErrors:
        """Return the errors of the parts of a machine, or of n machines.

        Parameters
        ----------
        seed : int or (n, 1) array
            Seed of the run.
        name : str
            Name of the section, which keys the random stream.
        parts : int
            Number of poles or coils.

        Raises
        ------
        InputError
            Errors are given for another number of parts.
        """
        if self.errors is None:
            bounds = self.gain_error, self.angle_error_rad, self.angle_error_rad, self.distance_error_m
            columns = np.stack(np.broadcast_arrays(*bounds), axis=-1)  # (4,) or (n, 1, 4)
            return part_errors(errors(seed, name, parts, len(bounds)) * columns)
        table = np.reshape(self.errors, (*np.shape(self.errors)[:-2], -1, 4))
        if table.shape[-2] != parts:
            raise InputError(f"scenario: expected {name}.errors of {parts} parts, received {table.shape[-2]}")
        return part_errors(table)


def scatter_of(plant: Any, seed: Seed, actuator: Actuator) -> Scatter | None:
    """Return the scatter of a plant section, or of n of them; None if they have none.

    Parameters
    ----------
    plant : PlantSection
        Its sections `poles` and `coils`.
    seed : int or (n, 1) array
        Seed of the run.
    actuator : Actuator
        Nominal machine.

    Raises
    ------
    InputError
        The given errors do not fit the machine.
    """
    acts = plant.poles.acts | plant.coils.acts
    if not np.any(acts):
        return None
    poles = plant.poles.part_errors(seed, "plant.poles", len(actuator.pole_axes))
    coils = plant.coils.part_errors(seed, "plant.coils", len(actuator.coil_axes))
    return Scatter(poles, coils, acts)
