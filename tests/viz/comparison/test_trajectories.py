"""Runs side by side in one recording: each under its own path, on one timeline."""

import numpy as np
from rerun.chunk import RrdReader

from spheretwin.viz.comparison.trajectories import LawTrajectory, write
from spheretwin.viz.layout.view import TIMELINE


def flight(law, ticks):
    t_s = 0.01 * np.arange(ticks)
    q = np.stack([0.1 * np.sin(t_s), 0.2 * t_s, t_s], axis=1)
    return LawTrajectory(law, t_s, q, q + 1e-3, np.full(ticks, 0.1))


def test_every_law_has_its_errors_and_its_tip_on_one_timeline(tmp_path, actuator):
    path = write(
        tmp_path / "side.rrd", {"PD": flight("pd", 20), "tuned PID": flight("pid", 50)}, actuator, "both"
    )
    found: dict[str, int] = {}
    for chunk in RrdReader(path).stream().filter(has_timeline=TIMELINE):
        found[chunk.entity_path] = found.get(chunk.entity_path, 0) + chunk.to_record_batch().num_rows
    assert found["/world/desired/tip"] == 50
    for label, ticks in (("PD", 20), ("tuned_PID", 50)):
        assert found[f"/world/{label}/tip"] == ticks
        for angle in "αβγ":
            assert found[f"/error/{angle}/{label}"] == ticks
        assert found[f"/torque/{label}"] == ticks
    assert [each.name for each in tmp_path.iterdir()] == ["side.rrd"]
