"""C code of the plant against `plant.step` and `simulate`; its derivatives; sanitizers."""

import subprocess
from functools import cache

import numpy as np
import pytest

import spheretwin as st
from spheretwin import plant
from spheretwin.export.c_library import write_c
from spheretwin.export.controller_code import controller_code
from spheretwin.export.plant_code import plant_code
from spheretwin.models.base.errors import InputError
from tests.requirements import needs_c_compiler
from tests.twin.export.generated import SANITIZERS, CPlant, compiled

FRICTION = {
    "plant.coulomb_Nm": [2e-3] * 3,
    "plant.coulomb_asymmetry": [0.3, -0.5, 0.1],
    "plant.viscous_Nm_s": [1e-4] * 3,
    "plant.payload_kg": 0.05,
}
PROTOTYPE = {
    "hardware": "prototype",
    "plant.stiction.on": False,
    "plant.cable.hysteresis_Nm": [0.0] * 3,
    "plant.cable.stiffness_Nm_rad": [0.02, 0.03, 0.01],
    "plant.thermal.rotor_degC": 60.0,
    "plant.group_gain": np.linspace(0.97, 1.03, 18).tolist(),
    "drive.resistance_ohm": np.linspace(1.0, 1.6, 18).tolist(),
    "drive.thermal_resistance_K_W": np.linspace(3.0, 5.0, 18).tolist(),
}
"""General joint, scatter of poles and coils, groups of other resistances, a cable, warm magnets."""


CHANGES = {"ideal joint": FRICTION, "general joint": PROTOTYPE}


@pytest.fixture(scope="module")
def started(tmp_path_factory):
    """Return the plant of a name at its start; it is compiled once."""
    compiled_plant = cache(lambda name: CPlant(tmp_path_factory.mktemp("plant"), "nutation", CHANGES[name]))

    def start(name="ideal joint"):
        compiled_plant(name).reset()
        return compiled_plant(name)

    return start


def random_motion(generator):
    return generator.uniform(-0.5, 0.5, 3), generator.uniform(-5, 5, 3)


@needs_c_compiler
@pytest.mark.parametrize("name", CHANGES)
def test_steps_are_those_of_the_plant_step(started, name):
    c_plant, parameters = started(name), plant.parameters("nutation", CHANGES[name])
    generator = np.random.default_rng(0)
    q, qdot = random_motion(generator)
    c_plant.set("lag_s", 0.0)  # the step takes the currents themselves, and the magnets stay as warm
    if "rotor_heat_capacity_J_K" in c_plant.names:
        c_plant.set("rotor_heat_capacity_J_K", 1e15)
    x = c_plant.x_start.copy()
    x[:6] = *q, *qdot
    c_plant.start(x)
    state = plant.State(q, qdot)
    for _ in range(200):
        current, disturbance = generator.uniform(-2, 2, 18), generator.uniform(-0.01, 0.01, 3)
        state = plant.step(state, current, disturbance, parameters, 5e-4)
        assert c_plant.step(np.concatenate([current, disturbance]), 5e-4) == 0
    # The same operations, each rounded apart in C and some fused in the other: 200 steps of 1e-16 of 5 rad/s.
    np.testing.assert_allclose(c_plant.x[:6], np.concatenate(state), atol=2e-13)


@needs_c_compiler
@pytest.mark.parametrize("name", CHANGES)
def test_directional_derivatives_are_exact(started, name):
    c_plant = started(name)
    generator = np.random.default_rng(1)
    x, u = c_plant.x_start.copy(), generator.uniform(-1, 1, 21)
    x[:3], x[3:6] = random_motion(generator)
    x[6:24] = generator.uniform(-2, 2, 18)
    x[24:] += generator.uniform(0, 40, len(x) - 24)
    for _ in range(5):
        dx, du = generator.normal(size=len(x)), generator.normal(size=21)
        exact = c_plant.directional(u, x, du, dx)
        small = 1e-6
        difference = c_plant.derivatives(u + small * du, x + small * dx)
        difference = (difference - c_plant.derivatives(u - small * du, x - small * dx)) / (2 * small)
        # Rounding of the difference, 1e-16 / 1e-6 of the largest derivative, which is that of a current.
        assert np.abs(exact - difference).max() < 1e-9 * np.abs(exact).max()
        # Rates and accelerations are smaller, and each has its own bound.
        np.testing.assert_allclose(exact[:6], difference[:6], rtol=1e-6, atol=1e-5)


HEAT = {
    "plant.engine": "lagrangian",
    "duration": 0.03,
    "plant.thermal.on": True,
    "plant.thermal.rotor_degC": 40.0,
    "plant.thermal.stator_heat_capacity_J_K": 5.0,
    "drive.resistance_per_K": 0.0039,
    "drive.resistance_ohm": np.linspace(1.0, 1.6, 18).tolist(),
    "drive.inductance_H": np.linspace(9e-4, 6e-4, 18).tolist(),
    "drive.thermal_resistance_K_W": np.linspace(3.0, 5.0, 18).tolist(),
    # So that each winding is hotter by half a kelvin after some ticks.
    "drive.heat_capacity_J_K": np.linspace(0.1, 0.07, 18).tolist(),
    "drive.shutdown_degC": 300.0,
    "controller.law": "pd",
}


@pytest.mark.release("compiler, 2 s; test_steps_are_those_of_the_plant_step has the same code")
@needs_c_compiler
@pytest.mark.uncompiled
@pytest.mark.parametrize(
    ("inputs", "drive"),
    [
        # The demand of 8 A exceeds what 2 V can drive: the voltage of every amplifier is at its limit.
        ("voltages", {"drive.supply_V": 2.0}),
        # 2 A need 22.6 V at most: no voltage is at its limit.
        ("currents", {"drive.supply_V": 24.0}),
    ],
)
def test_currents_and_temperatures_are_those_of_simulate(inputs, drive, tmp_path):
    signs = np.where(np.arange(18) % 3 == 0, -1.0, 1.0)
    command = signs * (8.0 if inputs == "voltages" else 2.0)
    changes = {**FRICTION, **HEAT, **drive, "manual.currents_A": command.tolist()}
    run = st.simulate("nutation", changes).telemetry
    c_plant = CPlant(tmp_path, "nutation", changes, inputs)
    u = signs * drive["drive.supply_V"] if inputs == "voltages" else command
    for row in range(1, len(run["t_s"])):
        c_plant.advance(np.concatenate([u, run["disturbance_Nm"][row - 1]]), 1e-3)
        # Telemetry has the temperatures at the end of a tick, angles and rates at its start.
        reached = np.concatenate([c_plant.x[24:42], c_plant.x[42:44]])
        logged = [run["coil_temperature_degC"], run["stator_temperature_degC"], run["rotor_temperature_degC"]]
        expected = np.concatenate([np.atleast_1d(column[row - 1]).ravel() for column in logged])
        np.testing.assert_allclose(reached, expected, atol=1e-9)
        np.testing.assert_allclose(c_plant.x[:3], run["q_rad"][row], atol=1e-9)
        np.testing.assert_allclose(c_plant.x[3:6], run["qdot_rad_s"][row], atol=1e-9)
    assert np.abs(c_plant.x[24:42] - 20).min() > 0.5
    assert np.abs(run["q_rad"] - run["q_rad"][0]).max() > 1e-3


@needs_c_compiler
def test_leaving_the_range_and_diverging_end_a_step(tmp_path):
    c_plant = CPlant(tmp_path, "nutation", {})
    push = np.concatenate([np.zeros(18), [-1.0, 0.0, 0.0]])
    verdict, reached = c_plant.advance(push, 1.0)
    assert verdict == 1
    # 1 N·m turns 2.2e-3 kg·m² by 80 degrees in sqrt(2 q J / torque).
    expected = np.sqrt(2 * np.radians(80) * c_plant.parameters[0])
    assert reached == pytest.approx(expected, abs=c_plant.parameters[c_plant.names.index("step_s")])
    c_plant.start(c_plant.x_start)
    c_plant.set("spring_Nm_rad.alpha", 1e14)  # within its bounds, and no step resolves its oscillation
    before = c_plant.memory
    assert c_plant.advance(push, 1e-1) == (2, 0.0)
    np.testing.assert_array_equal(c_plant.memory, before)


@needs_c_compiler
def test_a_step_that_is_no_multiple_is_divided_evenly(started):
    c_plant = started()
    u = np.concatenate([np.linspace(-1, 1, 18), np.zeros(3)])
    c_plant.advance(u, 1.2e-3)  # three steps of 0.4 ms
    reached = c_plant.x.copy()
    c_plant.start(c_plant.x_start)
    for _ in range(3):
        c_plant.step(u, 0.4e-3)
    np.testing.assert_allclose(reached, c_plant.x, rtol=1e-14, atol=1e-18)


@pytest.mark.release("compiler, 7 s; other tests run the same code without sanitizers")
@needs_c_compiler
@pytest.mark.parametrize(
    "changes",
    [
        {"controller.law": "pid", "plant.thermal.on": True, "drive.supply_V": 24.0},
        {**PROTOTYPE, "controller.law": "afsm_eso", "watchdog.on": False, "estimator.kind": "kalman"},
        {"controller.law": "afsm", "estimator.kind": "differentiator", "allocation": "bounded"},
    ],
    ids=["pid", "afsm_eso", "afsm"],
)
def test_the_example_runs_under_sanitizers(changes, tmp_path):
    write_c(tmp_path, plant_code("hold", changes), controller_code("hold", changes))
    sources = ["st_plant.c", "st_controller.c", "st_example.c"]
    program = compiled(tmp_path, sources, "example", *SANITIZERS)
    done = subprocess.run([program], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    rows = np.loadtxt(done.stdout.splitlines(), delimiter=",", skiprows=1)
    # The load of 0.02 N·m pushes alpha by some milliradians; every law brings it back within a second.
    assert 1e-5 < np.abs(rows[:, 1]).max() < 0.1
    assert np.abs(rows[-1, 1:]).max() < 5e-3


def test_voltages_with_coupled_coils_are_refused():
    with pytest.raises(InputError, match=r"expected drive\.coil_coupling 0 with voltages"):
        plant_code("hold", {"drive.supply_V": 24.0, "drive.coil_coupling": 1.0}, "voltages")


def test_a_torque_field_is_refused():
    with pytest.raises(InputError, match="received one with a torque field"):
        plant_code("ventusff").table_header()
