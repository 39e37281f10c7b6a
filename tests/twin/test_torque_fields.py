"""The second actuator: its torque comes from a field, and every part of the twin runs it as the first."""

import numpy as np
import pytest

import spheretwin as st
from spheretwin import cli, plant
from spheretwin.crosscheck import coil_driven
from spheretwin.crosscheck.scale import scale_of
from spheretwin.models import actuator as actuators
from spheretwin.models.magnetics import torque_matrix
from tests.models.poses import SECOND
from tests.twin.plant.test_plants import assert_equal, one_by_one, together


def test_both_engines_track_and_agree():
    runs, actuator = [], actuators.load(SECOND)
    for engine in ("mujoco", "lagrangian"):
        run = st.simulate("ventusff", {"plant.engine": engine, "duration": 2.0})
        table = run.telemetry
        assert run.status == "completed"
        assert table["current_A"].shape == (400, 8)
        # PID of 40 rad/s against the jerk of 0.2 sin(pi t) at the start: 0.17 degrees; later less.
        assert np.abs(table["error_rad"]).max() < np.radians(0.2)
        assert np.abs(table["error_rad"][200:]).max() < np.radians(0.02)
        for row in (1, 100, 399):
            middle = table["q_rad"][row] + 0.25e-3 * table["qdot_rad_s"][row]
            torque = torque_matrix(middle, actuator) @ table["current_A"][row]
            np.testing.assert_allclose(torque, table["torque_Nm"][row], rtol=0, atol=1e-15)
        runs.append(table["q_rad"])
    np.testing.assert_allclose(*runs, rtol=0, atol=1e-9)  # two RK4 of the same motion, rounded otherwise


def test_plants_in_lanes_move_as_alone():
    changes = {"plant.coulomb_Nm": [1e-4, 0, 2e-4], "plant.payload_kg": 0.01}
    parameters = [plant.parameters("ventusff", changes), plant.parameters("ventusff")] * 10
    tables = parameters[0].magnetics.tables
    weaker = parameters[0].magnetics._replace(tables=tables._replace(field=0.5 * tables.field))
    parameters[3] = parameters[3]._replace(magnetics=weaker)
    ranges = ((0.6, 3), (5, 3), (1, 8), (1e-3, 3))
    rng = np.random.default_rng(0)
    case = [rng.uniform(-largest, largest, (20, width)) for largest, width in ranges]
    # Accelerations are up to 1e3 rad/s².
    assert_equal(together(parameters, *case, 20), one_by_one(parameters, *case, 20))


@pytest.mark.parametrize("engine", ["mujoco", "lagrangian"])
def test_coil_driven_motion_agrees_with_dop853(engine):
    """The part of the cross-check with G_t(q) I(t) at every evaluation, at currents for a light rotor."""
    actuator = actuators.load(SECOND)
    scale = scale_of(actuator)._replace(current=0.15)  # 0.3 A
    reference = coil_driven.integrate(SECOND, actuator, scale)
    reached = (coil_driven.by_plant(SECOND, scale, engine, step_s) for step_s in (1e-3, 5e-4, 2.5e-4))
    errors = [np.abs(states - reference)[:, :3].max() for states in reached]
    assert np.abs(reference[-1, :3] - reference[0, :3]).max() > 0.1  # the coils move it
    assert errors[1] < 1e-5  # bound of the cross-check
    np.testing.assert_allclose(np.log2(np.array(errors[:-1]) / errors[1:]), 2, atol=0.2)


def test_a_run_is_recorded_and_replayed(tmp_path, capsys):
    again, run = tmp_path / "again.parquet", st.simulate("ventusff", {"duration": 0.1})
    run.save(tmp_path / "run.rrd")
    first = run.save(tmp_path / "run.parquet")
    assert cli.main(["simulate", "--replay", str(first), "--telemetry", str(again)]) == 0
    assert first.read_bytes() == again.read_bytes()
    assert capsys.readouterr().err == ""
