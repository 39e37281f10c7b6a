"""Meshes of the stator: coils, the shell around them, and the base with the fork of the joint.

Sizes and positions of the coils are those of the actuator; all else is visual.
"""

import numpy as np
from manifold3d import Manifold
from meshes.rotor import (
    FORK_INNER_RADIUS_M,
    FORK_OUTER_RADIUS_M,
    SHAFT_RADIUS_M,
    ball_radius,
    fork,
)
from meshes.solids import (
    HOLE_SECTIONS,
    MM,
    RING_CHAMFER_M,
    SECTIONS,
    SMALL_SECTIONS,
    Points,
    along,
    around,
    cylinder,
    revolve,
    section,
    spherical_shell,
    union,
)

from spheretwin.models.actuator import Actuator

# Coil: two flanges, and between them a winding with visible turns.
COIL_FLANGE_M = 1.2 * MM
COIL_CHAMFER_M = 0.3 * MM
COIL_RECESS_M = 0.35 * MM
COIL_RIDGES = 7
COIL_RIDGE_DEPTH_M = 0.35 * MM
COIL_SECTIONS = 24

# A shell around the coils, open above so that the shaft can tilt as far as in the nutation. (The upper coils
# obstruct it if it points at one: their positions are those of the MJCF.)
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
# The neck of the joint passes through the lower opening of the ball: a slimmer neck permits more tilt.
NECK_RADIUS_M = 3.0 * MM


def coil(actuator: Actuator) -> Manifold:
    """Return an air-core coil: bore, two flanges, and the ridges of its outer turns."""
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


def stator(actuator: Actuator) -> Manifold:
    """Return the shell around the coils, cut open, the base, and the fork of the outer ring."""
    return _housing(actuator) + _base(actuator) + fork()


def shell_latitudes_deg(actuator: Actuator) -> tuple[float, float]:
    """Return the latitudes of the lower and upper rim of the stator shell, degrees.

    Above, the shaft passes at its largest tilt; below, the shell closes around the lowest coils.
    """
    shaft = np.degrees(np.arcsin(SHAFT_RADIUS_M / SHELL_INNER_RADIUS_M))
    highest = 90.0 - SHAFT_TILT_DEG - shaft - SHELL_RIM_MARGIN_DEG
    face = actuator.coil.distance_m - actuator.coil.length_m / 2
    half = np.degrees(np.arctan(actuator.coil.outer_radius_m / face))
    lowest = min(_latitudes_deg(actuator)) - half - SHELL_LOWER_MARGIN_DEG
    return float(lowest), float(highest)


def _housing(actuator: Actuator) -> Manifold:
    lowest, highest = shell_latitudes_deg(actuator)
    shell = spherical_shell(SHELL_INNER_RADIUS_M, SHELL_OUTER_RADIUS_M, lowest, highest)
    shell -= _sector() - _holders(actuator)
    hole = cylinder(
        actuator.coil.outer_radius_m + COIL_CLEARANCE_M,
        SHELL_INNER_RADIUS_M / 2,
        2 * SHELL_OUTER_RADIUS_M,
        COIL_SECTIONS,  # as for the coil in it: the gap between them is constant
    )
    return shell - along(hole, actuator.coil_axes)


def _latitudes_deg(actuator: Actuator) -> list[float]:
    return sorted(set(np.round(np.degrees(np.arcsin(actuator.coil_axes[:, 2])), 6).tolist()))


def _sector() -> Manifold:
    """Return the sector that is cut out to show the rotor."""
    reach = 2 * SHELL_OUTER_RADIUS_M
    angles = np.radians(np.linspace(CUT_FROM_DEG, CUT_TO_DEG, 5))
    corners = [(0.0, 0.0), *((reach * np.cos(a), reach * np.sin(a)) for a in angles)]
    return Manifold.extrude(section(corners), 2 * reach).translate([0, 0, -reach])


def _holders(actuator: Actuator) -> Manifold:
    """Return the holders of the coils in the cut: slim belts with collars, and the lower rim."""
    lowest, _ = shell_latitudes_deg(actuator)
    inner, outer = SHELL_INNER_RADIUS_M + BELT_INSET_M, SHELL_OUTER_RADIUS_M - BELT_INSET_M
    belts = [
        spherical_shell(inner, outer, at - BELT_HALF_WIDTH_DEG, at + BELT_HALF_WIDTH_DEG)
        for at in _latitudes_deg(actuator)
    ]
    collar = cylinder(actuator.coil.outer_radius_m + COLLAR_WALL_M, inner, outer, HOLE_SECTIONS)
    rim = spherical_shell(
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
    lip = RING_CHAMFER_M  # overlap with the shell: solids that touch only in an edge are not watertight
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
    """Return the pedestal: slender near the tilted ball, thick below it."""
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
