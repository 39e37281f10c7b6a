"""Scatter of a real machine: each pole and each coil with its own strength and placement.

A pair of poles and a pair of coils on common axes enter the torque matrix as one look-up (`Arrangement`).
With scatter their axes are no longer opposite. Their mean axis cancels the placement errors to first order;
what is left grows with the square of the angles. The strengths are exact: the two combinations of pole and
coil that are next to each other have other weights than the two that are far apart.

A larger distance from the joint centre changes the gap between pole and coil. To first order, f_t is then
multiplied by ``1 + gain delta``, and its angle is stretched: ``1 - |cos phi|`` is multiplied by
``1 - stretch delta``. Both sensitivities are those of the torque curve (`pole_torque.distance_sensitivity`).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spheretwin.models.actuator import Actuator
from spheretwin.models.base.arrays import Array
from spheretwin.models.base.errors import InputError
from spheretwin.models.base.record import put
from spheretwin.models.kinematics import frame_of_axis, rotation
from spheretwin.models.magnetics import TorqueModel, coils_by_group, pole_lines, rows_of, torque_model
from spheretwin.models.torque_field import TorqueField


class PartErrors(NamedTuple):
    """Errors of k poles or of k coils, of one machine or with n as first length."""

    gain: Array  # (k,) relative error of the remanence, or of the torque per ampere
    angle_rad: Array  # (k, 2) placement to the east and to the north of the nominal axis
    distance_m: Array  # (k,) placement along the axis

    def axes(self, nominal: Array) -> Array:
        """Return the axes, (k, 3) or (n, k, 3), for nominal axes (k, 3)."""
        across = np.reshape([frame_of_axis(axis)[:, :2] for axis in nominal], (-1, 3, 2))
        axes = nominal + (across @ self.angle_rad[..., None])[..., 0]
        return np.asarray(axes / np.linalg.norm(axes, axis=-1, keepdims=True))


def part_errors(table: Array) -> PartErrors:
    """Return the errors of a table (k, 4) or (n, k, 4): gain, two angles in rad, distance in m."""
    return PartErrors(table[..., 0], table[..., 1:3], table[..., 3])


class Scatter(NamedTuple):
    """Errors of all poles and of all coils of a machine, or of n machines."""

    poles: PartErrors
    coils: PartErrors
    acts: bool | NDArray[np.bool_] = True
    """Whether the machine has errors; (n, 1) if some of the machines equal their drawing."""


def no_scatter(actuator: Actuator) -> Scatter:
    """Return the scatter of a machine that equals its drawing."""
    poles, coils = len(actuator.pole_axes), len(actuator.coil_axes)
    return Scatter(part_errors(np.zeros((poles, 4))), part_errors(np.zeros((coils, 4))))


def summed_torque_matrix(q: Array, actuator: Actuator, scatter: Scatter | None = None) -> Array:
    """Return the torque matrix G_t(q) as a sum over all coils, with the torque curve or field itself.

    Parameters
    ----------
    q : (3,) array, rad
        Pose.
    actuator : Actuator
        Nominal machine.
    scatter : Scatter
        None unless given.

    Returns
    -------
    (3, n) array, N·m/A
        Column j is the stator-frame torque of one ampere in group j.
    """
    poles, coils, _ = scatter = scatter or no_scatter(actuator)
    if isinstance(actuator.torque_data, TorqueField):
        _check_representable(actuator.torque_data, scatter)
        torque = actuator.torque_data.torque(coils.axes(actuator.coil_axes) @ rotation(q)) @ rotation(q).T
        return actuator.of_groups((1 + coils.gain[:, None]) * torque)
    pole_axes = poles.axes(actuator.pole_axes) @ rotation(q).T  # (p, 3)
    coil_axes = coils.axes(actuator.coil_axes)  # (c, 3)
    pole_change, coil_change = _distance_changes(actuator, scatter)
    gain, stretch = pole_change[:, :, None] + coil_change[:, None]  # (p, c)
    cosine = pole_axes @ coil_axes.T
    pull = (1 + gain) * actuator.torque_curve.over_sine(cosine + stretch * (np.sign(cosine) - cosine))
    pull *= np.outer(actuator.pole_polarity * (1 + poles.gain), 1 + coils.gain)
    torque = np.einsum("pc,pck->ck", pull, np.cross(pole_axes[:, None], coil_axes))  # (c, 3)
    return actuator.of_groups(torque)


def scattered_model(actuator: Actuator, scatter: Scatter) -> TorqueModel:
    """Return the data of the torque matrix of a machine with scatter, or of n machines.

    Parameters
    ----------
    actuator : Actuator
        Nominal machine.
    scatter : Scatter
        Errors of each pole and of each coil.

    Raises
    ------
    InputError
        A distance has an error, and the torque curve lacks its sensitivities to distance; or poles or
        distances have errors, and the actuator has a torque field.
    """
    poles, coils, _ = scatter
    if isinstance(actuator.torque_data, TorqueField):
        _check_representable(actuator.torque_data, scatter)
        of_coils = coils_by_group(actuator, coils.axes(actuator.coil_axes), 1 + coils.gain)
        return _changed(torque_model(actuator), scatter, coils=of_coils)
    pole_axes, coil_axes = poles.axes(actuator.pole_axes), coils.axes(actuator.coil_axes)
    lines, pairs = pole_lines(actuator.pole_axes), actuator.groups
    strength = actuator.pole_polarity * (1 + poles.gain)
    pole_change, coil_change = _distance_changes(actuator, scatter)
    sums: list[Any] = [0.0, 0.0]  # of weight and stretched weight of the pairs at acute, at obtuse angles
    for first, second in np.ndindex(2, 2):
        pole, coil = lines[:, first], pairs[:, second]
        change, stretch = (
            of_pole[..., pole, None] + of_coil[..., None, coil]
            for of_pole, of_coil in zip(pole_change, coil_change, strict=True)
        )
        weight = strength[..., pole, None] * (1 + coils.gain[..., None, coil]) * (1 + change)
        weight[..., pole < 0, :] = 0.0
        sums[first ^ second] = sums[first ^ second] + np.array([weight, weight * stretch])
    gain, stretched = np.stack(sums, axis=-3).reshape(2, *weight.shape[:-2], 2, -1)  # (2, pairs) of each row
    cancelled = np.abs(gain) < 0.5  # poles whose effects cancel have no common stretch
    stretch = np.where(cancelled, 0.0, stretched / np.where(cancelled, 1.0, gain))
    return _changed(
        torque_model(actuator),
        scatter,
        line_axes=_mean_axes(pole_axes, lines),
        line_weights=1.0,
        group_axes=_mean_axes(coil_axes, pairs).mT,
        scattered=True,
        pair_gain=_mean_and_step(gain),
        pair_stretch=_mean_and_step(stretch),
    )


def _changed(model: TorqueModel, scatter: Scatter, **fields: ArrayLike) -> TorqueModel:
    """Return a model with other fields of its arrangement, where the scatter acts."""
    poles, coils, acts = scatter
    rows = rows_of(model, poles.gain[..., :1], coils.gain[..., :1], acts)
    put(rows, **fields)
    rows[~np.broadcast_to(acts, (len(rows), 1))[:, 0]] = model.arrangement
    return model._replace(arrangement=rows)


def _check_representable(field: TorqueField, scatter: Scatter) -> None:
    """Check that a torque field, which has all poles in one, can represent a scatter."""
    if any(map(np.any, scatter.poles)) or np.any(scatter.coils.distance_m):
        raise InputError(
            f"{field.name}: expected errors of the coils' gain and angle alone, which a torque field can"
            " represent, received errors of poles or of distances"
        )


def _mean_and_step(pairs: Array) -> Array:
    """Return mean and half difference of pairs at acute and at obtuse angles, (…, 2, pairs)."""
    acute, obtuse = pairs[..., 0, :], pairs[..., 1, :]
    return 0.5 * np.stack([acute + obtuse, acute - obtuse], axis=-2)


def _mean_axes(axes: Array, opposite: NDArray[np.int64]) -> Array:
    """Return the mean axis of each pair of opposite parts, unit vectors; a part alone has its own axis."""
    first, second = opposite.T
    total = axes[..., first, :] - np.where(second[:, None] < 0, 0.0, axes[..., second, :])
    return np.asarray(total / np.linalg.norm(total, axis=-1, keepdims=True))


def _distance_changes(actuator: Actuator, scatter: Scatter) -> tuple[Array, Array]:
    """Return the relative change of f_t and the stretch of its angle of each pole and of each coil."""
    known = actuator.torque_curve.distance_sensitivity
    distances_m = scatter.poles.distance_m, scatter.coils.distance_m
    if known is None and any(map(np.any, distances_m)):
        raise InputError(
            f"{actuator.torque_curve.name}: expected its sensitivities to distance, as `spheretwin magnetics"
            " curve` writes them, for errors of the distance; received a file without them"
        )
    magnet, coil = (
        np.multiply.outer(
            [known[f"{name} gain"], known[f"{name} stretch"]] if known else [0.0, 0.0], distance_m
        )
        for name, distance_m in zip(("magnet", "coil"), distances_m, strict=True)
    )
    return magnet, coil
