"""Many plants that are advanced together, each with parameters of its own."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from spheretwin.models.base.arrays import Array, is_real, real_array
from spheretwin.models.base.errors import InputError, shown
from spheretwin.models.base.record import Rows, put
from spheretwin.models.magnetics import Tables, scratch_of
from spheretwin.plant import lanes
from spheretwin.plant.friction import levels
from spheretwin.plant.lanes import LANES, LaneMagnetics, PlantBlock
from spheretwin.plant.plant_step import LONGEST_STEP_s, Parameters, State, check_parameters, roll_out

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
    blocks, magnetics
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
        first, n = each[0].magnetics, len(each)
        groups = first.sizes["groups"]
        self.magnetics = LaneMagnetics(
            arrangement=np.empty(n, first.arrangement.dtype),
            curves=first.tables.curve[None],
            fields=first.tables.field[None],
            table_of=np.zeros(n, np.int64),
            torque_gain=np.empty((n, groups)),
            G=np.empty((3, groups)),
            scratch=scratch_of(first),
            vectors=np.empty((3, max(3, groups))),
        )
        self.blocks = PlantBlock.zeros(-(-n // LANES))
        # A lane without a plant: at rest, of inertia 1.
        put(self.blocks, inertia_kg_m2=1.0, friction_smoothing_rad_s=1.0)
        self._tables = [first.tables]
        self._every, self._general = divmod(np.arange(n), LANES), np.zeros(n, bool)
        for number, one in enumerate(each):
            self._set(number, one)

    def __len__(self) -> int:
        return len(self._parameters)

    @property
    def groups(self) -> int:
        """Number of coil groups."""
        return self.magnetics.torque_gain.shape[1]

    @property
    def q_rad(self) -> Array:
        """Hinge angles (n, 3), a copy."""
        return self._column("q_rad")[self._every]

    @property
    def qdot_rad_s(self) -> Array:
        """Hinge rates (n, 3), a copy."""
        return self._column("qdot_rad_s")[self._every]

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
        chosen = tuple(numbers[plants] for numbers in self._every)  # of blocks and lanes
        count = np.size(chosen[0])
        given = {
            name: _checked(name, values, count, 3, single=True)
            for name, values in (("q_rad", q_rad), ("qdot_rad_s", qdot_rad_s))
        }
        for name, values in given.items():
            self._column(name)[chosen] = values if np.ndim(chosen[0]) else values[0]

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
        currents = self._each("currents", currents, self.groups)
        self._advance(currents[None], self._each("disturbance", disturbance), dt, steps)

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
        self._advance(np.empty((1, 0, self.groups)), -self._each("torque_q", torque_q), dt, steps)

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
        return self._advance(sequence, self._each("disturbance", disturbance), dt, steps)

    def _advance(self, currents: Array, disturbance: Array, dt: float, steps: int) -> Array:
        """Advance all plants under rows of currents (m, n, groups), or without; return the angles reached."""
        _check_steps(dt, steps)
        angles, currents = np.empty((len(currents), len(self), 3)), np.ascontiguousarray(currents)
        general = self._advance_general(currents, disturbance, dt, steps) if self._general.any() else {}
        if not self._general.all():
            constant_Nm = self._column("constant_torque_Nm")[self._every]
            self._column("held_Nm")[self._every] = -(disturbance + constant_Nm)
            slows = any(np.any(self.blocks[name]) for name in ("forward_Nm", "reverse_Nm", "viscous_Nm_s"))
            lanes.roll_out(self.blocks, self.magnetics, currents, dt, steps, slows, angles)
        for number, (state, path) in general.items():
            self.set_state(*state, number)
            angles[:, number] = path
        return angles

    def _advance_general(
        self, currents: Array, disturbance: Array, dt: float, steps: int
    ) -> dict[int, tuple[State, Array]]:
        """Return states and angles that plants with a general joint reach, by their number."""
        reached, q, qdot = {}, self.q_rad, self.qdot_rad_s
        for number in np.flatnonzero(self._general).tolist():
            own, state = self._parameters[number], State(q[number], qdot[number])
            held = currents[:, number] if currents.shape[1] else np.zeros((len(currents), self.groups))
            path = np.empty((len(currents), 3))
            end = roll_out(state, np.ascontiguousarray(held), disturbance[number], own, dt, steps, path)
            reached[number] = end, path
        return reached

    def _set(self, number: int, parameters: Parameters) -> None:
        check_parameters(parameters)
        model, magnetics = parameters.magnetics, self.magnetics
        expected, received = (
            _shape(self._tables[0], magnetics.arrangement),
            _shape(model.tables, model.arrangement),
        )
        if received != expected:
            raise InputError(f"plants: expected magnetics of {expected}, received {received}")
        self._parameters[number] = parameters
        forward_Nm, reverse_Nm = levels(parameters.coulomb_Nm, parameters.coulomb_asymmetry)
        values = parameters._asdict() | {"forward_Nm": forward_Nm, "reverse_Nm": reverse_Nm}
        for name in PlantBlock.fields().keys() & values:
            self._column(name)[divmod(number, LANES)] = values[name]
        self._general[number] = parameters.joint["on"][0]
        magnetics.torque_gain[number] = parameters.torque_gain
        magnetics.arrangement[number] = model.arrangement[0]
        magnetics.table_of[number] = self._place_of(model.tables)

    def _place_of(self, tables: Tables) -> int:
        """Return the number of a curve and field among those of all plants, after adding it if it is new."""
        for place, (curve, field) in enumerate(self._tables):
            if curve is tables.curve and field is tables.field:
                return place
        self._tables.append(tables)
        curves, fields = (np.stack(one) for one in zip(*self._tables, strict=True))
        self.magnetics = self.magnetics._replace(curves=curves, fields=fields)
        return len(self._tables) - 1

    def _each(self, name: str, values: ArrayLike, width: int = 3) -> Array:
        """Return values for each plant, (n, width)."""
        return np.ascontiguousarray(_checked(name, values, len(self), width))

    def _column(self, name: str) -> Array:
        """Return a field of the blocks as (blocks, lanes, 3) or (blocks, lanes, 1)."""
        return self.blocks[name].reshape(len(self.blocks), -1, LANES).swapaxes(1, 2)


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
