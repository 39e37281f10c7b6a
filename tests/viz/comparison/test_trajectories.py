"""Runs side by side in one recording: each under its own path, on one timeline."""

import numpy as np
from rerun.chunk import RrdReader

from spheretwin.viz import theme
from spheretwin.viz.comparison.trajectories import LawTrajectory, write
from spheretwin.viz.layout.view import TIMELINE
from spheretwin.viz.scene.entities import shaft_tip


def flight(law, ticks):
    t_s = 0.01 * np.arange(ticks)
    q = np.stack([0.1 * np.sin(t_s), 0.2 * t_s, t_s], axis=1)
    return LawTrajectory(law, t_s, q, q + [1e-3, 2e-3, -3e-3], 0.1 + t_s)


def test_every_law_has_its_errors_and_its_tip_on_one_timeline(tmp_path, actuator):
    path = write(
        tmp_path / "side.rrd", {"PD": flight("pd", 20), "tuned PID": flight("pid", 50)}, actuator, "both"
    )
    result: dict[str, int] = {}
    for chunk in RrdReader(path).stream().filter(has_timeline=TIMELINE):
        result[chunk.entity_path] = result.get(chunk.entity_path, 0) + chunk.to_record_batch().num_rows
    assert result["/world/desired/tip"] == 50
    for label, ticks in (("PD", 20), ("tuned_PID", 50)):
        assert result[f"/world/{label}/tip"] == ticks
        for angle in "αβγ":
            assert result[f"/error/{angle}/{label}"] == ticks
        assert result[f"/torque/{label}"] == ticks
    assert [each.name for each in tmp_path.iterdir()] == ["side.rrd"]


def test_the_layout_has_a_view_of_the_tips_the_error_of_each_hinge_and_the_torque(tmp_path, actuator):
    path = write(tmp_path / "side.rrd", {"PD": flight("pd", 20)}, actuator, "one")
    (store,) = RrdReader(path).blueprints()
    views = {}
    for chunk in RrdReader(path).stream(store=store):
        batch = chunk.to_record_batch()
        if "ViewBlueprint:space_origin" in batch.schema.names:
            ((origin,),), ((name,),) = (
                batch.column(f"ViewBlueprint:{each}").to_pylist() for each in ("space_origin", "display_name")
            )
            views[origin] = name
    assert set(views) == {"/world", "/torque", *(f"/error/{angle}" for angle in "αβγ")}
    assert all(f"{angle} [mrad]" in views[f"/error/{angle}"] for angle in "αβγ")
    assert "[N·m]" in views["/torque"]


def test_trajectories_have_errors_torques_tips_and_colours(tmp_path, actuator):
    runs = {"PD": flight("pd", 20), "tuned PID": flight("pid", 50)}
    path = write(tmp_path / "side.rrd", runs, actuator, "both")
    values, colours = {}, {}
    for chunk in RrdReader(path).stream():
        batch = chunk.to_record_batch()
        for name in batch.schema.names:
            if name in ("Scalars:scalars", "Points3D:positions"):
                values.setdefault(chunk.entity_path, []).extend(
                    cell[0] for cell in batch.column(name).to_pylist()
                )
            if name in ("SeriesLines:colors", "Points3D:colors"):
                colours[chunk.entity_path] = batch.column(name).to_pylist()[0][0]
    for label, run in runs.items():
        part = label.replace(" ", "_")
        for axis, angle in enumerate("αβγ"):
            error_mrad = 1e3 * (run.q_rad - run.q_ref_rad)[:, axis]
            np.testing.assert_array_equal(values[f"/error/{angle}/{part}"], error_mrad)
        np.testing.assert_array_equal(values[f"/torque/{part}"], run.torque_Nm)
        # Single precision.
        np.testing.assert_allclose(values[f"/world/{part}/tip"], shaft_tip(run.q_rad, actuator), atol=1e-7)
        red, green, blue = theme.rgb(theme.law_colour(run.law))
        packed = (red << 24) + (green << 16) + (blue << 8) + 255
        assert colours[f"/torque/{part}"] == colours[f"/world/{part}/tip"] == packed
    desired = shaft_tip(runs["tuned PID"].q_ref_rad, actuator)
    np.testing.assert_allclose(values["/world/desired/tip"], desired, atol=1e-7)
