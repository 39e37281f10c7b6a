"""Meshes of the passive joint: fork of the stator, two rings on pins, and bearing of the rotor."""

from manifold3d import Manifold

from spheretwin.models.meshes.solids import (
    MM,
    PIN_SECTIONS,
    RING_CHAMFER_M,
    SMALL_SECTIONS,
    along,
    both,
    chamfered_pin,
    cylinder,
    flat_ring,
)

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
