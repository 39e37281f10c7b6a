"""Power balance: what the currents push against their back-EMF is what the rotor gives mechanically.

Conventions. The flux linkage of a group is the flux of the magnets through its turns, along the axis about
which a positive current runs counterclockwise, summed over its two coils. A turning rotor induces
``-d(linkage)/dt`` in the direction of a positive current (Faraday); the amplifier pushes the current
against it and delivers ``+ current . d(linkage)/dt``. In air nothing is stored on the way (the magnets'
own energy does not change, the coils' depends on the currents alone), so that all of it is mechanical:

    torque . w = + current . d(linkage)/dt    for every current, hence    d(linkage)/dt = G_t^T w

The linkage below is magpylib's field on the turns' areas: no force, no curve, no torque in it.
"""

import magpylib
import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from spheretwin.models.design import direct_summation
from spheretwin.models.kinematics import rotation
from spheretwin.models.magnetics import torque_matrix

# Points across bore and winding, along the axis, around it.
BORE, WINDING, ALONG, AROUND = 4, 8, 10, 36

# Cylinders that stand for a ground pole.
STACKED = 20

STEP = 0.08  # rad: half a width of the curve's peak


def pose_of(R_SR):
    alpha, beta = np.arctan2(-R_SR[1, 2], R_SR[2, 2]), np.arcsin(R_SR[0, 2])
    return np.array([alpha, beta, np.arctan2(-R_SR[0, 1], R_SR[0, 0])])


def gauss(low, high, points):
    x, weight = np.polynomial.legendre.leggauss(points)
    return low + (high - low) * (0.5 + 0.5 * x), 0.5 * (high - low) * weight


def area_of_turns(coil):
    """Points in bore and winding of a coil along z, each with the area of all turns around it, m²."""
    inner, outer = coil.inner_radius_m, coil.outer_radius_m
    pieces = gauss(0, inner, BORE), gauss(inner, outer, WINDING)
    rho, d_rho = (np.concatenate(both) for both in zip(*pieces, strict=True))
    turns = coil.turns * (outer - np.maximum(rho, inner)) / (outer - inner)  # those of larger radius
    t, d_t = gauss(0, 1, ALONG)
    z = coil.distance_m + coil.length_m * (t**2 - 0.5)  # crowded at the air gap
    psi = (np.arange(AROUND) + 0.5) * 2 * np.pi / AROUND
    R, Z, P = (grid.ravel() for grid in np.meshgrid(rho, z, psi, indexing="ij"))
    area = np.outer(turns * rho * d_rho, 2 * t * d_t).ravel() * 2 * np.pi / AROUND
    return np.column_stack([R * np.cos(P), R * np.sin(P), Z]), np.repeat(area, AROUND)


def turned_to(axis):
    """Rotation that brings z onto an axis."""
    return Rotation.from_euler("ZY", [np.arctan2(axis[1], axis[0]), np.arccos(axis[2])])


def flux_linkage(R_SR, group, actuator):
    """Flux of the 16 magnets through the turns of one group, Wb."""
    poles = zip(actuator.pole_axes @ R_SR.T, actuator.pole_polarity, strict=True)
    stacks = [direct_summation.pole_magnet(actuator.magnet, *pole, STACKED) for pole in poles]
    magnets = magpylib.Collection(stacks)
    points, area = area_of_turns(actuator.coil)
    linkage = 0.0
    for axis in actuator.coil_axes[actuator.groups[group]]:
        placed = np.array_split(turned_to(axis).apply(points), 8)
        linkage += area @ (np.concatenate([magnets.getB(block) for block in placed]) @ axis)
    return linkage


@pytest.mark.release("flux through all windings for 10 s; test_coil.py has the identity in the plant")
@pytest.mark.parametrize("group", [0, 7, 15])
def test_torque_matrix_transposed_is_the_rate_of_the_flux_linkage(actuator, group):
    generator = np.random.default_rng(group)
    start = rotation(generator.uniform(-0.5, 0.5, 3))
    w = generator.normal(size=3)
    w /= np.linalg.norm(w)  # 1 rad/s about a fixed axis: time is angle

    def turned(angle):
        return Rotation.from_rotvec(angle * w).as_matrix() @ start

    times = STEP * np.arange(4)
    linkage = np.array([flux_linkage(turned(t), group, actuator) for t in times])
    node, weight = gauss(0, STEP, 12)
    rate = [
        sum(
            d * torque_matrix(pose_of(turned(t + at)), actuator)[:, group] @ w
            for at, d in zip(node, weight, strict=True)
        )
        / STEP
        for t in times[:-1]
    ]  # mean over each step
    peak = actuator.torque_curve.peak_Nm_per_A
    # Measured: 2e-4 of the peak. It is the steps of the stack: half as many leave 8e-4.
    assert_allclose(np.diff(linkage) / STEP, rate, rtol=0, atol=5e-4 * peak)
    assert np.max(np.abs(rate)) > 0.5 * peak
