"""Mesh files of the MJCF, generated from its numbers.

``python docs/scripts/make_meshes.py`` writes them; it needs the extra ``meshes``. Solids are
built and cut by manifold3d, in metres, in the frame of their body (pole and coil: origin at
their centre, z outward).
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from manifold3d import Manifold
from meshes import rotor, stator
from numpy.typing import NDArray

from spheretwin.models import actuator as actuators
from spheretwin.models.actuator import Actuator

if TYPE_CHECKING:
    from trimesh import Trimesh

# Faces that meet at less than this angle are shaded as one smooth surface.
CREASE_DEG = 30.0
VERTEX_DECIMALS = 7
NORMAL_DECIMALS = 3


def to_mesh(solid: Manifold) -> Trimesh:
    """Return the mesh of a solid in an order that depends on its shape only."""
    from trimesh import Trimesh  # slow to import

    raw = solid.as_original().simplify(10.0**-VERTEX_DECIMALS * 5).to_mesh64()
    corners = np.round(raw.vert_properties[:, :3], VERTEX_DECIMALS) + 0.0  # no negative zero
    vertices, index = np.unique(corners, axis=0, return_inverse=True)
    faces = index.ravel()[raw.tri_verts.astype(np.int64)]
    # The smallest vertex comes first, with the same winding; faces that rounding degenerates are removed.
    first = np.argmin(faces, axis=1)
    faces = np.take_along_axis(faces, (first[:, None] + np.arange(3)) % 3, axis=1)
    faces = faces[(faces[:, 0] != faces[:, 1]) & (faces[:, 1] != faces[:, 2]) & (faces[:, 2] != faces[:, 0])]
    faces = faces[np.lexsort(faces.T[::-1])]
    return Trimesh(vertices, faces, process=False)


def to_obj(mesh: Trimesh) -> str:
    """Return the text of an OBJ file: vertices in metres, and normals that are split along sharp edges.

    Without normals of its own a mesh gets one normal per vertex from MuJoCo, and every edge looks worn.
    """
    corner_normals = np.round(crease_normals(mesh).reshape(-1, 3), NORMAL_DECIMALS) + 0.0
    normals, normal_of_corner = np.unique(corner_normals, axis=0, return_inverse=True)
    normal_of_corner = normal_of_corner.reshape(-1, 3)
    lines = [
        f"v {x:.{VERTEX_DECIMALS}f} {y:.{VERTEX_DECIMALS}f} {z:.{VERTEX_DECIMALS}f}"
        for x, y, z in mesh.vertices
    ]
    lines += [
        f"vn {x:.{NORMAL_DECIMALS}f} {y:.{NORMAL_DECIMALS}f} {z:.{NORMAL_DECIMALS}f}" for x, y, z in normals
    ]
    for vertices, corners in zip(mesh.faces + 1, normal_of_corner + 1, strict=True):
        lines.append("f " + " ".join(f"{v}//{n}" for v, n in zip(vertices, corners, strict=True)))
    return "\n".join(lines) + "\n"


def crease_normals(mesh: Trimesh) -> NDArray[np.float64]:
    """Return the normal at each corner of each face: the mean over nearly coplanar faces of the vertex.

    Returns
    -------
    (faces, 3, 3) array
        Unit normals, weighted by the angle a face spans at the vertex.
    """
    from scipy.sparse import coo_array, csr_array  # slow to import

    vertex = mesh.faces.ravel()
    corner = np.arange(len(vertex))
    normal = np.repeat(mesh.face_normals, 3, axis=0)  # (corners, 3)
    at_vertex = csr_array((np.ones(len(vertex)), (vertex, corner)))
    pairs = (at_vertex.T @ at_vertex).tocoo()  # corners that share a vertex
    a, b = pairs.coords
    smooth = np.einsum("ij,ij->i", normal[a], normal[b]) > np.cos(np.radians(CREASE_DEG))
    weight = np.where(smooth, mesh.face_angles.ravel()[b], 0.0)
    total = coo_array((weight, (a, b)), shape=pairs.shape) @ normal
    return (total / np.linalg.norm(total, axis=1, keepdims=True)).reshape(-1, 3, 3)


ASSETS = actuators.FOLDER / "assets"


def meshes(actuator: Actuator) -> dict[str, Trimesh]:
    """Make every mesh that ``actuator.xml`` draws.

    Parameters
    ----------
    actuator : Actuator
        Its magnets, coils and shaft give the simulated dimensions.

    Returns
    -------
    dict of Trimesh, m
        By mesh name: watertight, in the frame of the body (pole and coil: of the part itself).
    """
    solids = {
        "stator": stator.stator(actuator),
        "outer_ring": rotor.outer_ring(),
        "inner_ring": rotor.inner_ring(),
        "ball": rotor.ball(actuator),
        "hoop": rotor.hoop(actuator),
        "shaft": rotor.shaft(actuator),
        "pole": rotor.pole(actuator),
        "coil": stator.coil(actuator),
    }
    return {name: to_mesh(solid) for name, solid in solids.items()}


def write(folder: Path, actuator: Actuator) -> list[Path]:
    """Write every mesh as OBJ, the same bytes for the same meshes.

    Parameters
    ----------
    folder : Path
        Created if missing; files of the same names are overwritten.
    actuator : Actuator
        See `meshes`.

    Returns
    -------
    list of Path
        The files written.
    """
    folder.mkdir(parents=True, exist_ok=True)
    written = []
    for name, mesh in meshes(actuator).items():
        path = folder / f"{name}.obj"
        path.write_text(to_obj(mesh), encoding="ascii", newline="\n")
        written.append(path)
    return written


if __name__ == "__main__":
    for path in write(ASSETS, actuators.load()):
        print(path)
