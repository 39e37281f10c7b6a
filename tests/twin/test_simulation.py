"""The closed loop: the paper's figures, identities within a run, determinism, other people's laws."""

import numba
import numpy as np
import pytest

from spheretwin import loop as loops
from spheretwin import runtime as machines
from spheretwin import scenario as scenarios
from spheretwin import simulation as simulations
from spheretwin.control.law import Law, NominalModel
from spheretwin.loop import Functions
from spheretwin.models.base.errors import InputError
from spheretwin.models.kinematics import rate_jacobian
from spheretwin.models.magnetics import torque_matrix
from spheretwin.models.telemetry.signals import Signal
from spheretwin.session import Session
from spheretwin.simulation import follow, simulate


def run(name, law=None, **overrides):
    changes = {key.replace("__", "."): value for key, value in overrides.items()}
    return simulate(scenarios.load(name, changes), law=law)


def largest_error(finished):
    return np.abs(finished.telemetry["error_rad"]).max(axis=0)


@pytest.fixture(scope="module")
def sinusoid():
    return {
        (law, load): run("sinusoid", controller__law=law, disturbance__load=load)
        for law in ("pd", "adaptive_fuzzy", "afsm")
        for load in (1.0, 2.0)
    }


@pytest.mark.parametrize(
    ("load", "paper"), [(1.0, [0.0832, 0.0750, 0.0761]), (2.0, [0.1854, 0.1986, 0.1769])]
)
def test_afsm_tracks_the_sinusoid_within_the_paper_s_errors(sinusoid, load, paper):
    finished = sinusoid["afsm", load]
    assert finished.status == "completed"
    assert np.all(largest_error(finished) <= paper)


@pytest.mark.parametrize("load", [1.0, 2.0])
def test_laws_rank_as_in_the_paper(sinusoid, load):
    pd, fuzzy, afsm = (largest_error(sinusoid[law, load]) for law in ("pd", "adaptive_fuzzy", "afsm"))
    assert np.all(pd > fuzzy)
    assert np.all(fuzzy > afsm)


def test_pd_error_is_what_statics_says(sinusoid):
    # At rest PD holds J_i kp e = load + modelling torque; the sine adds its own. L = 1: 0.05 N·m.
    static = 0.05 / (2.2e-3 * 50)
    assert np.all(np.abs(largest_error(sinusoid["pd", 1.0]) - static) < 0.06)


@pytest.fixture(scope="module")
def nutation():
    return run("nutation")


def test_nutation_is_tracked_from_rest(nutation):
    assert nutation.status == "completed"
    table = nutation.telemetry
    late = table["t_s"] > 1.0
    assert np.abs(table["error_rad"][late]).max() <= 0.03
    assert np.abs(table["current_A"]).max() <= 8.0
    np.testing.assert_array_equal(table["qdot_rad_s"][0], 0)


def test_logged_currents_give_the_logged_torque(nutation, actuator):
    table = nutation.telemetry
    for row in range(0, len(table), 50):
        middle = table["q_rad"][row] + 0.25e-3 * table["qdot_rad_s"][row]  # of the first physics step
        torque = torque_matrix(middle, actuator) @ table["current_A"][row]
        np.testing.assert_allclose(torque, table["torque_Nm"][row], atol=1e-9)


def test_commanded_currents_give_the_commanded_torque(nutation, actuator):
    table = nutation.telemetry
    for row in range(0, len(table), 50):
        q = table["q_rad"][row]
        torque_q = rate_jacobian(q).T @ torque_matrix(q, actuator) @ table["current_command_A"][row]
        wanted = table["allocation_scale"][row] * table["torque_command_Nm"][row]
        np.testing.assert_allclose(torque_q, wanted, atol=1e-11)


def test_sliding_variable_is_made_of_the_logged_errors(nutation):
    table = nutation.telemetry
    rate_error = table["qdot_rad_s"] - table["qdot_ref_rad_s"]
    np.testing.assert_allclose(table["sliding_s"], 50 * table["error_rad"] + rate_error, atol=1e-12)


def test_same_seed_same_bytes_other_seed_other_bytes():
    first, again = run("nutation", duration=1.0), run("nutation", duration=1.0)
    other = run("nutation", duration=1.0, seed=1)
    assert first.telemetry.values.tobytes() == again.telemetry.values.tobytes()
    assert first.telemetry.values.tobytes() != other.telemetry.values.tobytes()


def test_chunks_change_nothing(monkeypatch):
    whole = run("nutation", duration=0.5)
    monkeypatch.setattr(simulations, "CHUNK_STEPS", 14)
    assert run("nutation", duration=0.5).telemetry.values.tobytes() == whole.telemetry.values.tobytes()


@pytest.mark.parametrize("name", ["pd", "adaptive_fuzzy", "afsm"])
def test_compiled_and_uncompiled_loop_agree(name, monkeypatch):
    overrides = {"controller__law": name, "duration": 0.1}
    compiled = run("nutation", **overrides)
    monkeypatch.setattr(
        machines,
        "dispatch",
        lambda law, allocate, estimate, **options: Functions(
            loops.loop.py_func, law.step, allocate, estimate, ()
        ),
    )
    plain = run("nutation", **overrides)
    # Fused multiply-adds round once where Python rounds twice. Where sgn(s) first flips, a rounding may
    # decide its tick; up to there the traces differ by rounding alone.
    rows = 100
    if name == "afsm":
        flips = np.flatnonzero(np.any(np.diff(np.sign(compiled.telemetry["sliding_s"]), axis=0), axis=1))
        rows = flips[0] if len(flips) else rows
    assert rows >= 20
    np.testing.assert_allclose(
        plain.telemetry.values[:rows], compiled.telemetry.values[:rows], rtol=1e-9, atol=1e-12
    )
    # A flip a tick apart moves the angle by J^-1 torque T²/2, some 1e-5 rad.
    np.testing.assert_allclose(largest_error(plain), largest_error(compiled), atol=1e-4)


def proportional(t, reference, measurement, parameters, state, torque):
    state[0] += 1  # calls
    for axis in range(3):
        error, rate = measurement[0, axis] - reference[0, axis], measurement[1, axis] - reference[1, axis]
        torque[axis] = -parameters[0] * error - parameters[1] * rate


def user_law(step):
    calls = (Signal("calls", "1", 1, "calls so far"),)
    return Law("mine", step, np.array([0.5, 0.05]), np.zeros(1), calls)


def test_a_plain_python_law_runs_as_a_compiled_one_does():
    plain = run("hold", user_law(proportional), duration=0.3)
    fast = run("hold", user_law(numba.njit(proportional)), duration=0.3)
    np.testing.assert_array_equal(plain.telemetry["calls"], np.arange(1, 301))
    np.testing.assert_allclose(plain.telemetry.values, fast.telemetry.values, rtol=1e-9, atol=1e-12)
    # 0.05 N·m of load against 0.5 N·m/rad of stiffness.
    np.testing.assert_allclose(plain.telemetry["error_rad"][-1], -0.1, atol=0.01)


def test_the_law_s_state_is_not_shared_between_runs(actuator):
    scenario = scenarios.load("hold", {"duration": 0.1})
    law = scenario.controller.build(NominalModel(1e-3, 0.0, actuator.inertia))
    first, again = simulate(scenario, law=law), simulate(scenario, law=law)
    np.testing.assert_array_equal(first.telemetry.values, again.telemetry.values)
    np.testing.assert_array_equal(law.state, 0)


def test_leaving_the_workspace_ends_the_run_and_keeps_it():
    finished = run("sinusoid", controller__law="pd", disturbance__load=5.0)
    assert finished.status == "left_workspace"
    assert 0 < len(finished.telemetry) < finished.scenario.ticks
    assert np.abs(finished.telemetry["q_rad"][:, :2]).max() <= np.radians(80)


def test_a_law_that_loses_its_number_ends_the_run_and_keeps_it():
    def lost(t, reference, measurement, parameters, state, torque):
        torque[:] = 0.0 if t < 0.05 else np.nan

    finished = simulate(scenarios.load("hold"), law=Law("lost", lost, np.zeros(0), np.zeros(0)))
    assert finished.status == "diverged"
    assert len(finished.telemetry) == 50
    assert np.all(np.isfinite(finished.telemetry.values))


def test_stop_request_keeps_what_was_computed():
    asked = iter([False, False, True])
    session = Session(scenarios.load("nutation"))
    assert follow(session, 5000, [], stop_requested=lambda: next(asked)) == "interrupted"
    assert session.tick == simulations.CHUNK_STEPS
    assert session.status == "running"


def test_sinks_are_handed_every_row_once():
    seen = []

    class Collector:
        def write(self, rows):
            seen.append(rows.values.copy())

        def finish(self, status):
            endings.append(status)

    endings = []
    finished = simulate(scenarios.load("hold"), sinks=[Collector()])
    assert endings == ["completed"]
    np.testing.assert_array_equal(np.concatenate(seen), finished.telemetry.values)


def test_live_keeps_pace_with_the_clock():
    import time

    started = time.perf_counter()
    session = Session(scenarios.load("hold"))
    follow(session, 300, [], live=True)
    assert time.perf_counter() - started >= 0.3
    assert session.loop_s < 0.3


def test_scenario_is_resolved_from_the_model(nutation):
    assert nutation.scenario.drive.current_limit_A == 8.0
    assert nutation.scenario.drive.time_constant_s == pytest.approx(0.9e-3 / 1.3)


def test_current_lags_its_command_by_the_time_constant():
    # A step of command at t = 0 from zero current: after n physics steps, 1 - exp(-n h / T).
    scenario = scenarios.load("hold", {"duration": 0.002, "controller.law": "pd"})
    table = simulate(scenario).telemetry
    command, mean = table["current_command_A"][0], table["current_A"][0]
    h, T = scenario.plant.step_s, 0.9e-3 / 1.3
    share = 1 - (T / h) * (1 - np.exp(-h / T))
    np.testing.assert_allclose(mean, share * command, rtol=1e-12)


def raising(t, reference, measurement, parameters, state, torque):
    torque[:2] = 0.0
    if t > 0.02:
        raise ValueError("lost")
    torque[2] = 0.0


@pytest.mark.parametrize("step", [raising, numba.njit(raising)], ids=["plain", "compiled"])
def test_a_law_that_raises_is_never_taken_for_one_that_works(step):
    law = Law("raising", step, np.zeros(0), np.zeros(0))
    if step is raising:
        with pytest.raises(ValueError, match="lost"):
            simulate(scenarios.load("hold"), law=law)
    else:
        finished = simulate(scenarios.load("hold"), law=law)
        assert (finished.status, len(finished.telemetry)) == ("diverged", 21)
        assert str(finished.law_error) == (
            "law raising: expected a torque at 0.021 s, received ValueError: lost"
        )


def silent(t, reference, measurement, parameters, state, torque):
    pass


def scribbling(t, reference, measurement, parameters, state, torque):
    torque[:] = 0.0
    reference[:] = 7.0
    measurement[:] = 7.0


def test_a_law_that_writes_no_torque_ends_the_run():
    law = Law("silent", numba.njit(silent), np.zeros(0), np.zeros(0))
    finished = simulate(scenarios.load("hold"), law=law)
    assert (finished.status, len(finished.telemetry)) == ("diverged", 0)


def test_a_law_cannot_change_what_is_logged():
    scenario, law = scenarios.load("hold", {"duration": 0.05}), Law("s", scribbling, [], [])
    first, again = simulate(scenario, law=law), simulate(scenario, law=law)
    np.testing.assert_array_equal(first.telemetry["q_ref_rad"], np.tile([0.2, -0.1, 0.3], (50, 1)))
    np.testing.assert_array_equal(first.telemetry.values, again.telemetry.values)


@pytest.mark.parametrize(
    ("changes", "part"),
    [
        ({"signals": (Signal("mine", "1", 3, ""),)}, "at most 1 numbers"),
        ({"signals": (Signal("q_rad", "1", 1, ""),)}, "q_rad"),
        ({"parameters": np.zeros((2, 2))}, "one-dimensional"),
    ],
)
def test_a_law_whose_parts_do_not_fit_is_bad_input(changes, part):
    parts = {"parameters": np.zeros(2), "state": np.zeros(1), "signals": ()} | changes
    with pytest.raises(InputError, match=part):
        Law("mine", silent, **parts)


def test_a_law_of_another_signature_is_bad_input():
    law = Law("mine", numba.njit(lambda t, torque: None), np.zeros(0), np.zeros(0))
    with pytest.raises(InputError, match="that numba compiles") as caught:
        simulate(scenarios.load("hold"), law=law)
    assert "\n" not in str(caught.value)


def test_growing_random_torque_of_bound_zero_is_none():
    finished = run("hold", disturbance__gamma_envelope="growing", duration=0.1)
    np.testing.assert_array_equal(finished.telemetry["disturbance_Nm"], 0.05)
    with pytest.raises(InputError, match="finite disturbance"):
        run("hold", disturbance__gamma_envelope="growing", disturbance__random_bound_Nm=0.05, duration=300.0)


def test_bounded_allocation_completes_what_scaled_currents_cannot(sinusoid, actuator):
    scaled = sinusoid["pd", 2.0]
    assert scaled.status == "left_workspace"
    bounded = run("sinusoid", controller__law="pd", disturbance__load=2.0, allocation="bounded")
    assert bounded.status == "completed"
    table = bounded.telemetry
    assert np.abs(table["current_command_A"]).max() <= 8.0
    # Up to the first tick at which the least-norm currents met the limit, the runs are the same.
    first = np.argmax(scaled.telemetry["allocation_scale"] < 1)
    assert first > 1000
    np.testing.assert_array_equal(table["q_rad"][:first], scaled.telemetry["q_rad"][:first])
    for row in range(first - 5, first + 50):
        q = table["q_rad"][row]
        torque_q = rate_jacobian(q).T @ torque_matrix(q, actuator) @ table["current_command_A"][row]
        wanted = table["allocation_scale"][row] * table["torque_command_Nm"][row]
        np.testing.assert_allclose(torque_q, wanted, atol=1e-11)
