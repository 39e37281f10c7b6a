"""Eddy currents: bound of the viscous friction of a conducting rotor shell in the field of the coils.

The poles turn with the shell, so that only the coils induce currents in it. A sheet of conductivity sigma and
thickness t that moves with the speed v through the normal field B has the electric field v B, and dissipates
at most ``P = sigma t v**2 B**2`` per area: the paths that currents need to close and their own field only
reduce it. With ``v <= R w`` on a sphere of radius R, and over the area of each coil the field on its axis,

    c = P / w**2 <= sigma t R**2 N B**2 pi r**2,

for N coils of outer radius r. It holds for shells that are thin compared with the skin depth, 27 mm in
aluminium at 10 Hz.
"""

from __future__ import annotations

from math import hypot, log, pi

from spheretwin.models.actuator import Actuator

MU_0 = 4e-7 * pi
ALUMINIUM_S_m = 3.5e7


def face_field_T_per_A(actuator: Actuator) -> float:
    """Return the field on the axis of a coil at its face, of a current of 1 A."""
    coil = actuator.coil
    outer, inner = (
        radius + hypot(radius, coil.length_m) for radius in (coil.outer_radius_m, coil.inner_radius_m)
    )
    return MU_0 * coil.turns / (2 * (coil.outer_radius_m - coil.inner_radius_m)) * log(outer / inner)


def eddy_viscous_bound_Nm_s(
    actuator: Actuator, current_A: float, thickness_m: float = 1e-3, conductivity_S_m: float = ALUMINIUM_S_m
) -> float:
    """Return the bound of the viscous friction by eddy currents in the rotor shell.

    Parameters
    ----------
    actuator : Actuator
        Its coils; the shell is as far from the joint centre as their faces.
    current_A : float, A
        Root mean square of the group currents.
    thickness_m : float, m
        Thickness of the shell.
    conductivity_S_m : float, S/m
        Conductivity of the shell; aluminium unless given.
    """
    coil, field = actuator.coil, current_A * face_field_T_per_A(actuator)
    radius, area = coil.distance_m - coil.length_m / 2, pi * coil.outer_radius_m**2
    return conductivity_S_m * thickness_m * radius**2 * len(actuator.coil_axes) * field**2 * area
