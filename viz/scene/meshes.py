"""The actuator's meshes in a recording, taken from the model file."""

from __future__ import annotations

import json
import struct
from collections import defaultdict
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import mujoco
import numpy as np
import rerun as rr
from numpy.typing import NDArray

from spheretwin.models.base.arrays import Array
from spheretwin.models.base.errors import InputError, without_breaks
from spheretwin.models.base.mujoco_library import compiler_warnings
from spheretwin.models.magnet_and_coil import CoilGeometry, read_coil
from spheretwin.models.mjcf import fingerprint, missing_meshes, read
from spheretwin.viz import theme
from spheretwin.viz.scene.solids import merged_surface, revolved_surface

# Codes of the format.
_FLOAT, _SHORT, _INT = 5126, 5123, 5125
_MAGIC, _VERSION = b"glTF", 2
_JSON, _BINARY = b"JSON", b"BIN\0"
_HEADER_BYTES = 12


def binary(positions: NDArray[np.float64], triangles: NDArray[np.int64]) -> bytes:
    """Return one mesh without normals in glTF: the viewer shades each triangle by its own normal.

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
    """Pad to whole words of four bytes."""
    return contents + filling * (-len(contents) % 4)


# Shape of a coil besides its dimensions: a winding between two flanges.
SECTIONS = 10
FLANGE_SHARE = 0.07  # of the length
RECESS_SHARE = 0.12  # of the winding's depth


def coil_mesh(coil: CoilGeometry, centres: Array, axes: Array) -> rr.Mesh3D:
    """Return all coils as one mesh; each group has its pixel of a texture, whose bytes change over time.

    This is the fastest way to colour dozens of coils at 60 Hz without changing their shape: a mesh entity
    for each costs the viewer three times as long a frame.

    Parameters
    ----------
    coil : Coil
        Its radii and its length.
    centres : (n, 3) array, m
        Centres of the coils.
    axes : (n, 3) array
        Unit vectors along them.
    """
    one = revolved_surface(_outline(coil), SECTIONS)
    coil_surfaces = [
        one.placed(_rotation_to(axis), centre) for axis, centre in zip(axes, centres, strict=True)
    ]
    whole = merged_surface(coil_surfaces)
    return rr.Mesh3D.from_fields(
        vertex_positions=whole.positions,
        vertex_normals=whole.normals,
        triangle_indices=whole.triangles,
    )


def _outline(coil: CoilGeometry) -> list[tuple[float, float]]:
    """Corners of a coil's outline, each distance from the axis and height along it, m."""
    bore, radius, half = coil.inner_radius_m, coil.outer_radius_m, coil.length_m / 2
    flange = FLANGE_SHARE * coil.length_m
    winding, edge = radius - RECESS_SHARE * (radius - bore), half - flange
    above = [(winding, edge), (radius, edge), (radius, half), (bore, half)]
    below = [(distance, -height) for distance, height in reversed(above)]
    return [*below, *above, below[0]]


def _rotation_to(axis: Array) -> Array:
    """A rotation that takes z to a unit vector: its columns."""
    aside = np.eye(3)[np.argmin(np.abs(axis))]
    x = np.cross(aside, axis)
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(axis, x), axis], axis=1)


WORLD = "world"
COILS = f"{WORLD}/coils"
TORQUES = f"{WORLD}/torques"
FAILURE = f"{WORLD}/failure"
FAILURE_TEXT = f"{FAILURE}/text"
AXES = f"{WORLD}/axes"
ROTOR_AXES = f"{WORLD}/rotor/axes"
PAYLOAD = f"{WORLD}/rotor/payload"
CURRENT_SCALE = f"{WORLD}/current_scale"
"""Scale of the colours with its labels, and the range of the bars."""


POLES = {1: ("poles_north", theme.NORTH), -1: ("poles_south", theme.SOUTH)}
"""Name and colour of poles by their polarity."""

FRAME = "frame"
"""Name of a mesh that has that of its body."""

DECIMALS = 7
"""Decimals of vertices in m: those of a mesh file; equal vertices stay equal, which compresses."""


ROUNDING = 1e-12
"""Error of a pose that the engine has rotated to a mesh's own axes and back."""


class Piece(NamedTuple):
    """Copies of one mesh with one name."""

    positions: Array  # (n, 3) m, as in the mesh's file
    triangles: NDArray[np.int64]  # (m, 3), counter-clockwise from outside
    colour: theme.Colour
    rotations: Array  # (copies, 3, 3), into the frame of the body that carries them
    translations: Array  # (copies, 3) m

    def archetypes(self) -> list[rr.Asset3D | rr.InstancePoses3D]:
        """Return the archetypes of a recording: without poses if the mesh has the pose of its body."""
        contents = binary(self.positions, self.triangles)
        asset = rr.Asset3D.from_fields(blob=contents, albedo_factor=self.colour)
        if self._has_identity_pose():
            return [asset]
        return [asset, rr.InstancePoses3D(translations=self.translations, mat3x3=self.rotations)]

    def _has_identity_pose(self) -> bool:
        one = len(self.rotations) == 1 and np.allclose(self.rotations[0], np.eye(3), rtol=0, atol=ROUNDING)
        return one and np.allclose(self.translations, 0.0, rtol=0, atol=ROUNDING)


@dataclass(frozen=True, eq=False)
class Meshes:
    """Meshes of a model."""

    coils: rr.Mesh3D | None
    """All coils in one mesh, from their dimensions; None if the model draws none."""
    coil_places: tuple[int, ...]
    """Place among the actuator's coils of each coil in the mesh, which all have as many vertices."""
    others: dict[str, Piece]
    """Pieces by entity."""


class MeshLook(NamedTuple):
    """Common properties of copies."""

    body: int
    mesh: int
    name: str
    colour: theme.Colour


def read_meshes(mjcf: Path) -> Meshes:
    """Read the meshes of a model, which a run does not need; once while no file that it names has changed.

    A piece is a mesh of a body in one colour, named after the mesh. Poles are named and coloured by their
    polarity.

    Raises
    ------
    InputError
        A mesh is missing or broken.
    """
    return _meshes(mjcf, fingerprint(mjcf))


@lru_cache(maxsize=2)
def _meshes(mjcf: Path, _: str) -> Meshes:
    mujoco.mj_clearCache(mujoco.mj_getCache())  # it misses a mesh edited within a second
    try:
        # not `models.mjcf.read`: it leaves out visual meshes, the only ones needed here
        with compiler_warnings():  # a run has them from there
            model = _drawable(mjcf)
    except ValueError as error:
        raise InputError(
            f"model {mjcf}: expected meshes that can be drawn, {without_breaks(error)}"
        ) from None
    mujoco.mj_clearCache(mujoco.mj_getCache())  # 12 MB of meshes that are not read again
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    coils: list[int] = []
    others: dict[MeshLook, list[int]] = defaultdict(list)
    for geom in np.flatnonzero(model.geom_type == mujoco.mjtGeom.mjGEOM_MESH).tolist():
        if model.geom(geom).name.startswith("coil_"):
            coils.append(geom)
        else:
            others[_look(model, data, geom)].append(geom)
    pieces: dict[str, Piece] = {}
    for look, geoms in others.items():
        pieces[_unused_name(_entity(model, look), pieces)] = _piece(model, data, look, geoms)
    sites = _sites(model, "coil_")
    places = tuple(_nearest(data, geom, sites) for geom in coils)
    at = [sites[place] for place in places]
    return Meshes(_coils(data, at, mjcf) if coils else None, places, pieces)


def _drawable(mjcf: Path) -> mujoco.MjModel:
    """Return a model with the meshes whose files are there; the reader of the model warns of the others."""
    spec = mujoco.MjSpec.from_file(str(mjcf))
    lost = set(missing_meshes(spec, mjcf).values())
    for geom in [geom for geom in spec.geoms if geom.meshname in lost]:
        spec.delete(geom)
    for mesh in [mesh for mesh in spec.meshes if (mesh.name or Path(mesh.file).stem) in lost]:
        spec.delete(mesh)
    return spec.compile()


def _coils(data: mujoco.MjData, at: list[int], mjcf: Path) -> rr.Mesh3D:
    axes = data.site_xmat[at].reshape(-1, 3, 3)[:, :, 2]
    return coil_mesh(read_coil(read(mjcf).described), data.site_xpos[at], axes)


def _look(model: mujoco.MjModel, data: mujoco.MjData, geom: int) -> MeshLook:
    body, mesh = int(model.geom_bodyid[geom]), int(model.geom_dataid[geom])
    if model.geom(geom).name.startswith("pole_"):
        poles = _sites(model, "pole_")
        polarity = model.site_user[poles[_nearest(data, geom, poles)], 0]
        return MeshLook(body, mesh, *POLES[int(polarity)])
    name = model.mesh(mesh).name
    red, green, blue = (round(255 * share) for share in model.geom_rgba[geom, :3].tolist())
    return MeshLook(body, mesh, FRAME if name == model.body(body).name else name, (red, green, blue))


def _entity(model: mujoco.MjModel, look: MeshLook) -> str:
    """Return an entity below the body that carries it: parts fixed to a moving body move with it."""
    own = model.body(look.body).name or f"body{look.body}"
    carrier = model.body(_carrier(model, look.body)).name
    folders = [own] if carrier in ("world", own) else [carrier, own]
    return "/".join([WORLD, *map(rr.escape_entity_path_part, [*folders, look.name])])


def _unused_name(entity: str, taken: dict[str, Piece]) -> str:
    """Return the name, or with a number if it is in use."""
    names = [entity, *(f"{entity}_{i}" for i in range(2, len(taken) + 2))]
    return next(name for name in names if name not in taken)


def _piece(model: mujoco.MjModel, data: mujoco.MjData, look: MeshLook, geoms: list[int]) -> Piece:
    vertex, face = model.mesh_vertadr[look.mesh], model.mesh_faceadr[look.mesh]
    body = _carrier(model, look.body)
    R_SB, p_SB = data.xmat[body].reshape(3, 3), data.xpos[body]
    # MuJoCo turns and moves meshes to their own axes and centre, and the geoms' poses back.
    R_FM, p_FM = _matrix(model.mesh_quat[look.mesh]), model.mesh_pos[look.mesh]
    in_file = model.mesh_vert[vertex : vertex + model.mesh_vertnum[look.mesh]] @ R_FM.T + p_FM
    rotations = R_SB.T @ data.geom_xmat[geoms].reshape(-1, 3, 3) @ R_FM.T
    return Piece(
        positions=np.round(in_file, DECIMALS),
        triangles=model.mesh_face[face : face + model.mesh_facenum[look.mesh]].astype(np.int64),
        colour=look.colour,
        rotations=rotations,
        translations=(data.geom_xpos[geoms] - p_SB) @ R_SB - rotations @ p_FM,
    )


def _matrix(quaternion: Array) -> Array:
    """Rotation matrix of a quaternion w, x, y, z."""
    flat = np.empty(9)
    mujoco.mju_quat2Mat(flat, quaternion)
    return flat.reshape(3, 3)


def _carrier(model: mujoco.MjModel, body: int) -> int:
    """The moving body that a body is fixed to, or the world."""
    return int(model.body_weldid[body])


def _sites(model: mujoco.MjModel, prefix: str) -> list[int]:
    """Sites whose names begin so, in the order of the actuator's."""
    return [i for i in range(model.nsite) if model.site(i).name.startswith(prefix)]


def _nearest(data: mujoco.MjData, geom: int, sites: list[int]) -> int:
    """Place among some sites of the one at a geom: a model may draw in any order, or not all of them."""
    distances = np.linalg.norm(data.site_xpos[sites] - data.geom_xpos[geom], axis=1)
    return int(np.argmin(distances))
