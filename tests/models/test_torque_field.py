"""Torque fields: the shipped actuator in both forms, the spline against SciPy, files and groups of coils."""

import re
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.interpolate import CubicSpline

from spheretwin.models import actuator as actuators
from spheretwin.models import magnetics, torque_field
from spheretwin.models.base.errors import InputError
from spheretwin.models.curve_origin import disagreements
from spheretwin.models.inductance import mutual_inductance
from spheretwin.models.kinematics import rotation
from spheretwin.models.mjcf import contents_digest
from spheretwin.models.scatter import no_scatter, scattered_model, summed_torque_matrix
from spheretwin.models.torque_curve import TorqueCurve
from spheretwin.models.torque_field import TorqueField, directions
from tests.models.poses import SECOND, random_poses


def field_of_curve(actuator, latitudes, meridians):
    """The torque of all poles on one coil, (12) to (14), as a field."""
    axes = directions(latitudes, meridians).reshape(-1, 3)
    torque = np.zeros_like(axes)
    for r, polarity in zip(actuator.pole_axes, actuator.pole_polarity, strict=True):
        torque += polarity * actuator.torque_curve.over_sine(axes @ r)[:, None] * np.cross(r, axes)
    return TorqueField(torque.reshape(latitudes, meridians, 3))


def harmonics(n):
    """The coefficients of the second actuator's firmware: n x grad of two spherical harmonics, N·m/A."""
    x, y, z = np.moveaxis(n, -1, 0)
    u = 0.01396139 * z + 0.00688961 * (3 * z**3 - z)
    slope = 0.01396139 + 0.00688961 * (9 * z**2 - 1)
    gradient = np.stack([2 * x * u, -2 * y * u, (x**2 - y**2) * slope], axis=-1)
    return np.cross(n, gradient)


def random_axes(count, seed=0):
    axes = np.random.default_rng(seed).normal(size=(count, 3))
    return axes / np.linalg.norm(axes, axis=1, keepdims=True)


VENTUSFF = actuators.load(SECOND)


def test_the_shipped_actuator_is_the_same_as_a_curve_and_as_a_field(actuator):
    as_field = replace(actuator, torque_data=field_of_curve(actuator, 181, 360))
    for q in random_poses(100):
        difference = magnetics.torque_matrix(q, as_field) - magnetics.torque_matrix(q, actuator)
        assert np.abs(difference).max() < 1e-4 * actuator.torque_curve.peak_Nm_per_A


def test_the_spline_is_the_product_of_periodic_cubic_splines():
    samples = VENTUSFF.torque_data.torque_Nm_per_A
    beyond = np.roll(samples[-2::-1], samples.shape[1] // 2, axis=1)  # down the opposite meridian
    torus = np.concatenate([samples, beyond])
    torus = np.concatenate([torus, torus[:, :1]], axis=1)
    along_theta = CubicSpline(np.linspace(0, 2 * np.pi, len(torus)), torus, bc_type="periodic")
    phi = np.linspace(0, 2 * np.pi, torus.shape[1])
    for axis in random_axes(50):
        theta, azimuth = np.arccos(axis[2]), np.arctan2(axis[1], axis[0]) % (2 * np.pi)
        expected = CubicSpline(phi, along_theta(theta), bc_type="periodic")(azimuth)
        assert_allclose(VENTUSFF.torque_data.torque(axis[None])[0], expected, rtol=0, atol=1e-15)


def test_the_error_of_the_spline_falls_with_the_fourth_power_of_the_step():
    axes, errors = random_axes(2000), []
    for latitudes in (16, 31, 61):
        field = TorqueField(harmonics(directions(latitudes, 2 * (latitudes - 1))))
        errors.append(np.abs(field.torque(axes) - harmonics(axes)).max())
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert_allclose(orders, 4, atol=0.3)  # the next power at steps of 12 degrees


def test_the_second_actuator_has_the_harmonics_of_its_firmware():
    samples = VENTUSFF.torque_data.torque_Nm_per_A
    expected = harmonics(directions(*samples.shape[:2]))
    assert_allclose(samples, expected, rtol=0, atol=1e-9)  # decimals of the file
    assert VENTUSFF.torque_data.peak_Nm_per_A == pytest.approx(0.0197, abs=5e-5)
    axes = random_axes(2000)
    error = np.abs(VENTUSFF.torque_data.torque(axes) - harmonics(axes)).max()
    assert error < 5e-5 * VENTUSFF.torque_data.peak_Nm_per_A  # as the head of the file says


def test_poles_of_the_sphere_are_no_seam():
    for z in (1.0, -1.0):
        ring = np.array([[1e-9 * np.cos(a), 1e-9 * np.sin(a), z] for a in np.linspace(0, 2 * np.pi, 13)])
        values = VENTUSFF.torque_data.torque(ring)
        # Slopes of some 0.1 N·m/A per radian, over 1e-9.
        assert_allclose(values, np.broadcast_to(values[0], values.shape), rtol=0, atol=1e-9)
    axes = np.array([[-1.0, 1e-17, 0.0], [-1.0, -1e-17, 0.0], [1.0, 0.0, 0.0], [1.0, -1e-17, 0.0]])
    first, last, start, end = VENTUSFF.torque_data.torque(axes)
    assert_allclose([first, start], [last, end], rtol=0, atol=1e-15)


def test_a_positive_current_attracts_a_north_pole():
    """The polarities that the model file draws agree with the sign of the field."""
    field = VENTUSFF.torque_data
    for pole, polarity in zip(VENTUSFF.pole_axes, VENTUSFF.pole_polarity, strict=True):
        for side in np.linalg.svd(pole[None])[2][1:]:
            coil = (pole + 0.1 * side) / np.hypot(1, 0.1)
            torque = field.torque(coil[None])[0]
            assert polarity * (torque @ np.cross(pole, coil)) > 0


def test_the_matrix_sums_coils_by_the_groups_and_directions_of_the_model_file():
    assert VENTUSFF.groups.tolist() == [[0, 4], [1, 5], [2, 6], [3, 7], [8, 9], [10, 11], [12, 13], [14, 15]]
    assert VENTUSFF.coil_direction.tolist() == [1] * 4 + [-1] * 4 + [1] * 8
    for q in random_poses(100):
        of_coils = VENTUSFF.torque_data.torque(VENTUSFF.coil_axes @ rotation(q)) @ rotation(q).T
        expected = (VENTUSFF.coil_direction[:, None] * of_coils)[VENTUSFF.groups].sum(axis=1).T
        # The same polynomials, summed in another order: rounding of torques of 0.02 N·m/A.
        assert_allclose(magnetics.torque_matrix(q, VENTUSFF), expected, rtol=0, atol=1e-16 * 32)


def test_inductances_follow_the_directions_of_the_currents():
    reversed_group = VENTUSFF.coil_direction.copy()
    reversed_group[[1, 5]] *= -1
    actuators_of = (VENTUSFF, replace(VENTUSFF, coil_direction=reversed_group))
    M, turned = map(mutual_inductance, actuators_of)
    sign = np.ones(8)
    sign[1] = -1
    assert_allclose(turned, M * np.outer(sign, sign), rtol=1e-12)
    assert np.abs(M).max() > 0


def test_a_scaled_model_has_scaled_torques():
    q, G = np.array([0.1, 0.2, 0.3]), np.empty((3, 8))
    model = magnetics.scaled(magnetics.torque_model(VENTUSFF), 1.2)
    magnetics.fill_torque_matrix(q, model.arrangement[0], model.tables, G, magnetics.scratch_of(model))
    assert_allclose(G, 1.2 * magnetics.torque_matrix(q, VENTUSFF), rtol=0, atol=1e-16)  # rounding


def test_scatter_of_coils_is_exact_and_of_poles_is_refused():
    rng, errors = np.random.default_rng(4), no_scatter(VENTUSFF)
    gain, angle_rad = rng.uniform(-0.1, 0.1, 16), rng.uniform(-0.02, 0.02, (16, 2))
    coils = errors.coils._replace(gain=gain, angle_rad=angle_rad)
    scatter, G = errors._replace(coils=coils), np.empty((3, 8))
    model = scattered_model(VENTUSFF, scatter)
    for q in random_poses(5):
        magnetics.fill_torque_matrix(q, model.arrangement[0], model.tables, G, magnetics.scratch_of(model))
        assert_allclose(G, summed_torque_matrix(q, VENTUSFF, scatter), rtol=0, atol=1e-15)
        assert np.abs(G - magnetics.torque_matrix(q, VENTUSFF)).max() > 1e-4
    poles = errors.poles._replace(gain=np.full(8, 0.01))
    distant = errors._replace(coils=coils._replace(distance_m=np.ones(16)))
    for wrong in (errors._replace(poles=poles), distant):
        with pytest.raises(InputError, match="errors of the coils' gain and angle alone"):
            scattered_model(VENTUSFF, wrong)


def test_a_file_is_read_back_in_any_order(tmp_path):
    field = VENTUSFF.torque_data
    lines = torque_field.to_csv(field, ["Where from"]).splitlines()
    rows = np.random.default_rng(0).permutation(lines[2:]).tolist()
    (path := tmp_path / "field.csv").write_text("\n".join([*lines[:2], *rows]))
    again = torque_field.read(path)
    assert isinstance(again, TorqueField)
    assert_array_equal(again.torque_Nm_per_A, field.torque_Nm_per_A)
    assert again.name == "torque field field.csv"
    assert isinstance(torque_field.read(actuators.TORQUE_CURVE_PATH), TorqueCurve)


def test_the_coil_of_a_computed_field_is_compared_with_the_model(tmp_path):
    field = replace(VENTUSFF.torque_data, computed_for={"coil turns": 300.0, "coil distance_m": 0.037})
    line = "torque field torque_field.csv was computed for coil turns 300, the model has 400"
    assert disagreements(replace(VENTUSFF, torque_data=field)) == [line]
    assert disagreements(VENTUSFF) == []


def written(tmp_path, *replacements):
    text = SECOND.read_text()
    for old, new in replacements:
        assert old in text
        text = text.replace(old, new)
    (tmp_path / "torque_field.csv").write_bytes(SECOND.with_name("torque_field.csv").read_bytes())
    (path := tmp_path / "mine.xml").write_text(text)
    return path


def test_a_group_may_have_one_coil(tmp_path):
    numbers = [
        re.search(rf'name="coil_{coil:02}".*?user="(.*?)"', SECOND.read_text())[0] for coil in range(1, 17)
    ]
    alone = [(part, re.sub('user=".*"', f'user="{coil}"', part)) for coil, part in enumerate(numbers, 1)]
    actuator = actuators.load(written(tmp_path, *alone))
    assert actuator.groups.shape == (16, 1)
    q = np.array([0.1, -0.2, 0.4])
    of_coils = actuator.torque_data.torque(actuator.coil_axes @ rotation(q)) @ rotation(q).T
    assert_allclose(magnetics.torque_matrix(q, actuator), of_coils.T, rtol=0, atol=1e-16)


def test_the_torque_file_is_part_of_the_model_file(tmp_path):
    path = written(tmp_path)
    before, first = contents_digest(path), actuators.load(path)
    file = tmp_path / "torque_field.csv"
    file.write_text(file.read_text().replace("0.01", "0.02"))
    assert contents_digest(path) != before
    assert actuators.load(path) is not first
