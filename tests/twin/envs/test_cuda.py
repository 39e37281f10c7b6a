"""Environments on a GPU: in numba's simulator, against those of the processor."""

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

from spheretwin.envs import STATUS, CudaVectorEnv, TwinVectorEnv, vector_environment
from spheretwin.models.base import cuda
from spheretwin.models.base.errors import InputError

SIMULATED = pytest.mark.uncompiled
PLANTS, TICKS = 3, 6
CHANGES = {"plant.coulomb_Nm": [2e-3] * 3, "plant.viscous_Nm_s": [1e-4] * 3, "disturbance.load": 1.0}
AXES = ({"kind": "uniform", "field": "plant.payload_kg", "low": 0.0, "high": 0.1},)
SETTINGS = {"variants": 3, "episode_s": TICKS * 1e-3, "changes": CHANGES, "axes": AXES}
NAMES = ("observations", "rewards", "terminations", "truncations")


@SIMULATED
@pytest.mark.parametrize("actions", ["torque", "current"])
@pytest.mark.parametrize(("autoreset_mode", "episodes"), [("NextStep", 2), ("Disabled", 1)])
def test_episodes_are_those_of_the_processor(actions, autoreset_mode, episodes):
    settings = {**SETTINGS, "actions": actions, "autoreset_mode": autoreset_mode}
    here, there = (
        gymnasium.make_vec("spheretwin/Track-v0", num_envs=PLANTS, device=device, **settings)
        for device in ("cpu", "cuda")
    )
    assert isinstance(there.unwrapped, CudaVectorEnv)
    first, again = here.reset(seed=4), there.reset(seed=4)
    np.testing.assert_array_equal(again[0], first[0])
    np.testing.assert_array_equal(again[1]["variant"], first[1]["variant"])
    generator, ends = np.random.default_rng(), 0
    for _ in range(episodes * (TICKS + 1) - 1):
        given = generator.uniform(-1.2, 1.2, here.action_space.shape)
        *results, infos = here.step(given)
        *others, other_infos = there.step(given)
        for name, result, other in zip(NAMES, results, others, strict=True):
            # Lanes and a single plant sum in another order.
            np.testing.assert_allclose(other, result, rtol=1e-6, atol=1e-12, err_msg=name)
        np.testing.assert_allclose(other_infos["reward_terms"], infos["reward_terms"], rtol=1e-9, atol=1e-12)
        if "status" in infos:
            ends += 1
            assert [STATUS[code] for code in other_infos["code"]] == infos["status"].tolist()
            for name in ("max_error_rad", "rms_error_rad"):
                np.testing.assert_allclose(other_infos[name], infos[name], rtol=1e-9)
    assert ends == episodes


@SIMULATED
def test_an_episode_that_leaves_the_workspace_is_terminated_and_starts_anew():
    falling = {"episode_s": 0.1, "changes": {"plant.initial_rad": [0.0, 1.3, 0.0]}, "variants": 1}
    settings = {**falling, "torque_limit_Nm": 100.0}
    here, there = TwinVectorEnv(2, "Hold", **settings), CudaVectorEnv(2, "Hold", **settings)
    push = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 0.0]])
    start = here.reset(seed=1)[0]
    there.reset(seed=1)
    terminated = []
    for _ in range(30):
        results, others = here.step(push), there.step(push)
        np.testing.assert_array_equal(others[2], results[2])
        np.testing.assert_allclose(others[1], results[1], rtol=1e-9)
        terminated.append(others[2].copy())
        if len(terminated) > 1 and terminated[-2][0]:
            np.testing.assert_array_equal(others[0][0], start[0])
    assert np.any(terminated, axis=0).tolist() == [True, False]


@SIMULATED
@pytest.mark.parametrize("one", [np.float32, np.float64])
def test_actions_of_both_precisions_are_taken(one):
    env = CudaVectorEnv(1, **SETTINGS)
    env.reset(seed=0)
    # 0.25 is the same number in both.
    observations = env.step(np.full((1, 3), 0.25, one))[0].copy()
    other = TwinVectorEnv(1, **SETTINGS)
    other.reset(seed=0)
    np.testing.assert_allclose(observations, other.step(np.full((1, 3), 0.25))[0], rtol=1e-6)


@SIMULATED
@pytest.mark.parametrize(
    ("actions", "message"),
    [
        (np.zeros((2, 3)), r"expected actions of shape \(1, 3\).* received \(2, 3\) of float64"),
        (np.zeros((1, 3), np.int64), r"of single or double precision, received \(1, 3\) of int64"),
        ("none", "received"),
        ([[0.0, np.nan, 0.0]], "expected finite actions, received others for plant 0"),
    ],
    ids=["shape", "type", "text", "not finite"],
)
def test_other_actions_are_refused(actions, message):
    env = CudaVectorEnv(1, **SETTINGS)
    env.reset(seed=0)
    with pytest.raises(InputError, match=message):
        env.step(actions)


@SIMULATED
def test_an_episode_does_not_start_in_the_step_in_which_another_ends():
    with pytest.raises(InputError, match="NextStep or Disabled on a GPU, received SameStep"):
        CudaVectorEnv(1, autoreset_mode=AutoresetMode.SAME_STEP, **SETTINGS)


def test_another_device_is_refused():
    with pytest.raises(InputError, match="expected device cpu or cuda, received 'tpu'"):
        vector_environment(1, "tpu")


def test_names_the_extra_that_is_missing(monkeypatch):
    monkeypatch.setattr(cuda, "find_spec", lambda name: None)
    monkeypatch.setattr(cuda, "check_gpu", cuda.check_gpu.__wrapped__)
    with pytest.raises(InputError, match="cuda: expected numba-cuda, which the extra gpu installs"):
        vector_environment(1, "cuda")
