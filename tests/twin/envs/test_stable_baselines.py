"""Adapter to Stable-Baselines3, if that is installed: it needs torch, which no other test needs."""

import numpy as np
import pytest

pytest.importorskip("stable_baselines3", reason="Stable-Baselines3 is not installed")

from spheretwin.envs import StableBaselinesEnv, TwinVectorEnv

FALLING = {
    "episode_s": 0.5,
    "changes": {"plant.initial_rad": [0.0, 1.0, 0.0], "disturbance.load": 0.0},
    "variants": 1,
}
PUSHES = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 0.0]], np.float32)


def steps_until_both_end(env, step):
    ends = {}
    for tick in range(500):
        result = step(PUSHES)
        for i in np.flatnonzero(result[2]):
            ends.setdefault(int(i), (tick, result))
        if len(ends) == 2:
            return ends
    raise AssertionError


def test_the_last_observation_and_the_time_limit_are_told_apart():
    env = StableBaselinesEnv(2, "Hold", **FALLING)
    env.seed(0)
    start = env.reset()
    ends = steps_until_both_end(env, env.step)
    (early, failed), (late, complete) = ends[0], ends[1]
    assert early < late == 499
    np.testing.assert_array_equal(failed[0][0], start[0])
    assert failed[3][0]["TimeLimit.truncated"] is False
    assert failed[3][0]["status"] == "left_workspace"
    assert complete[3][1]["TimeLimit.truncated"] is True
    assert complete[3][1]["status"] == "completed"
    other = TwinVectorEnv(2, "Hold", "Disabled", **FALLING)
    other.reset(seed=0)
    for tick in range(500):
        observations = other.step(PUSHES)[0]
        if tick == early:
            np.testing.assert_array_equal(failed[3][0]["terminal_observation"], observations[0])
    np.testing.assert_array_equal(complete[3][1]["terminal_observation"], observations[1])


def test_seeds_choose_the_episodes_once():
    env = StableBaselinesEnv(3, "Point", variants=16)
    env.seed(5)
    first = env.reset()
    np.testing.assert_array_equal(first, TwinVectorEnv(3, "Point", variants=16).reset(seed=5)[0])
    assert not np.array_equal(env.reset(), first)


def test_attributes_and_methods_are_those_of_the_vector_environment():
    env = StableBaselinesEnv(2, "Hold", variants=1)
    assert env.get_attr("num_envs", [0]) == [2]
    assert env.env_method("scenario_of", indices=1)[0].name == "hold"
    assert env.env_is_wrapped(object) == [False, False]


def test_a_training_runs():
    from stable_baselines3 import PPO

    env = StableBaselinesEnv(4, "Point", variants=4, episode_s=0.02)
    model = PPO("MlpPolicy", env, n_steps=25, batch_size=50, n_epochs=1, seed=0, device="cpu")
    before = model.policy.state_dict()["mlp_extractor.policy_net.0.weight"].clone()
    model.learn(200)
    assert model.num_timesteps == 200
    assert not before.equal(model.policy.state_dict()["mlp_extractor.policy_net.0.weight"])
