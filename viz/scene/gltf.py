"""Meshes as binary glTF, in which a recording keeps them in half the bytes of its own form."""

from __future__ import annotations

import json
import struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

MEDIA_TYPE = "model/gltf-binary"

# Of the format: what its numbers mean.
_FLOAT, _SHORT, _INT = 5126, 5123, 5125
_MAGIC, _VERSION = b"glTF", 2
_JSON, _BINARY = b"JSON", b"BIN\0"
_HEADER_BYTES = 12


def binary(positions: NDArray[np.float64], triangles: NDArray[np.int64]) -> bytes:
    """One mesh without normals, as glTF has it: the viewer shades each triangle by its own.

    Parameters
    ----------
    positions : (n, 3) array, m
    triangles : (m, 3) array
        Corners of each, counter-clockwise from outside.
    """
    corner, kind = ("<u2", _SHORT) if len(positions) <= 0xFFFF else ("<u4", _INT)
    points, corners = positions.astype("<f4"), triangles.astype(corner).ravel()
    parts = [_padded(array.tobytes()) for array in (points, corners)]
    bounds = {"min": points.min(axis=0).tolist(), "max": points.max(axis=0).tolist()}
    described = {
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
        "accessors": [
            {"bufferView": 0, "componentType": _FLOAT, "count": len(points), "type": "VEC3", **bounds},
            {"bufferView": 1, "componentType": kind, "count": len(corners), "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": points.nbytes},
            {"buffer": 0, "byteOffset": len(parts[0]), "byteLength": corners.nbytes},
        ],
        "buffers": [{"byteLength": sum(map(len, parts))}],
    }
    return _file(described, b"".join(parts))


def _file(described: dict[str, Any], contents: bytes) -> bytes:
    text = _padded(json.dumps(described, separators=(",", ":")).encode(), b" ")
    chunks = _chunk(_JSON, text) + _chunk(_BINARY, contents)
    return struct.pack("<4sII", _MAGIC, _VERSION, _HEADER_BYTES + len(chunks)) + chunks


def _chunk(kind: bytes, contents: bytes) -> bytes:
    return struct.pack("<I4s", len(contents), kind) + contents


def _padded(contents: bytes, filling: bytes = b"\0") -> bytes:
    """To whole words of four bytes."""
    return contents + filling * (-len(contents) % 4)
