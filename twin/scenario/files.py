"""What the files of a scenario say: model, torque curves, and a digest by which they are known again."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import NamedTuple

import mujoco
import numpy as np

from spheretwin.models import actuator as actuators
from spheretwin.models import mjcf, torque_curve
from spheretwin.models.actuator import Actuator
from spheretwin.models.mjcf import Mjcf
from spheretwin.twin.scenario.sections import Scenario


class Files(NamedTuple):
    """What the files of a scenario say, read once for a session: an edit meanwhile changes nothing of it."""

    model: Mjcf
    actuator: Actuator
    nominal: Actuator
    """As the controller has it: the very same unless it has another torque curve."""


def files_of(scenario: Scenario) -> Files:
    """Read model file and torque curves of a scenario."""
    path = Path(scenario.plant.mjcf or actuators.MJCF_PATH)
    curve = Path(scenario.plant.torque_curve or actuators.TORQUE_CURVE_PATH)
    actuator = actuators.load(path, curve)
    other = scenario.nominal.torque_curve
    return Files(mjcf.read(path), actuator, actuators.load(path, Path(other)) if other else actuator)


def files_again(files: Files, before: Scenario, scenario: Scenario) -> Files:
    """Files of a changed scenario: what it names as before stays as it was read."""
    if scenario.plant.mjcf != before.plant.mjcf:
        return files_of(scenario)
    actuator, nominal, other = files.actuator, files.nominal, scenario.nominal.torque_curve
    if scenario.plant.torque_curve != before.plant.torque_curve:
        actuator = _with_curve(files.model, scenario.plant.torque_curve)
    if other is None:
        nominal = actuator
    elif other != before.nominal.torque_curve:
        nominal = _with_curve(files.model, other)
    return Files(files.model, actuator, nominal)


def _with_curve(model: Mjcf, curve: str | None) -> Actuator:
    read = torque_curve.read(Path(curve or actuators.TORQUE_CURVE_PATH))
    return actuators.from_model(model.described, read)


def named_files(scenario: Scenario) -> tuple[str | None, ...]:
    """Names by which a scenario finds its files."""
    return scenario.plant.mjcf, scenario.plant.torque_curve, scenario.nominal.torque_curve


def digest(files: Files) -> str:
    """Digest of all that files say of the physics, by which a snapshot knows its model."""
    models = (files.model.described, files.model.loaded)
    content = [np.empty(mujoco.mj_sizeModel(model), np.uint8) for model in models]
    for model, buffer in zip(models, content, strict=True):
        mujoco.mj_saveModel(model, None, buffer)
    for actuator in (files.actuator, files.nominal):
        content += [actuator.torque_curve.phi_rad, actuator.torque_curve.torque_Nm_per_A]
    return hashlib.sha256(b"".join(each.tobytes() for each in content)).hexdigest()
