"""Meshes of the rotor: poles, the ball around them, the hoop behind them, the shaft.

The shape of the poles and the length of the shaft are those of the actuator; all else is visual.
"""

from __future__ import annotations

import numpy as np
from manifold3d import Manifold
from meshes.solids import (
    MM,
    PIN_SECTIONS,
    RING_CHAMFER_M,
    SECTIONS,
    SMALL_SECTIONS,
    along,
    around,
    both,
    chamfered_pin,
    cylinder,
    flat_ring,
    revolve,
    spherical_shell,
    tube,
)

from spheretwin.models.actuator import Actuator

# Circles of a pole's front, from its rim to its middle.
FRONT_STEPS = 6

# Ball: a truncated shell whose holes leave a thin dark line around the poles.
BALL_WALL_M = 3.0 * MM
BALL_CUT_HEIGHT_M = 26.0 * MM
POLE_CLEARANCE_M = 0.35 * MM

# Back iron: a hoop that the poles are seated into, with a groove between their layers.
HOOP_INNER_RADIUS_M = 36.5 * MM
HOOP_OUTER_RADIUS_M = 41.2 * MM
HOOP_HALF_HEIGHT_M = 20.0 * MM
HOOP_GROOVE_HALF_WIDTH_M = 2.5 * MM
HOOP_GROOVE_DEPTH_M = 2.5 * MM

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


def ball_radius(actuator: Actuator) -> float:
    """Return the radius of the ball, m, through the middles of the fronts of the poles."""
    return actuator.magnet.front_m


def pole(actuator: Actuator) -> Manifold:
    """Return a pole as modelled, with sharp edges: a cylinder, its front flat or ground to a sphere."""
    magnet = actuator.magnet
    middle = magnet.length_m / 2
    rho = np.linspace(magnet.radius_m, 0.0, FRONT_STEPS) if magnet.front_radius_m else [magnet.radius_m, 0.0]
    front = [(float(r), middle - magnet.sagitta_at_m(float(r))) for r in rho]
    return revolve([(0.0, -middle), (magnet.radius_m, -middle), *front], SMALL_SECTIONS)


def ball(actuator: Actuator) -> Manifold:
    """Return the hollow ball, cut flat above and below, with a hole for each pole."""
    radius = ball_radius(actuator)
    shell = spherical_shell(radius - BALL_WALL_M, radius, -60.0, 60.0)
    band = shell.trim_by_plane([0, 0, 1], -BALL_CUT_HEIGHT_M).trim_by_plane([0, 0, -1], -BALL_CUT_HEIGHT_M)
    hole = cylinder(actuator.magnet.radius_m + POLE_CLEARANCE_M, 0.5 * radius, 1.5 * radius, SMALL_SECTIONS)
    return band - along(hole, actuator.pole_axes)


def hoop(actuator: Actuator) -> Manifold:
    """Return the back iron behind both layers of poles, with a flat seat for the inner face of each pole."""
    groove = HOOP_OUTER_RADIUS_M - HOOP_GROOVE_DEPTH_M
    band = spherical_shell(HOOP_INNER_RADIUS_M, HOOP_OUTER_RADIUS_M, -45.0, 45.0)
    band = band.trim_by_plane([0, 0, 1], -HOOP_HALF_HEIGHT_M).trim_by_plane([0, 0, -1], -HOOP_HALF_HEIGHT_M)
    band -= tube(groove, 2 * groove, -HOOP_GROOVE_HALF_WIDTH_M, HOOP_GROOVE_HALF_WIDTH_M)
    back = actuator.magnet.back_m
    seat = cylinder(actuator.magnet.radius_m + POLE_CLEARANCE_M, back, 2 * back, SMALL_SECTIONS)
    return band - along(seat, actuator.pole_axes)


def shaft(actuator: Actuator) -> Manifold:
    """Return the output shaft: journal in the bearing, spider on the upper cut of the ball, flange, tip."""
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


def _spider(actuator: Actuator) -> Manifold:
    """Return the rim on the upper cut of the ball, and the arms from there up to the hub."""
    thick = SPIDER_THICKNESS_M
    low, high = BALL_CUT_HEIGHT_M, BALL_CUT_HEIGHT_M + thick
    # The upper edge of the rim stays inside the sphere of the ball.
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


# Fork, outer ring, inner ring, bearing: each turns freely in the next. They are visual; the hinges are
# simulated.
FORK_INNER_RADIUS_M = 28.5 * MM
FORK_OUTER_RADIUS_M = 33.0 * MM
FORK_HALF_WIDTH_M = 4.0 * MM
FORK_EYE_RADIUS_M = 5.0 * MM
# Solids that touch only in a line are not watertight after their union.
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


def fork() -> Manifold:
    """Half a hoop under the rings, with an eye at each end for a pin of the outer ring."""
    hoop = flat_ring(FORK_INNER_RADIUS_M, FORK_OUTER_RADIUS_M, FORK_HALF_WIDTH_M).rotate([90, 0, 0])
    half = hoop.trim_by_plane([0, 0, -1], 0.0)
    inner, outer = FORK_INNER_RADIUS_M + FORK_EYE_SHIFT_M, FORK_OUTER_RADIUS_M + FORK_EYE_SHIFT_M
    eye = cylinder(FORK_EYE_RADIUS_M, inner, outer, SMALL_SECTIONS)
    bore = cylinder(PIVOT_RADIUS_M + RUNNING_CLEARANCE_M, 0.0, 2 * FORK_OUTER_RADIUS_M, PIN_SECTIONS)
    return half + along(eye, both("x")) - along(bore, both("x"))


def outer_ring() -> Manifold:
    """Ring on two pins along x, bored along y for the pins of the inner ring."""
    ring = flat_ring(OUTER_RING_INNER_RADIUS_M, OUTER_RING_OUTER_RADIUS_M, OUTER_RING_HALF_HEIGHT_M)
    middle = (OUTER_RING_INNER_RADIUS_M + OUTER_RING_OUTER_RADIUS_M) / 2
    pin = chamfered_pin(PIVOT_RADIUS_M, middle, FORK_OUTER_RADIUS_M + RING_CHAMFER_M)
    bore = cylinder(PIVOT_RADIUS_M + RUNNING_CLEARANCE_M, 0.0, 2 * OUTER_RING_OUTER_RADIUS_M, PIN_SECTIONS)
    return ring + along(pin, both("x")) - along(bore, both("y"))


def inner_ring() -> Manifold:
    """Ring on two pins along y; four spokes hold the bearing of the rotor along z."""
    ring = flat_ring(INNER_RING_INNER_RADIUS_M, INNER_RING_OUTER_RADIUS_M, INNER_RING_HALF_HEIGHT_M)
    housing = flat_ring(BEARING_INNER_RADIUS_M, BEARING_OUTER_RADIUS_M, BEARING_HALF_HEIGHT_M)
    pin = chamfered_pin(
        PIVOT_RADIUS_M, INNER_RING_INNER_RADIUS_M + RING_CHAMFER_M, OUTER_RING_OUTER_RADIUS_M + RING_CHAMFER_M
    )
    reach = INNER_RING_INNER_RADIUS_M + RING_CHAMFER_M
    spoke = Manifold.cube([2 * reach, 2 * SPOKE_HALF_WIDTH_M, 2 * SPOKE_HALF_HEIGHT_M], True)
    spokes = (spoke.rotate([0, 0, 45]) + spoke.rotate([0, 0, -45])) - cylinder(
        BEARING_INNER_RADIUS_M + RING_CHAMFER_M, -reach, reach, SMALL_SECTIONS
    )
    return ring + housing + spokes + along(pin, both("y"))
