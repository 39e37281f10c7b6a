"""The parts of the actuator as meshes: what the MJCF draws, remade from the numbers it holds.

``python -m spheretwin.models.drawing.geometry`` rewrites the assets; it needs the extra ``meshes``. Solids
are built and cut by manifold3d, in metres, in the frame of the body that carries them (pole and coil:
origin at their centre, z outward).
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from manifold3d import Manifold

from spheretwin.models import actuator as actuators
from spheretwin.models.actuator import Actuator
from spheretwin.models.drawing.mesh_files import to_mesh, to_obj
from spheretwin.models.drawing.solids import along, around, both, cylinder, revolve, section, union

if TYPE_CHECKING:
    from trimesh import Trimesh

ASSETS = actuators.FOLDER / "assets"

MM = 1e-3

# Everything below is drawn, not simulated: no inertia, torque or limit depends on it.
# What is simulated comes from the Actuator.

# Ball: a truncated shell whose holes leave a thin dark line around the poles.
BALL_WALL_M = 3.0 * MM
BALL_CUT_HEIGHT_M = 26.0 * MM
POLE_CLEARANCE_M = 0.35 * MM
# Poles stand this proud of the ball: seen, and still well inside the air gap.
POLE_PROUD_M = 0.05 * MM
POLE_CHAMFER_M = 0.4 * MM

# Back iron: a hoop that the poles are seated into, with a groove between their layers.
HOOP_INNER_RADIUS_M = 36.5 * MM
HOOP_OUTER_RADIUS_M = 41.2 * MM
HOOP_HALF_HEIGHT_M = 20.0 * MM
HOOP_GROOVE_HALF_WIDTH_M = 2.5 * MM
HOOP_GROOVE_DEPTH_M = 2.5 * MM

# Coil: two flanges, and between them a winding whose turns show.
COIL_FLANGE_M = 1.2 * MM
COIL_CHAMFER_M = 0.3 * MM
COIL_RECESS_M = 0.35 * MM
COIL_RIDGES = 7
COIL_RIDGE_DEPTH_M = 0.35 * MM

# Passive joint: fork of the stator, outer ring, inner ring, bearing; each turns freely in the next.
FORK_INNER_RADIUS_M = 28.5 * MM
FORK_OUTER_RADIUS_M = 33.0 * MM
FORK_HALF_WIDTH_M = 4.0 * MM
FORK_EYE_RADIUS_M = 5.0 * MM
# Solids that touch in a line alone are not watertight once joined.
FORK_EYE_SHIFT_M = 0.3 * MM
OUTER_RING_INNER_RADIUS_M = 21.5 * MM
OUTER_RING_OUTER_RADIUS_M = 27.0 * MM
OUTER_RING_HALF_HEIGHT_M = 3.5 * MM
INNER_RING_INNER_RADIUS_M = 15.5 * MM
INNER_RING_OUTER_RADIUS_M = 19.8 * MM
INNER_RING_HALF_HEIGHT_M = 3.0 * MM
SPOKE_HALF_WIDTH_M = 1.6 * MM
SPOKE_HALF_HEIGHT_M = 1.6 * MM
BEARING_INNER_RADIUS_M = 6.5 * MM
BEARING_OUTER_RADIUS_M = 9.5 * MM
BEARING_HALF_HEIGHT_M = 4.5 * MM
PIVOT_RADIUS_M = 2.5 * MM
RUNNING_CLEARANCE_M = 0.1 * MM
RING_CHAMFER_M = 0.5 * MM

# Shaft: a spider of four arms joins it to the ball's upper cut; a flange holds the payload.
SHAFT_RADIUS_M = 3.0 * MM
SPIDER_ARMS = 4
SPIDER_ARM_HALF_WIDTH_M = 2.2 * MM
SPIDER_RIM_WIDTH_M = 4.2 * MM
SPIDER_THICKNESS_M = 2.5 * MM
SCREWS = 8
SCREW_RADIUS_M = 1.1 * MM
SCREW_HEIGHT_M = 0.8 * MM
HUB_RADIUS_M = 9.0 * MM
HUB_HEIGHT_M = 35.0 * MM
PAYLOAD_FLANGE_RADIUS_M = 10.5 * MM
PAYLOAD_FLANGE_HALF_HEIGHT_M = 1.0 * MM

# Stator: a shell around the coils, open above so far that the shaft can tilt as the nutation asks. (The
# upper coils stand in its way where it points at one: they are where the MJCF has them.)
SHAFT_TILT_DEG = 57.0
SHELL_INNER_RADIUS_M = 57.0 * MM
SHELL_OUTER_RADIUS_M = 63.0 * MM
SHELL_RIM_MARGIN_DEG = 0.8
SHELL_LOWER_MARGIN_DEG = 4.0
CUT_FROM_DEG = -105.0
CUT_TO_DEG = -15.0
BELT_HALF_WIDTH_DEG = 1.8
BELT_INSET_M = 1.0 * MM
COLLAR_WALL_M = 1.3 * MM
COIL_CLEARANCE_M = 0.1 * MM
FLOOR_BELOW_CENTRE_M = 78.0 * MM
BASE_RADIUS_M = 60.0 * MM
BASE_HEIGHT_M = 4.0 * MM
SKIRT_WALL_M = 4.0 * MM
SKIRT_WINDOWS = 12
# The neck of the joint passes through the ball's lower opening: the slimmer, the further the ball can tilt.
NECK_RADIUS_M = 3.0 * MM

SECTIONS = 60
SMALL_SECTIONS = 40
COIL_SECTIONS = 24
PIN_SECTIONS = 24
HOLE_SECTIONS = 24
ARC_STEP_DEG = 6.0

Points = list[tuple[float, float]]


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
        "stator": stator(actuator),
        "outer_ring": outer_ring(),
        "inner_ring": inner_ring(),
        "ball": ball(actuator),
        "hoop": hoop(actuator),
        "shaft": shaft(actuator),
        "pole": pole(actuator),
        "coil": coil(actuator),
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


def ball_radius(actuator: Actuator) -> float:
    """Radius of the ball, m: the poles' outer faces lie on it."""
    return actuator.magnet.distance_m + actuator.magnet.length_m / 2


def pole(actuator: Actuator) -> Manifold:
    """One pole: a cylinder whose outer face is ground to the ball."""
    radius, half = actuator.magnet.radius_m, actuator.magnet.length_m / 2
    sphere = ball_radius(actuator) + POLE_PROUD_M
    rho = np.linspace(radius - POLE_CHAMFER_M, 0.0, 6)
    face = [(r, np.sqrt(sphere**2 - r**2) - actuator.magnet.distance_m) for r in rho]
    outline = [
        (0.0, -half),
        (radius - POLE_CHAMFER_M, -half),
        (radius, -half + POLE_CHAMFER_M),
        (radius, face[0][1] - POLE_CHAMFER_M),
        *face,
    ]
    return revolve(outline, SMALL_SECTIONS)


def coil(actuator: Actuator) -> Manifold:
    """One air-core coil: bore, two flanges, and the ridges of its outer turns."""
    bore, radius = actuator.coil.inner_radius_m, actuator.coil.outer_radius_m
    half = actuator.coil.length_m / 2
    winding = radius - COIL_RECESS_M
    edge = half - COIL_FLANGE_M
    pitch = 2 * edge / COIL_RIDGES
    ridges: Points = []
    for i in range(COIL_RIDGES):
        z = -edge + i * pitch
        ridges += [(winding - COIL_RIDGE_DEPTH_M, z), (winding, z + 0.3 * pitch), (winding, z + 0.7 * pitch)]
    ridges.append((winding - COIL_RIDGE_DEPTH_M, edge))
    c = COIL_CHAMFER_M
    outline = [
        (bore, -half + c),
        (bore + c, -half),
        (radius - c, -half),
        (radius, -half + c),
        (radius, -edge),
        *ridges,
        (radius, edge),
        (radius, half - c),
        (radius - c, half),
        (bore + c, half),
        (bore, half - c),
    ]
    return revolve(outline, COIL_SECTIONS)


def ball(actuator: Actuator) -> Manifold:
    """Hollow ball, cut flat above and below, with a hole for each pole."""
    radius = ball_radius(actuator)
    shell = _shell(radius - BALL_WALL_M, radius, -60.0, 60.0)
    band = shell.trim_by_plane([0, 0, 1], -BALL_CUT_HEIGHT_M).trim_by_plane([0, 0, -1], -BALL_CUT_HEIGHT_M)
    hole = cylinder(actuator.magnet.radius_m + POLE_CLEARANCE_M, 0.5 * radius, 1.5 * radius, SMALL_SECTIONS)
    return band - along(hole, actuator.pole_axes)


def hoop(actuator: Actuator) -> Manifold:
    """Back iron behind both layers of poles, with a flat seat for each pole's inner face."""
    groove = HOOP_OUTER_RADIUS_M - HOOP_GROOVE_DEPTH_M
    band = _shell(HOOP_INNER_RADIUS_M, HOOP_OUTER_RADIUS_M, -45.0, 45.0)
    band = band.trim_by_plane([0, 0, 1], -HOOP_HALF_HEIGHT_M).trim_by_plane([0, 0, -1], -HOOP_HALF_HEIGHT_M)
    band -= _tube(groove, 2 * groove, -HOOP_GROOVE_HALF_WIDTH_M, HOOP_GROOVE_HALF_WIDTH_M)
    inner_face = actuator.magnet.distance_m - actuator.magnet.length_m / 2
    seat = cylinder(actuator.magnet.radius_m + POLE_CLEARANCE_M, inner_face, 2 * inner_face, SMALL_SECTIONS)
    return band - along(seat, actuator.pole_axes)


def outer_ring() -> Manifold:
    """Ring on two pins along x, bored along y for the pins of the inner ring."""
    ring = _ring(OUTER_RING_INNER_RADIUS_M, OUTER_RING_OUTER_RADIUS_M, OUTER_RING_HALF_HEIGHT_M)
    middle = (OUTER_RING_INNER_RADIUS_M + OUTER_RING_OUTER_RADIUS_M) / 2
    pin = _pin(PIVOT_RADIUS_M, middle, FORK_OUTER_RADIUS_M + RING_CHAMFER_M)
    bore = cylinder(PIVOT_RADIUS_M + RUNNING_CLEARANCE_M, 0.0, 2 * OUTER_RING_OUTER_RADIUS_M, PIN_SECTIONS)
    return ring + along(pin, both("x")) - along(bore, both("y"))


def inner_ring() -> Manifold:
    """Ring on two pins along y; four spokes hold the bearing of the rotor along z."""
    ring = _ring(INNER_RING_INNER_RADIUS_M, INNER_RING_OUTER_RADIUS_M, INNER_RING_HALF_HEIGHT_M)
    housing = _ring(BEARING_INNER_RADIUS_M, BEARING_OUTER_RADIUS_M, BEARING_HALF_HEIGHT_M)
    pin = _pin(
        PIVOT_RADIUS_M, INNER_RING_INNER_RADIUS_M + RING_CHAMFER_M, OUTER_RING_OUTER_RADIUS_M + RING_CHAMFER_M
    )
    reach = INNER_RING_INNER_RADIUS_M + RING_CHAMFER_M
    spoke = Manifold.cube([2 * reach, 2 * SPOKE_HALF_WIDTH_M, 2 * SPOKE_HALF_HEIGHT_M], True)
    spokes = (spoke.rotate([0, 0, 45]) + spoke.rotate([0, 0, -45])) - cylinder(
        BEARING_INNER_RADIUS_M + RING_CHAMFER_M, -reach, reach, SMALL_SECTIONS
    )
    return ring + housing + spokes + along(pin, both("y"))


def shaft(actuator: Actuator) -> Manifold:
    """Output shaft: journal in the bearing, spider on the ball's upper cut, payload flange, tip."""
    tip, mount = actuator.shaft_tip_m[2], actuator.payload_mount_m[2]
    journal = BEARING_INNER_RADIUS_M - RUNNING_CLEARANCE_M
    c = RING_CHAMFER_M
    hub_top = HUB_HEIGHT_M + 2 * SPIDER_THICKNESS_M
    flange = PAYLOAD_FLANGE_HALF_HEIGHT_M
    outline = [
        (0.0, -BEARING_HALF_HEIGHT_M),
        (journal - c, -BEARING_HALF_HEIGHT_M),
        (journal, -BEARING_HALF_HEIGHT_M + c),
        (journal, BEARING_HALF_HEIGHT_M - c),
        (journal - c, BEARING_HALF_HEIGHT_M),
        (SHAFT_RADIUS_M, BEARING_HALF_HEIGHT_M),
        (SHAFT_RADIUS_M, HUB_HEIGHT_M),
        (HUB_RADIUS_M, HUB_HEIGHT_M),
        (HUB_RADIUS_M, hub_top - c),
        (HUB_RADIUS_M - c, hub_top),
        (SHAFT_RADIUS_M + 2 * c, hub_top),
        (SHAFT_RADIUS_M, hub_top + 4 * c),
        (SHAFT_RADIUS_M, mount - flange),
        (PAYLOAD_FLANGE_RADIUS_M, mount - flange),
        (PAYLOAD_FLANGE_RADIUS_M, mount + flange),
        (SHAFT_RADIUS_M, mount + flange),
        (SHAFT_RADIUS_M, tip - 2 * c),
        (SHAFT_RADIUS_M - 2 * c, tip),
        (0.0, tip),
    ]
    return revolve(outline, SMALL_SECTIONS) + _spider(actuator)


def stator(actuator: Actuator) -> Manifold:
    """Shell around the coils, cut open; base, and the fork that carries the outer ring."""
    return _housing(actuator) + _base(actuator) + _fork()


def _spider(actuator: Actuator) -> Manifold:
    """Rim that is screwed onto the ball's upper cut, and the arms from there up to the hub."""
    thick = SPIDER_THICKNESS_M
    low, high = BALL_CUT_HEIGHT_M, BALL_CUT_HEIGHT_M + thick
    # The rim's upper edge stays inside the ball's sphere.
    rim = float(np.sqrt(ball_radius(actuator) ** 2 - high**2)) - RING_CHAMFER_M
    inside = rim - SPIDER_RIM_WIDTH_M
    ring = revolve([(inside, low), (rim, low), (rim, high), (inside, high)], SECTIONS)
    root = HUB_RADIUS_M / 2
    cone = revolve(
        [
            (inside + 0.4 * thick, low),
            (inside + 1.2 * thick, high),
            (root, HUB_HEIGHT_M + 1.5 * thick),
            (root, HUB_HEIGHT_M),
        ],
        SECTIONS,
    )
    arm = Manifold.cube([rim, 2 * SPIDER_ARM_HALF_WIDTH_M, 4 * HUB_HEIGHT_M], True).translate([rim / 2, 0, 0])
    screw = cylinder(SCREW_RADIUS_M, low + thick / 2, high + SCREW_HEIGHT_M, PIN_SECTIONS)
    screw = screw.translate([rim - SPIDER_RIM_WIDTH_M / 2, 0, 0])
    return ring + (cone ^ around(arm, SPIDER_ARMS)) + around(screw, SCREWS, first_deg=180 / SCREWS)


def _housing(actuator: Actuator) -> Manifold:
    lowest, highest = shell_latitudes_deg(actuator)
    shell = _shell(SHELL_INNER_RADIUS_M, SHELL_OUTER_RADIUS_M, lowest, highest)
    shell -= _sector() - _holders(actuator)
    hole = cylinder(
        actuator.coil.outer_radius_m + COIL_CLEARANCE_M,
        SHELL_INNER_RADIUS_M / 2,
        2 * SHELL_OUTER_RADIUS_M,
        36,
    )
    return shell - along(hole, actuator.coil_axes)


def shell_latitudes_deg(actuator: Actuator) -> tuple[float, float]:
    """Lower and upper rim of the stator shell, degrees.

    Above, the shaft passes at its largest tilt; below, the shell closes around the lowest coils.
    """
    shaft = np.degrees(np.arcsin(SHAFT_RADIUS_M / SHELL_INNER_RADIUS_M))
    highest = 90.0 - SHAFT_TILT_DEG - shaft - SHELL_RIM_MARGIN_DEG
    face = actuator.coil.distance_m - actuator.coil.length_m / 2
    half = np.degrees(np.arctan(actuator.coil.outer_radius_m / face))
    lowest = min(_latitudes_deg(actuator)) - half - SHELL_LOWER_MARGIN_DEG
    return float(lowest), float(highest)


def _latitudes_deg(actuator: Actuator) -> list[float]:
    return sorted(set(np.round(np.degrees(np.arcsin(actuator.coil_axes[:, 2])), 6).tolist()))


def _sector() -> Manifold:
    """All that is cut away so that the rotor can be seen."""
    reach = 2 * SHELL_OUTER_RADIUS_M
    angles = np.radians(np.linspace(CUT_FROM_DEG, CUT_TO_DEG, 5))
    corners = [(0.0, 0.0), *((reach * np.cos(a), reach * np.sin(a)) for a in angles)]
    return Manifold.extrude(section(corners), 2 * reach).translate([0, 0, -reach])


def _holders(actuator: Actuator) -> Manifold:
    """What holds the coils where the shell is cut away: slim belts with collars, and the lower rim."""
    lowest, _ = shell_latitudes_deg(actuator)
    inner, outer = SHELL_INNER_RADIUS_M + BELT_INSET_M, SHELL_OUTER_RADIUS_M - BELT_INSET_M
    belts = [
        _shell(inner, outer, at - BELT_HALF_WIDTH_DEG, at + BELT_HALF_WIDTH_DEG)
        for at in _latitudes_deg(actuator)
    ]
    collar = cylinder(actuator.coil.outer_radius_m + COLLAR_WALL_M, inner, outer, HOLE_SECTIONS)
    rim = _shell(
        SHELL_INNER_RADIUS_M / 2, 2 * SHELL_OUTER_RADIUS_M, lowest - 1.0, lowest + SHELL_LOWER_MARGIN_DEG
    )
    return union([*belts, along(collar, actuator.coil_axes), rim])


def _base(actuator: Actuator) -> Manifold:
    floor = -FLOOR_BELOW_CENTRE_M
    top = floor + BASE_HEIGHT_M
    lowest, _ = shell_latitudes_deg(actuator)
    outer = SHELL_OUTER_RADIUS_M * np.cos(np.radians(lowest))
    rim = SHELL_OUTER_RADIUS_M * np.sin(np.radians(lowest))
    c = 2 * RING_CHAMFER_M
    plate = revolve(
        [
            (0.0, floor),
            (BASE_RADIUS_M - c, floor),
            (BASE_RADIUS_M, floor + c),
            (BASE_RADIUS_M, top - c),
            (BASE_RADIUS_M - c, top),
            (0.0, top),
        ],
        SECTIONS,
    )
    foot = BASE_RADIUS_M - 2 * SKIRT_WALL_M
    lip = RING_CHAMFER_M  # overlap with the shell: solids that meet in an edge alone are not watertight
    skirt = revolve(
        [
            (outer - lip - SKIRT_WALL_M, rim + 2 * lip),
            (foot - SKIRT_WALL_M, top - lip),
            (foot, top - lip),
            (outer - lip, rim + 1.5 * lip),
        ],
        SECTIONS,
    )
    middle = (rim + top) / 2
    window = (
        cylinder(0.36 * (rim - top), 0.0, 2 * BASE_RADIUS_M, HOLE_SECTIONS)
        .rotate([0, 90, 0])
        .translate([0, 0, middle])
    )
    windows = around(window, SKIRT_WINDOWS)
    return plate + (skirt - windows) + _pedestal(actuator, top)


def _pedestal(actuator: Actuator, top: float) -> Manifold:
    """Slender where the tilted ball comes close, stout below the ball."""
    below_ball = -ball_radius(actuator) - 2 * MM
    joint = (FORK_INNER_RADIUS_M + FORK_OUTER_RADIUS_M) / 2
    outline = [
        (0.0, -joint),
        (NECK_RADIUS_M, -joint),
        (NECK_RADIUS_M, below_ball),
        (2.5 * NECK_RADIUS_M, below_ball - 1.5 * NECK_RADIUS_M),
        (2.5 * NECK_RADIUS_M, top + 1.5 * NECK_RADIUS_M),
        (4 * NECK_RADIUS_M, top - MM),
        (0.0, top - MM),
    ]
    return revolve(outline, SMALL_SECTIONS)


def _fork() -> Manifold:
    """Half a hoop under the rings, with an eye at each end for a pin of the outer ring."""
    hoop = _ring(FORK_INNER_RADIUS_M, FORK_OUTER_RADIUS_M, FORK_HALF_WIDTH_M).rotate([90, 0, 0])
    half = hoop.trim_by_plane([0, 0, -1], 0.0)
    inner, outer = FORK_INNER_RADIUS_M + FORK_EYE_SHIFT_M, FORK_OUTER_RADIUS_M + FORK_EYE_SHIFT_M
    eye = cylinder(FORK_EYE_RADIUS_M, inner, outer, SMALL_SECTIONS)
    bore = cylinder(PIVOT_RADIUS_M + RUNNING_CLEARANCE_M, 0.0, 2 * FORK_OUTER_RADIUS_M, PIN_SECTIONS)
    return half + along(eye, both("x")) - along(bore, both("x"))


def _ring(inner: float, outer: float, half_height: float) -> Manifold:
    """Flat ring about z with chamfered edges."""
    c, h = RING_CHAMFER_M, half_height
    return revolve(
        [
            (inner, -h + c),
            (inner + c, -h),
            (outer - c, -h),
            (outer, -h + c),
            (outer, h - c),
            (outer - c, h),
            (inner + c, h),
            (inner, h - c),
        ],
        SECTIONS,
    )


def _shell(inner: float, outer: float, lowest_deg: float, highest_deg: float) -> Manifold:
    """Spherical shell between two latitudes, its rims cut towards the centre."""
    steps = max(1, round((highest_deg - lowest_deg) / ARC_STEP_DEG))
    latitude = np.radians(np.linspace(lowest_deg, highest_deg, steps + 1))
    circle = np.column_stack([np.cos(latitude), np.sin(latitude)])
    return revolve([*map(tuple, outer * circle), *map(tuple, inner * circle[::-1])], SECTIONS)


def _tube(inner: float, outer: float, low: float, high: float) -> Manifold:
    return revolve([(inner, low), (outer, low), (outer, high), (inner, high)], SECTIONS)


def _pin(radius: float, low: float, high: float) -> Manifold:
    c = RING_CHAMFER_M
    return revolve(
        [(0.0, low), (radius, low), (radius, high - c), (radius - c, high), (0.0, high)], PIN_SECTIONS
    )


if __name__ == "__main__":
    for path in write(ASSETS, actuators.load()):
        print(path)
