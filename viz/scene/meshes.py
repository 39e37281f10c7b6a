"""The actuator's meshes in a recording, taken from the model file."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

import mujoco
import numpy as np
import rerun as rr
from numpy.typing import NDArray

from spheretwin.models.base.errors import InputError
from spheretwin.models.base.wording import without_breaks
from spheretwin.models.mjcf import fingerprint
from spheretwin.viz.scene.paths import COILS, WORLD


@dataclass(frozen=True)
class Drawn:
    """A mesh with one normal a vertex, in the frame of its body."""

    positions: NDArray[np.float32]  # (n, 3) m
    normals: NDArray[np.float32]  # (n, 3)
    triangles: NDArray[np.int64]  # (m, 3)


def read_meshes(mjcf: Path) -> dict[str, rr.Mesh3D]:
    """Read what is drawn of a model, which a run does without; once while no file that it names has changed.

    Returns
    -------
    dict of Mesh3D
        By entity, one for each body and colour, named after the first geom that it draws; and one for all
        coils.

    Raises
    ------
    InputError
        A mesh is missing or broken.
    """
    return _meshes(mjcf, fingerprint(mjcf))


@lru_cache(maxsize=2)
def _meshes(mjcf: Path, _: str) -> dict[str, rr.Mesh3D]:
    mujoco.mj_clearCache(mujoco.mj_getCache())  # it misses a mesh edited within a second
    try:
        # Not `models.mjcf.read`: it leaves out what is only drawn, which is all that is wanted here.
        model = mujoco.MjModel.from_xml_path(str(mjcf))
    except ValueError as error:
        raise InputError(
            f"model {mjcf}: expected meshes that can be drawn, {without_breaks(error)}"
        ) from None
    mujoco.mj_clearCache(mujoco.mj_getCache())  # 12 MB of meshes that nobody reads again
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    coils: list[tuple[int, Drawn]] = []
    others: dict[tuple[str, tuple[float, ...]], list[Drawn]] = defaultdict(list)
    names: dict[tuple[str, tuple[float, ...]], str] = {}
    for i in np.flatnonzero(model.geom_type == mujoco.mjtGeom.mjGEOM_MESH).tolist():
        drawn, geom = _in_body_frame(model, data, i), model.geom(i)
        if geom.name.startswith("coil_"):
            coils.append((_coil_at(model, data, data.geom_xpos[i]), drawn))
            continue
        key = (model.body(geom.bodyid[0]).name, tuple(geom.rgba.tolist()))
        others[key].append(drawn)
        names.setdefault(key, geom.name or f"geom{i}")
    meshes = {COILS: _coil_mesh(coils, len(_coil_sites(model)))} if coils else {}
    for (body, colour), parts in others.items():
        drawn = _joined(parts)
        meshes[f"{WORLD}/{body}/{names[body, colour]}"] = rr.Mesh3D(
            vertex_positions=drawn.positions,
            vertex_normals=drawn.normals,
            triangle_indices=drawn.triangles,
            albedo_factor=[round(255 * c) for c in colour[:3]],
        )
    return meshes


def _in_body_frame(model: mujoco.MjModel, data: mujoco.MjData, geom: int) -> Drawn:
    """Mesh of a geom; MuJoCo moves meshes to their own centre, and the geom's pose moves them back."""
    mesh = model.geom_dataid[geom]
    vertex, normal, face = model.mesh_vertadr[mesh], model.mesh_normaladr[mesh], model.mesh_faceadr[mesh]
    faces = slice(face, face + model.mesh_facenum[mesh])
    corners = np.stack([model.mesh_face[faces].ravel(), model.mesh_facenormal[faces].ravel()], axis=1)
    # A vertex on a sharp edge has a normal for each side, so it is drawn once for each.
    code, triangles = np.unique(corners @ [1 << 32, 1], return_inverse=True)
    body = model.geom_bodyid[geom]
    R_SB, R_SG = data.xmat[body].reshape(3, 3), data.geom_xmat[geom].reshape(3, 3)
    R_BG = R_SB.T @ R_SG
    p_BG = R_SB.T @ (data.geom_xpos[geom] - data.xpos[body])
    positions = model.mesh_vert[vertex + (code >> 32)] @ R_BG.T + p_BG
    normals = model.mesh_normal[normal + (code & 0xFFFFFFFF)] @ R_BG.T
    return Drawn(positions.astype(np.float32), normals.astype(np.float32), triangles.reshape(-1, 3))


def _joined(drawn: list[Drawn]) -> Drawn:
    first = np.cumsum([0] + [len(part.positions) for part in drawn[:-1]])
    return Drawn(
        np.concatenate([part.positions for part in drawn]),
        np.concatenate([part.normals for part in drawn]),
        np.concatenate([part.triangles + start for part, start in zip(drawn, first, strict=True)]),
    )


def _coil_sites(model: mujoco.MjModel) -> list[int]:
    """Sites of the coils, in the order of the actuator's."""
    return [i for i in range(model.nsite) if model.site(i).name.startswith("coil_")]


def _coil_at(model: mujoco.MjModel, data: mujoco.MjData, position: NDArray[np.float64]) -> int:
    """The actuator's coil at a position: a model may draw its coils in any order, or not all of them."""
    distances = np.linalg.norm(data.site_xpos[_coil_sites(model)] - position, axis=1)
    return int(np.argmin(distances))


def _coil_mesh(coils: list[tuple[int, Drawn]], count: int) -> rr.Mesh3D:
    """All coils as one mesh; each looks up its own pixel of a texture, whose bytes then change over time.

    Of the ways to colour dozens of coils at 60 Hz this is the cheapest that keeps their shape: a mesh entity
    for each costs the viewer three times as long a frame.

    Parameters
    ----------
    coils : list of (int, Drawn)
        Each with its place among the actuator's.
    count : int
        How many the actuator has.
    """
    places, drawn = zip(*coils, strict=True)
    pixel = np.repeat((np.array(places) + 0.5) / count, [len(coil.positions) for coil in drawn])
    joined = _joined(list(drawn))
    return rr.Mesh3D.from_fields(
        vertex_positions=joined.positions,
        vertex_normals=joined.normals,
        triangle_indices=joined.triangles,
        vertex_texcoords=np.stack([pixel, np.full_like(pixel, 0.5)], axis=1),
        albedo_texture_format=rr.components.ImageFormat(
            width=count, height=1, color_model="RGB", channel_datatype="U8"
        ),
    )
