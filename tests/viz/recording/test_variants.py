"""Actuators of other numbers of groups are recorded with as many currents, coils and colours."""

import dataclasses

import numpy as np
import pytest

from spheretwin.models import actuator as actuators
from spheretwin.models import mjcf, torque_curve
from spheretwin.models.telemetry.signals import width
from spheretwin.models.telemetry.table import Table
from spheretwin.viz import theme
from spheretwin.viz.layout.view import TELEMETRY
from spheretwin.viz.recording.recorder import Recorder
from spheretwin.viz.scene import meshes as scene
from tests.models.model_files import edited
from tests.viz.recording.recordings import session_and_facts, static, telemetry_of, timed

LAYER = 'count="12" euler="0 0 30"'
ROWS = 40


@pytest.fixture(params=[(8, 12), (16, 24)], ids=["12 groups", "24 groups"])
def variant(request, tmp_path, monkeypatch):
    """Facts, actuator and signals of a stator with other layers of coils."""
    in_a_layer, groups = request.param
    path = edited(tmp_path, (LAYER, f'count="{in_a_layer}" euler="0 0 {360 / in_a_layer}"'))
    labels = tuple(f"group {j}" for j in range(groups))
    monkeypatch.setattr(actuators, "GROUPS", labels, raising=False)
    actuator = actuators.from_model(mjcf.read(path).described, torque_curve.read(actuators.TORQUE_CURVE_PATH))
    assert len(actuator.groups) == groups
    session, facts = session_and_facts(duration=ROWS * 1e-3)
    signals = tuple(
        dataclasses.replace(signal, size=groups, labels=labels) if signal.unit == "A" else signal
        for signal in session.signals
    )
    return dataclasses.replace(facts, mjcf=path), actuator, signals


def test_a_variant_is_recorded_with_its_own_groups(variant, tmp_path):
    facts, actuator, signals = variant
    groups = len(actuator.groups)
    table = Table(signals, np.random.default_rng(0).normal(size=(ROWS, width(signals))))
    table["t_s"][:] = np.arange(ROWS) * 1e-3
    with Recorder(actuator, signals, facts, path=tmp_path / "run.rrd") as recorder:
        recorder.write(table)
        recorder.finish("completed")
    path = tmp_path / "run.rrd"
    _, currents = telemetry_of(path, "current_A")
    np.testing.assert_array_equal(currents, table["current_A"])
    (styles,) = static(path, TELEMETRY, "styles_0")
    assert styles["current_A"]["names"] == [f"current group {j} [A]" for j in range(groups)]
    assert len(styles["current_A"]["colors"]) == groups
    (shape,) = static(path, scene.COILS, "Mesh3D:albedo_texture_format")
    assert shape["width"] == groups
    (_, (texture,)), *_ = timed(path, scene.COILS, "Mesh3D:albedo_texture_buffer")
    colours = np.frombuffer(bytes(texture), np.uint8).reshape(groups, 3)
    np.testing.assert_array_equal(
        colours,
        theme.current_colours(table["current_A"][0], 3.0),  # 98 % of normal numbers, times 1.1: 2.6
    )
