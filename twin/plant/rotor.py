"""Interface of the rotor engines to the loop."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.actuator import Actuator
from spheretwin.models.base.record import Record, Rows, field
from spheretwin.models.joint_chain import JointChain, fill_chain, fill_ideal
from spheretwin.models.lagrangian import loaded_inertia
from spheretwin.models.mjcf import Mjcf
from spheretwin.plant.mass_properties import MassErrors, true_model

Array = NDArray[np.float64]


class RotorSettings(NamedTuple):
    """Settings of a rotor."""

    model: Mjcf
    actuator: Actuator
    step_s: float
    integrator: str
    modelling_error: float
    """m: the rotor's inertia is (1 + m) times the model's (11), (54)."""
    payload_kg: float
    gravity_m_s2: float | None
    """Gravity along -z; None: that of the model."""
    mass: MassErrors | None = None
    """Differences of the machine from the model file."""

    def fill_joint(self, joints: Rows) -> None:
        """Fill the joint of the true rotor: an ideal one if its closed equations of motion hold.

        Parameters
        ----------
        joints : array of JointChain
        """
        error, payload_kg, gravity_m_s2 = self.modelling_error, self.payload_kg, self.gravity_m_s2
        x, y, height = map(float, self.actuator.payload_mount_m)
        inertia = loaded_inertia((1 + error) * self.actuator.inertia, payload_kg, height)
        fill_ideal(joints, inertia, payload_kg * (gravity_m_s2 or 0.0) * height)
        if self.mass is not None or not self.model.has_ideal_joint or (payload_kg and (x or y)):
            fill_chain(joints, true_model(self.model, error, payload_kg, gravity_m_s2, self.mass))


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
    """Rotor of one run."""

    rows: Rows
    """Array of one RotorData."""

    def start(self, q: Array, qdot: Array) -> RotorData:
        """Set pose and rates; return the record of `rows`.

        Parameters
        ----------
        q : (3,) array, rad
            Hinge angles.
        qdot : (3,) array, rad/s
            Their rates.
        """
        ...

    def state(self) -> Array:
        """Return the complete state."""
        ...

    def restore(self, state: Array) -> None:
        """Restore a state."""
        ...


class EngineKind(NamedTuple):
    """Row of the list of rotor engines."""

    name: str
    """Name in `plant.engine`."""
    set_up: Callable[[RotorSettings], Rotor]
    """Build a rotor; raises InputError for a model that the engine does not support."""
    step: Callable[[RotorData], None]
    """Compiled function that advances a rotor by one physics step."""
