"""Dense networks from ONNX files, whatever library has trained them."""

from __future__ import annotations

import os
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from spheretwin.control.law import LARGEST
from spheretwin.models.base.arrays import Array
from spheretwin.models.base.errors import InputError, without_breaks
from spheretwin.models.base.extras import missing
from spheretwin.models.base.files import regular_file

ACTIVATIONS = ("", "Relu", "Tanh", "Sigmoid", "Elu", "LeakyRelu", "Clip")
"""Activations, by their names in ONNX."""

SAME = ("Identity", "Flatten", "Cast", "Reshape", "Dropout", "Squeeze", "Unsqueeze")
"""Operations that leave the numbers of one row as they are."""

PRODUCTS = ("Gemm", "MatMul")
SUMS = ("Add", "Sub", "Mul", "Div")

SLOPES = {"Elu": 1.0, "LeakyRelu": 0.01}
"""Slope below 0 of activations that have one, unless a file gives it."""


class Layer(NamedTuple):
    """Layer of a network: ``activation(weights @ x + offset)``."""

    weights: Array  # (m, n)
    offset: Array  # (m,)
    activation: str  # of `ACTIVATIONS`
    low: float  # least value of Clip, slope of Elu and LeakyRelu
    high: float  # largest value of Clip


def network_of(path: str, inputs: int) -> tuple[Layer, ...]:
    """Return the layers of an ONNX file.

    Its first output is followed back to the input. Products, sums and quotients with constants, such as those
    that scale observations, become part of a layer.

    Parameters
    ----------
    path : str
    inputs : int
        Numbers that the network receives.

    Raises
    ------
    InputError
        The package onnx is missing, the file cannot be read, or the network has another number of inputs,
        other operations, branches or numbers that are not finite.
    """
    try:
        state = regular_file(os.path.expanduser(path)).stat()
    except OSError as error:
        raise InputError(
            f"policy {path}: expected a file of ONNX, received {without_breaks(error)}"
        ) from None
    return _network_of(path, inputs, state.st_mtime_ns, state.st_size)


@lru_cache(maxsize=32)
def _network_of(path: str, inputs: int, changed_ns: int, size: int) -> tuple[Layer, ...]:
    try:
        import onnx
        from google.protobuf.message import DecodeError
    except ModuleNotFoundError:
        raise missing(f"policy {path}", "onnx", "rl") from None
    try:
        graph = onnx.load(os.path.expanduser(path)).graph
        tensors = {entry.name: entry for entry in graph.initializer}
        tensors |= {own.output[0]: own.attribute[0].t for own in graph.node if own.op_type == "Constant"}
        constants = {name: onnx.numpy_helper.to_array(own).astype(float) for name, own in tensors.items()}
        with np.errstate(all="ignore"):  # numbers that are not finite are refused at the end
            return _layers(_chain(graph, constants), constants, inputs)
    except _RefusalError as error:
        raise InputError(f"policy {path}: {error}") from None
    except (DecodeError, LookupError, TypeError, ValueError) as error:  # no file of ONNX, or a damaged one
        received = without_breaks(error)
        raise InputError(f"policy {path}: expected a network as ONNX, received {received}") from None


class _RefusalError(Exception):
    """What was expected, and received."""


def _chain(graph: Any, constants: dict[str, Array]) -> list[Any]:
    """Return the operations from the input to the first output."""
    producers = {name: node for node in graph.node for name in node.output if name not in constants}
    name, chain = graph.output[0].name, []
    while name in producers:
        node = producers[name]
        others = [own for own in node.input if own and own not in constants]
        if len(others) != 1:
            raise _RefusalError(
                f"expected one input of each layer, received {node.op_type} with {len(others)}"
            )
        chain.append(node)
        name = others[0]
    return chain[::-1]


def _layers(chain: list[Any], constants: dict[str, Array], inputs: int) -> tuple[Layer, ...]:
    layers, weights, offset = [], np.eye(inputs), np.zeros(inputs)
    for node in chain:
        if node.op_type in ACTIVATIONS:
            layers.append(Layer(weights, offset, node.op_type, *_range(node, constants)))
            weights, offset = np.eye(len(offset)), np.zeros(len(offset))
        elif node.op_type not in SAME:
            weights, offset = _after(node, constants, weights, offset)
    if not layers or not np.array_equal(weights, np.eye(len(offset))) or offset.any():
        layers.append(Layer(weights, offset, "", 0.0, 0.0))
    if not all(np.isfinite([*own.weights.ravel(), *own.offset]).all() for own in layers):
        raise _RefusalError("expected finite numbers, received others")
    return tuple(layers)


def _range(node: Any, constants: dict[str, Array]) -> tuple[float, float]:
    """Return the numbers of an activation that its layer keeps."""
    attributes = {own.name: own.f for own in node.attribute}
    if node.op_type != "Clip":
        return attributes.get("alpha", SLOPES.get(node.op_type, 0.0)), 0.0
    given = [float(constants[name]) if name else None for name in [*node.input[1:], "", ""][:2]]
    low, high = given if any(own is not None for own in given) else map(attributes.get, ("min", "max"))
    return -LARGEST if low is None else low, LARGEST if high is None else high


def _after(node: Any, constants: dict[str, Array], weights: Array, offset: Array) -> tuple[Array, Array]:
    """Return ``weights @ x + offset`` after an operation with constants."""
    first, *others = node.input
    if node.op_type in PRODUCTS and first not in constants:
        own: dict[str, Any] = {e.name: e.f if e.type == 1 else e.i for e in node.attribute}
        matrix = constants[others[0]] if own.get("transB") else constants[others[0]].T
        if own.get("transA"):
            raise _RefusalError("expected observations as rows, received Gemm with transA")
        added = own.get("beta", 1.0) * constants[others[1]].ravel() if others[1:] else 0.0
        return (scaled := own.get("alpha", 1.0) * matrix) @ weights, scaled @ offset + added
    is_first = first in constants
    if node.op_type not in SUMS or (node.op_type == "Div" and is_first):
        known = ", ".join([*PRODUCTS, *SUMS, *ACTIVATIONS[1:], *SAME])
        raise _RefusalError(f"expected the operations {known}, received {node.op_type}")
    constant = constants[first if is_first else others[0]].ravel()
    factors: dict[str, tuple[Any, Any]] = {
        "Add": (1.0, constant),
        "Sub": (-1.0, constant) if is_first else (1.0, -constant),
        "Mul": (constant, 0.0),
        "Div": (1.0 / constant, 0.0),
    }
    scale, shift = factors[node.op_type]
    return np.reshape(scale, (-1, 1)) * weights, scale * offset + shift
