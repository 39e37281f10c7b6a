"""The prototype's way out, in the loop: delay, converter, amplifiers with a supply, coils that warm."""

import numpy as np
import pytest

from spheretwin import cli
from spheretwin import scenario as scenarios
from spheretwin.electronics.amplifier import drive_coils
from spheretwin.electronics.coil import back_emf
from spheretwin.electronics.delay import due
from spheretwin.electronics.drive_chain import begin, drive_chain, end
from spheretwin.models.base.errors import InputError
from spheretwin.models.kinematics import rate_jacobian
from spheretwin.models.lagrangian import inertia_matrix
from spheretwin.models.magnetics import torque_matrix
from spheretwin.scenario.hardware import PROTOTYPE_DRIVE
from spheretwin.session import Session
from spheretwin.simulation import simulate

L_H = 0.9e-3


def driven(name="hold", **changes):
    return scenarios.load(name, {**PROTOTYPE_DRIVE, "duration": 0.1, "seed": 5, **changes})


@pytest.mark.parametrize("engine", ["mujoco", "lagrangian"])
@pytest.mark.parametrize("delay_s", [0.0, 1e-3, 3e-3])
def test_currents_are_what_the_stages_make_of_the_commands(engine, delay_s):
    """The stages called one after the other, outside the loop, give the logged currents and columns."""
    clock = {"plant.engine": engine, "plant.step_s": 1e-3, "drive.delay_s": delay_s}
    with Session(driven(**clock)) as session:
        table, actuator, resolved = session.advance(100), session.actuator, session.scenario
    stages, groups = drive_chain(resolved.drive, 1e-3, 1, 18, resolved.seed), 18
    current, emf, last = np.zeros(groups), np.empty(groups), table["qdot_rad_s"][0]
    for tick in range(100):
        begin(stages, table["current_command_A"][tick].copy())
        due(stages.delay, 0, stages.setpoint)
        rates = table["qdot_rad_s"][tick]
        # Pose and rates in the middle of the step, as the plant predicts them.
        q, qdot, last = table["q_rad"][tick] + 5e-4 * rates, rates + 0.5 * (rates - last), rates
        back_emf(torque_matrix(q, actuator), np.ones(groups), rate_jacobian(q) @ qdot, emf)
        drive_coils(stages.amplifier, stages.coil, stages.setpoint, emf, current, stages.flow)
        # Torque matrices and sums of three products, rounded in another order: 1e-16 of volts, times 1/R.
        np.testing.assert_allclose(table["current_A"][tick], stages.flow.mean_current_A, rtol=0, atol=1e-11)
        np.testing.assert_allclose(
            table["copper_loss_W"][tick], stages.flow.copper_J / 1e-3, rtol=1e-9, atol=1e-9
        )
        np.testing.assert_allclose(
            table["coil_power_W"][tick], stages.flow.work_J / 1e-3, rtol=1e-9, atol=1e-8
        )
        end(stages)
        np.testing.assert_allclose(
            table["coil_temperature_degC"][tick], stages.coil.temperature_degC, rtol=0, atol=1e-10
        )


def test_nothing_flows_before_the_delay_is_over():
    quiet = {"drive.dac_offset_V": 0.0, "drive.amplifier_offset_V": 0.0, "drive.dac_inl_lsb": 0.0}
    table = simulate(driven(**quiet, **{"drive.delay_s": 2.5e-3, "drive.dac_bits": 0})).telemetry
    assert np.abs(table["current_command_A"][0]).max() > 0.1
    np.testing.assert_array_equal(table["current_A"][:3], 0.0)  # the row of 2 ms is of its first half
    assert np.abs(table["current_A"][3]).max() > 0.1


def test_work_at_the_coils_is_heat_motion_and_field():
    """Energy: what goes into the coils is copper loss, the rotor's kinetic energy, and ½ L i²."""
    still = {
        "plant.engine": "lagrangian", "disturbance.load": 0.0, "drive.resistance_per_K": 0.0,
        "plant.modelling_error": 0.0, "drive.delay_s": 0.0,
        "controller.law": "pd", "controller.stiffness": 400.0,
    }  # fmt: skip
    left = []
    for step_s in (5e-4, 2.5e-4, 1.25e-4):
        with Session(driven(duration=0.06, **still, **{"plant.step_s": step_s})) as session:
            table, inertia = session.advance(60), session.actuator.inertia
            current = session._runtime._plant.current
            q, qdot = session.q_rad, session._runtime._rotor.data.qdot
            work = table["coil_power_W"].sum() * 1e-3
            heat = table["copper_loss_W"].sum() * 1e-3
            kinetic = 0.5 * qdot @ inertia_matrix(q, inertia) @ qdot
            field = 0.5 * L_H * float(np.sum(current**2))
        left.append(abs(work - heat - kinetic - field) / kinetic)
    # The EMF of the middle of a physics step is held over it: what is left is of second order in the step, or
    # smaller where the errors of its parts cancel.
    assert left[0] < 2e-4
    assert left[0] / left[1] > 3.8, left
    assert left[1] / left[2] > 3.8, left


def test_a_supply_limits_how_fast_a_current_rises():
    weak = simulate(driven(**{"drive.supply_V": 8.0, "drive.delay_s": 0.0})).telemetry
    strong = simulate(driven(**{"drive.supply_V": 100.0, "drive.delay_s": 0.0})).telemetry
    assert weak["voltage_limited"].max() > 0.5
    assert strong["voltage_limited"].max() < 0.2
    rise = np.abs(np.diff(weak["current_A"], axis=0)).max() / 1e-3
    # No faster than the whole swing over L, whatever is asked; R i and EMF may help a falling current.
    assert rise < 2 * (8.0 + 1.3 * 8.0) / L_H


def test_a_coil_too_hot_ends_the_run_safely_and_keeps_it(tmp_path, capsys):
    path = tmp_path / "hot.parquet"
    arguments = ["--hardware", "electronics", "--drive.shutdown-degC", "20.05", "--telemetry", str(path)]
    assert cli.main(["simulate", "hold", *arguments]) == 1
    assert "failsafe" in capsys.readouterr().err
    assert path.exists()
    run = simulate(driven(**{"drive.shutdown_degC": 20.05, "duration": 3.0}))
    assert run.status == "failsafe"
    assert run.telemetry["coil_temperature_degC"][-1].max() > 20.05
    assert run.telemetry["coil_temperature_degC"][-2].max() <= 20.05


@pytest.mark.parametrize("delay_s", [0.0, 5e-4, 2e-3])
def test_a_session_goes_on_with_commands_on_their_way_and_warm_coils(delay_s):
    scenario = driven("nutation", **{"drive.delay_s": delay_s, "duration": 1.0})
    with Session(scenario) as session, Session(scenario) as other, Session(scenario) as changed:
        session.advance(150)
        other.restore(session.snapshot())
        changed.advance(100)
        changed.set("plant.group_gain", [1.0] * 18)  # builds the plant anew
        changed.advance(50)
        expected = session.advance(100).values.tobytes()
        assert other.advance(100).values.tobytes() == expected
        assert changed.advance(100).values.tobytes() == expected


def test_chunks_and_threads_of_a_prototype_move_no_bit():
    from concurrent.futures import ThreadPoolExecutor

    scenario = scenarios.load("tilt", {"hardware": "electronics", "duration": 0.3, "seed": 9})
    whole = simulate(scenario).telemetry.values.tobytes()
    with Session(scenario) as session:
        pieces = [session.advance(7).values for _ in range(42)] + [session.advance(6).values]
    assert np.concatenate(pieces).tobytes() == whole
    with ThreadPoolExecutor(2) as pool:
        runs = list(pool.map(lambda _: simulate(scenario).telemetry.values.tobytes(), range(4)))
    assert set(runs) == {whole}


def test_the_controller_knows_the_drive_s_delay_and_bandwidth_if_its_sheet_states_them():
    def known(**changes):
        with Session(driven(**changes)) as session:
            return session.scenario.nominal.delay_s, session.scenario.nominal.time_constant_s

    stated = (1e-3, pytest.approx(1 / 12566.370614359172))
    assert known(hardware="electronics") == known(**{"nominal.equals_truth": True}) == stated
    assert known() == (0.0, pytest.approx(0.9e-3 / 1.3))  # L/R of the model file
    assert known(**{"nominal.equals_truth": True, "nominal.delay_s": 0.0})[0] == 0.0


@pytest.mark.parametrize(
    ("changes", "part"),
    [
        ({"drive.supply_V": 24.0, "drive.time_constant_s": 1e-3}, "either a supply_V"),
        ({"drive.delay_s": 3e-4}, "expected drive.delay_s a whole multiple of plant.step_s"),
        ({"drive.delay_s": -1e-3}, "drive.delay_s: expected a number greater than or equal to 0"),
        ({"drive.supply_V": 4.0, "drive.drop_up_V": 4.8}, "below drive.supply_V"),
        ({"drive.dac_bits": 16.5}, "drive.dac_bits: expected a whole number"),
    ],
)
def test_a_drive_that_cannot_be_is_refused_on_one_line(changes, part):
    with pytest.raises(InputError) as caught:
        scenarios.load("hold", changes)
    assert part in str(caught.value)
    assert "\n" not in str(caught.value)


def test_neutral_stages_move_no_bit():
    plain = simulate(scenarios.load("hold", {"duration": 0.1})).telemetry
    neutral = {
        "drive.delay_s": 0.0,
        "drive.dac_bits": 0,
        "drive.dac_offset_V": 1e-3,
        "drive.bandwidth_rad_s": 10.0,
    }
    telemetry = simulate(scenarios.load("hold", {"duration": 0.1, **neutral})).telemetry
    assert telemetry.values.tobytes() == plain.values.tobytes()


def test_copper_loss_is_what_the_coils_say_they_lost():
    from spheretwin.run import figures_of

    run = simulate(driven("nutation", duration=0.3))
    loss_J = run.telemetry["copper_loss_W"].sum() * 1e-3
    # The same numbers, added in another order.
    assert figures_of(run)["copper_loss_J"] == pytest.approx(loss_J, rel=1e-12)
