"""Torque capability against tilt: degrees, worst, median and best pose."""

from types import SimpleNamespace

import numpy as np

from spheretwin.viz.figures.maps import capability_by_tilt, capability_map

TILT_rad = np.radians([0.0, 10.0, 20.0])
BEST = np.arange(1.0, 13.0).reshape(3, 2, 2)


def test_lines_are_the_worst_and_the_median_pose_over_degrees():
    workspace = SimpleNamespace(tilt_rad=TILT_rad, reachable=np.ones((3, 2, 2), bool))
    on_grid = SimpleNamespace(best_Nm=BEST, least_norm_Nm=BEST / 2, copper_W_per_Nm2=3 * BEST)
    worst = {"best_Nm": BEST.min((1, 2)) - 0.5, "least_norm_Nm": BEST.min((1, 2)) / 4,
             "copper_W_per_Nm2": np.array([20.0, 40.0, 60.0])}  # fmt: skip
    torque, copper = capability_by_tilt(workspace, on_grid, worst, 8.0).axes
    expected = {
        "best currents: worst pose": worst["best_Nm"],
        "best currents: median": np.median(BEST, (1, 2)),
        "least-norm currents: worst pose": worst["least_norm_Nm"],
        "least-norm currents: median": np.median(BEST, (1, 2)) / 2,
    }
    lines = {line.get_label(): line for line in torque.get_lines()}
    assert set(lines) == set(expected)
    for label, values in expected.items():
        np.testing.assert_allclose(lines[label].get_xdata(), [0.0, 10.0, 20.0])
        np.testing.assert_allclose(lines[label].get_ydata(), values)
    points = torque.collections[0].get_paths()[0].vertices
    assert points[:, 1].max() == BEST.max()
    high, middle = copper.get_lines()
    assert (high.get_label(), list(high.get_ydata())) == ("worst pose", [20.0, 40.0, 60.0])
    np.testing.assert_allclose(middle.get_ydata(), 3 * np.median(BEST, (1, 2)))
    assert (torque.get_ylabel(), copper.get_ylabel()) == (
        "torque in every direction, N·m",
        "copper loss, W/(N·m)²",
    )
    assert copper.get_xlabel() == "tilt of the shaft, degrees"
    assert torque.get_title(loc="left") == "Torque capability at 8 A a group"


def test_maps_are_the_worst_reachable_spin_over_tilt_and_azimuth():
    tilt_rad, azimuth_rad = np.radians([0.0, 10.0, 20.0]), np.radians([0.0, 90.0])
    reachable = np.ones((3, 2, 2), bool)
    reachable[1, 1, 0] = False  # the least value of its tilt and azimuth
    reachable[2, 0] = False
    workspace = SimpleNamespace(tilt_rad=tilt_rad, azimuth_rad=azimuth_rad, reachable=reachable)
    on_grid = SimpleNamespace(
        best_Nm=BEST, least_norm_Nm=BEST / 2, singular_value_Nm_per_A=BEST / 100, condition=10 * BEST
    )
    figure = capability_map(workspace, on_grid, 8.0)
    least = np.array([[1.0, 3.0], [5.0, 8.0], [np.nan, 11.0]])
    largest = np.array([[2.0, 4.0], [6.0, 8.0], [np.nan, 12.0]])
    maps = [axes for axes in figure.axes if axes.name == "polar"]
    for axes, expected in zip(maps, (least / 2, least, least / 100, 10 * largest), strict=True):
        (mesh,) = axes.collections
        values = np.ma.filled(mesh.get_array(), np.nan).reshape(3, 3)
        np.testing.assert_allclose(values, np.column_stack([expected, expected[:, :1]]))
        corners = mesh.get_coordinates()
        np.testing.assert_allclose(corners[0, :, 0], [0.0, np.pi / 2, 2 * np.pi])
        np.testing.assert_allclose(corners[:, 0, 1], [0.0, 10.0, 20.0])
    assert maps[0].collections[0].norm is maps[1].collections[0].norm
    assert maps[0].collections[0].get_clim() == (0.5, 11.0)
    titles = [axes.get_title() for axes in maps]
    assert titles[0] == "least-norm torque, N·m"
    assert titles[1] == "torque by best currents, N·m"
    assert "at 8 A" in figure.get_suptitle()
    assert "N·m/A" in titles[2]
    assert titles[3] == "condition number"
