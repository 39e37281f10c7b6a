"""Interface of the rotor engines to the loop."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple, Protocol

import mujoco
import numpy as np
from numpy.typing import ArrayLike, NDArray

from spheretwin.models.actuator import Actuator
from spheretwin.models.base.arrays import Array
from spheretwin.models.base.record import Record, Rows, field
from spheretwin.models.joint_chain import JointChain, fill_chain, fill_ideal
from spheretwin.models.lagrangian import loaded_inertia
from spheretwin.models.mjcf import Mjcf
from spheretwin.plant.mass_properties import MassErrors, row_of, true_model

Number = float | Array


class RotorSettings(NamedTuple):
    """Settings of a rotor, or of n rotors: numbers may be arrays (n, 1)."""

    model: Mjcf
    actuator: Actuator
    step_s: Number
    integrator: str
    modelling_error: Number
    """m: the rotor's inertia is (1 + m) times the model's (11), (54)."""
    payload_kg: Number
    gravity_m_s2: Number | None
    """Gravity along -z; None: that of the model."""
    mass: MassErrors | list[Any] | None = None
    """Differences of the machine from the model file, or a list of those of n machines."""
    rows: int = 1
    """Number of rotors."""

    def fill_joint(self, joints: Rows) -> None:
        """Fill the joint of the true rotor: an ideal one if its closed equations of motion hold.

        Parameters
        ----------
        joints : array of JointChain
        """
        x, y, height = map(float, self.actuator.payload_mount_m)
        inertia = loaded_inertia((1 + self.modelling_error) * self.actuator.inertia, self.payload_kg, height)
        gravity_m_s2 = 0.0 if self.gravity_m_s2 is None else self.gravity_m_s2
        fill_ideal(joints, inertia, self.payload_kg * gravity_m_s2 * height)
        for row in range(self.rows):
            payload_kg, mass = row_of(self.payload_kg, row), row_of(self.mass, row)
            if mass is not None or not self.model.has_ideal_joint or (payload_kg and (x or y)):
                fill_chain(joints[row : row + 1], self.true_model(row))

    def true_model(self, row: int) -> mujoco.MjModel:
        """Return the compiled model of the true rotor of a row."""
        differences = self.modelling_error, self.payload_kg, self.gravity_m_s2, self.mass
        return true_model(self.model, *(row_of(value, row) for value in differences))


class RotorData(Record):
    """Rotor of a run; compiled code reads and writes its pose, rates and torque."""

    step_s: float = field("physics step", "s")
    joint: JointChain = field("hinges and masses")
    q: Array = field("hinge angles", "rad", 3)
    qdot: Array = field("hinge rates", "rad/s", 3)
    torque_q: Array = field("torque on the hinges, held over a step", "N·m", 3)
    warnings: int = field("warnings of the engine: a run ends at the first one")
    addresses: NDArray[np.int64] = field("of MuJoCo's model, data, pose, rates, torque, warnings", "", 6)


class Rotor(Protocol):
    """Rotor of a run, or rotors of n rows."""

    rows: Rows
    """Array of RotorData, one for each row."""

    def start(self, q: ArrayLike, qdot: ArrayLike) -> RotorData:
        """Set pose and rates; return the first record of `rows`.

        Parameters
        ----------
        q : (3,) or (n, 3) array, rad
            Hinge angles.
        qdot : (3,) or (n, 3) array, rad/s
            Their rates.
        """
        ...

    def state(self) -> list[Array]:
        """Return the complete state of each row."""
        ...

    def restore(self, states: Sequence[Array]) -> None:
        """Restore the state of each row."""
        ...


class EngineKind(NamedTuple):
    """Row of the list of rotor engines."""

    name: str
    """Name in `plant.engine`."""
    set_up: Callable[[RotorSettings], Rotor]
    """Build a rotor; raises InputError for a model that the engine does not support."""
    step: Callable[[RotorData], None]
    """Compiled function that advances a rotor by one physics step."""
