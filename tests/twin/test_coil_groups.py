"""Groups with values of their own: currents and heat of each are those of its resistance and inductance."""

import numpy as np
import pytest

from spheretwin import scenario as scenarios
from spheretwin.config.active_config import initial_config
from spheretwin.electronics.coil import SHORTED
from spheretwin.electronics.drive_chain import DriveChain, advance, begin, end, fill_drive
from spheretwin.machine.parameters import KINDS, Machine, Parameter
from spheretwin.session import Session
from tests.twin.model_files import model_file

GROUPS, STEP_s, TICK_s = 18, 5e-4, 1e-3
R, L = np.linspace(5.7, 8.3, GROUPS), np.linspace(9e-3, 4e-3, GROUPS)
NUMBERS = {"group_resistance_ohm": R.tolist(), "group_inductance_H": L.tolist()}


def resolved(path, **changes):
    fields = {name.replace("__", "."): value for name, value in changes.items()}
    return initial_config(scenarios.load("hold", {"plant.mjcf": path, **fields}), None, None).scenario


def chain_of(drive):
    setting = drive, STEP_s, round(TICK_s / STEP_s), 0
    return DriveChain.filled(fill_drive, *setting, groups=GROUPS, delays=8)[0]


def step(chain, command, current, substep=0):
    """Advance currents at rest, so that there is no back-EMF; return their means."""
    mean, ones, none = np.empty(GROUPS), np.ones(GROUPS), np.zeros(0)
    if not substep:
        begin(chain, command, 0, none)
    at_rest = np.zeros(3), np.zeros(3), np.zeros((3, GROUPS))
    advance(chain, substep, *at_rest, ones, none, current, mean)
    return mean


@pytest.mark.parametrize("supply_V", [None, 2.0])
def test_step_response_of_each_current_is_the_exponential_of_its_own_r_and_l(tmp_path, supply_V):
    """Without a supply towards the command; at the limit of a supply towards V / R, the DC gain 1 / R."""
    chain = chain_of(resolved(model_file(tmp_path, **NUMBERS), drive__supply_V=supply_V).drive)
    command, current = np.full(GROUPS, 8.0), np.zeros(GROUPS)
    final = command if supply_V is None else supply_V / R
    for number in range(200):
        mean = step(chain, command, current, number % 2)
        start, end_ = number * STEP_s * R / L, (number + 1) * STEP_s * R / L
        # Each step rounds the current once more.
        np.testing.assert_allclose(current, -final * np.expm1(-end_), rtol=1e-13)
        exact = final * (1 - (np.exp(-start) - np.exp(-end_)) / (end_ - start))
        np.testing.assert_allclose(mean, exact, rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(current, final, rtol=1e-13)


def test_a_shorted_group_decays_with_its_own_time_constant(tmp_path):
    chain = chain_of(resolved(model_file(tmp_path, **NUMBERS), drive__supply_V=24.0).drive)
    chain.coil.contact[:] = SHORTED
    current = np.ones(GROUPS)
    step(chain, np.zeros(GROUPS), current)
    np.testing.assert_allclose(current, np.exp(-STEP_s * R / L), rtol=1e-14)


def test_each_group_heats_by_its_own_loss_and_thermal_data(tmp_path):
    capacity_J_K, thermal_K_W = np.linspace(0.1, 0.3, GROUPS), np.linspace(5.0, 2.0, GROUPS)
    thermal = {"heat_capacity_J_K": capacity_J_K, "thermal_resistance_K_W": thermal_K_W}
    numbers = {f"group_{name}": values.tolist() for name, values in thermal.items()}
    path = model_file(tmp_path, **NUMBERS, **numbers, group_resistance_per_K=0.0)
    chain = chain_of(resolved(path, hardware="electronics", drive__bandwidth_rad_s=1e9).drive)
    chain.amplifier.offset_A[:] = 0.0
    command, current, ticks = np.full(GROUPS, 0.5), np.full(GROUPS, 0.5), 100
    chain.delay.history[:] = command
    chain.converts = False
    for _ in range(ticks):
        step(chain, command, current)
        step(chain, command, current, 1)
        end(chain)
    exact_K = R * 0.5**2 * thermal_K_W * -np.expm1(-ticks * TICK_s / (thermal_K_W * capacity_J_K))
    np.testing.assert_allclose(chain.coil.temperature_degC - 20, exact_K, rtol=1e-10)


@pytest.mark.parametrize("hardware", ["ideal", "prototype"])
def test_plant_and_data_sheet_have_the_values_of_the_model_file(tmp_path, hardware):
    path = model_file(tmp_path, **NUMBERS)
    with Session(scenarios.load("hold", {"plant.mjcf": path, "hardware": hardware})) as session:
        scenario = session.scenario
    for section in (scenario.drive, scenario.nominal):
        np.testing.assert_array_equal(section.resistance_ohm, R)
        np.testing.assert_array_equal(section.inductance_H, L)
    chain = chain_of(scenario.drive)
    np.testing.assert_array_equal(chain.coil.cold_resistance_ohm, R)
    np.testing.assert_array_equal(chain.coil.inductance_H, L)
    if hardware == "ideal":
        np.testing.assert_array_equal(scenario.nominal.time_constant_s, L / R)


@pytest.mark.parametrize("stated", [[1.3] * GROUPS, 1.3])
def test_a_list_of_equal_values_is_one_value(tmp_path, stated):
    own = resolved(model_file(tmp_path, group_resistance_ohm=stated), drive__inductance_H=[0.9e-3] * GROUPS)
    shipped = initial_config(scenarios.load("hold"), None, None).scenario
    assert (own.drive, own.nominal.resistance_ohm) == (shipped.drive, 1.3)


def test_the_record_of_a_run_gives_the_same_values_again(tmp_path):
    path = model_file(tmp_path, **NUMBERS, group_temperature_limit_degC=np.linspace(90, 120, 18).tolist())
    first = resolved(path, hardware="prototype")
    again = initial_config(scenarios.from_record(first.model_dump(mode="json"), "record"), None, None)
    assert (again.scenario.drive, again.scenario.nominal) == (first.drive, first.nominal)


def test_identification_has_the_lag_of_each_group_unless_it_fits_one():
    machine = Machine("hold", {"drive.time_constant_s": (L / R).tolist()})
    np.testing.assert_array_equal(machine.setup([], []).lag_s, L / R)
    assert machine.setup([Parameter(KINDS["lag_s"], 0)], [2e-3]).lag_s == 2e-3
