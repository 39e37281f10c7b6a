"""The rotor in MJX: the model of MuJoCo, computed by XLA."""

import jax.numpy as jnp
from mujoco import mjx
from problem import Problem, bare_rotor

NAME = "MJX"


class Rotor:
    """Rotor of the product's model; only pose and rates pass from step to step."""

    def __init__(self, problem: Problem) -> None:
        rotor = bare_rotor(problem)
        self._model, self._rotor = mjx.put_model(rotor.model), rotor.model.body("rotor").id
        self._data = mjx.make_data(self._model)

    def start(self, q, inertia):
        still = 0.0 * inertia[0]
        return q, (still,) * 3, inertia

    def pose(self, state):
        return state[0], state[1]

    def step(self, state, torque_q):
        q, qdot, inertia = state
        model = self._model.replace(body_inertia=self._model.body_inertia.at[self._rotor].set(inertia))
        data = self._data.replace(qpos=jnp.stack(q), qvel=jnp.stack(qdot), qfrc_applied=jnp.stack(torque_q))
        after = mjx.step(model, data)
        return tuple(after.qpos), tuple(after.qvel), inertia
