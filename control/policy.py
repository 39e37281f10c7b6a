"""Law that is a trained network: what it observes, and its layers from an ONNX file.

The observation and the limit of its actions are those of the environments (`spheretwin.envs`), where such a
network is trained. Observations and weights are of double precision here, of single precision there.
"""

from __future__ import annotations

from math import exp, expm1, tanh
from typing import Annotated, Any, NamedTuple

import numpy as np
from pydantic import Field, PrivateAttr, model_validator

from spheretwin.control.law import Law, NominalModel, Positive
from spheretwin.control.law_components.parameters import LawParameters
from spheretwin.control.network import ACTIVATIONS, Layer, network_of
from spheretwin.models.base.arrays import Array
from spheretwin.models.base.compiled import allocation_free, inlined
from spheretwin.models.base.errors import InputError

TORQUE_LIMIT_Nm = 0.5
"""Largest torque on a hinge; at the pose 0, 3 A in every group give as much (assumed)."""

LIMIT, LAYERS, FIRST = 0, 1, 2  # layout of the parameters; FIRST: of the first layer
ACTIVATION, LOW, HIGH, OUTPUTS, WEIGHTS = 0, 1, 2, 3, 4  # of a layer; its weights by rows, then its offset

NONE, RELU, TANH, SIGMOID, ELU, LEAKY, CLIP = range(len(ACTIVATIONS))


class Observed(NamedTuple):
    """Part of an observation: three numbers, of alpha, beta and gamma."""

    name: str
    unit: str
    bound: float
    description: str


OBSERVATION = (
    Observed("error_rad", "rad", 10.0, "hinge angles minus their reference"),
    Observed("error_rate_rad_s", "rad/s", 1e3, "hinge rates minus their reference"),
    Observed("q_rad", "rad", 10.0, "hinge angles"),
    Observed("qdot_rad_s", "rad/s", 1e3, "hinge rates"),
    Observed("qddot_ref_rad_s2", "rad/s²", 1e5, "acceleration of the reference"),
)
BOUNDS = np.repeat([part.bound for part in OBSERVATION], 3)


@inlined
def write_observation(q: Any, qdot: Any, reference: Array, row: Any) -> None:
    """Write the observation (15,) at a reference (3, 3); numbers beyond their bounds are cut, NaN is 0."""
    for k in range(3):
        row[k], row[3 + k] = q[k] - reference[0, k], qdot[k] - reference[1, k]
        row[6 + k], row[9 + k], row[12 + k] = q[k], qdot[k], reference[2, k]
    for place in range(15):
        bound = BOUNDS[place]
        row[place] = min(max(row[place], -bound), bound) if row[place] == row[place] else 0.0


class PolicyLaw(LawParameters):
    """Trained network as a law.

    A file of one line, ``from spheretwin import PolicyLaw``, makes it the law ``FILE.py:PolicyLaw``. The
    network maps the 15 numbers of an observation of `spheretwin.envs` to three shares of `torque_limit_Nm`,
    cut at -1 and 1. It is read when the section is created; later changes of the file have no effect.

    Raises
    ------
    InputError
        The file is not such a network, or the package onnx is missing.
    """

    file: Annotated[str, Field(min_length=1)] = Field(
        description="network as ONNX: dense layers and activations", json_schema_extra={"path": True}
    )
    torque_limit_Nm: Positive = Field(
        TORQUE_LIMIT_Nm, description="largest torque on a hinge, that of the environment it was trained in"
    )

    _layers: tuple[Layer, ...] = PrivateAttr(())

    @model_validator(mode="after")
    def _read(self) -> PolicyLaw:
        self._layers = network_of(self.file, len(BOUNDS))
        if (returned := len(self._layers[-1].offset)) != 3:
            raise InputError(
                f"policy {self.file}: expected a network that returns 3 torques, received {returned}"
            )
        return self

    def build(self, known: NominalModel) -> Law:
        """Return a law whose state is the working space of the network."""
        numbers: list[float] = [self.torque_limit_Nm, len(self._layers)]
        for layer in self._layers:
            numbers += [ACTIVATIONS.index(layer.activation), layer.low, layer.high, len(layer.offset)]
            numbers += [*layer.weights.ravel().tolist(), *layer.offset.tolist()]
        widest = max(len(BOUNDS), *(len(layer.offset) for layer in self._layers))
        return Law("policy", step, np.array(numbers), np.zeros(2 * widest))


@allocation_free
def step(
    t: float, reference: Array, measurement: Array, parameters: Array, state: Array, torque: Array
) -> None:
    """Write the torque of one control tick; see `control.law.Law`."""
    widest = state.shape[0] // 2
    given, here = 15, 0  # numbers that a layer receives, and where they stand
    write_observation(measurement[0], measurement[1], reference, state)
    place = FIRST
    for _ in range(int(parameters[LAYERS])):
        there, returned, weights = widest - here, int(parameters[place + OUTPUTS]), place + WEIGHTS
        offset = weights + returned * given
        for i in range(returned):
            total = parameters[offset + i]
            for j in range(given):
                total += parameters[weights + i * given + j] * state[here + j]
            activation, low, high = int(parameters[place]), parameters[place + LOW], parameters[place + HIGH]
            state[there + i] = _activated(activation, low, high, total)
        given, here, place = returned, there, offset + returned
    for axis in range(3):
        torque[axis] = parameters[LIMIT] * min(max(state[here + axis], -1.0), 1.0)


@inlined
def _activated(activation: int, low: float, high: float, x: float) -> float:
    """Return an activation of x; `low` is also the slope of `ELU` and `LEAKY` below 0."""
    if activation == RELU:
        return max(x, 0.0)
    if activation == TANH:
        return tanh(x)
    if activation == SIGMOID:
        return 1.0 / (1.0 + exp(-x)) if x > 0 else 1.0 - 1.0 / (1.0 + exp(x))
    if activation == ELU:
        return x if x > 0 else low * expm1(x)
    if activation == LEAKY:
        return x if x > 0 else low * x
    if activation == CLIP:
        return min(max(x, low), high)
    return x
