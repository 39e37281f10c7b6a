"""Torque matrix: maps group currents to the torque on the rotor (12)-(15)."""

from __future__ import annotations

from functools import lru_cache
from math import atan2, pi, sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spheretwin.models.actuator import Actuator
from spheretwin.models.base.arrays import Array
from spheretwin.models.base.cache import cached_array
from spheretwin.models.base.compiled import allocation_free, inlined
from spheretwin.models.base.errors import InputError
from spheretwin.models.base.record import Record, Rows, field
from spheretwin.models.base.vectors import (
    WIDTH,
    Vector,
    cubic,
    like,
    limited,
    load,
    side,
    store,
    total,
    vector,
)
from spheretwin.models.kinematics import rotation_rows
from spheretwin.models.torque_curve import TorqueCurve
from spheretwin.models.torque_field import TorqueField

# The look-up's intervals: wide where |cos phi| is below the knee, narrow above it, where f_t rises and falls
# (phi below 18 degrees). 780 intervals (25 kB) hold the spline to 2e-7 of its peak; equal intervals would
# need 8192 of them (262 kB), which falls out of the first-level cache.
KNEE = 0.95
WIDE_PER_UNIT = 200
NARROW_PER_UNIT = 4000
CENTRE = KNEE * WIDE_PER_UNIT + (1 - KNEE) * NARROW_PER_UNIT  # row of the cosine 0
CURVE_ROWS = round(2 * CENTRE) + 1

# Columns of the working space of `fill_torque_matrix`, which has a row for each pole line.
SCRATCH_COLUMNS = 6

# Of the coordinates of opposite axes, which come from rotations of degrees.
OPPOSITE_TOLERANCE = 1e-12


class Arrangement(Record):
    """Pole lines and coil groups of an actuator.

    The two coils of a group have axes s and -s, so a pole axis r enters a group's column as
    ``h(r.s) r x s`` with the odd function ``h(c) = g(c) - g(-c)``, ``g = f_t / sin``. Because h is
    odd, the poles at r and -r add: the shipped 16 poles are 8 *pole lines*, each with the sum of the two
    polarities as its weight. 144 look-ups replace 576 pairs of coil and pole.

    A machine with scatter (`models.scatter`) has a gain and a stretch for each pair of line and group: row 0
    plus row 1 if the angle between line and group axis is acute, row 0 minus row 1 if it is obtuse.

    An actuator with a torque field has no pole lines, but the axes of its coils, group by group; with a
    torque curve these are empty.
    """

    line_axes: Array = field("rotor frame", "", ("lines", 3))
    line_weights: Array = field("of each pole line", "", "lines")
    group_axes: Array = field("stator frame", "", (3, "groups"))
    scattered: bool = field("whether pairs have a gain and a stretch")
    pair_gain: Array = field("factor of h", "", (2, "pairs"))
    pair_stretch: Array = field("share of 1 - |c| that is added to |c|", "", (2, "pairs"))
    coils: Array = field(
        "of a torque field: axis, stator frame, and torque over that of the field", "", (4, "coils")
    )


class Tables(NamedTuple):
    """Torque of a pole or a coil by its angle: arrays that all actuators with this curve or field share."""

    curve: Array
    """(781, 4), cubic coefficients of h, N·m/A; (0, 4) with a torque field."""
    field: Array
    """(t + 2, p + 3, 3), spline coefficients of the torque field, N·m/A; (0, 0, 3) with a torque curve."""


class TorqueModel(NamedTuple):
    """Data of the compiled torque matrix."""

    arrangement: Rows
    """Array of `Arrangement`: one for each row, or one for all."""
    tables: Tables

    @property
    def sizes(self) -> dict[str, int]:
        """Sizes of the arrangement, for the records that it is nested in."""
        data = self.arrangement[0]
        lines, (_, groups) = len(data.line_weights), data.group_axes.shape
        return {"lines": lines, "groups": groups, "pairs": lines * groups, "coils": data.coils.shape[1]}


def torque_matrix(q: Array, actuator: Actuator) -> Array:
    """Return the torque matrix G_t(q): ``torque_S = G_t(q) @ current`` (15).

    Parameters
    ----------
    q : (3,) array, rad
        Pose.
    actuator : Actuator
        Poles, coils, groups and torque curve or field.

    Returns
    -------
    (3, n) array, N·m/A
        Column j is the stator-frame torque of one ampere in group j.

    Raises
    ------
    InputError
        `q` is not a pose.
    """
    q = np.asarray(q, dtype=np.float64)
    if q.shape != (3,) or not np.all(np.isfinite(q)):
        raise InputError(f"torque matrix: expected a pose of three finite angles, received {q}")
    model, G = torque_model(actuator), np.empty((3, len(actuator.groups)))
    fill_torque_matrix(q, model.arrangement[0], model.tables, G, scratch_of(model))
    return G


@lru_cache(maxsize=8)
def torque_model(actuator: Actuator) -> TorqueModel:
    """Return the data of an actuator for compiled code, cached for the actuators used last."""
    if isinstance(actuator.torque_data, TorqueField):
        coils = coils_by_group(actuator, actuator.coil_axes, np.ones(len(actuator.coil_axes)))
        rows = _arrangement(actuator, 0, coils.shape[1])
        rows["coils"] = coils
        return TorqueModel(rows, Tables(np.empty((0, 4)), actuator.torque_data.coefficients))
    lines = pole_lines(actuator.pole_axes)
    opposite = np.where(lines[:, 1] < 0, 0.0, actuator.pole_polarity[lines[:, 1]])
    rows = _arrangement(actuator, len(lines), 0)
    rows["line_axes"] = actuator.pole_axes[lines[:, 0]]
    rows["line_weights"] = actuator.pole_polarity[lines[:, 0]] + opposite
    return TorqueModel(rows, Tables(_cached_table(actuator.torque_curve), np.empty((0, 0, 3))))


def _arrangement(actuator: Actuator, lines: int, coils: int) -> Rows:
    groups = len(actuator.groups)
    rows = Arrangement.zeros(lines=lines, groups=groups, pairs=lines * groups, coils=coils)
    rows["group_axes"] = actuator.group_axes.T
    return rows


def coils_by_group(actuator: Actuator, axes: Array, gain: Array) -> Array:
    """Return the coils of a torque field as `Arrangement` has them, from axes (…, c, 3) and gains (…, c)."""
    of_coils = np.concatenate([axes, (actuator.coil_direction * gain)[..., None]], axis=-1)
    return np.ascontiguousarray(of_coils[..., actuator.groups.ravel(), :].mT)


def scaled(model: TorqueModel, scale: ArrayLike) -> TorqueModel:
    """Return a model of which all torques are those of another one times a factor, or n factors (n, 1)."""
    if np.all(np.equal(scale, 1)):
        return model
    rows = rows_of(model, scale)
    rows["line_weights"] *= scale
    rows["coils"][:, 3] *= scale
    return model._replace(arrangement=rows)


def rows_of(model: TorqueModel, *columns: ArrayLike) -> Rows:
    """Return a copy of an arrangement for as many rows as columns (n, 1) have, which numbers may be too."""
    shape = np.broadcast_shapes((len(model.arrangement), 1), *map(np.shape, columns))
    return np.broadcast_to(model.arrangement, shape[:1]).copy()


def pole_lines(axes: Array) -> NDArray[np.int64]:
    """Return the poles of each pole line, (lines, 2): one pole and its opposite, or -1 if there is none."""
    opposite = np.all(np.abs(axes[:, None] + axes) <= OPPOSITE_TOLERANCE, axis=2)
    partner = np.where(opposite.any(axis=1), np.argmax(opposite, axis=1), -1)
    return np.array([[pole, other] for pole, other in enumerate(partner) if not 0 <= other < pole])


def lookup_table(curve: TorqueCurve) -> Array:
    """Return cubics for ``h(c) = g(c) - g(-c)`` on intervals of c from -1 to 1; `place` finds a cosine's row.

    Each cubic interpolates h at four Chebyshev points of its interval. The last row repeats the end of the
    previous one: the cosine of a pole directly in front of a coil may round past 1.

    Returns
    -------
    (n + 1, 4) array, N·m/A
        Coefficients of 1, t, t², t³ with t from 0 to 1 within an interval.
    """
    narrow = round((1 - KNEE) * NARROW_PER_UNIT)
    wide = round(2 * KNEE * WIDE_PER_UNIT)
    below, middle = np.linspace(-1, -KNEE, narrow + 1), np.linspace(-KNEE, KNEE, wide + 1)
    edges = np.concatenate([below[:-1], middle, -below[-2::-1]])  # (n + 1,)
    t = 0.5 - 0.5 * np.cos((2 * np.arange(4) + 1) * np.pi / 8)  # (4,)
    c = edges[:-1, None] + np.diff(edges)[:, None] * t  # (n, 4)
    h = curve.over_sine(c) - curve.over_sine(-c)
    table = np.linalg.solve(np.vander(t, increasing=True), h.T).T  # (n, 4)
    beyond = [[table[-1].sum(), 0.0, 0.0, 0.0]]
    return np.ascontiguousarray(np.concatenate([table, beyond]))


@inlined
def place(cosine: Vector) -> Vector:
    """Return the place of a cosine in the look-up table: the number of its row plus the fraction t.

    Two slopes, joined at the knee.
    """
    beyond = cosine - limited(cosine, -KNEE, KNEE)
    return CENTRE + WIDE_PER_UNIT * cosine + (NARROW_PER_UNIT - WIDE_PER_UNIT) * beyond


def scratch_of(model: TorqueModel) -> Array:
    """Return the working space of `fill_torque_matrix`.

    Returns
    -------
    (lines, 6) array
        Axis of each pole line in the stator frame, and the axis times the weight of the line.
    """
    return np.empty((model.arrangement.dtype["line_weights"].shape[0], SCRATCH_COLUMNS))


@inlined
def fill_torque_matrix(q: Array, arrangement: Arrangement, tables: Tables, G: Array, scratch: Array) -> None:
    """Write the torque matrix into `G`.

    Parameters
    ----------
    q : (3,) array, rad
        Pose; finite.
    arrangement : Arrangement
        Of n groups.
    tables : Tables
        Of its curve or field.
    G : (3, n) array, N·m/A
        Result.
    scratch : (lines, 6) array
        Of `scratch_of`; its content does not matter.

    Notes
    -----
    `g(cos phi)` is looked up, never `f_t(phi)`: no arc cosine, and no singular case for a pole
    in front of a coil.

    One pose of the shipped actuator takes about 0.2 µs on a 2024 server core, compared with 1.1 µs for all
    576 pairs in one plain loop. Pairs of opposite coils and of opposite poles leave 144 look-ups (see
    `TorqueModel`), four at a time.
    """
    if arrangement.coils.shape[1] > 0:
        _fill_from_field(q, arrangement, tables.field, G)
        return
    R_x, R_y, R_z = rotation_rows(q)
    for line in range(arrangement.line_axes.shape[0]):
        r, weight = arrangement.line_axes[line], arrangement.line_weights[line]
        x = R_x[0] * r[0] + R_x[1] * r[1] + R_x[2] * r[2]
        y = R_y[0] * r[0] + R_y[1] * r[1] + R_y[2] * r[2]
        z = R_z[0] * r[0] + R_z[1] * r[1] + R_z[2] * r[2]
        scratch[line, 0], scratch[line, 1], scratch[line, 2] = x, y, z
        scratch[line, 3], scratch[line, 4], scratch[line, 5] = weight * x, weight * y, weight * z
    group_axes = arrangement.group_axes
    s_x, s_y, s_z = group_axes[0], group_axes[1], group_axes[2]
    G_x, G_y, G_z = G[0], G[1], G[2]
    groups = G.shape[1]
    left = groups % WIDTH
    for j in range(0, groups - left, WIDTH):
        axes = load(s_x, j), load(s_y, j), load(s_z, j)
        of_x, of_y, of_z = _columns(axes, j, arrangement, tables.curve, scratch)
        store(of_x, G_x, j)
        store(of_y, G_y, j)
        store(of_z, G_z, j)
    for j in range(groups - left, groups):
        G_x[j], G_y[j], G_z[j] = _columns((s_x[j], s_y[j], s_z[j]), j, arrangement, tables.curve, scratch)


@inlined
def _columns(
    axes: tuple[Vector, Vector, Vector], first: int, arrangement: Arrangement, curve: Array, lines: Array
) -> tuple[Vector, Vector, Vector]:
    """Return one column of the torque matrix, or four, from the axes of the groups."""
    s_x, s_y, s_z = axes
    groups, scattered = arrangement.group_axes.shape[1], arrangement.scattered
    gains, stretches = arrangement.pair_gain, arrangement.pair_stretch
    x = y = z = 0.0 * s_x
    for line in range(lines.shape[0]):
        pair = line * groups + first
        cosine = lines[line, 0] * s_x + lines[line, 1] * s_y + lines[line, 2] * s_z
        if scattered:
            share = like(s_x, stretches[0], pair)
            share = share + side(cosine) * like(s_x, stretches[1], pair)
            cosine = cosine + share * (side(cosine) - cosine)
        h = cubic(curve, place(cosine))
        if scattered:
            gain = like(s_x, gains[0], pair)
            h = h * (gain + side(cosine) * like(s_x, gains[1], pair))
        x, y, z = x + h * lines[line, 3], y + h * lines[line, 4], z + h * lines[line, 5]
    return y * s_z - z * s_y, z * s_x - x * s_z, x * s_y - y * s_x


@allocation_free
def _fill_from_field(q: Array, arrangement: Arrangement, field: Array, G: Array) -> None:
    """Write the torque matrix of a torque field into `G`, as `TorqueField.torque` computes it."""
    R_x, R_y, R_z = rotation_rows(q)
    coils, groups = arrangement.coils, G.shape[1]
    size, rows, columns = coils.shape[1] // groups, field.shape[0] - 3, field.shape[1] - 3
    for j in range(groups):
        x = y = z = 0.0  # torque, rotor frame
        for coil in range(j * size, (j + 1) * size):
            s_x, s_y, s_z, weight = coils[0, coil], coils[1, coil], coils[2, coil], coils[3, coil]
            n_x = R_x[0] * s_x + R_y[0] * s_y + R_z[0] * s_z
            n_y = R_x[1] * s_x + R_y[1] * s_y + R_z[1] * s_z
            n_z = R_x[2] * s_x + R_y[2] * s_y + R_z[2] * s_z
            row = atan2(sqrt(n_x * n_x + n_y * n_y), n_z) * (rows / pi)
            column = atan2(n_y, n_x) * (columns / (2 * pi))
            column += columns if column < 0 else 0.0
            i = min(max(int(row), 0), rows - 1)  # an angle may round to its end, or be NaN
            k = min(max(int(column), 0), columns - 1)
            row_weights, column_weights = _spline_weights(row - i), _spline_weights(column - k)
            for a in range(4):
                along_x = along_y = along_z = 0.0
                for b in range(4):
                    along_x += column_weights[b] * field[i + a, k + b, 0]
                    along_y += column_weights[b] * field[i + a, k + b, 1]
                    along_z += column_weights[b] * field[i + a, k + b, 2]
                share = weight * row_weights[a]
                x, y, z = x + share * along_x, y + share * along_y, z + share * along_z
        G[0, j] = R_x[0] * x + R_x[1] * y + R_x[2] * z
        G[1, j] = R_y[0] * x + R_y[1] * y + R_y[2] * z
        G[2, j] = R_z[0] * x + R_z[1] * y + R_z[2] * z


@inlined
def _spline_weights(t: float) -> tuple[float, float, float, float]:
    """Return the values of the four cubic B-splines at a fraction of a step."""
    u = 1 - t
    return (
        u * u * u / 6,
        (t * t * (3 * t - 6) + 4) / 6,
        (u * u * (3 * u - 6) + 4) / 6,
        t * t * t / 6,
    )


class CachedMatrix(Record):
    """Torque matrix with its pose: at the same pose it is not computed again."""

    q: Array = field("pose; NaN before the first update", "rad", 3)
    G: Array = field("torque matrix", "N·m/A", (3, "groups"))
    scratch: Array = field("working space of `fill_torque_matrix`", "", ("lines", SCRATCH_COLUMNS))


@inlined
def update_cached_matrix(q: Array, arrangement: Arrangement, tables: Tables, cached: CachedMatrix) -> None:
    """Compute the torque matrix at a pose, unless it is the cached pose.

    Parameters
    ----------
    q : (3,) array, rad
        Pose; finite.
    arrangement : Arrangement
        Of n groups.
    tables : Tables
        Of its curve or field.
    cached : CachedMatrix
        Changed in place.
    """
    if not (q[0] == cached.q[0] and q[1] == cached.q[1] and q[2] == cached.q[2]):
        # Slices of fields have the type of other arrays: the function is compiled once for both.
        fill_torque_matrix(q[:], arrangement, tables, cached.G[:], cached.scratch[:])
        cached.q[0], cached.q[1], cached.q[2] = q[0], q[1], q[2]


@allocation_free
def rotor_torque(G: Array, current: Array, torque_S: Array) -> None:
    """Compute ``torque_S = G current`` (15).

    Parameters
    ----------
    G : (3, n) array, N·m/A
        Torque matrix.
    current : (n,) array, A
        Of each group.
    torque_S : (3,) array, N·m
        Result: on the rotor, stator frame.
    """
    G_x, G_y, G_z = G[0], G[1], G[2]
    groups = current.shape[0]
    left = groups % WIDTH
    of_x = of_y = of_z = vector(0.0, 0.0, 0.0, 0.0)
    for j in range(0, groups - left, WIDTH):
        amperes = load(current, j)
        of_x, of_y = of_x + load(G_x, j) * amperes, of_y + load(G_y, j) * amperes
        of_z = of_z + load(G_z, j) * amperes
    x, y, z = total(of_x), total(of_y), total(of_z)
    for j in range(groups - left, groups):
        x, y, z = x + G_x[j] * current[j], y + G_y[j] * current[j], z + G_z[j] * current[j]
    torque_S[0], torque_S[1], torque_S[2] = x, y, z


def _cached_table(curve: TorqueCurve) -> Array:
    """Return the look-up table, from the cache if possible: the spline is slow to import."""
    samples = curve.phi_rad.tobytes() + curve.torque_Nm_per_A.tobytes()
    return cached_array(samples, lambda: lookup_table(curve))
