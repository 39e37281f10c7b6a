"""What the controller knows and what the plant is: each may differ from the other, and only as it says."""

import shutil

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from spheretwin.control.law import Law
from spheretwin.models import actuator as actuators
from spheretwin.models.kinematics import rate_jacobian, rotation, rotor_rate_jacobian
from spheretwin.models.lagrangian import gravity_torque, loaded_inertia
from spheretwin.models.magnetics import torque_matrix
from spheretwin.twin import scenario as scenarios
from spheretwin.twin.session import Session

ENGINES = ("mujoco", "lagrangian")
PAYLOAD_KG = 0.05
# Nothing acts but what a test adds.
STILL = {
    "disturbance.load": 0.0, "disturbance.random_bound_Nm": 0.0,
    "plant.modelling_error": 0.0, "plant.modelling_torque_Nm": [0.0, 0.0, 0.0],
}  # fmt: skip
PD = STILL | {"controller.law": "pd"}


def session(name="sinusoid", changes=None, law=None):
    return Session(scenarios.load(name, changes), law)


def table(ticks, name="sinusoid", changes=None, law=None):
    return session(name, changes, law).advance(ticks)


def letting_go(t, reference, measurement, parameters, state, torque):
    torque[:] = 0.0


FREE = Law("free", letting_go, [], [])


# --- the nominal torque matrix


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("scale", [2.0, 0.5, 4.0, -1.0])
def test_a_scale_of_the_nominal_matrix_divides_the_currents(engine, scale):
    changes = {"plant.engine": engine}
    true = table(1, "hold", changes | PD)
    assumed = table(1, "hold", changes | PD | {"nominal.torque_scale": scale})
    assert true["allocation_scale"][0] == assumed["allocation_scale"][0] == 1
    # A power of two moves exponents alone: not one bit of a mantissa.
    np.testing.assert_array_equal(assumed["current_command_A"][0], true["current_command_A"][0] / scale)
    np.testing.assert_array_equal(assumed["torque_command_Nm"], true["torque_command_Nm"])
    np.testing.assert_array_equal(assumed["torque_Nm"][0], true["torque_Nm"][0] / scale)


def test_a_scale_that_is_no_power_of_two_divides_to_rounding():
    true = table(1, "hold", PD)["current_command_A"][0]
    for scale in (0.7, 1.1, 3.0):
        assumed = table(1, "hold", PD | {"nominal.torque_scale": scale})["current_command_A"][0]
        # Some hundred products and sums round, at currents below 1 A.
        np.testing.assert_allclose(assumed, true / scale, rtol=0, atol=1e-14)


def test_a_scale_and_a_stiffness_are_the_same_to_a_pd_law():
    # The plant gets 1/k of the torque asked for, so PD with k times its gains is as PD without.
    changes = {"controller.stiffness": 100.0, "controller.damping": 40.0}
    true, assumed = table(2000, changes=PD), table(2000, changes=PD | changes | {"nominal.torque_scale": 2.0})
    np.testing.assert_array_equal(assumed["allocation_scale"], 1)
    np.testing.assert_array_equal(assumed["q_rad"], true["q_rad"])


def test_a_weaker_or_stronger_actuator_than_assumed_tracks_otherwise():
    error = {
        scale: np.abs(table(2000, changes=PD | {"nominal.torque_scale": scale})["error_rad"]).max()
        for scale in (0.5, 1.0, 2.0)
    }
    assert error[2.0] > 1.2 * error[1.0]  # half the torque asked for
    assert error[0.5] < error[1.0] / 1.2


@pytest.mark.parametrize("law", ["pd", "adaptive_fuzzy", "afsm"])
@pytest.mark.parametrize("engine", ENGINES)
def test_a_wrong_sign_loses_the_rotor(engine, law):
    changes = {"nominal.torque_scale": -1.0, "controller.law": law, "plant.engine": engine}
    lost = session("sinusoid", changes)
    assert len(lost.advance(1000)) < 200
    assert lost.status == "left_workspace"


@pytest.mark.parametrize("law", ["adaptive_fuzzy", "afsm"])
def test_a_wrong_sign_may_spin_the_rotor_instead(law):
    # The third hinge has no end, and a rotor that spins keeps its axis.
    run = table(1000, "hold", {"nominal.torque_scale": -1.0, "controller.law": law})
    assert len(run) == 1000
    assert np.abs(run["qdot_rad_s"][-1, 2]) > 200
    assert np.abs(run["error_rad"][-1, 2]) > 100


def written(path, curve, factor=1.0):
    pairs = zip(np.degrees(curve.phi_rad).tolist(), (factor * curve.torque_Nm_per_A).tolist(), strict=True)
    path.write_text("\n".join(["phi_deg,torque_Nm_per_A", *(f"{phi!r},{torque!r}" for phi, torque in pairs)]))
    return str(path)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_nominal_curve_of_the_same_content_changes_no_byte(engine, tmp_path):
    path = shutil.copy(actuators.TORQUE_CURVE_PATH, tmp_path / "same.csv")
    changes = {"plant.engine": engine}
    one = table(800, changes=changes)
    other = table(800, changes=changes | {"nominal.torque_curve": str(path)})
    assert one.values.tobytes() == other.values.tobytes()


def test_a_nominal_curve_of_half_the_torque_is_a_scale_of_a_half(actuator, tmp_path):
    half = written(tmp_path / "half.csv", actuator.torque_curve, 0.5)
    by_curve = table(300, changes=PD | {"nominal.torque_curve": half})
    by_scale = table(300, changes=PD | {"nominal.torque_scale": 0.5})
    # Samples are halved without rounding; the spline through them rounds anew.
    np.testing.assert_allclose(by_curve.values, by_scale.values, rtol=1e-9, atol=1e-12)
    assert not np.array_equal(by_curve["q_rad"], table(300, changes=PD)["q_rad"])


# --- nominal inertia, currents


@pytest.mark.parametrize("law", ["pd", "adaptive_fuzzy", "afsm"])
def test_the_nominal_inertia_scales_what_the_law_asks_for(law, actuator):
    changes = STILL | {"controller.law": law}
    true = table(1, "hold", changes)["torque_command_Nm"][0]
    factors = np.array([2.0, 0.5, 4.0])
    assumed = {"nominal.inertia_kg_m2": (factors * actuator.inertia).tolist()}
    np.testing.assert_array_equal(table(1, "hold", changes | assumed)["torque_command_Nm"][0], factors * true)
    as_torque = {"controller.level": "torque"}
    np.testing.assert_array_equal(
        table(1, "hold", changes | as_torque | assumed)["torque_command_Nm"],
        table(1, "hold", changes | as_torque)["torque_command_Nm"],
    )


@pytest.mark.parametrize("allocation", ["least_norm", "bounded"])
def test_the_lower_of_two_limits_binds(allocation):
    changes = {"allocation": allocation}
    low = table(300, "hold", changes | {"nominal.current_limit_A": 0.3})
    assert np.abs(low["current_command_A"]).max() == 0.3
    assert np.any(low["allocation_scale"] < 1)
    unknown = changes | PD | {"nominal.current_limit_A": 100.0, "drive.current_limit_A": 0.2}
    high = table(300, "hold", unknown)
    assert np.abs(high["current_command_A"]).max() > 0.25
    np.testing.assert_array_equal(high["allocation_scale"], 1)  # the controller does not know of the limit
    assert 0.19 < np.abs(high["current_A"]).max() <= 0.2
    # Without a lag each current is its command, as far as the amplifiers go.
    ideal = table(300, "hold", unknown | {"drive.time_constant_s": 0.0})
    np.testing.assert_array_equal(ideal["current_A"], np.clip(ideal["current_command_A"], -0.2, 0.2))


def test_a_limit_that_the_controller_does_not_know_cannot_be_exceeded_by_any_command():
    def huge(t, reference, measurement, parameters, state, torque):
        torque[:] = 50.0

    law = Law("huge", huge, [], [])
    pushed = table(20, "hold", STILL | {"nominal.current_limit_A": 100.0}, law)
    assert np.abs(pushed["current_command_A"]).max() == 100.0
    assert 7.9 < np.abs(pushed["current_A"]).max() <= 8.0


# --- the true torque


GAIN = np.linspace(0.0, 1.7, 18)


@pytest.mark.parametrize("engine", ENGINES)
def test_torque_is_that_of_the_currents_times_their_gains(engine, actuator):
    run = table(600, changes={"plant.engine": engine, "plant.group_gain": GAIN.tolist()})
    for row in range(0, 600, 7):
        G = torque_matrix(run["q_rad"][row], actuator)
        # The same 18 products and sums in another order, of torques below 1 N·m.
        np.testing.assert_allclose(
            run["torque_Nm"][row], G @ (GAIN * run["current_A"][row]), rtol=0, atol=1e-14
        )
    bare = torque_matrix(run["q_rad"][300], actuator) @ run["current_A"][300]
    assert np.abs(bare - run["torque_Nm"][300]).max() > 1e-3


def test_an_open_group_is_one_that_the_controller_does_not_know_of():
    open_group = [0.0] + 17 * [1.0]
    kept, broken = table(400), table(400, changes={"plant.group_gain": open_group})
    np.testing.assert_array_equal(broken["current_command_A"][0], kept["current_command_A"][0])
    assert np.abs(broken["current_command_A"][:, 0]).max() > 0.01
    assert not np.array_equal(broken["q_rad"], kept["q_rad"])
    none = table(30, "hold", STILL | {"plant.group_gain": 18 * [0.0]})
    np.testing.assert_array_equal(none["torque_Nm"], 0)
    np.testing.assert_array_equal(none["q_rad"], 0)


# --- sensors

OFFSET = np.array([0.02, -0.03, 0.05])
ASKEW = {"sensors.angle_offset_rad": OFFSET.tolist()}


@pytest.mark.parametrize("engine", ENGINES)
def test_the_rotor_rests_where_the_sensors_see_no_error(engine):
    stiff = {"controller.stiffness": 900.0, "controller.damping": 60.0, "plant.engine": engine}
    run = table(3000, "hold", PD | ASKEW | stiff)
    # Critically damped at 30 1/s: after 3 s the start is gone to exp(-90) of 0.3 rad.
    np.testing.assert_allclose(run["error_rad"][-1], -OFFSET, rtol=0, atol=1e-14)
    np.testing.assert_allclose(run["q_measured_rad"][-1], run["q_ref_rad"][-1], rtol=0, atol=1e-14)


def test_measured_columns_are_what_the_controller_has():
    run = table(500, changes=ASKEW)
    np.testing.assert_array_equal(run["q_measured_rad"], run["q_rad"] + OFFSET)
    np.testing.assert_array_equal(run["qdot_estimated_rad_s"], run["qdot_rad_s"])
    np.testing.assert_array_equal(run["error_rad"], run["q_rad"] - run["q_ref_rad"])
    s = 50 * (run["q_measured_rad"] - run["q_ref_rad"]) + run["qdot_rad_s"] - run["qdot_ref_rad_s"]
    np.testing.assert_allclose(run["sliding_s"], s, rtol=0, atol=1e-13)  # of some 10 rad/s


def test_measured_columns_are_there_only_where_they_differ():
    def names(changes):
        return [signal.name for signal in session(changes=changes).signals]

    for changes in ({}, {"sensors.angle_offset_rad": [0.0, 0.0, 0.0]}):
        assert not {"q_measured_rad", "qdot_estimated_rad_s"} & set(names(changes))
    for axis in range(3):
        offset = [0.0, 0.0, 0.0]
        offset[axis] = 1e-6
        assert {"q_measured_rad", "qdot_estimated_rad_s"} <= set(names({"sensors.angle_offset_rad": offset}))


@pytest.mark.parametrize("scale", [1.0, 0.8])
@pytest.mark.parametrize("allocation", ["least_norm", "bounded"])
def test_currents_are_allocated_at_the_measured_pose_by_the_nominal_matrix(allocation, scale, actuator):
    changes = {"allocation": allocation, "nominal.torque_scale": scale, "nominal.current_limit_A": 0.1}
    run = table(800, "hold", PD | ASKEW | changes)
    assert len(run) == 800
    assert 0 < np.count_nonzero(run["allocation_scale"] < 1) < 800
    for row in range(0, 800, 7):
        seen, command = run["q_measured_rad"][row], run["current_command_A"][row]
        wanted = run["allocation_scale"][row] * run["torque_command_Nm"][row]
        torque = rate_jacobian(seen).T @ (scale * torque_matrix(seen, actuator)) @ command
        np.testing.assert_allclose(torque, wanted, rtol=0, atol=1e-11)  # as in a run with ideal sensors
    q = run["q_rad"][50]
    at_the_true_pose = rate_jacobian(q).T @ (scale * torque_matrix(q, actuator))
    wanted = run["allocation_scale"][50] * run["torque_command_Nm"][50]
    assert np.abs(at_the_true_pose @ run["current_command_A"][50] - wanted).max() > 1e-4


def test_coils_pull_at_the_true_pose(actuator):
    run = table(500, changes=ASKEW)
    for row in range(0, 500, 13):
        torque = torque_matrix(run["q_rad"][row], actuator) @ run["current_A"][row]
        np.testing.assert_allclose(run["torque_Nm"][row], torque, rtol=0, atol=1e-14)


# --- gravity and rates at the start


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("gravity", [0.0, 1.62, 9.81])
def test_a_payload_falls_as_a_pendulum(engine, gravity, actuator):
    changes = STILL | {
        "plant.engine": engine, "plant.payload_kg": PAYLOAD_KG, "plant.gravity_m_s2": gravity,
        "plant.initial_rad": [0.1, 0.0, 0.0], "plant.initial_rad_s": [0.5, 0.0, 0.0],
    }  # fmt: skip
    run = table(301, "hold", changes, FREE)
    height = actuator.payload_mount_m[2]
    inertia = actuator.inertia[0] + PAYLOAD_KG * height**2

    def flow(_, state):
        return [state[1], PAYLOAD_KG * gravity * height / inertia * np.sin(state[0])]

    exact = solve_ivp(flow, (0, 0.3), [0.1, 0.5], "DOP853", t_eval=run["t_s"], rtol=1e-13, atol=1e-14).y
    # RK4 of half a millisecond at some 5 1/s: (5 * 5e-4)^4 / 120 a unit of growth.
    np.testing.assert_allclose(run["q_rad"][:, 0], exact[0], rtol=0, atol=1e-11)
    np.testing.assert_allclose(run["qdot_rad_s"][:, 0], exact[1], rtol=0, atol=1e-10)
    np.testing.assert_allclose(run["q_rad"][:, 1:], 0, atol=1e-14)
    if gravity == 0:
        np.testing.assert_allclose(run["q_rad"][:, 0], 0.1 + 0.5 * run["t_s"], rtol=0, atol=1e-13)


def test_without_gravity_a_payload_does_not_sag(actuator):
    loaded = {"plant.payload_kg": PAYLOAD_KG, "controller.stiffness": 400.0}
    floating = table(4000, "hold", PD | loaded | {"plant.gravity_m_s2": 0.0})
    # The slower of the two poles, without the payload's 20 % of inertia, is some 10 1/s.
    np.testing.assert_allclose(floating["error_rad"][-1], 0, atol=1e-12)
    heavy = table(4000, "hold", PD | loaded)
    sag = gravity_torque(heavy["q_rad"][-1], PAYLOAD_KG * 9.81 * actuator.payload_mount_m[2])
    np.testing.assert_allclose(heavy["error_rad"][-1] * 400 * actuator.inertia, -sag, rtol=0, atol=1e-12)
    assert np.abs(sag).max() > 0.005


@pytest.mark.parametrize("engine", ENGINES)
def test_a_run_begins_at_the_rates_that_are_given(engine):
    rates = [0.3, -0.2, 4.0]
    run = table(1, "hold", {"plant.initial_rad_s": rates, "plant.engine": engine})
    np.testing.assert_array_equal(run["qdot_rad_s"][0], rates)
    spinning = table(500, "hold", STILL | {"plant.initial_rad_s": [0, 0, 4.0], "plant.engine": engine}, FREE)
    # A principal axis, without torque: a steady rate. A thousand sums of 2e-3 rad round up to 2 rad.
    np.testing.assert_allclose(spinning["q_rad"][:, 2], 4.0 * spinning["t_s"], rtol=0, atol=1e-13)
    np.testing.assert_allclose(spinning["q_rad"][:, :2], 0, atol=1e-15)


# --- friction in the loop


@pytest.mark.parametrize("engine", ENGINES)
def test_viscous_friction_slows_a_spin_by_one_share_a_step(engine, actuator):
    viscous, step_s = 1e-3, 5e-4
    changes = STILL | {
        "plant.engine": engine, "plant.initial_rad_s": [0.0, 0.0, 20.0],
        "plant.viscous_Nm_s": [0.0, 0.0, viscous], "plant.modelling_error": 0.5,
    }  # fmt: skip
    run = table(400, "hold", changes, FREE)
    share = 1 / (1 + step_s * viscous / (1.5 * actuator.inertia[2]))
    exact = 20.0 * share ** (2 * np.arange(400))  # two steps a tick
    np.testing.assert_allclose(run["qdot_rad_s"][:, 2], exact, rtol=1e-12)  # 800 roundings
    # Taken at the rate to which the step leads.
    np.testing.assert_allclose(run["friction_Nm"][:, 2], -viscous * share * exact, rtol=1e-12)
    np.testing.assert_array_equal(run["friction_Nm"][:, :2], 0)


@pytest.mark.parametrize("field", ["plant.coulomb_Nm", "plant.viscous_Nm_s"])
def test_friction_is_logged_only_where_there_is_some(field):
    def names(changes):
        return [signal.name for signal in session(changes=changes).signals]

    assert "friction_Nm" not in names({})
    assert "friction_Nm" not in names({field: [0.0, 0.0, 0.0]})
    assert "friction_Nm" in names({field: [0.0, 0.0, 1e-9]})


def test_friction_opposes_the_motion_and_stays_below_its_level():
    coulomb, viscous = np.array([4e-3, 3e-3, 2e-3]), np.array([1e-4, 2e-4, 3e-4])
    changes = {"plant.coulomb_Nm": coulomb.tolist(), "plant.viscous_Nm_s": viscous.tolist()}
    run = table(3000, changes=changes)
    friction, rate = run["friction_Nm"], run["qdot_rad_s"]
    moving = np.abs(rate) > 0.2  # twenty times the smoothing rate
    assert moving.sum() > 3000
    assert np.all((friction * rate)[moving] < 0)
    # Of the level 1 / sqrt(1 + 1/400) at least; the rate a step later differs by some per cent.
    level = coulomb + viscous * np.abs(rate)
    assert np.all(np.abs(friction)[moving] > 0.97 * level[moving])
    assert np.all(np.abs(friction) < 1.03 * level + 1e-12)


LOADED = {
    "controller.law": "pd", "plant.payload_kg": PAYLOAD_KG, "plant.coulomb_Nm": [4e-3, 3e-3, 2e-3],
    "plant.viscous_Nm_s": [1e-4, 2e-4, 3e-4], "plant.friction_smoothing_rad_s": 0.1,
    "plant.initial_rad_s": [1.0, -2.0, 3.0], "plant.modelling_torque_Nm": [0.01, -0.01, 0.005],
}  # fmt: skip


@pytest.mark.parametrize("name", ["sinusoid", "nutation"])
def test_both_engines_agree_on_a_loop_with_friction_payload_and_gravity(name):
    changes = LOADED | {"disturbance.load": 0.5} | ASKEW
    one, other = (table(3000, name, changes | {"plant.engine": engine}) for engine in ENGINES)
    assert len(one) == 3000
    # Both take the same RK4 steps of the same equations: they differ by rounding, which PD does not amplify.
    np.testing.assert_allclose(one["q_rad"], other["q_rad"], rtol=0, atol=1e-11)
    np.testing.assert_allclose(one["qdot_rad_s"], other["qdot_rad_s"], rtol=0, atol=1e-10)
    np.testing.assert_allclose(one["friction_Nm"], other["friction_Nm"], rtol=0, atol=1e-11)
    np.testing.assert_allclose(one["current_A"], other["current_A"], rtol=0, atol=1e-9)


# --- energy


def energy_J(q, qdot, actuator, modelling_error):
    """Rotor by its body rates, payload by its velocity and height: not by any matrix of the Lagrangian."""
    w_SR_R, w_SR_S = rotor_rate_jacobian(q) @ qdot, rate_jacobian(q) @ qdot
    arm = rotation(q) @ actuator.payload_mount_m
    velocity = np.cross(w_SR_S, arm)
    kinetic = (1 + modelling_error) * w_SR_R @ (actuator.inertia * w_SR_R) + PAYLOAD_KG * velocity @ velocity
    return 0.5 * kinetic + PAYLOAD_KG * 9.81 * arm[2]


def turned(q, qdot, step_s):
    """Integral of the rotor's angular velocity over each step, by Simpson; the middle by Hermite's cubic."""
    middle = (q[:-1] + q[1:]) / 2 + step_s / 8 * (qdot[:-1] - qdot[1:])
    rate = 1.5 * np.diff(q, axis=0) / step_s - (qdot[:-1] + qdot[1:]) / 4
    w = [np.array([rate_jacobian(a) @ b for a, b in zip(q, qdot, strict=True)])]
    between = np.array([rate_jacobian(a) @ b for a, b in zip(middle, rate, strict=True)])
    return step_s / 6 * (w[0][:-1] + 4 * between + w[0][1:])


def works_J(run, step_s, unmodelled_Nm):
    """Work of coils, friction, disturbance and what is not modelled, each from the rows alone."""
    moved = np.diff(run["q_rad"], axis=0)
    return {
        "coils": np.sum(run["torque_Nm"][:-1] * turned(run["q_rad"], run["qdot_rad_s"], step_s)),
        "friction": np.sum(run["friction_Nm"][:-1] * moved),
        "disturbance": -np.sum(run["disturbance_Nm"][:-1] * moved),
        "unmodelled": -np.sum(moved @ unmodelled_Nm),
    }


def unbalanced_J(engine, step_s, actuator):
    """Energy over 0.4 s that the works do not account for, and the least of the works."""
    changes = {"plant.engine": engine, "plant.step_s": step_s, "controller.period_s": step_s}
    run = table(round(0.4 / step_s) + 1, changes=LOADED | changes | {"plant.modelling_error": 0.2})
    ends = [energy_J(run["q_rad"][i], run["qdot_rad_s"][i], actuator, 0.2) for i in (0, -1)]
    works = works_J(run, step_s, np.array(LOADED["plant.modelling_torque_Nm"]))
    return abs(ends[1] - ends[0] - sum(works.values())), min(map(abs, works.values()))


@pytest.mark.parametrize("engine", ENGINES)
def test_energy_is_kept_by_the_rows_of_the_telemetry_alone(engine, actuator):
    # A row each physics step: torques are held over it, so that their works are exact but for the turn of a
    # torque that is fixed in space, which is of fourth order, as the steps themselves are.
    steps = np.array([8e-3, 4e-3, 2e-3])
    left_J = [unbalanced_J(engine, step_s, actuator)[0] for step_s in steps]
    order = np.polyfit(np.log(steps), np.log(left_J), 1)[0]
    assert 3.7 < order < 4.3, left_J
    left_J, least_J = unbalanced_J(engine, 5e-4, actuator)
    # Measured 1e-14 J of some 20 mJ that go in and out; any of the works left out would be seen.
    assert left_J < 1e-13
    assert least_J > 1e-5


def test_the_payload_s_inertia_is_the_lagrangian_s(actuator):
    # The same kinetic energy from the inertia that the plant is built with.
    inertia = loaded_inertia(1.2 * actuator.inertia, PAYLOAD_KG, float(actuator.payload_mount_m[2]))
    q, qdot = np.array([0.3, -0.4, 0.5]), np.array([1.0, -2.0, 3.0])
    w = rotor_rate_jacobian(q) @ qdot
    lifted = PAYLOAD_KG * 9.81 * (rotation(q) @ actuator.payload_mount_m)[2]
    assert 0.5 * w @ (inertia * w) == pytest.approx(energy_J(q, qdot, actuator, 0.2) - lifted, rel=1e-14)
