"""Model of the plant for generated code: tunable parameters, initial states, sizes and tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import SimpleNamespace
from typing import Any, Literal, NamedTuple

import numpy as np

from spheretwin import scenario as scenarios
from spheretwin.config.active_config import initial_config
from spheretwin.config.plant_model import parameters
from spheretwin.export.c_text import constant, definitions, header
from spheretwin.models import magnetics
from spheretwin.models.base.arrays import Array
from spheretwin.models.base.errors import InputError
from spheretwin.models.coil_group import of_each_group
from spheretwin.models.magnetics import Arrangement, Tables
from spheretwin.models.mjcf_reader import HINGES
from spheretwin.plant.magnet_heat import initial_degC, remanence
from spheretwin.plant.plant_step import Parameters
from spheretwin.scenario.sections import ResolvedScenario

Inputs = Literal["currents", "voltages"]

LARGEST = 1e15
"""Bound of a number without a bound of its own: products of two are finite."""
SMALLEST = 1e-9
"""Least value of a number that another one is divided by, in its SI unit."""
FASTEST = 1e6
"""Bound of angles (rad), rates (rad/s), currents (A), voltages (V), torques (N m) and temperatures (degC)."""
SHORTEST_STEP_S = 1e-6
COLDEST_DEGC = -273.15


class Variable(NamedTuple):
    """Parameter, state or input of the generated plant: one number or one for each of its parts."""

    name: str
    values: tuple[float, ...]
    unit: str
    description: str
    parts: tuple[str, ...] = ()
    """Names of the numbers; empty for a single one."""
    least: float = -LARGEST
    largest: float = LARGEST
    """Bounds: the description of an FMU declares them, every entry of the code enforces them."""
    fixed: bool = False
    """True for a parameter that cannot change during a simulation."""

    @property
    def names(self) -> list[str]:
        """Names of all numbers, such as ``q_rad.alpha`` and ``current_A[3]``."""
        return [self.name + part for part in self.parts] or [self.name]

    def check(self) -> None:
        """Refuse a number beyond the bounds.

        Raises
        ------
        InputError
            The message has name, bounds and number.
        """
        for name, value in zip(self.names, self.values, strict=True):
            if not self.least <= value <= self.largest:
                raise InputError(
                    f"export: expected {name} from {self.least:g} to {self.largest:g} {self.unit},"
                    f" received {value:g}"
                )


class PlantCode(NamedTuple):
    """Plant of a scenario for generated code."""

    name: str
    inputs: Inputs
    thermal: bool
    groups: int
    parameters: list[Variable]
    states: list[Variable]
    commands: list[Variable]
    """Inputs."""
    step: Parameters
    """Parameters of the plant step."""
    hinge_range_rad: Array

    def model_header(self) -> str:
        """Return the header of sizes and of the structure of the parameters."""
        fields = [
            f"    double {one.name}{f'[{len(one.values)}]' if one.parts else ''}; "
            f"/* {one.unit}: {one.description} */"
            for one in self.parameters
        ]
        flags = {
            "ST_GROUPS": self.groups,
            "ST_VOLTAGES": self.inputs == "voltages",
            "ST_THERMAL": self.thermal,
        }
        return header([*definitions(flags), "", "typedef struct {", *fields, "} st_parameters;"])

    def bounds_header(self) -> str:
        """Return the header of least and largest values."""
        rows = {
            "ST_PARAMETER_BOUNDS": self.parameters,
            "ST_STATE_BOUNDS": self.states,
            "ST_INPUT_BOUNDS": self.commands,
        }
        # Fixed parameters are the last ones.
        fixed = sum(len(one.values) for one in self.parameters if one.fixed)
        return header(
            [
                *definitions({"ST_FIXED_PARAMETERS": fixed}),
                *(
                    constant(name, [(one.least, one.largest) for one in ones for _ in one.values], "double")
                    for name, ones in rows.items()
                ),
            ]
        )

    def table_header(self) -> str:
        """Return the header of tables and default values."""
        joint = self.step.joint[0]
        lines = [
            NUMBERS,
            *magnetic_tables(self.step.magnetics.arrangement[0], self.step.magnetics.tables),
            *definitions({"ST_GENERAL_JOINT": bool(joint.on)}),
            constant("ST_HINGE_RANGE", self.hinge_range_rad, "double"),
            constant("ST_INITIAL", [value for one in self.states for value in one.values], "double"),
            "static const st_parameters ST_DEFAULTS = {",
            *(f"    {_initialiser(one)}, /* {one.name} */" for one in self.parameters),
            "};",
        ]
        return header(lines)


NUMBERS = "#define ST_C(number) ((ST_NUMBER)(number))"
"""First line of a header of tables."""


def magnetic_tables(of: Arrangement, tables: Tables) -> list[str]:
    """Return the tables of the torque matrix.

    Raises
    ------
    InputError
        The field is not that of pole lines and a torque curve.
    """
    curve = tables.curve
    if of.coils.size:
        raise InputError("export: expected an actuator with a torque curve, received one with a torque field")
    lines, groups = len(of.line_axes), of.group_axes.shape[1]
    place = {
        "ST_LINES": lines,
        "ST_ROWS": len(curve),
        "ST_SCATTER": bool(of.scattered),
        "ST_KNEE": f"ST_C({magnetics.KNEE!r})",
        "ST_CENTRE": f"ST_C({magnetics.CENTRE!r})",
        "ST_WIDE": magnetics.WIDE_PER_UNIT,
        "ST_NARROW": magnetics.NARROW_PER_UNIT,
    }
    arrays = {
        "ST_LINE_AXES": of.line_axes,
        "ST_LINE_WEIGHTS": of.line_weights,
        "ST_GROUP_AXES": of.group_axes,
        "ST_TABLE": curve,
    }
    if of.scattered:
        arrays["ST_PAIR_GAIN"] = of.pair_gain.reshape(2, lines, groups)
        arrays["ST_PAIR_STRETCH"] = of.pair_stretch.reshape(2, lines, groups)
    return [*definitions(place), *(constant(name, table) for name, table in arrays.items())]


def plant_code(
    scenario: str, changes: Mapping[str, Any] | None = None, inputs: Inputs = "currents"
) -> PlantCode:
    """Return the plant of a scenario for generated code.

    Parameters
    ----------
    scenario : str
        Name or file.
    changes : mapping, optional
        Fields by dotted name, such as those of an identified twin.
    inputs : str
        ``currents``, which the amplifiers follow with a lag up to their limit, or ``voltages`` at the groups.

    Raises
    ------
    InputError
        A field is invalid or beyond the bounds of the generated code, or the plant has a state that the code
        does not have: static friction, hysteresis of a cable; with voltages, mutual inductance.
    """
    loaded = scenarios.load(scenario, changes)
    step, config = parameters(loaded), initial_config(loaded, None, None)
    resolved, actuator = config.scenario, config.files.actuator
    if inputs == "voltages" and resolved.drive.coil_coupling:
        raise InputError(
            "export: expected drive.coil_coupling 0 with voltages as inputs,"
            f" received {resolved.drive.coil_coupling:g}"
        )
    groups = len(actuator.groups)
    model = PlantCode(
        name=resolved.name,
        inputs=inputs,
        thermal=resolved.plant.thermal.on,
        groups=groups,
        parameters=_parameters(resolved, step, inputs, groups),
        states=_states(resolved, groups),
        commands=_inputs(resolved, inputs, groups),
        step=step,
        hinge_range_rad=actuator.hinge_range_rad,
    )
    for one in (*model.parameters, *model.states):
        one.check()
    return model


AXES = tuple(f".{angle}" for angle in HINGES)


def _per_group(groups: int) -> tuple[str, ...]:
    return tuple(f"[{group}]" for group in range(groups))


def _parameters(scenario: ResolvedScenario, step: Parameters, inputs: Inputs, groups: int) -> list[Variable]:
    drive, thermal, plant = scenario.drive, scenario.plant.thermal, scenario.plant
    own = SimpleNamespace(
        torque_gain=step.torque_gain / remanence(thermal, drive.ambient_degC),
        thermal_period_s=scenario.controller.period_s,
    )
    hinges, each, one, any_sign = AXES, _per_group(groups), (), -LARGEST
    is_ideal, voltages, warms = not step.joint["on"][0], inputs == "voltages", thermal.on
    # Condition, parts, where its value is, name, unit, meaning; least value.
    table: list[tuple[Any, ...]] = [
        (is_ideal, hinges, step, "inertia_kg_m2", "kg.m2", "principal moments, with the payload"),
        (is_ideal, one, step, "weight_moment_Nm", "N.m", "weight of the payload times height", 0),
        (True, hinges, step, "coulomb_Nm", "N.m", "Coulomb friction of each hinge", 0),
        (True, hinges, step, "coulomb_asymmetry", "1", "its excess towards positive angles", -1, 1),
        (True, hinges, step, "viscous_Nm_s", "N.m.s", "viscous friction of each hinge", 0),
        (True, one, step, "friction_smoothing_rad_s", "rad/s",
         "rate over which Coulomb friction changes sign"),
        (True, hinges, step, "constant_torque_Nm", "N.m", "constant torque, subtracted", any_sign),
        (True, hinges, step, "spring_Nm_rad", "N.m/rad", "stiffness about each hinge", 0),
        (True, each, own, "torque_gain", "1",
         "torque of each group over nominal, at 20 degC", -FASTEST, FASTEST),
        (not voltages, one, drive, "current_limit_A", "A", "largest current of the amplifiers", 0),
        (not voltages, each, drive, "lag_s", "s", "time constant of each current", 0),
        (True, each, drive, "resistance_ohm", "Ohm", "resistance of each group at 20 degC"),
        (voltages, each, drive, "inductance_H", "H", "inductance of each group"),
        (True, each, drive, "resistance_per_K", "1/K", "relative rise of the resistance", 0),
        (True, each, drive, "heat_capacity_J_K", "J/K", "heat capacity of each winding"),
        (True, each, drive, "thermal_resistance_K_W", "K/W", "from a winding to the stator", 0),
        (warms, one, drive, "ambient_degC", "degC", "temperature of the surroundings", COLDEST_DEGC),
        (warms, one, thermal, "remanence_per_K", "1/K", "relative change of the remanence", any_sign),
        (warms, one, thermal, "stator_heat_capacity_J_K", "J/K", "of the stator"),
        (warms, one, thermal, "rotor_heat_capacity_J_K", "J/K", "of the rotor"),
        (warms, one, thermal, "stator_to_ambient_K_W", "K/W", "from stator to surroundings"),
        (warms, one, thermal, "air_gap_K_W", "K/W", "from stator to rotor"),
        (warms, one, thermal, "rotor_to_ambient_K_W", "K/W", "from rotor to surroundings"),
        (True, one, plant, "step_s", "s", "longest step of the fixed-step method", SHORTEST_STEP_S, 1, True),
        (True, one, own, "thermal_period_s", "s",
         "time between updates of the temperatures by the fixed-step method", SHORTEST_STEP_S, FASTEST, True),
    ]  # fmt: skip

    def variable(
        parts: tuple[str, ...], of: Any, name: str, unit: str, text: str, least: float = SMALLEST, *more: Any
    ) -> Variable:
        value = getattr(of, name)
        values = np.ravel(of_each_group(value, groups) if parts is each else value)
        return Variable(name, _numbers(values), unit, text, parts, least, *more)

    return [variable(*row) for applies, *row in table if applies]


def _states(scenario: ResolvedScenario, groups: int) -> list[Variable]:
    plant, ambient_degC = scenario.plant, scenario.drive.ambient_degC
    rotor_degC = initial_degC(plant.thermal, ambient_degC) if plant.thermal.on else ambient_degC
    each = _per_group(groups)
    motion = [
        Variable("q_rad", _numbers(plant.initial_rad), "rad", "angle of each hinge", AXES),
        Variable("qdot_rad_s", _numbers(plant.initial_rad_s), "rad/s", "rate of each hinge", AXES),
        Variable("current_A", (0.0,) * groups, "A", "current of each group", each),
    ]
    temperatures = [
        Variable("winding_degC", (ambient_degC,) * groups, "degC", "temperature of each winding", each),
        Variable("stator_degC", (ambient_degC,), "degC", "temperature of the stator"),
        Variable("rotor_degC", (rotor_degC,), "degC", "temperature of the rotor"),
    ]
    return [
        *(one._replace(least=-FASTEST, largest=FASTEST) for one in motion),
        *(one._replace(least=COLDEST_DEGC, largest=FASTEST) for one in temperatures),
    ]


def _inputs(scenario: ResolvedScenario, inputs: Inputs, groups: int) -> list[Variable]:
    each, zeros = _per_group(groups), (0.0,) * groups
    commands = {
        "currents": Variable("current_command_A", zeros, "A", "commanded current of each group", each),
        "voltages": Variable("voltage_V", zeros, "V", "voltage at each group", each),
    }
    disturbance = "generalised disturbance torque on each hinge, subtracted"
    both = [commands[inputs], Variable("disturbance_Nm", (0.0,) * 3, "N.m", disturbance, AXES)]
    return [one._replace(least=-FASTEST, largest=FASTEST) for one in both]


def _numbers(values: Sequence[float] | Array | None) -> tuple[float, ...]:
    return tuple(float(value) for value in np.asarray(values, np.float64))


def _initialiser(one: Variable) -> str:
    text = ", ".join(map(repr, one.values))
    return f"{{{text}}}" if one.parts else text
