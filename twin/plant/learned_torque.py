"""Learned torque: what the model of a machine lacks, as a function of pose, rates and torque of the coils.

On hinge i it is ``w Σ_m exp(-d_m²/2) (a_mi + b_mi q̇_i/V_i + c_mi τ_i/T_i)``. The centres m are poses of the
logs; d_m is the distance of the pose from centre m in units of a length for each hinge, τ the torque of the
coils on the hinges, V and T the largest rates and torques of the logs.

The factor w is 1 within the range of the logs: each of their poses is within `reach` of a centre. Towards
twice that distance, and towards twice V or T, it falls linearly to 0. Nothing is extrapolated: beyond that
the plant is that of the model. Telemetry has w and the torque.
"""

from __future__ import annotations

import hashlib
import io
from collections.abc import Mapping
from functools import cache
from math import exp, sqrt
from typing import Annotated, Any

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator

from spheretwin.models.base.arrays import Array
from spheretwin.models.base.compiled import allocation_free, compiled, inlined
from spheretwin.models.base.errors import InputError, without_breaks
from spheretwin.models.base.record import Record, Rows, field
from spheretwin.models.joint_chain import torque_on_hinges
from spheretwin.plant.plant_part import PlantPart, PlantSetup
from spheretwin.plant.plant_step import Parameters, torque_matrix

MOST_CENTRES = 24
FEATURES = 3
"""1, own rate, own torque."""

Digest = Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]


class LearnedTorqueSection(BaseModel):
    """Torque that `machine.learning.learn` has found besides the model."""

    model_config = ConfigDict(frozen=True, extra="forbid", strict=True, allow_inf_nan=False)

    file: str | None = Field(None, description="file of the learned torque", json_schema_extra={"path": True})
    sha256: Digest | None = Field(None, description="its digest")

    @model_validator(mode="after")
    def _has_both(self) -> LearnedTorqueSection:
        if (self.file is None) != (self.sha256 is None):
            raise ValueError("expected file and sha256 of a learned torque, received one of them")
        return self


class LearnedTorque(Record):
    """Learned torque of a plant."""

    on: bool = field("whether there is one")
    centres: int = field("number of centres")
    centre_rad: Array = field("poses", "rad", (MOST_CENTRES, 3))
    length_rad: Array = field("unit of the distance along each hinge", "rad", 3)
    reach: float = field("largest distance of a pose of the logs from the nearest centre")
    rate_rad_s: Array = field("largest rates of the logs", "rad/s", 3)
    torque_Nm: Array = field("largest torques of the coils on the hinges", "N·m", 3)
    weight_Nm: Array = field("of each centre and feature, by hinge", "N·m", (MOST_CENTRES, FEATURES, 3))
    coil_Nm: Array = field("torque of the coils on the hinges", "N·m", 3)
    output_Nm: Array = field("learned torque on the hinges", "N·m", 3)
    share: float = field("factor w of the last step: 1 within the range of the logs")


NUMBERS = ("centre_rad", "length_rad", "reach", "rate_rad_s", "torque_Nm", "weight_Nm")
"""Arrays of a file; `centre_rad` and `weight_Nm` have a row for each centre."""


@allocation_free
def add_learned_torque(
    learned: LearnedTorque, q: Array, qdot: Array, coil_Nm: Array, torque_q: Array
) -> None:
    """Add the learned torque to the torque on the hinges.

    Parameters
    ----------
    learned : LearnedTorque
        Its output is set.
    q, qdot : (3,) arrays, rad and rad/s
    coil_Nm : (3,) array, N·m
        Torque of the coils on the hinges.
    torque_q : (3,) array, N·m
        Changed.
    """
    nearest = np.inf
    for i in range(3):
        learned.output_Nm[i] = 0.0
    for m in range(learned.centres):
        square = 0.0
        for i in range(3):
            square += ((q[i] - learned.centre_rad[m, i]) / learned.length_rad[i]) ** 2
        nearest = min(nearest, square)
        bell = exp(-0.5 * square)
        for i in range(3):
            learned.output_Nm[i] += bell * (
                learned.weight_Nm[m, 0, i]
                + learned.weight_Nm[m, 1, i] * qdot[i] / learned.rate_rad_s[i]
                + learned.weight_Nm[m, 2, i] * coil_Nm[i] / learned.torque_Nm[i]
            )
    share = min(1.0, max(0.0, 2.0 - sqrt(nearest) / learned.reach))
    for i in range(3):
        share *= min(1.0, max(0.0, 2.0 - abs(qdot[i]) / learned.rate_rad_s[i]))
        share *= min(1.0, max(0.0, 2.0 - abs(coil_Nm[i]) / learned.torque_Nm[i]))
    learned.share = share
    for i in range(3):
        learned.output_Nm[i] *= share
        torque_q[i] += learned.output_Nm[i]


@compiled
def learned_torques(learned: Rows, parameters: Parameters, q: Array, qdot: Array, current: Array) -> Array:
    """Return the learned torque on the hinges at states (n, 3) that differ little, under currents (groups,).

    The torque of the coils is that of the first state.
    """
    coil, outputs = np.empty(3), np.zeros(q.shape)
    if not np.all(np.isfinite(q)):  # a state that has diverged stays as it is
        return outputs
    torque_on_hinges(parameters.joint[0], q[0], np.dot(torque_matrix(q[0], parameters), current), coil)
    for row in range(q.shape[0]):
        add_learned_torque(learned[0], q[row], qdot[row], coil, outputs[row])
    return outputs


@inlined
def _load(learned: LearnedTorque, plant: Any, substep: int) -> None:
    torque_on_hinges(plant.rotor.joint, plant.middle_q[:], plant.torque_S[:], learned.coil_Nm[:])
    add_learned_torque(
        learned, plant.middle_q[:], plant.middle_qdot[:], learned.coil_Nm[:], plant.rotor.torque_q[:]
    )


@inlined
def log_learned_torque(learned: LearnedTorque, row: Array) -> None:
    """Write torque and factor into the beginning of a row."""
    for i in range(3):
        row[i] = learned.output_Nm[i]
    row[3] = learned.share


def learned_torque(section: LearnedTorqueSection) -> Rows:
    """Return an array of one learned torque; it is off without a file.

    Raises
    ------
    InputError
        The file cannot be read, has another digest or other arrays.
    """
    rows = LearnedTorque.zeros()
    if section.file and section.sha256:
        fill_learned_torque(rows, read_arrays(section.file, section.sha256))
    return rows


def fill_learned_torque(rows: Rows, arrays: dict[str, Array]) -> None:
    """Fill learned torques from the arrays of a file."""
    count = len(arrays["centre_rad"])
    rows["on"], rows["centres"], rows["share"] = 1, count, 1.0
    for name in NUMBERS:
        place = rows[name][:, :count] if name in ("centre_rad", "weight_Nm") else rows[name]
        place[...] = arrays[name]


def write_arrays(path: Any, arrays: Mapping[str, Array]) -> str:
    """Write the arrays of a learned torque; return the digest of the file."""
    content = io.BytesIO()
    np.savez(content, allow_pickle=False, **arrays)
    path.write_bytes(content.getvalue())
    return hashlib.sha256(content.getvalue()).hexdigest()


@cache
def read_arrays(file: str, sha256: str) -> dict[str, Array]:
    """Return the arrays of a file of a learned torque.

    Raises
    ------
    InputError
        The file cannot be read, has another digest or other arrays.
    """
    try:
        with open(file, "rb") as opened:
            content = opened.read()
    except OSError as error:
        raise InputError(f"learned torque {file}: expected a file, {without_breaks(error)}") from None
    if hashlib.sha256(content).hexdigest() != sha256:
        raise InputError(f"learned torque {file}: expected the digest {sha256}, received another content")
    with np.load(io.BytesIO(content), allow_pickle=False) as stored:
        arrays = {name: stored[name] for name in stored.files}
    shapes = {name: arrays[name].shape for name in NUMBERS if name in arrays}
    count = len(arrays.get("centre_rad", ()))
    expected = {
        "centre_rad": (count, 3), "length_rad": (3,), "reach": (), "rate_rad_s": (3,), "torque_Nm": (3,),
        "weight_Nm": (count, FEATURES, 3),
    }  # fmt: skip
    if shapes != expected or not 0 < count <= MOST_CENTRES:
        raise InputError(f"learned torque {file}: expected arrays of {expected}, received {shapes}")
    return arrays


def _fill(rows: Rows, setup: PlantSetup) -> None:
    section = setup.scenario.plant.learned_torque
    if section.file and section.sha256:
        fill_learned_torque(rows, read_arrays(section.file, section.sha256))


LEARNED_TORQUE = PlantPart(LearnedTorque, _fill, LearnedTorqueSection, load=_load)
