"""Temperatures of windings, stator and rotor: exact solution, order, energy, remanence, snapshots."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import expm, solve

from spheretwin import scenario as scenarios
from spheretwin import simulate
from spheretwin.electronics.coil import advance_temperature
from spheretwin.electronics.drive_chain import DriveChain, fill_drive
from spheretwin.electronics.drive_section import ResolvedDrive
from spheretwin.metrics.figures import Figures
from spheretwin.metrics.reduction import PlannedRun
from spheretwin.models.actuator import load
from spheretwin.models.base.errors import InputError
from spheretwin.plant.magnet_heat import MagnetHeat, ResolvedThermal, advance_heat, begin_heat, fill_heat
from spheretwin.scenario.hardware import MACHINE
from spheretwin.session import Session

AMBIENT_degC, GROUPS, PERIOD_s = 25.0, 4, 1.0
WINDING_J_K, WINDING_K_W = 60.0, 4.0
LOSS_W = np.array([0.0, 2.0, 5.0, 9.0])
ASSUMED = {
    name.removeprefix("plant.thermal."): value.value
    for name, value in MACHINE["ideal"].items()
    if name.startswith("plant.thermal.")
}


def thermal(**values):
    return ResolvedThermal(**{"on": True, **ASSUMED, **values})


SECTION = thermal()


def heat_of(period_s, section=SECTION):
    coils = {"supply_V": 24.0, "resistance_ohm": 1.3, "inductance_H": 9e-4, "current_limit_A": 8.0}
    heat = {"heat_capacity_J_K": WINDING_J_K, "thermal_resistance_K_W": WINDING_K_W}
    drive = ResolvedDrive(resistance_per_K=0.0, ambient_degC=AMBIENT_degC, **coils, **heat)
    coil = DriveChain.filled(fill_drive, drive, period_s, 1, 0, groups=GROUPS, delays=8)[0].coil
    fields = section, AMBIENT_degC, period_s, WINDING_J_K, coil.settled
    return coil, MagnetHeat.filled(fill_heat, *fields, groups=GROUPS)[0]


def heated(duration_s, period_s, section=SECTION):
    """Return the temperatures of stator and rotor at the end of each period, with constant losses."""
    coil, heat = heat_of(period_s, section)
    copper_J = LOSS_W * period_s
    degC = np.empty((round(duration_s / period_s), 2))
    for row in degC:
        begin_heat(heat, np.ones(GROUPS), coil)
        advance_temperature(coil, copper_J)
        advance_heat(heat, coil.temperature_degC, copper_J)
        row[:] = heat.stator_degC, heat.rotor_degC
    return degC, coil, heat


def network(section=SECTION):
    """Return A and b of ``dT/dt = A T + b`` for the windings, the stator and the rotor."""
    n = GROUPS
    conductance = np.zeros((n + 2, n + 2))  # to the neighbour
    conductance[:n, n] = conductance[n, :n] = 1 / WINDING_K_W
    conductance[n, n + 1] = conductance[n + 1, n] = 1 / section.air_gap_K_W
    outer = np.zeros(n + 2)
    outer[n:] = 1 / section.stator_to_ambient_K_W, 1 / section.rotor_to_ambient_K_W
    masses = [section.stator_heat_capacity_J_K, section.rotor_heat_capacity_J_K]
    capacity = np.array([WINDING_J_K] * n + masses)
    A = (conductance - np.diag(conductance.sum(axis=1) + outer)) / capacity[:, None]
    return A, (np.append(LOSS_W, [0.0, 0.0]) + outer * AMBIENT_degC) / capacity


def exact(duration_s):
    A, b = network()
    final = -solve(A, b)
    return final + expm(A * duration_s) @ (AMBIENT_degC - final)


def test_the_temperatures_converge_to_the_exact_solution_with_order_1():
    duration_s = 1024.0
    final = exact(duration_s)[GROUPS:]
    errors = [np.abs(heated(duration_s, h)[0][-1] - final).max() for h in (8.0, 4.0, 2.0)]
    # The next term is the square of the period over the time constant of a winding, 240 s.
    np.testing.assert_allclose(np.log2(np.divide(errors[:-1], errors[1:])), 1.0, atol=0.05)
    # At the control period of 1 ms the error is 2000 times smaller.
    assert errors[-1] < 0.05


positive = st.floats(0.1, 1e4)


# The windings exchange 1 J/K with the stator in this period: a smaller capacity is refused.
@given(st.floats(2.0, 1e4), positive, positive, positive, positive, st.floats(-50, 150))
def test_energy_is_conserved(stator_J_K, rotor_J_K, stator_K_W, gap_K_W, rotor_K_W, rotor_degC):
    capacities = {"stator_heat_capacity_J_K": stator_J_K, "rotor_heat_capacity_J_K": rotor_J_K}
    outer = {"stator_to_ambient_K_W": stator_K_W, "rotor_to_ambient_K_W": rotor_K_W}
    section = thermal(rotor_degC=rotor_degC, air_gap_K_W=gap_K_W, **capacities, **outer)
    degC, coil, _ = heated(20 * PERIOD_s, PERIOD_s, section)
    stored = WINDING_J_K * (coil.temperature_degC - AMBIENT_degC).sum()
    stored += [stator_J_K, rotor_J_K] @ (degC[-1] - [AMBIENT_degC, rotor_degC])
    lost = PERIOD_s * ((degC - AMBIENT_degC) / [stator_K_W, rotor_K_W]).sum()
    # Rounding of heat capacities times temperatures, over 20 steps.
    scale = (stator_J_K + rotor_J_K + 1 / stator_K_W + 1 / rotor_K_W + 1 / gap_K_W + 1e3) * 200
    assert abs(stored + lost - 20 * PERIOD_s * LOSS_W.sum()) < 1e-12 * scale


def test_gains_fall_with_the_remanence():
    gains = np.array([1.0, 0.9, 1.1, 1.0])
    coil, heat = heat_of(1e-3, thermal(rotor_degC=60.0))
    present = gains.copy()
    begin_heat(heat, present, coil)
    np.testing.assert_allclose(present, gains * (1 - 0.0011 * 40), rtol=1e-15)


PROTOTYPE = {"hardware": "prototype", "plant.engine": "lagrangian", "drive.delay_s": 0.0}


def test_hot_magnets_give_less_torque_for_the_same_currents():
    manual = PROTOTYPE | {"manual.currents_A": [0.0] * 4 + [1.0] + [0.0] * 13, "duration": 0.05}
    cold, hot = (simulate("hold", manual | {"plant.thermal.rotor_degC": T}).telemetry for T in (20.0, 60.0))
    # Of the first half of a millisecond, in which the back-EMF is below 1e-6 of the voltage.
    np.testing.assert_allclose(hot["torque_Nm"][0], (1 - 0.0011 * 40) * cold["torque_Nm"][0], rtol=1e-6)
    assert hot["rotor_temperature_degC"][-1] == pytest.approx(60.0, abs=0.01)


def test_a_change_of_the_plant_keeps_the_temperatures():
    with Session(scenarios.load("nutation", PROTOTYPE)) as session:
        stator = session.advance(40)["stator_temperature_degC"]
        assert np.all(np.diff(stator) > 0)
        session.set("plant.payload_kg", 0.01)
        assert 0 <= session.advance(1)["stator_temperature_degC"][0] - stator[-1] < 1e-3


def test_a_run_above_the_knee_has_a_warning():
    assert "the magnets reached 80.5 °C, above plant.thermal.knee_degC 80 °C" in warnings_of(80.5)
    assert "magnets" not in warnings_of(79.0)


def warnings_of(rotor_degC):
    with Session(scenarios.load("hold", PROTOTYPE | {"plant.thermal.rotor_degC": rotor_degC})) as session:
        figures = Figures(PlannedRun(session.scenario, load(), 50))
        figures.write(session.advance(50))
    return " ".join(figures.warnings())


def test_temperatures_need_a_supply():
    with pytest.raises(InputError, match=r"expected a drive.supply_V with plant.thermal.on, received none"):
        simulate("hold", {"plant.thermal.on": True})


def test_a_stator_that_stores_less_than_the_windings_release_is_refused():
    message = r"stator_heat_capacity_J_K above 0\.99\d* J/K, .* received 0\.5 J/K"
    with pytest.raises(InputError, match=message):
        heat_of(PERIOD_s, thermal(stator_heat_capacity_J_K=0.5))
