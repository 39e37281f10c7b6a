"""Many plants that are advanced together, each with parameters of its own."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spheretwin.models.base.arrays import is_real, real_array
from spheretwin.models.base.errors import InputError, shown
from spheretwin.models.base.record import Rows
from spheretwin.models.magnetics import Tables, scratch_of
from spheretwin.plant import lanes
from spheretwin.plant.friction import levels
from spheretwin.plant.lanes import LANES, LaneField
from spheretwin.plant.plant_step import LONGEST_STEP_s, Parameters, State, check_parameters, roll_out

Array = NDArray[np.float64]
Plant = int | NDArray[np.integer] | NDArray[np.bool_]
"""Number of one plant, numbers of some, or a mask."""


class Plants:
    """Plants in lockstep on one core; each step is that of `plant.step`, within rounding.

    Plants with an ideal joint are computed in blocks of 16, one in each lane of the vector unit. A plant with
    a general joint is computed by `plant.step` itself.

    Parameters
    ----------
    parameters : Parameters or sequence of Parameters
        Of all plants, or of each; all with equal numbers of pole lines and groups, and torque curves, or
        torque fields of one size.
    count : int, optional
        Number of plants; only with parameters of all.

    Attributes
    ----------
    blocks, field
        State and parameters for the compiled code of `lanes`.

    Raises
    ------
    InputError
        No plant, a count with a sequence, or magnetics of different sizes.

    Examples
    --------
    >>> import numpy as np
    >>> from spheretwin import plant
    >>> plants = plant.Plants(plant.parameters("nutation"), 64)
    >>> plants.step(np.full(18, 0.5), np.zeros(3), 5e-4, steps=2)  # A, N·m, s
    >>> plants.q_rad.shape
    (64, 3)
    """

    def __init__(self, parameters: Parameters | Sequence[Parameters], count: int | None = None) -> None:
        if isinstance(parameters, Parameters):
            each = [parameters] * (1 if count is None else count)
        elif count is None:
            each = list(parameters)
        else:
            raise InputError(f"plants: expected a count with one set of parameters, received {count}")
        if not each:
            raise InputError("plants: expected at least one plant, received none")
        self._parameters = each
        first, n, blocks = each[0].magnetics, len(each), -(-len(each) // LANES)
        groups = first.sizes["groups"]
        self.field = LaneField(
            arrangement=np.empty(n, first.arrangement.dtype),
            curves=first.tables.curve[None],
            fields=first.tables.field[None],
            table_of=np.zeros(n, np.int64),
            torque_gain=np.empty((n, groups)),
            G=np.empty((3, groups)),
            scratch=scratch_of(first),
            vectors=np.empty((3, max(3, groups))),
        )
        self.blocks = np.zeros((blocks, lanes.ROWS * LANES))
        # A lane without a plant: at rest, of inertia 1.
        self._write(lanes.INERTIA, np.ones((blocks * LANES, 3)))
        self.blocks[:, lanes.SMOOTHING : lanes.SMOOTHING + LANES] = 1.0
        self._constant_Nm = np.zeros((n, 3))
        self._tables = [first.tables]
        for number, one in enumerate(each):
            self._set(number, one)

    def __len__(self) -> int:
        return len(self._parameters)

    @property
    def groups(self) -> int:
        """Number of coil groups."""
        return self.field.torque_gain.shape[1]

    @property
    def q_rad(self) -> Array:
        """Hinge angles (n, 3), a copy."""
        return self._read(lanes.Q)

    @property
    def qdot_rad_s(self) -> Array:
        """Hinge rates (n, 3), a copy."""
        return self._read(lanes.QDOT)

    def set_state(self, q_rad: ArrayLike, qdot_rad_s: ArrayLike, plants: Plant | slice = slice(None)) -> None:
        """Set angles and rates.

        Parameters
        ----------
        q_rad, qdot_rad_s : (3,) or (m, 3) arrays, or float
            For all, or for each; a number is that of every hinge.
        plants : int, indices or mask, optional
            Which plants; default: all.

        Raises
        ------
        InputError
            Another shape, or a number that is not finite; nothing is changed.
        """
        count = len(np.atleast_2d(self._read(lanes.Q)[plants]))
        states = [
            (first, _checked(name, values, count, 3, single=True))
            for first, name, values in ((lanes.Q, "q_rad", q_rad), (lanes.QDOT, "qdot_rad_s", qdot_rad_s))
        ]
        for first, given in states:
            present = self._read(first)
            present[plants] = given if isinstance(plants, slice) or np.ndim(plants) else given[0]
            self._write(first, present)

    def set_parameters(self, number: int, parameters: Parameters) -> None:
        """Give one plant other parameters; its state stays.

        Raises
        ------
        InputError
            Another number of pole lines or groups than that of the first plant.
        """
        if parameters is not self._parameters[number]:
            self._set(number, parameters)

    def step(self, currents: ArrayLike, disturbance: ArrayLike, dt: float, steps: int = 1) -> None:
        """Advance all plants under held currents.

        Parameters
        ----------
        currents : (groups,) or (n, groups) array, A
            Of each group.
        disturbance : (3,) or (n, 3) array, N·m
            Generalised torque, subtracted in (1).
        dt : float, s
            Length of a step.
        steps : int
            Number of steps.

        Raises
        ------
        InputError
            Another shape, or a number that is not finite.
        """
        currents, disturbance = (
            self._each("currents", currents, self.groups),
            self._each("disturbance", disturbance),
        )
        _check_steps(dt, steps)
        general = self._advance_general(currents[None], disturbance, dt, steps)
        self._write(lanes.HELD, -(disturbance + self._constant_Nm))
        lanes.advance(self.blocks, self.field, currents, dt, steps, self._slows)
        self._put(general)

    def step_torque(self, torque_q: ArrayLike, dt: float, steps: int = 1) -> None:
        """Advance all plants under held torques on the hinges, without currents.

        Parameters
        ----------
        torque_q : (3,) or (n, 3) array, N·m
            Generalised torque, held over the steps.
        dt : float, s
        steps : int

        Raises
        ------
        InputError
            Another shape, or a number that is not finite.
        """
        torque_q = self._each("torque_q", torque_q)
        _check_steps(dt, steps)
        general = self._advance_general(np.zeros((1, len(self), self.groups)), -torque_q, dt, steps)
        self._write(lanes.HELD, torque_q - self._constant_Nm)
        lanes.advance(self.blocks, self.field, np.empty((0, self.groups)), dt, steps, self._slows)
        self._put(general)

    def roll_out(self, currents: ArrayLike, disturbance: ArrayLike, dt: float, steps: int = 1) -> Array:
        """Advance all plants under a sequence of currents and return the angles that they reach.

        Parameters
        ----------
        currents : (m, n, groups) array, A
            Rows of currents of each plant, each held over some steps.
        disturbance : (3,) or (n, 3) array, N·m
        dt : float, s
        steps : int
            Steps under each row.

        Returns
        -------
        (m, n, 3) array, rad

        Raises
        ------
        InputError
            Another shape of currents or disturbance, or a number that is not finite.
        """
        sequence = real_array(currents)
        if sequence is None or sequence.ndim != 3 or sequence.shape[1:] != (len(self), self.groups):
            raise InputError(
                f"plants: expected currents of (rows, {len(self)}, {self.groups}),"
                f" received {shown(currents) if sequence is None else sequence.shape}"
            )
        if not np.all(np.isfinite(sequence)):
            raise InputError("plants: expected finite currents, received others")
        _check_steps(dt, steps)
        reached = np.empty((len(sequence), len(self), 3))
        disturbance = self._each("disturbance", disturbance)
        general = self._advance_general(sequence, disturbance, dt, steps, reached)
        if ideal := [number for number in range(len(self)) if number not in general]:
            self._write(lanes.HELD, -(disturbance + self._constant_Nm))
            angles, currents = np.empty_like(reached), np.ascontiguousarray(sequence)
            lanes.roll_out(self.blocks, self.field, currents, dt, steps, self._slows, angles)
            reached[:, ideal] = angles[:, ideal]
        self._put(general)
        return reached

    def _set(self, number: int, parameters: Parameters) -> None:
        check_parameters(parameters)
        model, field = parameters.magnetics, self.field
        expected, received = (
            _shape(self._tables[0], field.arrangement),
            _shape(model.tables, model.arrangement),
        )
        if received != expected:
            raise InputError(f"plants: expected magnetics of {expected}, received {received}")
        self._parameters[number] = parameters
        block, lane = divmod(number, LANES)
        column = self.blocks[block].reshape(lanes.ROWS, LANES)[:, lane]
        forward_Nm, reverse_Nm = levels(parameters.coulomb_Nm, parameters.coulomb_asymmetry)
        for first, values in (
            (lanes.INERTIA, parameters.inertia_kg_m2),
            (lanes.COULOMB, forward_Nm),
            (lanes.REVERSE, reverse_Nm),
            (lanes.VISCOUS, parameters.viscous_Nm_s),
            (lanes.SPRING, parameters.spring_Nm_rad),
        ):
            column[first // LANES : first // LANES + 3] = values
        column[lanes.WEIGHT // LANES] = parameters.weight_moment_Nm
        column[lanes.SMOOTHING // LANES] = parameters.friction_smoothing_rad_s
        self._constant_Nm[number] = parameters.constant_torque_Nm
        field.torque_gain[number] = parameters.torque_gain
        field.arrangement[number] = model.arrangement[0]
        field.table_of[number] = self._place_of(model.tables)

    @property
    def _slows(self) -> bool:
        coefficients = lanes.COULOMB, lanes.REVERSE, lanes.VISCOUS
        return any(np.any(self._read(first)) for first in coefficients)

    def _place_of(self, tables: Tables) -> int:
        """Return the number of a curve and field among those of all plants, after adding it if it is new."""
        for place, (curve, field) in enumerate(self._tables):
            if curve is tables.curve and field is tables.field:
                return place
        self._tables.append(tables)
        curves, fields = (np.stack(one) for one in zip(*self._tables, strict=True))
        self.field = self.field._replace(curves=curves, fields=fields)
        return len(self._tables) - 1

    def _advance_general(
        self, currents: Array, disturbance: Array, dt: float, steps: int, angles: Array | None = None
    ) -> dict[int, State]:
        """Return the states that plants with a general joint reach, by their number; write their angles."""
        general = [number for number, one in enumerate(self._parameters) if one.joint["on"][0]]
        if not general:
            return {}
        reached, q, qdot = {}, self.q_rad, self.qdot_rad_s
        rows = np.empty((len(currents), 3))
        for number in general:
            reached[number] = roll_out(
                State(q[number], qdot[number]),
                np.ascontiguousarray(currents[:, number]),
                disturbance[number],
                self._parameters[number],
                dt,
                steps,
                rows,
            )
            if angles is not None:
                angles[:, number] = rows
        return reached

    def _put(self, states: dict[int, State]) -> None:
        for number, state in states.items():
            self.set_state(*state, number)

    def _each(self, name: str, values: ArrayLike, width: int = 3) -> Array:
        """Return values for each plant, (n, width)."""
        return np.ascontiguousarray(_checked(name, values, len(self), width))

    def _read(self, first: int) -> Array:
        rows = self.blocks[:, first : first + 3 * LANES].reshape(-1, 3, LANES)
        return rows.transpose(0, 2, 1).reshape(-1, 3)[: len(self)].copy()

    def _write(self, first: int, values: Array) -> None:
        """Write three rows of the blocks from values (at most lanes, 3)."""
        complete = np.zeros((len(self.blocks) * LANES, 3))
        complete[: len(values)] = values
        rows = complete.reshape(-1, LANES, 3).transpose(0, 2, 1)
        self.blocks[:, first : first + 3 * LANES] = rows.reshape(len(self.blocks), -1)


def _shape(tables: Tables, arrangement: Rows) -> str:
    """Return the sizes of magnetics that are equal for all plants."""
    lines, groups, coils = (arrangement.dtype[name].shape for name in ("line_axes", "group_axes", "coils"))
    field = f", {coils[1]} coils and {tables.field.shape} coefficients of a torque field" if coils[1] else ""
    return f"{lines[0]} pole lines and {groups[1]} groups{field}"


def _checked(name: str, values: ArrayLike, count: int, width: int, *, single: bool = False) -> Array:
    """Return values for each of some plants, (count, width); a single number may be that of all."""
    given = real_array(values)
    shapes = ((), (width,), (count, width)) if single else ((width,), (count, width))
    if given is None or given.shape not in shapes or not np.all(np.isfinite(given)):
        is_large = given is not None and given.size > width
        raise InputError(
            f"plants: expected {name} of {width} finite numbers, for all or for each of {count},"
            f" received {f'an array of {np.shape(values)}' if is_large else shown(values)}"
        )
    return np.broadcast_to(given, (count, width))


def _check_steps(dt: float, steps: int) -> None:
    if not (is_real(dt) and 0 < dt <= LONGEST_STEP_s):
        raise InputError(
            f"plants: expected a step dt above 0, up to {LONGEST_STEP_s:g} s, received {shown(dt)}"
        )
    if not isinstance(steps, int | np.integer) or steps < 0:
        raise InputError(f"plants: expected steps as a whole number from 0 on, received {shown(steps)}")
