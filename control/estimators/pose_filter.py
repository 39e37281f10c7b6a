"""Pose filter: the rotation of the rotor from its field at sensors, an extended Kalman filter on SO(3).

*State.* Rotation R, rate ω in the stator frame, and the remanence over its nominal value. The error δ of R is
a small rotation in the stator frame: ``R = exp(δ) R_estimated``, which has no singular pose.

*Prediction.* The rate is constant except for white acceleration of density q (rad²/s³).

*Correction.* The field of the coils, known from the measured currents, is subtracted. Each reading corrects
the state in turn, with the slopes at the predicted pose: their errors are independent.

*Start.* The remaining field is compared with that of poses on a grid over the range of the hinges, with any
remanence. The best ones are refined by Gauss-Newton steps, and the best of these is the start. γ is searched
within one period of the symmetry of the poles about `start_rad`: the field is the same in the others. The
search is repeated if the predicted field does not resemble the readings.
"""

from __future__ import annotations

from math import asin, atan2, cos, pi, sin, sqrt

import numpy as np

from spheretwin.models.base.arrays import Array
from spheretwin.models.base.compiled import allocation_free, inlined
from spheretwin.models.base.record import Record, Rows, field, put
from spheretwin.models.kinematics import rotation_rows
from spheretwin.models.stator_field import read_table

GRID_rad = 0.18
"""Largest step of the search, a quarter of the pitch of the poles."""

BEST, REFINEMENTS = 12, 12

LONGEST_rad, WITHIN_rad = 0.2, 0.1
"""Largest step of a refinement; distance beyond the range of the hinges at which a pose is still accepted."""

LOST = 0.25
"""Share of the squared readings that the prediction leaves, from which the search is repeated."""

FIRST_ANGLE_rad, FIRST_RATE_rad_s = 0.05, 20.0
"""Standard deviations after a search."""

STATES = 7
"""Rotation error, rates, remanence."""


class FieldGeometry(Record):
    """Field at the readings, each the component along an axis at a point of the stator."""

    points: Array = field("directions of the points", "", ("readings", 3))
    axes: Array = field("of the readings", "", ("readings", 3))
    poles: Array = field("axes, rotor frame", "", ("poles", 3))
    polarity: Array = field("of the poles", "", "poles")
    table: Array = field("of `stator_field.pole_table`", "T", ("table_rows", 4))
    coils_T_A: Array = field("field of each group", "T/A", ("readings", "groups"))
    poles_S: Array = field("axes of the poles, stator frame", "", ("poles", 3))


class PoseFilter(Record):
    """Filter with its state and scratch."""

    period_s: float = field("control period", "s")
    variance_T2: float = field("of a reading", "T²")
    density: float = field("of white acceleration", "rad²/s³")
    remanence_variance: float = field("of the magnets, over the square of the nominal value")
    first_rad: Array = field("first pose of the grid", "rad", 3)
    step_rad: Array = field("steps of the grid", "rad", 3)
    steps: Array = field("poses of the grid along each hinge", "", 3)
    started: int = field("1 after the first search", state=True)
    searches: int = field("number of searches", state=True)
    q: Array = field("estimated pose, γ over any number of turns", "rad", 3, state=True)
    R_SR: Array = field("estimated rotation", "", (3, 3), state=True)
    w_SR_S: Array = field("estimated rate", "rad/s", 3, state=True)
    remanence: float = field("estimated, over the nominal one", state=True)
    P: Array = field("covariance", "", (STATES, STATES), state=True)
    innovation_T: float = field("readings less prediction, rms", "T", state=True)
    rotor_T: Array = field("readings less the field of the coils", "T", "readings")
    field_T: Array = field("predicted field of the poles", "T", "readings")
    slopes_T: Array = field("its derivative by a rotation in the stator frame", "T/rad", ("readings", 3))
    sensitivity: Array = field("of a reading to the state", "", STATES)
    gain: Array = field("of a reading", "", STATES)
    change: Array = field("of the state", "", STATES)
    candidates: Array = field("cost and pose of the best poses of the grid", "", (BEST, 4))


def fill_grid(rows: Rows, hinge_range_rad: Array, start_rad: Array, turn_period_rad: float) -> None:
    """Fill the grid of the search: the range of α and β, one period of γ about its start."""
    low, high = hinge_range_rad[:, 0].copy(), hinge_range_rad[:, 1].copy()
    low[2], high[2] = start_rad[2] - turn_period_rad / 2, start_rad[2] + turn_period_rad / 2
    low[:2], high[:2] = np.maximum(low[:2], [-pi, -pi / 2]), np.minimum(high[:2], [pi, pi / 2])
    steps = ((high - low) / GRID_rad).round() + 1
    put(rows, first_rad=low + (high - low) / (2 * steps), step_rad=(high - low) / steps, steps=steps)


@allocation_free
def fill_field(
    geometry: FieldGeometry, poles: Array, strength: Array, R_SR: Array, result_T: Array, slopes_T: Array
) -> None:
    """Write the field of poles at the readings (n,), T, and its slopes (n, 3), T/rad.

    Parameters
    ----------
    geometry : FieldGeometry
        Places of the readings, and field of a north pole.
    poles : (p, 3) array
        Axes of the poles, rotor frame.
    strength : (p,) array
        Remanence of each pole over the nominal one, with its sign.
    R_SR : (3, 3) array
        Rotation of the rotor.
    result_T, slopes_T : arrays
        Results.
    """
    poles_S = geometry.poles_S
    for k in range(poles.shape[0]):
        for i in range(3):
            poles_S[k, i] = R_SR[i, 0] * poles[k, 0] + R_SR[i, 1] * poles[k, 1] + R_SR[i, 2] * poles[k, 2]
    for r in range(result_T.shape[0]):
        p0, p1, p2 = geometry.points[r, 0], geometry.points[r, 1], geometry.points[r, 2]
        a0, a1, a2 = geometry.axes[r, 0], geometry.axes[r, 1], geometry.axes[r, 2]
        along = p0 * a0 + p1 * a1 + p2 * a2
        total = by_p0 = by_p1 = by_p2 = by_a0 = by_a1 = by_a2 = 0.0
        for k in range(poles.shape[0]):
            u0, u1, u2 = poles_S[k, 0], poles_S[k, 1], poles_S[k, 2]
            x, y = p0 * u0 + p1 * u1 + p2 * u2, a0 * u0 + a1 * u1 + a2 * u2
            one, sign = read_table(geometry.table[:], x), strength[k]
            total += sign * ((one.f + x * one.g) * along - one.g * y)
            by_x = sign * ((one.f_slope + one.g + x * one.g_slope) * along - one.g_slope * y)
            by_y = -sign * one.g
            by_p0, by_p1, by_p2 = by_p0 + by_x * u0, by_p1 + by_x * u1, by_p2 + by_x * u2
            by_a0, by_a1, by_a2 = by_a0 + by_y * u0, by_a1 + by_y * u1, by_a2 + by_y * u2
        result_T[r] = total
        slopes_T[r, 0] = by_p1 * p2 - by_p2 * p1 + by_a1 * a2 - by_a2 * a1
        slopes_T[r, 1] = by_p2 * p0 - by_p0 * p2 + by_a2 * a0 - by_a0 * a2
        slopes_T[r, 2] = by_p0 * p1 - by_p1 * p0 + by_a0 * a1 - by_a1 * a0


@allocation_free
def estimate_pose(pose: PoseFilter, geometry: FieldGeometry, reading_T: Array, current_A: Array) -> None:
    """Advance the filter by one control tick.

    Parameters
    ----------
    pose : PoseFilter
        Result: its `q`.
    geometry : FieldGeometry
    reading_T : (n,) array, T
    current_A : (groups,) array, A
        Measured; zeros leave the field of the coils in the readings.
    """
    rotor_T = pose.rotor_T
    for r in range(rotor_T.shape[0]):
        rotor_T[r] = reading_T[r]
        for j in range(current_A.shape[0]):
            rotor_T[r] -= geometry.coils_T_A[r, j] * current_A[j]
    if pose.started == 0:
        _search(pose, geometry)
    else:
        _predict(pose)
    if _correct(pose, geometry) and pose.started == 1:
        _search(pose, geometry)
        _correct(pose, geometry)
    pose.started = 1
    _write_angles(pose)


@allocation_free
def _fill_predicted(pose: PoseFilter, geometry: FieldGeometry) -> None:
    """Write the field of the nominal poles in the estimated pose."""
    poles, polarity = geometry.poles[:], geometry.polarity[:]
    fill_field(geometry, poles, polarity, pose.R_SR[:], pose.field_T[:], pose.slopes_T[:])


@inlined
def _predict(pose: PoseFilter) -> None:
    T, P = pose.period_s, pose.P
    turn(pose.R_SR[:], T * pose.w_SR_S[0], T * pose.w_SR_S[1], T * pose.w_SR_S[2])
    for i in range(3):  # P = F P F' + Q with F = [[1, T], [0, 1]] of rotation and rate
        for j in range(STATES):
            P[i, j] += T * P[3 + i, j]
    for i in range(3):
        for j in range(STATES):
            P[j, i] += T * P[j, 3 + i]
    q = pose.density * T
    for i in range(3):
        P[i, i] += q * T * T / 3.0
        P[i, 3 + i] += q * T / 2.0
        P[3 + i, i] += q * T / 2.0
        P[3 + i, 3 + i] += q


@allocation_free
def _correct(pose: PoseFilter, geometry: FieldGeometry) -> bool:
    """Correct the state; return True, with the state unchanged, if the prediction is lost."""
    field_T, P, H = pose.field_T[:], pose.P[:], pose.sensitivity[:]
    gain, change = pose.gain[:], pose.change[:]
    _fill_predicted(pose, geometry)
    count, left, size = field_T.shape[0], 0.0, 0.0
    for r in range(count):
        left += (pose.rotor_T[r] - pose.remanence * field_T[r]) ** 2
        size += pose.rotor_T[r] ** 2
    pose.innovation_T = sqrt(left / count)
    if pose.started == 1 and left > LOST * size:
        return True
    for i in range(STATES):
        change[i] = 0.0
    for r in range(count):
        for i in range(3):
            H[i] = pose.remanence * pose.slopes_T[r, i]
        H[6] = field_T[r]
        variance, error = pose.variance_T2, pose.rotor_T[r] - pose.remanence * field_T[r]
        for i in range(STATES):
            gain[i] = P[i, 0] * H[0] + P[i, 1] * H[1] + P[i, 2] * H[2] + P[i, 6] * H[6]
        for i in range(3):
            variance += H[i] * gain[i]
            error -= H[i] * change[i]
        variance += H[6] * gain[6]
        error -= H[6] * change[6]
        for i in range(STATES):
            change[i] += gain[i] * error / variance
            for j in range(STATES):
                P[i, j] -= gain[i] * gain[j] / variance
    turn(pose.R_SR[:], change[0], change[1], change[2])
    for i in range(3):
        pose.w_SR_S[i] += change[3 + i]
    pose.remanence += change[6]
    return False


@allocation_free
def _search(pose: PoseFilter, geometry: FieldGeometry) -> None:
    """Find the pose whose field is most like the readings, and start the filter there at rest."""
    candidates, q = pose.candidates[:], pose.q[:]
    last_rad, period_rad = q[2], pose.steps[2] * pose.step_rad[2]
    if pose.searches == 0:
        last_rad = pose.first_rad[2] + 0.5 * (period_rad - pose.step_rad[2])
    for place in range(BEST):
        candidates[place, 0] = 2.0
    for a in range(int(pose.steps[0])):
        for b in range(int(pose.steps[1])):
            for c in range(int(pose.steps[2])):
                q[0] = pose.first_rad[0] + a * pose.step_rad[0]
                q[1] = pose.first_rad[1] + b * pose.step_rad[1]
                q[2] = pose.first_rad[2] + c * pose.step_rad[2]
                _insert(candidates, _cost(pose, geometry), q)
    least, best = 3.0, 0
    for place in range(BEST):
        for i in range(3):
            q[i] = candidates[place, 1 + i]
        cost = _refined(pose, geometry)
        is_within = True
        for i in range(2):
            beyond = abs(q[i] - pose.first_rad[i] - 0.5 * (pose.steps[i] - 1.0) * pose.step_rad[i])
            is_within = is_within and beyond < 0.5 * pose.steps[i] * pose.step_rad[i] + WITHIN_rad
        if cost < least and is_within:
            least, best = cost, place
        for i in range(3):
            candidates[place, 1 + i] = q[i]
    for i in range(3):
        q[i] = candidates[best, 1 + i]
    q[2] += period_rad * round((last_rad - q[2]) / period_rad)  # the field is the same
    _cost(pose, geometry)
    pose.remanence = 1.0
    if pose.remanence_variance > 0.0:
        pose.remanence = _scale(pose.rotor_T[:], pose.field_T[:])
    pose.searches += 1
    for i in range(STATES):
        for j in range(STATES):
            pose.P[i, j] = 0.0
    for i in range(3):
        pose.w_SR_S[i] = 0.0
        pose.P[i, i], pose.P[3 + i, 3 + i] = FIRST_ANGLE_rad**2, FIRST_RATE_rad_s**2
    pose.P[6, 6] = pose.remanence_variance


@inlined
def _insert(candidates: Array, cost: float, q: Array) -> None:
    """Insert a pose into the list of the best ones, the least cost first."""
    place = BEST
    while place > 0 and cost < candidates[place - 1, 0]:
        place -= 1
        if place + 1 < BEST:
            for i in range(4):
                candidates[place + 1, i] = candidates[place, i]
    if place < BEST:
        candidates[place, 0] = cost
        for i in range(3):
            candidates[place, 1 + i] = q[i]


@allocation_free
def _cost(pose: PoseFilter, geometry: FieldGeometry) -> float:
    """Return the share of the squared readings that the field of the pose `q`, times any number, leaves."""
    for i, row in enumerate(rotation_rows(pose.q[:])):
        pose.R_SR[i, 0], pose.R_SR[i, 1], pose.R_SR[i, 2] = row
    _fill_predicted(pose, geometry)
    scale = max(_scale(pose.rotor_T[:], pose.field_T[:]), 0.0)
    left, size = 0.0, 1e-300
    for r in range(pose.field_T.shape[0]):
        left += (pose.rotor_T[r] - scale * pose.field_T[r]) ** 2
        size += pose.rotor_T[r] ** 2
    return left / size


@inlined
def _scale(reading_T: Array, field_T: Array) -> float:
    """Return the number by which the field is most like the readings."""
    product, square = 0.0, 1e-300
    for r in range(field_T.shape[0]):
        product += reading_T[r] * field_T[r]
        square += field_T[r] ** 2
    return product / square


@allocation_free
def _refined(pose: PoseFilter, geometry: FieldGeometry) -> float:
    """Refine the pose `q` by Gauss-Newton steps; return its cost."""
    slopes, field_T, change = pose.slopes_T[:], pose.field_T[:], pose.change[:]
    for _ in range(REFINEMENTS):
        _cost(pose, geometry)
        scale = max(_scale(pose.rotor_T[:], field_T), 0.1)
        xx = yy = zz = xy = xz = yz = x = y = z = 0.0
        for r in range(field_T.shape[0]):
            error, a, b, c = pose.rotor_T[r] / scale - field_T[r], slopes[r, 0], slopes[r, 1], slopes[r, 2]
            xx, yy, zz = xx + a * a, yy + b * b, zz + c * c
            xy, xz, yz = xy + a * b, xz + a * c, yz + b * c
            x, y, z = x + a * error, y + b * error, z + c * error
        damping = 1e-3 * (xx + yy + zz) + 1e-300
        xx, yy, zz = xx + damping, yy + damping, zz + damping
        first, second, third = yy * zz - yz * yz, xz * yz - xy * zz, xy * yz - xz * yy
        determinant = xx * first + xy * second + xz * third
        change[0] = (first * x + second * y + third * z) / determinant
        change[1] = (second * x + (xx * zz - xz * xz) * y + (xy * xz - xx * yz) * z) / determinant
        change[2] = (third * x + (xy * xz - xx * yz) * y + (xx * yy - xy * xy) * z) / determinant
        length = sqrt(change[0] ** 2 + change[1] ** 2 + change[2] ** 2)
        short = min(1.0, LONGEST_rad / max(length, 1e-300))
        turn(pose.R_SR[:], short * change[0], short * change[1], short * change[2])
        _write_angles(pose)
    return float(_cost(pose, geometry))


@inlined
def turn(R: Array, x: float, y: float, z: float) -> None:
    """Multiply a rotation from the left by that of a vector, rad: Rodrigues' formula."""
    square = x * x + y * y + z * z
    angle = sqrt(square)
    sine = sin(angle) / angle if square > 1e-16 else 1.0
    rest = (1.0 - cos(angle)) / square if square > 1e-16 else 0.5
    for j in range(3):
        a, b, c = R[0, j], R[1, j], R[2, j]
        d, e, f = y * c - z * b, z * a - x * c, x * b - y * a
        R[0, j] = a + sine * d + rest * (y * f - z * e)
        R[1, j] = b + sine * e + rest * (z * d - x * f)
        R[2, j] = c + sine * f + rest * (x * e - y * d)


@inlined
def _write_angles(pose: PoseFilter) -> None:
    """Write the hinge angles of the rotation; γ is the one nearest to the last."""
    R, q = pose.R_SR, pose.q
    q[0] = atan2(-R[1, 2], R[2, 2])
    q[1] = asin(min(max(R[0, 2], -1.0), 1.0))
    gamma = atan2(-R[0, 1], R[0, 0])
    q[2] = gamma + 2.0 * pi * round((q[2] - gamma) / (2.0 * pi))
