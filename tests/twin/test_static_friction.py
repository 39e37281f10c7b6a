"""Static friction and cable in the loop: telemetry, energy, state, events, replay, both engines."""

import numpy as np
import pytest

from spheretwin import scenario as scenarios
from spheretwin.linear import linearise
from spheretwin.models.lagrangian import inertia_matrix
from tests.twin.passive_cases import ENGINES, FREE, STILL, session, table
from tests.twin.plant.motions import kinetic_J

COULOMB_Nm, BREAK_AWAY = np.array([2e-3, 3e-3, 4e-3]), 1.5
STICTION = {"plant.stiction.on": True, "plant.coulomb_Nm": COULOMB_Nm.tolist()}
STIFFNESS_Nm_rad = BREAK_AWAY * COULOMB_Nm / 0.75e-3
SPRING_Nm_rad, NEUTRAL_rad = np.array([[0.05, 0.03, 0.02], [0.1, -0.1, 0.3]])
CONSTANT_Nm = np.array([1e-3, 0, -2e-3])
CABLE = {
    "plant.cable.stiffness_Nm_rad": SPRING_Nm_rad.tolist(),
    "plant.cable.neutral_rad": NEUTRAL_rad.tolist(),
    "plant.cable.torque_Nm": CONSTANT_Nm.tolist(),
}
HYSTERESIS = {"plant.cable.hysteresis_Nm": [1e-3, 1e-3, 1e-3], "plant.cable.hysteresis_rad": 0.02}
BOTH = STICTION | CABLE | HYSTERESIS | {"plant.viscous_Nm_s": [1e-4, 1e-4, 1e-4]}


COMPILES = pytest.mark.release("compiles loops for 19 s; test_bristle_friction.py has the elements")


@COMPILES
@pytest.mark.parametrize("engine", ENGINES)
def test_a_cable_swings_the_rotor_about_its_neutral_pose(engine, actuator):
    """Hinge γ of the upright rotor: a harmonic oscillation about the equilibrium."""
    changes = STILL | {"plant.engine": engine, "controller.period_s": 5e-4}
    changes |= {"plant.cable.stiffness_Nm_rad": [0.0, 0.0, 0.05], "plant.cable.neutral_rad": [0.0, 0.0, 0.2]}
    run = table(8000, "hold", changes | {"plant.cable.torque_Nm": [0.0, 0.0, 5e-3]}, FREE)
    natural, rest = np.sqrt(0.05 / actuator.inertia[2]), 0.2 + 5e-3 / 0.05
    exact = rest * (1 - np.cos(natural * run["t_s"]))
    # The explicit midpoint is early by (natural h)²/24 of the phase of 19 rad in 4 s, times the amplitude.
    bound = 2 * rest * (natural * 5e-4) ** 2 / 24 * natural * 4
    assert np.abs(run["q_rad"][:, 2] - exact).max() < bound
    # No energy is lost or gained: the last swings are as wide as the first.
    assert run["q_rad"][-3000:, 2].max() == pytest.approx(run["q_rad"][:3000, 2].max(), rel=1e-5)
    middle = run["q_rad"][:, 2] + 0.5 * 5e-4 * run["qdot_rad_s"][:, 2]
    np.testing.assert_allclose(run["cable_Nm"][:, 2], 5e-3 - 0.05 * (middle - 0.2), rtol=0, atol=1e-16)
    assert not run["cable_Nm"][:, :2].any()


@pytest.mark.uncompiled
@pytest.mark.parametrize("engine", ENGINES)
def test_the_rows_account_for_the_energy_of_friction_and_cable(engine, actuator):
    """A row each physics step: kinetic energy, and the works of all torques over the path."""

    def unbalanced_J(step_s):
        changes = STILL | BOTH | {"plant.engine": engine, "plant.initial_rad_s": [1.0, -0.8, 2.0]}
        changes |= {"plant.step_s": step_s, "controller.period_s": step_s}
        run = table(round(0.1 / step_s) + 1, "hold", changes, FREE)
        kinetic = [kinetic_J(run["q_rad"][i], run["qdot_rad_s"][i], actuator, 0.0) for i in (0, -1)]
        moved = np.diff(run["q_rad"], axis=0)
        work_J = [np.sum(run[name][:-1] * moved) for name in ("friction_Nm", "cable_Nm")]
        return kinetic[1] - kinetic[0] - sum(work_J), work_J, kinetic[0]

    left_J, work_J, first_J = unbalanced_J(5e-4)
    assert min(map(abs, work_J)) > 0.02 * first_J  # each counts here
    assert abs(left_J) < 1e-5 * first_J
    # Torques are held over each step, so that the works are nearly exact: at least second order.
    assert abs(left_J) < 0.3 * abs(unbalanced_J(1e-3)[0])


@pytest.mark.parametrize(
    "ticks", [pytest.param(150, marks=pytest.mark.uncompiled), pytest.param(1500, marks=COMPILES)]
)
def test_both_engines_agree_on_a_loop_with_static_friction_and_a_cable(ticks):
    changes = BOTH | {"controller.law": "afsm_eso"}
    one, other = (table(ticks, "tilt", changes | {"plant.engine": engine}) for engine in ENGINES)
    bounds = {"q_rad": 1e-9, "presliding_rad": 1e-9, "friction_Nm": 1e-8, "cable_Nm": 1e-10}
    for name, bound in bounds.items():
        np.testing.assert_allclose(one[name], other[name], rtol=0, atol=bound)
    assert np.abs(one["presliding_rad"]).max() > 0.6e-3
    level = BREAK_AWAY * COULOMB_Nm + 1e-4 * np.abs(one["qdot_rad_s"]).max(axis=0)
    assert np.all(np.abs(one["friction_Nm"]) <= level)
    assert np.abs(one["friction_Nm"]).max() > 0.95 * BREAK_AWAY * COULOMB_Nm[0]


def test_fields_without_effect_change_no_bit_and_add_no_column():
    coulomb = {"plant.coulomb_Nm": COULOMB_Nm.tolist()}
    idle = {"plant.stiction.presliding_rad": 0.1, "plant.cable.neutral_rad": [1.0, 1.0, 1.0]}
    plain, other = (table(300, "nutation", changes) for changes in (coulomb, coulomb | idle))
    assert [signal.name for signal in plain.signals] == [signal.name for signal in other.signals]
    np.testing.assert_array_equal(plain.values, other.values)


@COMPILES
def test_another_level_keeps_the_deflections_and_switching_off_drops_them():
    # 0.4 of break-away, at once: with an overshoot of 0.37 it remains in the elastic range.
    load_Nm = -0.4 * BREAK_AWAY * COULOMB_Nm
    changes = STILL | STICTION | {"plant.modelling_torque_Nm": load_Nm.tolist()}
    with session("hold", changes, FREE) as run:
        before = run.advance(2000)["presliding_rad"][-1]
        np.testing.assert_allclose(before, -load_Nm / STIFFNESS_Nm_rad, rtol=1e-9)
        run.set("plant.coulomb_Nm", (2 * COULOMB_Nm).tolist())
        after = run.advance(2000)["presliding_rad"]
        # Twice as stiff: half of the deflection remains, without a jump.
        np.testing.assert_allclose(after[0], before, rtol=0, atol=2e-6)
        np.testing.assert_allclose(after[-1], 0.5 * before, rtol=1e-6)
        run.set("plant.stiction.on", False)
        assert "presliding_rad" not in {signal.name for signal in run.advance(10).signals}
        run.set("plant.stiction.on", True)
        assert np.abs(run.advance(1)["presliding_rad"]).max() < 1e-5


def test_the_linear_model_has_the_spring_and_the_torque_of_the_cable(actuator):
    scenario, pose = scenarios.load("hold", STILL | CABLE), np.array([0.2, -0.1, 0.4])
    bare = linearise(scenarios.load("hold", STILL), pose)
    model = linearise(scenario, pose)
    M = inertia_matrix(pose, actuator.inertia)
    # Currents are commanded for a torque: the nominal model is the true one, so a command has no stiffness.
    stiffness = M @ (model.system.A - bare.system.A)[3:, :3]
    np.testing.assert_allclose(stiffness, -np.diag(SPRING_Nm_rad), rtol=0, atol=1e-12)
    torque_Nm = SPRING_Nm_rad * (pose - NEUTRAL_rad) - CONSTANT_Nm
    np.testing.assert_allclose(model.input_at_rest - bare.input_at_rest, torque_Nm, rtol=0, atol=1e-12)
    plants = (scenarios.load("hold", STILL), scenario)
    np.testing.assert_array_equal(*(linearise(each, pose, nominal=True).system.A for each in plants))
