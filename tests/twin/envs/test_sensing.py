"""Noise, delay, pickles and pictures of environments."""

import pickle

import gymnasium
import mujoco
import numpy as np
import pytest

from spheretwin.envs import OBSERVATION, CudaVectorEnv, TwinEnv, TwinVectorEnv
from spheretwin.envs.picture import SIZE
from spheretwin.models.base import cuda
from spheretwin.models.base.errors import InputError
from tests.requirements import has_opengl

PARTS = {part.name: slice(3 * place, 3 * place + 3) for place, part in enumerate(OBSERVATION)}
SETTINGS = {"episode_s": 0.02, "variants": 4}
NOISE = {"angle_noise_rad": 1e-3, "rate_noise_rad_s": 0.1}


def pair(task="Track", plants=3, **sensing):
    """Environments that sense exactly and otherwise, after the same reset, and their first observations."""
    envs = TwinVectorEnv(plants, task, **SETTINGS), TwinVectorEnv(plants, task, **SETTINGS, **sensing)
    return *envs, *(env.reset(seed=5)[0] for env in envs)


def test_a_delay_shows_the_motion_of_some_periods_ago_and_the_reference_of_now():
    exact, late, first, observed = pair(delay_periods=3)
    np.testing.assert_array_equal(observed, first)
    generator, seen = np.random.default_rng(), [first]
    for _ in range(45):  # more than two episodes
        actions = generator.uniform(-1, 1, (3, 3))
        (true, rewards, *_), (shown, others, *_) = exact.step(actions), late.step(actions)
        np.testing.assert_array_equal(others, rewards)
        started = np.all(true[:, PARTS["qdot_rad_s"]] == first[:, PARTS["qdot_rad_s"]], axis=1)
        seen = [true] if started.all() else [*seen, true]
        past = seen[max(len(seen) - 4, 0)]
        for angle, error in (("q_rad", "error_rad"), ("qdot_rad_s", "error_rate_rad_s")):
            np.testing.assert_array_equal(shown[:, PARTS[angle]], past[:, PARTS[angle]])
            reference = true[:, PARTS[angle]] - true[:, PARTS[error]]
            expected = past[:, PARTS[angle]] - reference
            np.testing.assert_allclose(shown[:, PARTS[error]], expected, rtol=0, atol=1e-6)
        unchanged = PARTS["qddot_ref_rad_s2"]
        np.testing.assert_array_equal(shown[:, unchanged], true[:, unchanged])


def test_noise_has_its_deviation_and_leaves_end_and_reward():
    exact, noisy, first, observed = pair(plants=16, **NOISE)
    differences = [observed - first]
    for _ in range(400):
        (true, *results), (shown, *others) = (env.step(np.zeros((16, 3))) for env in (exact, noisy))
        for result, other in zip(results[:3], others[:3], strict=True):
            np.testing.assert_array_equal(other, result)
        differences.append(shown - true)
    differences = np.array(differences)
    for angle, error, deviation in (
        ("q_rad", "error_rad", NOISE["angle_noise_rad"]),
        ("qdot_rad_s", "error_rate_rad_s", NOISE["rate_noise_rad_s"]),
    ):
        drawn = differences[..., PARTS[angle]]
        # 19,248 numbers: five deviations of their standard deviation and of their mean.
        assert abs(drawn.std() / deviation - 1) < 5 / np.sqrt(2 * drawn.size)
        assert abs(drawn.mean()) < 5 * deviation / np.sqrt(drawn.size)
        np.testing.assert_allclose(differences[..., PARTS[error]], drawn, rtol=0, atol=1e-6)


def test_a_seed_means_the_same_noise():
    env = TwinVectorEnv(2, "Hold", **SETTINGS, **NOISE)
    first = env.reset(seed=3)[0], env.step(np.zeros((2, 3)))[0]
    again = env.reset(seed=3)[0], env.step(np.zeros((2, 3)))[0]
    np.testing.assert_array_equal(again, first)
    assert not np.array_equal(env.reset()[0], first[0])


@pytest.mark.parametrize("sensing", [{}, {**NOISE, "delay_periods": 2}], ids=["exact", "sensors"])
def test_a_pickle_continues_where_it_was(sensing):
    env = TwinVectorEnv(3, "Track", **SETTINGS, **sensing)
    env.reset(seed=1)
    generator = np.random.default_rng()
    for _ in range(5):
        env.step(generator.uniform(-1, 1, (3, 3)))
    other = pickle.loads(pickle.dumps(env))
    for _ in range(30):  # over the start of new episodes
        actions = generator.uniform(-1, 1, (3, 3))
        for result, again in zip(env.step(actions)[:4], other.step(actions)[:4], strict=True):
            np.testing.assert_array_equal(again, result)


def test_a_pickle_of_one_plant_continues_too():
    env = gymnasium.make("spheretwin/Track-v0", **SETTINGS).unwrapped
    env.reset(seed=1)
    other = pickle.loads(pickle.dumps(env))
    np.testing.assert_array_equal(other.step(np.ones(3))[0], env.step(np.ones(3))[0])


@pytest.mark.uncompiled
def test_a_gpu_has_neither_noise_nor_delay():
    with pytest.raises(InputError, match="expected no noise and no delay on a GPU"):
        CudaVectorEnv(1, delay_periods=1, **SETTINGS)
    assert cuda.SIMULATED


def changed(picture, other):
    """Share of the pixels that differ by more than the rounding of a driver with several threads."""
    return np.mean(np.abs(picture.astype(int) - other).max(axis=2) > 3)


@pytest.mark.skipif(not has_opengl(), reason="no OpenGL: MUJOCO_GL=egl draws without a screen")
def test_a_picture_shows_the_pose():
    env = gymnasium.make("spheretwin/Hold-v0", render_mode="rgb_array", **SETTINGS).unwrapped
    env.reset(seed=0)
    upright = env.render()
    assert (upright.shape, upright.dtype) == ((SIZE, SIZE, 3), np.uint8)
    assert upright.std() > 20  # something is drawn
    assert changed(env.render(), upright) == 0
    for _ in range(19):
        env.step(np.ones(3))
    # The shaft has turned: a part of the picture has changed, the floor has not.
    assert 0.002 < changed(env.render(), upright) < 0.5
    env.close()


def test_other_ways_to_render_are_refused_and_none_renders_nothing():
    with pytest.raises(InputError, match="expected render_mode rgb_array, received 'human'"):
        TwinEnv(render_mode="human")
    env = TwinEnv(**SETTINGS)
    env.reset()
    assert env.render() is None


def test_missing_opengl_is_named(monkeypatch):
    def missing(*_):
        raise AttributeError("no attribute 'glGetError'")

    monkeypatch.setattr(mujoco, "GLContext", missing)
    env = TwinEnv(render_mode="rgb_array", **SETTINGS)
    env.reset()
    with pytest.raises(InputError, match="received no attribute 'glGetError'; MUJOCO_GL=egl or MUJOCO_GL="):
        env.render()


@pytest.mark.skipif(has_opengl(), reason="there is OpenGL")
def test_a_second_picture_without_opengl_is_refused_too():
    env = TwinEnv(render_mode="rgb_array", **SETTINGS)
    env.reset()
    for _ in range(2):  # MuJoCo's renderer would end the process
        with pytest.raises(InputError, match="expected OpenGL for pictures"):
            env.render()
