"""Set-up of the plants of many rows: the same bytes as that of each row alone."""

import re
from functools import partial
from typing import NamedTuple

import numpy as np
import pytest

from spheretwin import scenario as scenarios
from spheretwin.config.active_config import initial_config
from spheretwin.electronics.drive_chain import DriveChain
from spheretwin.models import actuator as actuators
from spheretwin.models import mjcf
from spheretwin.models.base.columns import Columns, column_of
from spheretwin.models.base.errors import InputError
from spheretwin.models.base.record import Rows
from spheretwin.models.magnetics import scaled, torque_model
from spheretwin.models.scatter import scattered_model
from spheretwin.plant.end_stops import EndStops, EndStopsSection, fill_end_stops
from spheretwin.plant.friction import Friction, fill_friction
from spheretwin.plant.mass_properties import mass_errors
from spheretwin.plant.part_scatter import scatter_of
from spheretwin.plant.parts import PARTS
from spheretwin.plant.plant_part import PlantSetup
from spheretwin.plant.plant_tick import ENGINES
from spheretwin.plant.rotor import RotorSettings

pytestmark = pytest.mark.uncompiled

ACTUATOR, MODEL = actuators.load(), mjcf.read(actuators.MJCF_PATH)
ROWS, GROUPS = 5, len(ACTUATOR.groups)

RANGES = {
    "plant.modelling_error": (-0.2, 0.5),
    "plant.payload_kg": (0.01, 0.1),
    "plant.gravity_m_s2": (1.0, 10.0),
    "plant.friction_smoothing_rad_s": (1e-3, 1e-2),
    "plant.stiction.break_away": (1.0, 2.0),
    "plant.stiction.presliding_rad": (1e-4, 1e-2),
    "plant.stiction.damping_ratio": (0.0, 1.0),
    "plant.stiction.stribeck_rad_s": (0.01, 0.1),
    "plant.end_stops.travel_rad": (0.01, 0.1),
    "plant.end_stops.stiffness_Nm_rad": (100.0, 2000.0),
    "plant.end_stops.damping_ratio": (0.0, 1.0),
    "plant.cable.hysteresis_rad": (0.01, 0.1),
    "plant.thermal.remanence_per_K": (-0.002, -0.001),
    "plant.thermal.rotor_degC": (20.0, 60.0),
    "plant.thermal.stator_heat_capacity_J_K": (500.0, 1500.0),
    "plant.thermal.rotor_heat_capacity_J_K": (500.0, 1500.0),
    "plant.thermal.stator_to_ambient_K_W": (0.5, 1.0),
    "plant.thermal.air_gap_K_W": (1.0, 3.0),
    "plant.thermal.rotor_to_ambient_K_W": (1.0, 5.0),
    "drive.ambient_degC": (10.0, 30.0),
    "drive.heat_capacity_J_K": (1.0, 3.0),
    "plant.poles.gain_error": (0.0, 0.1),
    "plant.coils.gain_error": (0.0, 0.1),
    "plant.coils.angle_error_rad": (0.0, 5e-3),
    "plant.coils.distance_error_m": (0.0, 1e-4),
}
TRIPLES = {
    "plant.coulomb_Nm": (0.0, 0.01),
    "plant.backlash_rad": (0.0, 0.02),
    "plant.coulomb_asymmetry": (-1.0, 1.0),
    "plant.viscous_Nm_s": (0.0, 0.01),
    "plant.cable.stiffness_Nm_rad": (0.0, 0.1),
    "plant.cable.neutral_rad": (-0.1, 0.1),
    "plant.cable.torque_Nm": (-0.1, 0.1),
    "plant.cable.torque_error_Nm": (0.0, 0.1),
    "plant.cable.hysteresis_Nm": (0.0, 0.1),
    "plant.initial_rad": (-0.5, 0.5),
    "plant.initial_rad_s": (-1.0, 1.0),
}
SWITCHES = "plant.stiction.on", "plant.end_stops.on", "plant.thermal.on"
PERIODS = (1e-3, 5e-4), (1.5e-3, 5e-4), (2e-3, 1e-3)
MASS = {"plant.mass.centre_error_m": 1e-3, "plant.mass.axis_tilt_rad": [[1e-3, 0.0]] * 3}
NO_CABLE = dict.fromkeys([name for name in TRIPLES if name.startswith("plant.cable")], [0.0] * 3)
SUPPLIED = {"drive.supply_V": 24.0, "hardware": "electronics"}


class Block(NamedTuple):
    """Scenarios of rows, and their drives."""

    scenarios: list
    drive: Rows

    @property
    def scenario(self):
        return column_of(self.scenarios)

    def rows(self):
        return [Block([scenario], self.drive[row : row + 1]) for row, scenario in enumerate(self.scenarios)]


def block(seed, **same):
    rng = np.random.default_rng(seed)
    columns = {name: rng.uniform(*bounds, ROWS).tolist() for name, bounds in RANGES.items()}
    columns |= {name: rng.uniform(*bounds, (ROWS, 3)).tolist() for name, bounds in TRIPLES.items()}
    columns |= {name: rng.integers(2, size=ROWS).astype(bool).tolist() for name in SWITCHES}
    columns |= {"seed": rng.integers(2**31, size=ROWS).tolist()}
    periods = [PERIODS[place] for place in rng.integers(len(PERIODS), size=ROWS)]
    columns |= dict(zip(("controller.period_s", "plant.step_s"), zip(*periods, strict=True), strict=True))
    columns |= {name: [value] * ROWS for name, value in {**SUPPLIED, **same}.items()}
    changes = [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]
    made = [initial_config(scenarios.load("hold", change), None, None).scenario for change in changes]
    drive = DriveChain.zeros(ROWS, groups=GROUPS, delays=32)
    drive["coil"]["settled"] = rng.uniform(0, 1, (ROWS, GROUPS))
    return Block(made, drive)


def shared(block):
    """Return a block whose rows share a scenario."""
    return Block(block.scenarios[:1] * ROWS, block.drive)


def started(engine, block):
    section = block.scenario.plant
    settings = RotorSettings(
        MODEL,
        ACTUATOR,
        section.step_s,
        "RK4",
        section.modelling_error,
        section.payload_kg,
        section.gravity_m_s2,
        mass_errors(section.mass, block.scenario.seed),
        len(block.scenarios),
    )
    rotor = ENGINES[engine].set_up(settings)
    rotor.start(section.initial_rad, section.initial_rad_s)
    return rotor


def part_rows(name, block):
    rows = PARTS[name].record.zeros(len(block.scenarios), groups=GROUPS)
    setup = PlantSetup(block.scenario, ACTUATOR, started("lagrangian", block).rows, block.drive)
    PARTS[name].fill(rows, setup)
    return rows


def arrangement_rows(block):
    scatter = scatter_of(block.scenario.plant, block.scenario.seed, ACTUATOR)
    model = scattered_model(ACTUATOR, scatter) if scatter else torque_model(ACTUATOR)
    rows = scaled(model, block.scenario.plant.payload_kg).arrangement
    return np.broadcast_to(rows, len(block.scenarios))


def same_bytes(fill, block):
    return fill(block).tobytes() == b"".join(fill(row).tobytes() for row in block.rows())


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("name", PARTS)
def test_parts(name, seed):
    rows = block(seed)
    for made in (rows, shared(rows), block(seed, **NO_CABLE)):
        assert same_bytes(partial(part_rows, name), made)


def test_the_first_row_that_cannot_be_set_up_is_reported():
    heated = block(0, **{"plant.thermal.on": True})
    heated.drive["coil"]["settled"][2:] = [[1e3], [2e3], [3e3]]
    with pytest.raises(InputError) as alone:
        part_rows("heat", heated.rows()[2])
    with pytest.raises(InputError, match=re.escape(str(alone.value))):
        part_rows("heat", heated)
    stops = [EndStopsSection(on=on, travel_rad=travel) for on, travel in ((False, 0.6), (True, 0.7))]
    with pytest.raises(InputError, match=r"received 0\.7"):
        fill_end_stops(EndStops.zeros(2), Columns(stops), np.full((3, 2), [-0.1, 0.1]), np.ones(3), 1e-3)
    with pytest.raises(InputError, match=r"three finite values that are not negative, received \[-1, 0, 0\]"):
        fill_friction(Friction.zeros(2), np.array([[0, 0, 0], [-1, 0, 0]]), np.zeros(3), 1e-3, 1e-3)
    with pytest.raises(InputError, match="received 0"):
        fill_friction(Friction.zeros(2), np.zeros(3), np.zeros(3), np.array([[1.0], [0.0]]), 1e-3)


@pytest.mark.parametrize("mass", [{}, MASS])
@pytest.mark.parametrize("engine", ENGINES)
def test_rotors(engine, mass):
    rows = block(0, **mass)
    if mass:  # one row equals its drawing
        rows.scenarios[2] = block(0).scenarios[2]
    rotor, alone = started(engine, rows), [started(engine, row) for row in rows.rows()]
    states = rotor.state()
    for state, one in zip(states, alone, strict=True):
        np.testing.assert_array_equal(state, one.state()[0])
    for name in set(rotor.rows.dtype.names) - {"addresses"}:
        assert rotor.rows[name].tobytes() == b"".join(one.rows[name].tobytes() for one in alone)
    np.testing.assert_array_equal(rotor.rows["joint"]["on"], [bool(mass) and row != 2 for row in range(ROWS)])
    rotor.start(np.zeros(3), np.zeros(3))
    rotor.restore(states)
    np.testing.assert_array_equal(rotor.rows["q"], np.concatenate([one.rows["q"] for one in alone]))
    np.testing.assert_array_equal(rotor.state(), states)


ERRORS = [[0.01, 1e-3, -1e-3, 1e-5]]


@pytest.mark.parametrize(
    "same", [{}, {"plant.poles.errors": ERRORS * 16}, {"plant.coils.errors": ERRORS * 36}]
)
def test_arrangements(same):
    rows = block(0, **same)
    for made in (rows, shared(rows)):
        assert same_bytes(arrangement_rows, made)


def test_arrangements_of_rows_of_which_some_have_no_scatter():
    none = dict.fromkeys([name for name in RANGES if name.startswith(("plant.poles", "plant.coils"))], 0.0)
    rows, ideal = block(0), block(0, **none)
    rows.scenarios[1:3] = ideal.scenarios[1:3]
    assert same_bytes(arrangement_rows, rows)
    np.testing.assert_array_equal(arrangement_rows(rows)["scattered"], [1, 0, 0, 1, 1])
    assert same_bytes(arrangement_rows, ideal)
