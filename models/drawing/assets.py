"""The meshes that the MJCF draws, remade from the numbers it holds.

``python -m spheretwin.models.drawing.assets`` rewrites them; it needs the extra ``meshes``. Solids are built
and cut by manifold3d, in metres, in the frame of the body that carries them (pole and coil: origin at their
centre, z outward).
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from spheretwin.models import actuator as actuators
from spheretwin.models.actuator import Actuator
from spheretwin.models.drawing import joint, rotor, stator
from spheretwin.models.drawing.mesh_files import to_mesh, to_obj

if TYPE_CHECKING:
    from trimesh import Trimesh

ASSETS = actuators.FOLDER / "assets"


def meshes(actuator: Actuator) -> dict[str, Trimesh]:
    """Make every mesh that ``actuator.xml`` draws.

    Parameters
    ----------
    actuator : Actuator
        Its magnets, coils and shaft give the dimensions that are simulated.

    Returns
    -------
    dict of Trimesh, m
        By mesh name: watertight, in the frame of the body (pole and coil: of the part itself).
    """
    solids = {
        "stator": stator.stator(actuator),
        "outer_ring": joint.outer_ring(),
        "inner_ring": joint.inner_ring(),
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
        Made if missing; files of the same names are overwritten.
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
