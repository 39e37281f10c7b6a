"""Content of the offline design: sums of few points, curves, surveys, checks, and messages about geometry."""

from dataclasses import replace

import numpy as np
import pytest

from spheretwin.models import actuator as actuators
from spheretwin.models import scatter as scatters
from spheretwin.models.design import (
    capability,
    curve_check,
    direct_summation,
    field_check,
    geometry_check,
    pole_torque,
    torque_map,
    workspace,
)
from spheretwin.models.design.direct_summation import Quadrature, Rule
from tests.content import values
from tests.content.content import content_test
from tests.content.values import number

FEW = Quadrature(near=Rule(2, 4, 8, 4), far=Rule(2, 2, 6, 2))
NOISE = 1e-11


def leaf(value):
    return "rounding" if isinstance(value, float | np.floating) and abs(value) < NOISE else number(value)


def lines(value):
    return values.lines(values.plain(value, leaf))


def displaced(actuator):
    def parts(axes):
        shares = np.linspace(-1, 1, 4 * len(axes)).reshape(-1, 4)
        return scatters.part_errors(shares * [0.02, 0.003, 0.002, 1e-4])

    return scatters.Scatter(parts(actuator.pole_axes), parts(actuator.coil_axes))


def direct_sums():
    """Torque matrices by sums of few points, of ground and flat magnets, with and without displaced parts."""
    actuator = actuators.load()
    flat = replace(actuator, magnet=replace(actuator.magnet, front_radius_m=0.0))
    q = np.array([0.2, -0.3, 0.5])
    content = {
        "rule": FEW,
        "halved": FEW.halved(),
        "standard": direct_summation.STANDARD,
        "flat": direct_summation.FLAT,
    }
    for name, subject in (("ground", actuator), ("flat", flat)):
        content[f"{name}: cylinders"] = direct_summation.cylinders(subject.magnet, 4)
        content[f"{name}: reach"] = direct_summation._rim_reaches_winding(subject)
        content[f"{name}: matrix"] = direct_summation.direct_torque_matrix(q, subject, FEW)
        moved = displaced(subject)
        content[f"{name}: displaced"] = direct_summation.direct_torque_matrix(q, subject, FEW, moved)
    content["conductors"] = direct_summation.conductors(actuator.coil, Rule(2, 3, 4))
    compared = direct_summation.compare(actuator, np.array([0.0, 0.4]), 3, FEW)
    content["compared"] = compared
    content["errors"] = direct_summation.errors(compared, 8.0, currents=5, seed=2)
    return lines(content)


def verdict_of_the_field():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(direct_summation, "STANDARD", FEW)
        verdict = field_check.judge(actuators.load(), poses=2, seed=1)
    other = verdict.curve_is_of_another_geometry
    return lines({**verdict._asdict(), "checks": [each.row() for each in verdict.checks], "other": other})


def curves():
    actuator = actuators.load()
    mesh, angles = pole_torque.Mesh(4, 16, 2, 4), np.radians([0.0, 5.0, 10.0, 20.0, 40.0, 90.0, 180.0])
    content = {"samples": pole_torque.sample_angles(), "mesh": pole_torque.Mesh(), "doubled": mesh.doubled()}
    flat = replace(actuator.magnet, front_radius_m=0.0)
    parts = {"ground": (actuator.magnet, False), "flat": (flat, False), "iron": (actuator.magnet, True)}
    for name, (magnet, on_iron) in parts.items():
        curve = pole_torque.compute_curve(magnet, actuator.coil, angles, mesh, on_iron=on_iron)
        content[name] = curve.torque_Nm_per_A
    curve_angles = np.radians(np.linspace(0, 180, 17))
    curve = pole_torque.compute_curve(actuator.magnet, actuator.coil, curve_angles, mesh)
    content["convergence"] = pole_torque.convergence(curve, actuator.magnet, actuator.coil, mesh)
    content["leave one out"] = curve_check.leave_one_out(actuator.torque_curve)
    content["lookup"] = curve_check.largest_lookup_error(actuator.torque_curve)
    return lines(content)


def workspaces():
    """Capability of few poses, their grid and the verdict over them."""
    actuator = actuators.load()
    tilts = np.radians([0.0, 10.0, 30.0])
    q = workspace.pose(tilts, np.array([0.0, 1.0, -2.0]), np.array([0.3, 0.0, 2.0]))
    content = {
        "poses": q,
        "reachable": workspace.reachable(q, actuator),
        "capability": capability.capability(q, actuator),
    }
    content["far"] = workspace.reachable(workspace.pose(np.radians([79.0, 81.0, 89.0]), 0.0, 0.0), actuator)
    content["directions"] = [
        torque_map.direction_text(each) for each in ((1, 0, 0), (0.5, -0.5, 0.1), (0, 0, -1))
    ]
    return lines(content)


def geometry():
    """Gaps of geometries, and messages about those that cannot be built."""
    actuator = actuators.load()
    content = {"gap": geometry_check.air_gap_m(actuator)}
    changes = {
        "shipped": {},
        "wide coils": {"coil": replace(actuator.coil, outer_radius_m=0.03)},
        "wide poles": {"magnet": replace(actuator.magnet, radius_m=0.03)},
        "close coils": {"coil": replace(actuator.coil, distance_m=0.055)},
        "far poles": {"magnet": replace(actuator.magnet, front_radius_m=0.06)},
    }
    for name, change in changes.items():
        subject = replace(actuator, **change)
        checks = (geometry_check.air_gap_m, geometry_check.of_geometry, geometry_check.of_parts)
        content[name] = [each(subject) for each in checks]
    axes = np.array([[1.0, 0, 0], [0, 1.0, 0], [0.8, 0.6, 0]])
    content["clearance"] = geometry_check.clearance(axes, 0.01, 0.02, 0.05)
    return lines(content)


CASES = {
    "design_direct_sums": direct_sums, "design_field_verdict": verdict_of_the_field, "design_curves": curves,
    "design_workspaces": workspaces, "design_geometry": geometry,
}  # fmt: skip


RELEASE = {"design_field_verdict": "recomputes a field for 1.3 s; other cases have the form of a verdict"}


test_content = content_test(CASES, RELEASE)
