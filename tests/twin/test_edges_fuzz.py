"""Extreme values at the edges of the package: each call is refused by a typed error or gives finite numbers.

The draws have fixed seeds. `tests/twin/export/test_fuzz_exports.py` has the compiled edges of exports, and
`tests/twin/machine/link/test_frames.py` the bytes of frames.
"""

import numpy as np
import pytest

from spheretwin import plant
from spheretwin import scenario as scenarios
from spheretwin.envs import TwinVectorEnv
from spheretwin.models.base.errors import InputError
from spheretwin.session import Session

EXTREME = (
    np.nan, np.inf, -np.inf, 0.0, -0.0, 5e-324, 1e-300, 1e-12, -1.0, 1.0, 1e3, -1e6, 1e15, 1e30, 1e100,
    -1e200, 1e308,
)  # fmt: skip
NOT_NUMBERS = (
    None,
    True,
    "1",
    "nan",
    b"\0",
    [],
    {},
    [1.0, "x"],
    [[1.0], [1.0, 2.0]],
    1j,
    object(),
    np.datetime64("NaT"),
)


class Draws:
    """Random values from a seed."""

    def __init__(self, seed):
        self.generator = np.random.default_rng(seed)

    def one_of(self, choices):
        return choices[int(self.generator.integers(len(choices)))]

    def chance(self, share):
        return self.generator.random() < share

    def number(self):
        if self.chance(0.5):
            return float(self.one_of(EXTREME))
        return float(self.generator.normal() * 10 ** self.generator.uniform(-9, 9))

    def array(self, size):
        """Plain numbers, half of the time with extreme ones; sometimes of another length."""
        size += int(self.generator.integers(-2, 3)) if self.chance(0.1) else 0
        values = self.generator.uniform(-0.5, 0.5, size)
        for _ in range(int(self.generator.integers(1, 3)) if self.chance(0.5) and size else 0):
            values[self.generator.integers(size)] = self.number()
        return values

    def vector(self, size):
        """Array, list, or neither."""
        if self.chance(0.05):
            return self.one_of(NOT_NUMBERS)
        values = self.array(size)
        return self.one_of((values, values.tolist(), np.repeat(values, 2)[::2]))

    def value(self):
        return self.number() if self.chance(0.8) else self.one_of(NOT_NUMBERS)


def attempted(call, *arguments, **named):
    """Return True and the result of a call; False and None if it is refused."""
    try:
        with np.errstate(all="ignore"):
            return True, call(*arguments, **named)
    except InputError:
        return False, None


def plausible(*arrays):
    """True if all numbers are such that a rotor stays slow for a step."""
    return all(np.abs(values).max(initial=0) <= 1e3 for values in arrays)


FIELDS = {
    "inertia_kg_m2": 3,
    "coulomb_Nm": 3,
    "viscous_Nm_s": 3,
    "constant_torque_Nm": 3,
    "spring_Nm_rad": 3,
    "torque_gain": 18,
    "weight_moment_Nm": None,
    "friction_smoothing_rad_s": None,
}


def test_a_step_of_the_plant_is_refused_or_finite():
    draws, accepted = Draws(1), 0
    parameters = plant.parameters("nutation", {"plant.coulomb_Nm": [2e-3] * 3})
    for _ in range(2000):
        changed = parameters
        if draws.chance(0.3):
            name = draws.one_of(tuple(FIELDS))
            value = draws.array(FIELDS[name]) if FIELDS[name] else draws.number()
            changed = parameters._replace(**{name: value})
        q, qdot, currents, disturbance = (draws.array(size) for size in (3, 3, 18, 3))
        dt = draws.number() if draws.chance(0.3) else 5e-4
        given = [values.copy() for values in (q, qdot, currents, disturbance)]
        done, reached = attempted(plant.step, plant.State(q, qdot), currents, disturbance, changed, dt)
        for before, after in zip(given, (q, qdot, currents, disturbance), strict=True):
            np.testing.assert_array_equal(before, after)
        if done:
            accepted += 1
            assert np.isfinite(np.concatenate(reached)).all()
    assert accepted > 500


def test_many_plants_refuse_or_advance():
    draws, advanced = Draws(2), 0
    parameters = plant.parameters("nutation")
    for _ in range(150):
        plants = plant.Plants([parameters] * 3)
        q, qdot, currents, disturbance = (draws.vector(size) for size in (3, 3, 18, 3))
        dt, steps = (draws.value() if draws.chance(0.2) else usual for usual in (5e-4, 2))
        before = plants.q_rad, plants.qdot_rad_s
        if not attempted(plants.set_state, q, qdot)[0]:
            np.testing.assert_array_equal((plants.q_rad, plants.qdot_rad_s), before)
        before = plants.q_rad, plants.qdot_rad_s
        if not attempted(plants.step, currents, disturbance, dt, steps)[0]:
            np.testing.assert_array_equal((plants.q_rad, plants.qdot_rad_s), before)
        elif plausible(*before, np.asarray(currents), np.asarray(disturbance)) and dt < 1e-3:
            advanced += 1
            assert np.isfinite((plants.q_rad, plants.qdot_rad_s)).all()
    assert advanced > 20


NAMES = (
    "disturbance.load", "plant.payload_kg", "nominal.current_limit_A", "controller.stiffness", "trajectory",
    "seed", "fault", "nope", "state", "",
)  # fmt: skip
TICKS = (0, 1, 5, -1, True, 2.0, None, "3", np.nan, np.int64(2), 1e9)


def test_a_session_refuses_or_goes_on_with_finite_rows():
    draws, rows = Draws(3), 0
    scenario = scenarios.load("hold", {"controller.law": "pid", "plant.engine": "lagrangian"})
    for _ in range(40):
        with Session(scenario) as session:
            snapshot = session.snapshot()
            for _ in range(6):
                call = draws.one_of(("set", "set_state", "advance", "restore"))
                if call == "set":
                    value = draws.vector(3) if draws.chance(0.3) else draws.value()
                    attempted(session.set, draws.one_of(NAMES), value)
                elif call == "set_state":
                    state = [draws.vector(size) if draws.chance(0.7) else None for size in (3, 3, 18)]
                    attempted(session.set_state, *state)
                elif call == "advance":
                    done, table = attempted(session.advance, draws.one_of(TICKS))
                    rows += len(table) if done else 0
                    assert not done or np.isfinite(table.values).all()
                else:
                    attempted(session.restore, draws.one_of((*NOT_NUMBERS, snapshot)))
    assert rows > 30


SEEDS = (None, 1, -1, 1.5, "x", [1, 2], [1, 2, 3], [None, 1, -1], np.int64(3), 10**30)
OPTIONS = (None, {}, {"reset_mask": [True] * 3}, {"reset_mask": np.ones(2, bool)}, {"nope": 1}, [1], "x")


@pytest.mark.parametrize("actions", ["torque", "current"])
def test_an_environment_refuses_or_goes_on_with_finite_numbers(actions):
    draws, steps = Draws(4), 0
    env = TwinVectorEnv(3, "Hold", episode_s=0.05, variants=1, actions=actions)
    width = env.action_space.shape[1]
    for _ in range(300):
        if draws.chance(0.2):
            attempted(env.reset, seed=draws.one_of(SEEDS), options=draws.one_of(OPTIONS))
            continue
        values = draws.array(3 * width)
        values = values.reshape(3, -1) if values.size % 3 == 0 else values
        done, result = attempted(env.step, values if draws.chance(0.9) else draws.one_of(NOT_NUMBERS))
        if done:
            steps += 1
            assert all(np.isfinite(numbers).all() for numbers in result[:2])
    assert steps > 50
