"""Train a policy for the task Point and compare it with PID: ``python tests/benchmarks/training.py``.

It is PPO of Stable-Baselines3 and needs the packages stable-baselines3, torch and matplotlib. The learning
curve is written to training.svg. The errors of policy and PID are those of episodes that the training did not
see, on the same plants.
"""

import argparse
import time

import matplotlib.pyplot as plt
import numpy as np
from stable_baselines3 import PPO
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.vec_env import VecNormalize

import spheretwin as st
from spheretwin.envs.stable_baselines import StableBaselinesEnv

PERIOD_s = 0.005
SETTINGS = {"episode_s": 1.0, "changes": {"controller.period_s": PERIOD_s}, "torque_limit_Nm": 1.0}
TEST_SEED = 1  # of the variants; those of the training have seed 0
TEST_EPISODES = 32


class Curve(BaseCallback):
    """RMS error of the episodes that end, over the control periods so far."""

    def __init__(self):
        super().__init__()
        self.periods, self.rms_rad = [], []

    def _on_step(self):
        for info in self.locals["infos"]:
            if "rms_error_rad" in info:
                self.periods.append(self.num_timesteps)
                self.rms_rad.append(info["rms_error_rad"])
        return True


def train(periods, plants, seed=0):
    """Policy after some control periods, its scaled environment, and its learning curve."""
    envs = VecNormalize(StableBaselinesEnv(plants, "Point", **SETTINGS), gamma=0.97)
    model = PPO(
        "MlpPolicy",
        envs,
        n_steps=200,
        batch_size=3200,
        n_epochs=10,
        gamma=0.97,
        learning_rate=5e-4,
        policy_kwargs={"log_std_init": -1.0, "net_arch": [64, 64]},
        seed=seed,
        device="cpu",
    )
    curve = Curve()
    model.learn(periods, callback=curve)
    return model, envs, curve


def errors_of_policy(model, scaling):
    """RMS errors (rad) of test episodes under the policy without exploration, and their scenarios."""
    plants = StableBaselinesEnv(TEST_EPISODES, "Point", **SETTINGS, variants_seed=TEST_SEED)
    plants.seed(TEST_SEED)
    observations, done, rms = plants.reset(), np.zeros(TEST_EPISODES, bool), np.full(TEST_EPISODES, np.nan)
    scenarios = [plants.vector.scenario_of(i) for i in range(TEST_EPISODES)]
    while not done.all():
        actions, _ = model.predict(scaling.normalize_obs(observations), deterministic=True)
        observations, _, ended, infos = plants.step(np.clip(actions, -1, 1))
        for i in np.flatnonzero(ended & ~done):
            rms[i] = infos[i]["rms_error_rad"] if infos[i]["status"] == "completed" else np.inf
        done |= ended
    return rms, scenarios


def error_of_pid(scenario, period_s):
    """RMS error (rad) of the same episode under PID with its default gains."""
    changes = {
        "trajectory.angle_rad": list(scenario.trajectory.angle_rad), "seed": scenario.seed,
        "duration": scenario.duration, "plant.engine": "lagrangian", "controller.law": "pid",
        "controller.period_s": period_s,
    }  # fmt: skip
    run = st.simulate("hold", changes)
    return float(np.sqrt(np.mean(np.sum(run.telemetry["error_rad"] ** 2, axis=1))))


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--periods", type=int, default=5_000_000)
    parser.add_argument("--plants", type=int, default=64)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    started = time.perf_counter()
    model, scaling, curve = train(options.periods, options.plants, options.seed)
    taken = time.perf_counter() - started
    figure, axes = plt.subplots(figsize=(5, 3), layout="constrained")
    axes.semilogy(curve.periods, 1e3 * np.array(curve.rms_rad), ".", markersize=1)
    axes.set(xlabel="control periods", ylabel="RMS error of an episode, mrad", title="PPO on Point")
    figure.savefig("training.svg")
    policy, scenarios = errors_of_policy(model, scaling)
    rows = {"policy at 5 ms": policy}
    for period_s in (PERIOD_s, 1e-3):
        rows[f"PID at {1e3 * period_s:g} ms"] = [error_of_pid(scenario, period_s) for scenario in scenarios]
    for part in np.array_split(np.arange(len(curve.periods)), 10):
        rms_mrad = 1e3 * np.median(np.array(curve.rms_rad)[part])
        print(f"after {curve.periods[part[-1]]:>9,} periods: RMS error {rms_mrad:.0f} mrad, with exploration")
    print(f"{options.periods} control periods of {options.plants} plants in {taken:.0f} s")
    for name, errors in rows.items():
        low, median, high = 1e3 * np.quantile(errors, [0, 0.5, 1])
        print(f"{name}: RMS error {median:.1f} mrad, {low:.1f} to {high:.1f}")


if __name__ == "__main__":
    main()
