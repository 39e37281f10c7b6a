"""Quantities that recordings derive from telemetry."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from typing import Any, NamedTuple

import numpy as np

from spheretwin.models.actuator import Actuator
from spheretwin.models.base.arrays import Array
from spheretwin.models.coil_group import of_each_group
from spheretwin.models.kinematics import generalised_torque
from spheretwin.models.lagrangian import coriolis_rows, inertia_entries
from spheretwin.models.symbolic import on_symbols, turns_by
from spheretwin.models.telemetry.signals import ANGLES
from spheretwin.models.telemetry.table import Table
from spheretwin.viz import theme
from spheretwin.viz.scene.places import shaft_tip


class QuantityRows(NamedTuple):
    """Rows and parameters from which a quantity is computed."""

    table: Table
    """Rows of one chunk."""
    before: Table
    """The row before the first of them; at the start of a run its first row itself."""
    actuator: Actuator
    current_limit_A: float


Values = Callable[[QuantityRows], Array]


class Quantity(NamedTuple):
    """Quantity derived from telemetry, for recordings or for a comparison of runs."""

    name: str
    """Ends in its unit."""
    unit: str
    title: str
    values: Values
    """One row for each row of the chunk: (n, size)."""
    floor: float
    """Half of the least range of its plot: smaller values must not look large."""
    labels: tuple[str, ...] = ("",)
    """A name for each entry."""
    colours: tuple[theme.Colour, ...] = (theme.PLAIN,)
    """A colour for each entry."""
    needs: tuple[str, ...] = ()
    """Signals that it needs besides those of every run."""
    group: str = ""
    """Group of compared quantities that are drawn in one row."""
    desired: Values | None = None
    """Reference of a compared quantity, (n,)."""
    limits: tuple[float, float] | None = None
    """Limits of the axis of a compared quantity; those of the values unless given."""

    @property
    def size(self) -> int:
        """Numbers a row."""
        return len(self.labels)

    @property
    def heading(self) -> str:
        """Title with the unit."""
        return f"{self.title} [{self.unit}]"

    def column(self, rows: QuantityRows) -> Array:
        """Return the values of its only entry, (n,)."""
        return self.values(rows)[:, 0]


def by_axis(
    name: str, unit: str, title: str, values: Values, floor: float, needs: tuple[str, ...] = ()
) -> Quantity:
    """Quantity with an entry for each hinge, in the colours of the axes."""
    return Quantity(name, unit, title, values, floor, ANGLES, theme.AXIS_COLOURS, needs)


def copper_loss(rows: QuantityRows) -> Array:
    """Return the copper loss, (n, 1) in W: that of the amplifiers, else from the resistance of cold coils."""
    table = rows.table
    if any(signal.name == "copper_loss_W" for signal in table.signals):
        return np.sum(table["copper_loss_W"], axis=1, keepdims=True)
    squares = table["current_A"] ** 2
    resistance_ohm = of_each_group(rows.actuator.group.resistance_ohm, squares.shape[1])
    return np.sum(resistance_ohm * squares, axis=1, keepdims=True)


COPPER_LOSS = Quantity("copper_loss_total_W", "W", "heat of all coils", copper_loss, floor=0.5)


_turns = turns_by(np.cos, np.sin)
_inertia_entries, _coriolis_rows = on_symbols(inertia_entries), on_symbols(coriolis_rows)


def coupling_torque(rows: QuantityRows) -> Array:
    """Return the part of ``M qddot + C qdot`` that is not an axis's own inertia, (n, 3) in N·m.

    The accelerations are differences of the rates from tick to tick; the inertia is that of the rotor only.
    """
    q, rate, t_s = rows.table["q_rad"], rows.table["qdot_rad_s"], rows.table["t_s"]
    step_s = np.diff(t_s, prepend=rows.before["t_s"])
    change = np.diff(rate, axis=0, prepend=rows.before["qdot_rad_s"])
    a, b, g = (change / np.where(step_s > 0, step_s, 1.0)[:, None]).T  # 0 at the first tick of a run
    at, inertia = _turns(q.T), rows.actuator.inertia
    M, C = _inertia_entries(at, inertia), _coriolis_rows(at, rate.T, inertia)
    inertial = (M.alpha_beta * b + M.alpha_gamma * g, M.alpha_beta * a, M.alpha_gamma * a)
    coriolis = (sum(entry * of for entry, of in zip(row, rate.T, strict=True)) for row in C)
    return np.stack([*map(np.add, inertial, coriolis)], axis=1)


COUPLING = by_axis(
    "coupling_torque_Nm",
    "N·m",
    "torques of the hinges on each other (6)-(10)",
    coupling_torque,
    floor=0.005,
)


def delivered_torque(rows: QuantityRows) -> Array:
    """Generalised torque ``E^T torque_S`` at the pose of the tick, (n, 3) in N·m."""
    on_hinges: list[Any] = [None] * 3
    _generalised_torque(rows.table["q_rad"].T, rows.table["torque_Nm"].T, on_hinges)
    return np.stack(on_hinges, axis=1)


_generalised_torque = on_symbols(generalised_torque, turns=_turns)
DELIVERED = by_axis(
    "torque_delivered_Nm", "N·m", "generalised torque of the coils", delivered_torque, floor=0.02
)
ERROR = by_axis(
    "error_mrad",
    "mrad",
    "tracking error q - q_ref (28)",
    lambda rows: 1e3 * rows.table["error_rad"],
    floor=0.1,
)


def error_angle(rows: QuantityRows) -> Array:
    """Angle of ``R_ref^T R``, (n, 1) in degrees."""
    return np.degrees(angle_between(rows.table["q_rad"], rows.table["q_ref_rad"]))[:, None]


def angle_between(q: Array, desired: Array) -> Array:
    """Angle of the one rotation between two orientations, (n,) in rad, of hinge angles (n, 3) in rad.

    It is that of ``Ry(-β_ref) Rx(α - α_ref) Ry(β) Rz(γ - γ_ref)``, of which this is the quaternion. Its
    vector part is used as well as its scalar: near 1 the scalar by itself would lose half of the digits.
    """
    difference, sum_beta = (q - desired) / 2, (q[:, 1] + desired[:, 1]) / 2
    (ca, cb, cg), (sa, sb, sg) = np.cos(difference).T, np.sin(difference).T
    w, z = ca * cb, sa * np.sin(sum_beta)
    along = w * cg - z * sg
    across = (sa * np.cos(sum_beta)) ** 2 + (ca * sb) ** 2 + (z * cg + w * sg) ** 2
    return np.asarray(2 * np.arctan2(np.sqrt(across), np.abs(along)))


ERROR_ANGLE = Quantity("error_angle_deg", "°", "angle between the rotor and its reference", error_angle, 0.01)


ESTIMATED_RATE = by_axis(
    "rate_error_rad_s",
    "rad/s",
    "estimated minus true rates",
    lambda rows: rows.table["qdot_estimated_rad_s"] - rows.table["qdot_rad_s"],
    0.01,
    needs=("qdot_estimated_rad_s",),
)


MOST = 3.0
"""Larger margins are drawn as this: they do not matter, and are unbounded for a torque command near zero."""


def torque_margin(rows: QuantityRows) -> Array:
    """Share of the commanded torque that could be added along itself, (n, 1); 0 where the limit acts."""
    largest_A = np.max(np.abs(rows.table["current_command_A"]), axis=1)
    factor = rows.current_limit_A / np.maximum(largest_A, rows.current_limit_A / (1 + MOST))
    left = np.where(rows.table["allocation_scale"] < 1, 0.0, np.maximum(factor - 1, 0.0))
    return left[:, None]


MARGIN = Quantity(
    "torque_margin",
    "1",
    "share of the commanded torque that the current limit permits in addition",
    torque_margin,
    floor=MOST / 2,
)


MEASURED_ANGLE = by_axis(
    "measurement_error_mrad",
    "mrad",
    "measured minus true angles",
    lambda rows: 1e3 * (rows.table["q_measured_rad"] - rows.table["q_rad"]),
    0.1,
    needs=("q_measured_rad",),
)


def tip_distance(rows: QuantityRows) -> Array:
    """Distance between the tip and the desired tip, (n, 1) in mm."""
    actual = shaft_tip(rows.table["q_rad"], rows.actuator)
    desired = shaft_tip(rows.table["q_ref_rad"], rows.actuator)
    return 1e3 * np.sqrt(np.sum((actual - desired) ** 2, axis=1))[:, None]


TIP_DISTANCE = Quantity(
    "tip_distance_mm", "mm", "distance of the shaft's tip from its reference", tip_distance, 0.01
)


QUANTITIES: tuple[Quantity, ...] = (
    ERROR,
    ERROR_ANGLE,
    TIP_DISTANCE,
    DELIVERED,
    MARGIN,
    COUPLING,
    COPPER_LOSS,
    MEASURED_ANGLE,
    ESTIMATED_RATE,
)


def quantities_of(names: Collection[str]) -> tuple[Quantity, ...]:
    """Return the quantities of a run with signals of these names."""
    return tuple(quantity for quantity in QUANTITIES if set(quantity.needs) <= set(names))


def compared_quantities(tables: Sequence[Table]) -> list[Quantity]:
    """Return the quantities of a comparison that all runs have."""
    names = [{signal.name for signal in table.signals} for table in tables]
    return [
        quantity
        for quantity in COMPARED_QUANTITIES
        if all(set(quantity.needs) <= available for available in names)
    ]


def _entry(values: Values, axis: int) -> Values:
    """Return one entry of a quantity, (n, 1)."""
    return lambda rows: values(rows)[:, axis : axis + 1]


def _signal(name: str) -> Values:
    return lambda rows: rows.table[name]


def _norm(values: Values) -> Values:
    """Return the norm of all entries, (n, 1)."""
    return lambda rows: np.linalg.norm(values(rows), axis=1, keepdims=True)


def _largest_current(rows: QuantityRows) -> Array:
    return np.abs(rows.table["current_A"]).max(axis=1, keepdims=True)


def _desired(axis: int) -> Values:
    return lambda rows: rows.table["q_ref_rad"][:, axis]


# Titles are short: next to two others, a plot has the width of a sixth of a screen.
COMPARED_QUANTITIES: tuple[Quantity, ...] = (
    ERROR_ANGLE._replace(title="error as one angle", group="whole"),
    *(Quantity(f"error_{axis}_mrad", "mrad", f"{axis} error", _entry(ERROR.values, i), ERROR.floor,
               group="error") for i, axis in enumerate(ANGLES)),
    *(Quantity(f"angle_{axis}_rad", "rad", f"{axis} angle", _entry(_signal("q_rad"), i), 0.01,
               group="angle", desired=_desired(i)) for i, axis in enumerate(ANGLES)),
    *(Quantity(f"sliding_{axis}_rad_s", "rad/s", f"{axis} sliding", _entry(_signal("sliding_s"), i), 0.01,
               needs=("sliding_s",), group="sliding") for i, axis in enumerate(ANGLES)),
    Quantity("torque_command_norm_Nm", "N·m", "command", _norm(_signal("torque_command_Nm")),
             DELIVERED.floor, group="effort"),
    Quantity("largest_current_A", "A", "top current", _largest_current, 0.05, group="effort"),
    MARGIN._replace(title="torque margin", group="effort", limits=(-0.05 * MOST, 1.05 * MOST)),
    Quantity("torque_delivered_norm_Nm", "N·m", "torque delivered on the hinges", _norm(DELIVERED.values),
             DELIVERED.floor, group="more"),
)  # fmt: skip
"""All, in the order in which they are drawn; groups are contiguous."""
