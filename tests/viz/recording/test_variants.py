"""Actuators of other numbers of groups are recorded with as many currents, coils and colours."""

import dataclasses

import numpy as np
import pytest
import rerun.blueprint as rrb
from rerun.chunk import RrdReader

from spheretwin import scenario as scenarios
from spheretwin.models import actuator as actuators
from spheretwin.models import mjcf, torque_curve
from spheretwin.models.telemetry.signals import width
from spheretwin.models.telemetry.table import Table
from spheretwin.provenance import facts_of
from spheretwin.session import Session
from spheretwin.viz import theme
from spheretwin.viz.layout.layout import layout
from spheretwin.viz.layout.view import TELEMETRY, View, application
from spheretwin.viz.recording.recorder import Recorder
from spheretwin.viz.scene import meshes as scene

LAYER = 'count="12" euler="0 0 30"'
ROWS = 40


@pytest.fixture(params=[(8, 12), (16, 24)], ids=["12 groups", "24 groups"])
def variant(request, tmp_path, monkeypatch):
    """Facts, actuator and signals of a stator with other layers of coils."""
    in_a_layer, groups = request.param
    text = actuators.MJCF_PATH.read_text(encoding="utf-8")
    assert text.count(LAYER) == 3
    text = text.replace(LAYER, f'count="{in_a_layer}" euler="0 0 {360 / in_a_layer}"')
    text = text.replace('meshdir="assets"', f'meshdir="{actuators.FOLDER / "assets"}"')
    (path := tmp_path / "variant.xml").write_text(text, encoding="utf-8")
    labels = tuple(f"group {j}" for j in range(groups))
    monkeypatch.setattr(actuators, "GROUPS", labels, raising=False)
    actuator = actuators.from_model(mjcf.read(path).described, torque_curve.read(actuators.TORQUE_CURVE_PATH))
    assert len(actuator.groups) == groups
    session = Session(scenarios.load("hold", {"duration": ROWS * 1e-3}))
    signals = tuple(
        dataclasses.replace(signal, size=groups, labels=labels) if signal.unit == "A" else signal
        for signal in session.signals
    )
    return dataclasses.replace(facts_of(session.initial_scenario), mjcf=path), actuator, signals


def one_row_each(path, entity, component):
    """Values of a component, one flat row for each row of the recording."""
    rows = []
    for chunk in RrdReader(path).stream().filter(content=f"/{entity}"):
        batch = chunk.to_record_batch()
        if component in batch.schema.names:
            rows += batch.column(component).to_pylist()
    return rows


def test_a_variant_is_recorded_with_its_own_groups(variant, tmp_path):
    facts, actuator, signals = variant
    groups = len(actuator.groups)
    table = Table(signals, np.random.default_rng(0).normal(size=(ROWS, width(signals))))
    table["t_s"][:] = np.arange(ROWS) * 1e-3
    with Recorder(actuator, signals, facts, path=tmp_path / "run.rrd") as recorder:
        recorder.write(table)
        recorder.finish("completed")
    path = tmp_path / "run.rrd"

    currents = [row["current_A"] for (row,) in one_row_each(path, TELEMETRY, "values_0")]
    np.testing.assert_array_equal(currents, table["current_A"])
    ((styles,),) = one_row_each(path, TELEMETRY, "styles_0")
    assert styles["current_A"]["names"] == [f"current group {j} [A]" for j in range(groups)]
    assert len(styles["current_A"]["colors"]) == groups

    (shape,) = one_row_each(path, scene.COILS, "Mesh3D:albedo_texture_format")
    assert shape[0]["width"] == groups
    textures = one_row_each(path, scene.COILS, "Mesh3D:albedo_texture_buffer")
    first = np.reshape(np.frombuffer(bytes(textures[0][0]), np.uint8), (groups, 3))
    np.testing.assert_array_equal(first, theme.current_colours(table["current_A"][0], facts.current_limit_A))


def test_the_layout_of_each_number_of_groups_is_one_of_its_own():
    views = [View(1.0, 8.0, groups, (), False) for groups in (12, 18, 24)]
    for view in views:
        assert "mean currents, -8 A blue, +8 A red; top: variation" in titles(layout(view))
    assert len({application(view) for view in views}) == 3


def titles(blueprint):
    """Names of all views."""
    waiting, results = [blueprint.root_container], []
    while waiting:
        part = waiting.pop()
        waiting += getattr(part, "contents", ()) if isinstance(part, rrb.Container) else ()
        results.append(part.name)
    return results
