"""Files of a scenario: model, torque curves or fields, and a digest that identifies them."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import NamedTuple

import mujoco
import numpy as np

from spheretwin.models import actuator as actuators
from spheretwin.models import mjcf, torque_field
from spheretwin.models.actuator import Actuator
from spheretwin.models.mjcf import Mjcf
from spheretwin.scenario.fields import SHIPPED
from spheretwin.scenario.sections import ResolvedScenario, Scenario


class Files(NamedTuple):
    """Content of the files of a scenario, read once for a session: later edits have no effect."""

    model: Mjcf
    actuator: Actuator
    nominal: Actuator
    """Actuator of the controller's data sheet: the same model file with the nominal torque curve or field."""


def files_of(scenario: Scenario) -> Files:
    """Read the model file and the torque curves of a scenario."""
    path = Path(scenario.plant.mjcf or actuators.MJCF_PATH)
    true, nominal = scenario.plant.torque_curve or SHIPPED, nominal_curve(scenario)
    actuator = actuators.load(path, _path(true))
    return Files(
        mjcf.read(path), actuator, actuator if nominal == true else actuators.load(path, _path(nominal))
    )


class FilesCache:
    """Files of scenarios that run in one process; each set of names is read once."""

    def __init__(self) -> None:
        self._read: dict[tuple[str | None, ...], Files] = {}

    def files_of(self, scenario: Scenario) -> Files:
        """Return the files of a scenario as they were when a scenario first named them."""
        named = (scenario.plant.mjcf, scenario.plant.torque_curve, nominal_curve(scenario))
        if named not in self._read:
            self._read[named] = files_of(scenario)
        return self._read[named]


def nominal_curve(scenario: Scenario) -> str:
    """Return the torque curve of the controller's data sheet: a path, or `SHIPPED`.

    A user model file is another machine: the torque curve of the plant then belongs to its data sheet.
    """
    if scenario.nominal.torque_curve is not None:
        return scenario.nominal.torque_curve
    follows = scenario.nominal.equals_truth or scenario.plant.mjcf is not None
    return (scenario.plant.torque_curve if follows else None) or SHIPPED


def reload_files(files: Files, before: ResolvedScenario, scenario: Scenario) -> Files:
    """Return the files of a changed scenario; a file with an unchanged name is not read again."""
    if scenario.plant.mjcf != before.plant.mjcf:
        return files_of(scenario)
    actuator, nominal, curve = files.actuator, files.nominal, nominal_curve(scenario)
    if scenario.plant.torque_curve != before.plant.torque_curve:
        actuator = _with_curve(files.model, scenario, scenario.plant.torque_curve or SHIPPED)
    if curve != before.nominal.torque_curve:
        nominal = _with_curve(files.model, scenario, curve)
    return Files(files.model, actuator, nominal)


def _with_curve(model: Mjcf, scenario: Scenario, curve: str) -> Actuator:
    mjcf_path = Path(scenario.plant.mjcf or actuators.MJCF_PATH)
    path = _path(curve) or actuators.torque_path(mjcf_path, model.described)
    return actuators.from_model(model.described, torque_field.read(path))


def _path(curve: str) -> Path | None:
    return None if curve == SHIPPED else Path(curve)


def digest(files: Files) -> str:
    """Return the digest of the physical content of files, which identifies the model of a snapshot."""
    models = (files.model.described, files.model.loaded)
    content = [np.empty(mujoco.mj_sizeModel(model), np.uint8) for model in models]
    for model, buffer in zip(models, content, strict=True):
        mujoco.mj_saveModel(model, None, buffer)
    for actuator in (files.actuator, files.nominal):
        content += actuator.torque_data.content
    return hashlib.sha256(b"".join(array.tobytes() for array in content)).hexdigest()
