"""The rotor in MJX: MuJoCo's own model as XLA computes it."""

import jax.numpy as jnp
from mujoco import mjx
from problem import Problem, bare_rotor

NAME = "MJX"


class Rotor:
    """Of the model that the product steps; only pose and rates go from step to step."""

    def __init__(self, problem: Problem) -> None:
        rotor = bare_rotor(problem)
        self._model, self._rotor = mjx.put_model(rotor.model), rotor.model.body("rotor").id
        self._data = mjx.make_data(self._model)

    def start(self, q, inertia):
        still = 0.0 * inertia[0]
        return q, (still,) * 3, inertia

    def pose(self, moving):
        return moving[0], moving[1]

    def step(self, moving, torque_S, torque_q):
        q, qdot, inertia = moving
        model = self._model.replace(body_inertia=self._model.body_inertia.at[self._rotor].set(inertia))
        data = self._data.replace(
            qpos=jnp.stack(q),
            qvel=jnp.stack(qdot),
            qfrc_applied=jnp.stack(torque_q),
            xfrc_applied=self._data.xfrc_applied.at[self._rotor, 3:].set(jnp.stack(torque_S)),
        )
        after = mjx.step(model, data)
        return tuple(after.qpos), tuple(after.qvel), inertia
