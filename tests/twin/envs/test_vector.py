"""Vector environment against single steps of the plant, `simulate`, and the interface of Gymnasium."""

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode

import spheretwin as st
from spheretwin import plant
from spheretwin.envs import OBSERVATION, REWARD_TERMS, TwinEnv, TwinVectorEnv
from tests.requirements import has_opengl

FRICTION = {"plant.coulomb_Nm": [2e-3] * 3, "plant.viscous_Nm_s": [1e-4] * 3}
PARTS = {part.name: slice(3 * place, 3 * place + 3) for place, part in enumerate(OBSERVATION)}
FALLING = {"episode_s": 0.6, "changes": {"plant.initial_rad": [0.0, 1.0, 0.0]}, "variants": 1}
"""Torques up to the limit leave the workspace."""


@pytest.mark.release("2 s; changes with Gymnasium")
@pytest.mark.parametrize("task", ["Track", "Hold", "Point"])
@pytest.mark.parametrize("actions", ["torque", "current"])
def test_gymnasium_accepts_the_registered_environments(task, actions):
    made = gymnasium.make(f"spheretwin/{task}-v0", actions=actions, variants=2, episode_s=0.1)
    check_env(made.unwrapped, skip_render_check=not has_opengl())
    many = gymnasium.make_vec(f"spheretwin/{task}-v0", num_envs=3, actions=actions, variants=2, episode_s=0.1)
    observations, _ = many.reset(seed=1)
    assert observations in many.observation_space
    assert many.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP
    assert many.action_space.shape == (3, 3 if actions == "torque" else 18)


@pytest.mark.parametrize("changes", [{}, FRICTION], ids=["no friction", "friction"])
def test_an_episode_under_currents_is_that_of_simulate(tmp_path, changes):
    generator, ticks = np.random.default_rng(0), 40
    currents = generator.uniform(-3, 3, (ticks, 18))
    file = tmp_path / "currents.csv"
    header = ",".join(["t_s", *(f"current_{j:02}_A" for j in range(18))])
    rows = np.column_stack([1e-3 * np.arange(ticks), currents])
    np.savetxt(file, rows, delimiter=",", header=header, comments="", fmt="%.17g")
    common = {"seed": 5, **changes}
    fields = {"plant.engine": "lagrangian", "plant.step_s": 1e-3, "duration": ticks * 1e-3, **common}
    run = st.simulate("nutation", fields | {"manual.file": str(file)}).telemetry
    settings = {"actions": "current", "episode_s": ticks * 1e-3, "variants": 1}
    env = TwinEnv(scenario="nutation", changes=common, **settings)
    observed = [env.reset(seed=0)[0]] + [env.step(row / 8)[0] for row in currents]  # of 8 A
    assert np.abs(run["qdot_rad_s"]).max() > 1
    for name in ("q_rad", "qdot_rad_s", "error_rad"):
        values = np.array([row[PARTS[name]] for row in observed[:-1]])
        # Observations have single precision.
        np.testing.assert_allclose(values, run[name], rtol=2e-7, atol=1e-7, err_msg=name)


def test_an_episode_under_torques_is_that_of_single_steps():
    env = TwinVectorEnv(5, "Track", episode_s=0.05, changes=FRICTION | {"disturbance.load": 1.0}, variants=3)
    env.reset(seed=3)
    actions = np.random.default_rng(1).uniform(-0.6, 0.6, (30, 5, 3))
    lanes = [env.scenario_of(i) for i in range(5)]
    assert len({scenario.seed for scenario in lanes}) > 1
    for row in actions:
        observations = env.step(row)[0]
    for i, scenario in enumerate(lanes):
        run = st.simulate(scenario).telemetry
        parameters = plant.parameters(scenario)
        state = plant.State(run["q_rad"][0].copy(), run["qdot_rad_s"][0].copy())
        for tick in range(30):
            torque = run["disturbance_Nm"][tick] - 0.5 * actions[tick, i]
            state = plant.step(state, np.zeros(18), torque, parameters, 1e-3)
        for name, expected in state._asdict().items():
            np.testing.assert_allclose(observations[i, PARTS[name]], expected, rtol=2e-7, atol=1e-7)


def test_two_physics_steps_make_a_period_of_two_milliseconds():
    coarse, fine = (
        TwinVectorEnv(1, "Hold", episode_s=0.02, variants=1, changes={"disturbance.load": 0.0, **changes})
        for changes in ({"controller.period_s": 2e-3}, {})
    )
    action = np.array([[0.3, -0.2, 0.1]])
    coarse.reset()
    fine.reset()
    for _ in range(10):
        once = coarse.step(action)[0]
        fine.step(action)
        twice = fine.step(action)[0]
    np.testing.assert_array_equal(once, twice)


def test_rewards_are_the_sum_of_their_terms():
    reward = {"tracking": 2.0, "rate": 0.5, "effort": 0.25, "failure": 7.0}
    env = TwinVectorEnv(1, "Hold", variants=1, reward=reward, episode_s=1.0)
    env.reset(seed=0)
    action = np.array([[0.5, -1.9, 0.0]])
    for _ in range(3):
        observations, rewards, _, _, infos = env.step(action)
    error, rate = observations[0, :3].astype(float), observations[0, 3:6].astype(float)
    expected = [
        -2.0 * np.linalg.norm(error) / 0.1,
        -0.5 * np.linalg.norm(rate) / 10,
        -0.25 * (0.5**2 + 1.0) / 3,  # cut at the limit
        0.0,
    ]
    np.testing.assert_allclose(infos["reward_terms"][0], expected, rtol=1e-6)
    assert rewards[0] == pytest.approx(infos["reward_terms"].sum(), rel=1e-14)
    assert env.reward_terms == REWARD_TERMS == tuple(reward)


def until_an_end(env, actions):
    """Return the last step before a plant leaves its workspace."""
    for _ in range(10_000):
        result = env.step(actions)
        if result[2].any():
            return result
    raise AssertionError


def test_a_rotor_that_leaves_its_workspace_terminates_the_episode():
    env = TwinVectorEnv(1, "Hold", **FALLING)
    env.reset(seed=0)
    _, rewards, terminations, truncations, infos = until_an_end(env, np.array([[0.0, 1.0, 0.0]]))
    assert (terminations[0], truncations[0]) == (True, False)
    assert infos["status"][0] == "left_workspace"
    assert infos["reward_terms"][0, 3] == -100
    assert rewards[0] < -100


def test_a_complete_episode_is_truncated_with_its_figures():
    env, errors = TwinVectorEnv(1, "Hold", episode_s=0.05, variants=1), []
    env.reset(seed=0)
    for _ in range(50):
        observations, _, terminations, truncations, infos = env.step(np.zeros((1, 3)))
        errors.append(np.linalg.norm(observations[0, :3].astype(float)))
    assert (terminations[0], truncations[0]) == (False, True)
    assert infos["status"][0] == "completed"
    assert infos["max_error_rad"][0] == pytest.approx(max(errors), rel=1e-6)
    assert infos["rms_error_rad"][0] == pytest.approx(np.sqrt(np.mean(np.square(errors))), rel=1e-6)


PUSH = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 0.0]])


def ending(mode):
    """Environment of two plants whose first leaves the workspace long before the end, and its last step."""
    env = TwinVectorEnv(2, "Hold", mode, **FALLING)
    env.reset(seed=0)
    return env, until_an_end(env, PUSH)


def start():
    """First observation of an episode of these plants."""
    return TwinVectorEnv(1, "Hold", **FALLING).reset(seed=0)[0][0]


def test_next_step_starts_an_episode_anew_in_the_step_after_its_end():
    env, (last, _, terminations, _, _) = ending("NextStep")
    assert terminations.tolist() == [True, False]
    observations, rewards, terminations, truncations, infos = env.step(PUSH)
    np.testing.assert_array_equal(observations[0], start())
    assert not np.array_equal(last[0], start())
    assert rewards[0] == 0
    assert rewards[1] < 0
    assert not terminations.any()
    assert not truncations.any()
    assert "status" not in infos


def test_same_step_returns_the_start_and_keeps_the_last_observation():
    env, (observations, rewards, terminations, _, infos) = ending("SameStep")
    _, expected = ending("NextStep")
    np.testing.assert_array_equal(observations[0], start())
    np.testing.assert_array_equal(infos["final_obs"][0], expected[0][0])
    assert infos["_final_obs"].tolist() == [True, False]
    assert infos["final_info"]["status"][0] == "left_workspace"
    np.testing.assert_array_equal(rewards, expected[1])
    assert terminations.tolist() == [True, False]
    assert not env.step(PUSH)[2].any()


def test_disabled_holds_an_episode_until_it_is_reset():
    env, (last, *_) = ending("Disabled")
    observations, rewards, terminations, _, _ = env.step(PUSH)
    assert terminations.tolist() == [True, False]
    assert rewards[0] == 0
    env.reset(options={"reset_mask": np.array([True, False])})
    after, rewards, terminations, _, _ = env.step(PUSH)
    assert not terminations.any()
    assert rewards[0] != 0
    assert abs(after[0, 7] - 1.0) < 1e-3
    assert not np.array_equal(last[1], observations[1])


def test_the_seed_of_a_plant_alone_chooses_its_episodes():
    settings = {"variants": 16, "episode_s": 0.02}
    env = TwinVectorEnv(6, "Point", "SameStep", **settings)
    first, infos = env.reset(seed=10)
    assert len(set(infos["variant"])) > 1
    again = TwinVectorEnv(6, "Point", "SameStep", **settings)
    np.testing.assert_array_equal(again.reset(seed=10)[0], first)
    alone = TwinVectorEnv(1, "Point", "SameStep", **settings)
    np.testing.assert_array_equal(alone.reset(seed=13)[0][0], first[3])
    for _ in range(45):  # over two ends
        here, there = env.step(np.zeros((6, 3))), alone.step(np.zeros((1, 3)))
        np.testing.assert_array_equal(here[0][3], there[0][0])
    seeds = [None, 99, None, None, None, None]
    shuffled, _ = env.reset(seed=seeds)
    np.testing.assert_array_equal(shuffled[1], alone.reset(seed=99)[0][0])


def test_axes_vary_the_plants():
    axes = (
        {"kind": "uniform", "field": "plant.payload_kg", "low": 0.0, "high": 0.2},
        {"kind": "normal", "field": "plant.modelling_error", "mean": 0.0, "deviation": 0.1},
    )
    env = TwinVectorEnv(32, "Hold", axes=axes, variants=32, variants_seed=4)
    env.reset(seed=0)
    loads = [env.scenario_of(i).plant.payload_kg for i in range(32)]
    assert 0 <= min(loads) < 0.05
    assert 0.15 < max(loads) <= 0.2
    errors = np.array([env.scenario_of(i).plant.modelling_error for i in range(32)])
    assert 0.03 < errors.std() < 0.2
    for _ in range(20):
        observations = env.step(np.zeros((32, 3)))[0]
    by_load = {}
    for load, row in zip(loads, observations, strict=True):
        by_load.setdefault(load, row)
        np.testing.assert_array_equal(by_load[load], row)  # the same variant moves the same in any lane
    assert len({row.tobytes() for row in by_load.values()}) == len(by_load) > 10


def test_returned_arrays_are_not_used_again():
    env = TwinVectorEnv(2, "Hold", variants=1)
    first, _ = env.reset(seed=0)
    results = [env.step(np.zeros((2, 3))) for _ in range(2)]
    for one, other in zip(*results, strict=True):
        if isinstance(one, np.ndarray):
            assert not np.shares_memory(one, other)
    assert not np.shares_memory(first, results[0][0])
