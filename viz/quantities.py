"""Quantities that recordings derive from telemetry."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from spheretwin.models.actuator import Actuator
from spheretwin.models.telemetry.signals import ANGLES
from spheretwin.models.telemetry.table import Table
from spheretwin.viz import theme

Array = NDArray[np.float64]


class QuantityRows(NamedTuple):
    """Rows and parameters from which a quantity is computed."""

    table: Table
    """Rows of one chunk."""
    before: Table
    """The row before the first of them; at the start of a run its first row itself."""
    actuator: Actuator
    current_limit_A: float


class Quantity(NamedTuple):
    """Quantity that a recording derives from telemetry."""

    name: str
    """Ends in its unit."""
    unit: str
    meaning: str
    values: Callable[[QuantityRows], Array]
    """One row for each row of the chunk: (n, size)."""
    floor: float
    """Half of the least range of its plot: smaller values must not look large."""
    labels: tuple[str, ...] = ("",)
    """A name for each entry."""
    colours: tuple[theme.Colour, ...] = (theme.PLAIN,)
    """A colour for each entry."""
    needs: str = ""
    """Signal that it needs; empty if none."""

    @property
    def size(self) -> int:
        """Numbers a row."""
        return len(self.labels)


def by_axis(
    name: str,
    unit: str,
    meaning: str,
    values: Callable[[QuantityRows], Array],
    floor: float,
    needs: str = "",
) -> Quantity:
    """Quantity with an entry for each hinge, in the colours of the axes."""
    return Quantity(name, unit, meaning, values, floor, ANGLES, theme.AXIS_COLOURS, needs)


def copper_loss(rows: QuantityRows) -> Array:
    """Return the copper loss, (n, 1) in W: that of the amplifiers, else from the resistance of cold coils."""
    table = rows.table
    if any(signal.name == "copper_loss_W" for signal in table.signals):
        return np.sum(table["copper_loss_W"], axis=1, keepdims=True)
    return rows.actuator.group.resistance_ohm * np.sum(table["current_A"] ** 2, axis=1, keepdims=True)


COPPER_LOSS = Quantity("copper_loss_total_W", "W", "heat of all coils", copper_loss, floor=0.5)


def coupling_torque(rows: QuantityRows) -> Array:
    """Return the part of ``M qddot + C qdot`` that is not an axis's own inertia, (n, 3) in N·m.

    The accelerations are differences of the rates from tick to tick; the inertia is that of the rotor only.
    """
    q, rate, t_s = rows.table["q_rad"], rows.table["qdot_rad_s"], rows.table["t_s"]
    step_s = np.diff(t_s, prepend=rows.before["t_s"])
    change = np.diff(rate, axis=0, prepend=rows.before["qdot_rad_s"])
    acceleration = change / np.where(step_s > 0, step_s, 1.0)[:, None]  # 0 at the first tick of a run
    return _inertial(q, acceleration, rows.actuator.inertia) + _coriolis(q, rate, rows.actuator.inertia)


def _inertial(q: Array, acceleration: Array, inertia: Array) -> Array:
    """Entries off the diagonal of M, times the accelerations."""
    J1, J2, J3 = inertia
    alpha_beta = (J1 - J2) * np.cos(q[:, 1]) * np.cos(q[:, 2]) * np.sin(q[:, 2])
    alpha_gamma = J3 * np.sin(q[:, 1])
    a, b, g = acceleration.T
    return np.stack([alpha_beta * b + alpha_gamma * g, alpha_beta * a, alpha_gamma * a], axis=1)


def _coriolis(q: Array, rate: Array, inertia: Array) -> Array:
    """Coriolis and centrifugal torques ``C qdot``: each product of rates once."""
    J1, J2, J3 = inertia
    cb, sb, cg, sg = np.cos(q[:, 1]), np.sin(q[:, 1]), np.cos(q[:, 2]), np.sin(q[:, 2])
    a, b, g = rate.T
    D = J1 - J2
    double_angle = D * cb * (cg**2 - sg**2)
    tilt = (J3 - J1 * cg**2 - J2 * sg**2) * sb * cb
    turn = D * sg * cg
    return np.stack(
        [
            2 * tilt * a * b - 2 * turn * cb**2 * a * g - turn * sb * b**2 + (double_angle + J3 * cb) * b * g,
            -tilt * a**2 + (double_angle - J3 * cb) * a * g + 2 * turn * b * g,
            turn * cb**2 * a**2 + (J3 * cb - double_angle) * a * b - turn * b**2,
        ],
        axis=1,
    )


COUPLING = by_axis(
    "coupling_torque_Nm",
    "N·m",
    "torques of the hinges on each other (6)-(10)",
    coupling_torque,
    floor=0.005,
)


def delivered_torque(rows: QuantityRows) -> Array:
    """Generalised torque ``E^T torque_S`` at the pose of the tick, (n, 3) in N·m."""
    return on_the_hinges(rows.table["q_rad"], rows.table["torque_Nm"])


def on_the_hinges(q: Array, torque_S: Array) -> Array:
    """Generalised torque of torques of the stator frame (n, 3) in N·m, at hinge angles (n, 3) in rad."""
    x, y, z = torque_S.T
    ca, sa = np.cos(q[:, 0]), np.sin(q[:, 0])
    cb, sb = np.cos(q[:, 1]), np.sin(q[:, 1])
    return np.stack([x, ca * y + sa * z, sb * x + cb * (ca * z - sa * y)], axis=1)


DELIVERED = by_axis(
    "torque_delivered_Nm", "N·m", "generalised torque of the coils", delivered_torque, floor=0.02
)


def tracking_error(rows: QuantityRows) -> Array:
    """Error (28), (n, 3) in mrad."""
    return 1e3 * rows.table["error_rad"]


ERROR = by_axis("error_mrad", "mrad", "tracking error q - q_ref (28)", tracking_error, floor=0.1)


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


def estimated_rate(rows: QuantityRows) -> Array:
    """Estimated minus true rates, (n, 3) in rad/s."""
    return rows.table["qdot_estimated_rad_s"] - rows.table["qdot_rad_s"]


ESTIMATED_RATE = by_axis(
    "rate_error_rad_s",
    "rad/s",
    "estimated minus true rates",
    estimated_rate,
    0.01,
    needs="qdot_estimated_rad_s",
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


def measured_angle(rows: QuantityRows) -> Array:
    """Measured minus true angles, (n, 3) in mrad."""
    return 1e3 * (rows.table["q_measured_rad"] - rows.table["q_rad"])


MEASURED_ANGLE = by_axis(
    "measurement_error_mrad",
    "mrad",
    "measured minus true angles",
    measured_angle,
    0.1,
    needs="q_measured_rad",
)


def tip_distance(rows: QuantityRows) -> Array:
    """Distance between the tip and the desired tip, (n, 1) in mm."""
    from spheretwin.viz.scene.motion import shaft_tip  # Rerun is slow to import

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
    return tuple(quantity for quantity in QUANTITIES if not quantity.needs or quantity.needs in names)


class ScalarQuantity(NamedTuple):
    """Quantity with one number for each row, drawn for several runs."""

    name: str
    """Name in paths."""
    title: str
    """Short: next to two others it has the width of a sixth of a screen."""
    unit: str
    group: str
    """Group of quantities that are drawn in one row."""
    needs: tuple[str, ...]
    """Signals that it is made of."""
    values: Callable[[QuantityRows], Array]
    """Its values, (n,)."""
    desired: Callable[[QuantityRows], Array] | None = None
    """Reference, (n,)."""
    limits: tuple[float, float] | None = None
    """Limits of the axis; those of the values unless given."""

    @property
    def heading(self) -> str:
        """Title with the unit."""
        return f"{self.title} [{self.unit}]"


def scalar_quantities(tables: Sequence[Table]) -> list[ScalarQuantity]:
    """Quantities that all of some runs have."""
    names = [{signal.name for signal in table.signals} for table in tables]
    return [
        quantity
        for quantity in SCALAR_QUANTITIES
        if all(set(quantity.needs) <= available for available in names)
    ]


def _entry(signal: str, axis: int) -> Callable[[QuantityRows], Array]:
    return lambda rows: rows.table[signal][:, axis]


def _column(values: Callable[[QuantityRows], Array], place: int = 0) -> Callable[[QuantityRows], Array]:
    """Return one entry of a quantity of recordings."""
    return lambda rows: values(rows)[:, place]


def _largest(signal: str) -> Callable[[QuantityRows], Array]:
    return lambda rows: np.abs(rows.table[signal]).max(axis=1)


def _commanded_Nm(rows: QuantityRows) -> Array:
    return np.linalg.norm(rows.table["torque_command_Nm"], axis=1)


def _delivered_Nm(rows: QuantityRows) -> Array:
    return np.linalg.norm(DELIVERED.values(rows), axis=1)


SCALAR_QUANTITIES = (
    ScalarQuantity("error_angle_deg", "error as one angle", "°", "whole", ("q_rad", "q_ref_rad"),
             _column(ERROR_ANGLE.values)),
    *(ScalarQuantity(f"error_{axis}_mrad", f"error of {axis}", "mrad", "error", ("error_rad",),
               _column(ERROR.values, i)) for i, axis in enumerate(ANGLES)),
    *(ScalarQuantity(f"angle_{axis}_rad", f"angle {axis}", "rad", "angle", ("q_rad", "q_ref_rad"),
               _entry("q_rad", i), _entry("q_ref_rad", i)) for i, axis in enumerate(ANGLES)),
    *(ScalarQuantity(f"sliding_{axis}_rad_s", f"sliding of {axis}", "rad/s", "sliding", ("sliding_s",),
               _entry("sliding_s", i)) for i, axis in enumerate(ANGLES)),
    ScalarQuantity(
        "torque_asked_Nm", "commanded torque", "N·m", "effort", ("torque_command_Nm",), _commanded_Nm
    ),
    ScalarQuantity(
        "largest_current_A", "top current", "A", "effort", ("current_A",), _largest("current_A")
    ),
    ScalarQuantity("torque_margin", "torque margin", "1", "effort",
             ("current_command_A", "allocation_scale"),
             _column(MARGIN.values), limits=(-0.05 * MOST, 1.05 * MOST)),
    ScalarQuantity("torque_delivered_Nm", "torque delivered on the hinges", "N·m", "more",
             ("q_rad", "torque_Nm"), _delivered_Nm),
)  # fmt: skip
"""All, in the order in which they are drawn; groups are contiguous."""
