"""The actuator's meshes in a recording, taken from the model file."""

from __future__ import annotations

from collections import defaultdict
from functools import lru_cache
from pathlib import Path
from typing import NamedTuple

import mujoco
import numpy as np
import rerun as rr
from numpy.typing import NDArray

from spheretwin.models.actuator import read_magnet_and_coil
from spheretwin.models.base.errors import InputError
from spheretwin.models.base.mujoco_library import compiler_warnings
from spheretwin.models.base.wording import without_breaks
from spheretwin.models.mjcf import fingerprint
from spheretwin.viz import palette
from spheretwin.viz.scene import gltf
from spheretwin.viz.scene.coils import coil_mesh
from spheretwin.viz.scene.paths import WORLD

Array = NDArray[np.float64]

POLES = {1: ("poles_north", palette.NORTH), -1: ("poles_south", palette.SOUTH)}
"""Name and colour of poles by their polarity."""

FRAME = "frame"
"""Name of a mesh that has that of its body."""

DECIMALS = 7
"""Of vertices in m: what a mesh file holds, and equal where they were equal there, which compresses."""


ROUNDING = 1e-12
"""Of a pose that the engine has turned to a mesh's own axes and back."""


class Piece(NamedTuple):
    """What is drawn under one name: copies of one mesh."""

    positions: Array  # (n, 3) m, as in the mesh's file
    triangles: NDArray[np.int64]  # (m, 3), counter-clockwise from outside
    colour: palette.Colour
    rotations: Array  # (copies, 3, 3), into the frame of the body that carries them
    translations: Array  # (copies, 3) m

    def archetypes(self) -> list[rr.Asset3D | rr.InstancePoses3D]:
        """In the form in which a recording takes it: without poses where its body carries one as it is."""
        contents = gltf.binary(self.positions, self.triangles)
        asset = rr.Asset3D(contents=contents, media_type=gltf.MEDIA_TYPE, albedo_factor=self.colour)
        if self._lies_as_in_its_file():
            return [asset]
        return [asset, rr.InstancePoses3D(translations=self.translations, mat3x3=self.rotations)]

    def _lies_as_in_its_file(self) -> bool:
        one = len(self.rotations) == 1 and np.allclose(self.rotations[0], np.eye(3), rtol=0, atol=ROUNDING)
        return one and np.allclose(self.translations, 0.0, rtol=0, atol=ROUNDING)


class Meshes(NamedTuple):
    """What is drawn of a model."""

    coils: rr.Mesh3D | None
    """All of them, turned from their numbers; None where the model draws none."""
    others: dict[str, Piece]
    """By entity."""


class Look(NamedTuple):
    """What copies of one thing have in common."""

    body: int
    mesh: int
    name: str
    colour: palette.Colour


def read_meshes(mjcf: Path) -> Meshes:
    """Read what is drawn of a model, which a run does without; once while no file that it names has changed.

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
        # Not `models.mjcf.read`: it leaves out what is only drawn, which is all that is wanted here.
        with compiler_warnings():  # a run has them from there
            model = mujoco.MjModel.from_xml_path(str(mjcf))
    except ValueError as error:
        raise InputError(
            f"model {mjcf}: expected meshes that can be drawn, {without_breaks(error)}"
        ) from None
    mujoco.mj_clearCache(mujoco.mj_getCache())  # 12 MB of meshes that nobody reads again
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    coils: list[int] = []
    others: dict[Look, list[int]] = defaultdict(list)
    for geom in np.flatnonzero(model.geom_type == mujoco.mjtGeom.mjGEOM_MESH).tolist():
        if model.geom(geom).name.startswith("coil_"):
            coils.append(geom)
        else:
            others[_look(model, data, geom)].append(geom)
    pieces: dict[str, Piece] = {}
    for look, geoms in others.items():
        pieces[_free(_entity(model, look), pieces)] = _piece(model, data, look, geoms)
    return Meshes(_coils(model, data, coils, mjcf) if coils else None, pieces)


def _coils(model: mujoco.MjModel, data: mujoco.MjData, geoms: list[int], mjcf: Path) -> rr.Mesh3D:
    sites = _sites(model, "coil_")
    places = [_nearest(data, geom, sites) for geom in geoms]
    at = [sites[place] for place in places]
    axes = data.site_xmat[at].reshape(-1, 3, 3)[:, :, 2]
    _, coil = read_magnet_and_coil(mjcf)
    return coil_mesh(coil, data.site_xpos[at], axes, places, len(sites))


def _look(model: mujoco.MjModel, data: mujoco.MjData, geom: int) -> Look:
    body, mesh = int(model.geom_bodyid[geom]), int(model.geom_dataid[geom])
    if model.geom(geom).name.startswith("pole_"):
        poles = _sites(model, "pole_")
        polarity = model.site_user[poles[_nearest(data, geom, poles)], 0]
        return Look(body, mesh, *POLES[int(polarity)])
    name = model.mesh(mesh).name
    red, green, blue = (round(255 * share) for share in model.geom_rgba[geom, :3].tolist())
    return Look(body, mesh, FRAME if name == model.body(body).name else name, (red, green, blue))


def _entity(model: mujoco.MjModel, look: Look) -> str:
    """Below the body that carries it: what is fixed to a moving body moves with it."""
    own = model.body(look.body).name or f"body{look.body}"
    carrier = model.body(_carrier(model, look.body)).name
    folders = [own] if carrier in ("world", own) else [carrier, own]
    return "/".join([WORLD, *map(rr.escape_entity_path_part, [*folders, look.name])])


def _free(entity: str, taken: dict[str, Piece]) -> str:
    """The same name, or with a number where it is taken."""
    names = [entity, *(f"{entity}_{i}" for i in range(2, len(taken) + 2))]
    return next(name for name in names if name not in taken)


def _piece(model: mujoco.MjModel, data: mujoco.MjData, look: Look, geoms: list[int]) -> Piece:
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
