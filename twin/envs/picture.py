"""Pictures of an actuator at a pose, by MuJoCo's renderer."""

from __future__ import annotations

import warnings
from pathlib import Path

import mujoco
import numpy as np
from numpy.typing import NDArray

from spheretwin.models.actuator import MJCF_PATH
from spheretwin.models.base.errors import InputError, without_breaks

SCENE = MJCF_PATH.with_name("scene.xml")
VIEW = "three_quarter"
"""Camera of the scene."""

SIZE = 480
"""Width and height, pixels."""


class Camera:
    """View of an actuator.

    Parameters
    ----------
    model_file : str, optional
        Own model file, seen by a free camera; the shipped actuator in its scene unless given.

    Raises
    ------
    InputError
        OpenGL is missing.
    """

    def __init__(self, model_file: str | None) -> None:
        model = mujoco.MjModel.from_xml_path(str(Path(model_file) if model_file else SCENE))
        self._model, self._data = model, mujoco.MjData(model)
        self._view = -1 if model_file else VIEW
        _check_opengl()
        self._renderer = mujoco.Renderer(model, SIZE, SIZE)

    def image(self, q_rad: NDArray[np.float64]) -> NDArray[np.uint8]:
        """Return the picture (480, 480, 3) at hinge angles (3,), rad."""
        self._data.qpos[:3] = q_rad
        mujoco.mj_kinematics(self._model, self._data)
        mujoco.mj_camlight(self._model, self._data)
        self._renderer.update_scene(self._data, self._view)
        image: NDArray[np.uint8] = self._renderer.render()
        return image

    def close(self) -> None:
        """Free the context of OpenGL."""
        self._renderer.close()


def _check_opengl() -> None:
    # GLFW only warns that it has no context. MuJoCo's renderer ends the process when it fails a second time.
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")  # an error would leave a context half made
        try:
            mujoco.GLContext(SIZE, SIZE).free()
            received = str(said[0].message) if said else ""
        except Exception as error:  # EGL, OSMesa and MuJoCo fail with exceptions of their own
            received = without_breaks(error)
    if received:
        raise InputError(
            f"environment: expected OpenGL for pictures, received {received};"
            " MUJOCO_GL=egl or MUJOCO_GL=osmesa draws without a screen"
        )
