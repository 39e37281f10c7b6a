"""Runs merged into one recording: every number of each run, values outside of plots, and what is refused."""

import os
import re
import shutil
from dataclasses import replace
from unittest.mock import Mock

import numpy as np
import pytest

from spheretwin import cli
from spheretwin.analysis import comparison
from spheretwin.analysis.recorded_run import events, read
from spheretwin.models.base.errors import InputError
from spheretwin.models.telemetry.status import Status
from spheretwin.models.telemetry.table import Table
from spheretwin.viz.comparison.ghosts import Ghost
from spheretwin.viz.comparison.merged_recording import EDGE, _heading
from spheretwin.viz.comparison.runs import settled_bounds
from spheretwin.viz.layout.extents import number
from spheretwin.viz.quantities import COMPARED_QUANTITIES
from tests.twin.analysis.runs import written
from tests.viz.comparison.compared import T_s, run_of
from tests.viz.recording.panels import columns, layouts, series


class Merged:
    """Entities of a merged recording, its numbers by entity and field, and its text."""

    def __init__(self, path):
        self.path, self._read = path, columns(path)
        self.entities = {entity for entity, _ in self._read[0]}
        ((self.text,),) = self._read[0]["/runs", "TextDocument:text"][0].to_pylist()

    def series(self, name):
        entity, _, field = name.partition(":")
        return series(self._read, entity, "values_0" if field else "Scalars:scalars", field)


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """A recording and the telemetry of a longer run at another rate and of one that leaves the workspace."""
    folder = tmp_path_factory.mktemp("runs")
    _, first = written(folder, "first", duration=0.6)
    slow, _ = written(folder, "slow", **{"duration": 0.7, "controller.period_s": 2e-3})
    failed, _ = written(folder, "failed", **{"duration": 1.0, "controller.law": "pd", "disturbance.load": 60})
    return {"first": first, "slow": slow, "failed": failed}


@pytest.fixture(scope="module")
def merged(files, tmp_path_factory):
    out = tmp_path_factory.mktemp("merged") / "all.rrd"
    assert cli.main(["review", *map(str, files.values()), "--merge", str(out)]) == 0
    assert os.listdir(out.parent) == ["all.rrd"]
    return Merged(out)


def has_every_row(merged, run, entity):
    """True if the telemetry below an entity has each row of a run at its own time, in whole nanoseconds."""
    for signal in run.table.signals:
        t_ns, values = merged.series(f"{entity}:{signal.name}")
        if values.tobytes() != run.table[signal.name].tobytes() or np.any(
            t_ns != np.round(run.table["t_s"] * 1e9)
        ):
            return False
    return True


def test_every_signal_and_line_of_every_run_is_there(files, merged):
    for place, (name, path) in enumerate(files.items(), start=1):
        run = read(path)
        assert has_every_row(merged, run, f"/run_{place}_{name}/telemetry")
        for quantity in COMPARED_QUANTITIES:
            entity = f"/run_{place}_{name}/compare/{quantity.name}"
            if entity in merged.entities:
                assert np.array_equal(merged.series(entity)[0], np.round(run.table["t_s"] * 1e9))
        error = merged.series(f"/run_{place}_{name}/compare/error_β_mrad")[1][:, 0]
        assert np.array_equal(error, 1e3 * run.table["error_rad"][:, 1])


def limits(merged, entity):
    """Range of the plot that contains an entity; the narrower one of two."""
    (layout,) = layouts(merged.path)
    queries = {part: rows[0] for (part, name), rows in layout.items() if name == "ViewContents:query"}
    views = (part.removesuffix("/ViewContents") for part, query in queries.items() if entity in query)
    ranges = [layout[f"{view}/ScalarAxis", "ScalarAxis:range"][0][0] for view in views]
    return min(ranges, key=lambda bounds: bounds[1] - bounds[0])


def test_the_end_of_a_failed_run_is_a_cross_within_every_plot_and_stated(files, merged):
    run = read(files["failed"])
    assert run.record.status is Status.LEFT_WORKSPACE
    ends = [entity for entity in merged.entities if "/end/" in entity]
    assert {entity.split("/")[1] for entity in ends} == {"run_3_failed"}
    assert len(ends) == len([entity for entity in merged.entities if "/run_3_failed/compare/" in entity])
    for entity in ends:
        assert list(merged.series(entity)[0]) == [round(run.table["t_s"][-1] * 1e9)]
        line = merged.series(entity.replace("/end/", "/compare/"))[1]
        low, high = limits(merged, entity)
        edge = EDGE * (high - low)
        assert merged.series(entity)[1][0, 0] == pytest.approx(np.clip(line[-1, 0], low + edge, high - edge))
    _, _, reason = events(run)[-1]
    assert f"**left workspace at {run.simulated_s:.3f} s**: {reason}" in merged.text


def test_a_failed_run_does_not_flatten_the_others_and_the_text_states_its_values(merged):
    low, high = limits(merged, "/run_2_slow/compare/error_α_mrad")
    complete = merged.series("/run_2_slow/compare/error_α_mrad")[1]
    settled = complete[len(complete) // 2 :]
    assert low <= settled.min() <= settled.max() <= high
    assert high - low < np.ptp(complete) / 4  # the transient is not within
    of_failed = merged.series("/run_3_failed/compare/error_α_mrad")[1]
    farthest = of_failed[np.argmax(np.abs(of_failed))][0]
    assert abs(farthest) > 2 * max(abs(low), abs(high))
    assert re.search(rf"^- α error \(mrad\): .*run 3 reaches {number(farthest)} \(", merged.text, re.M)


def test_sibling_plots_have_one_range_and_another_tab_has_all_values(merged):
    assert len({tuple(limits(merged, f"/run_2_slow/compare/error_{axis}_mrad")) for axis in "αβγ"}) == 1
    (layout,) = layouts(merged.path)
    names = {rows[0][0] for (_, name), rows in layout.items() if name == "ContainerBlueprint:display_name"}
    assert {"settled", "all values", "minus run 1"} <= names


def test_differences_are_those_at_the_ticks_of_both_runs(files, merged):
    first, slow = (read(files[name]).table for name in ("first", "slow"))
    t_ns, values = merged.series("/run_2_slow/difference/error_β_mrad")
    count = len(t_ns)
    assert count == len(first) // 2  # twice the period, and a longer run
    expected = 1e3 * (slow["error_rad"][:count, 1] - first["error_rad"][::2, 1])
    np.testing.assert_allclose(values[:, 0], expected)
    assert not any(entity.startswith("/run_1_first/difference") for entity in merged.entities)


def test_the_largest_and_rms_error_of_each_run_are_next_to_its_name(files, merged):
    table = read(files["slow"]).table
    largest, rms = (
        [number(value) for value in values]
        for values in (
            1e3 * np.abs(table["error_rad"]).max(axis=0),
            1e3 * np.sqrt(np.mean(table["error_rad"] ** 2, axis=0)),
        )
    )
    (row,) = (line for line in merged.text.splitlines() if re.match(r"\| 2 +\|", line))
    assert [cell.strip() for cell in row.strip("| ").split("|")] == ["2", *largest, *rms]


@pytest.mark.parametrize(
    ("sizes", "most"),
    [((3.6, 20.6, 1000.0), 20.6), ((3.6, 1000.0), 3.6), ((3.6, 20.6), 20.6), ((100.0, 1000.0), 1000.0)],
)
def test_a_run_that_is_far_off_does_not_flatten_the_others(sizes, most):
    columns = [size * np.sin(40 * T_s) for size in sizes]
    low, high = settled_bounds([run_of(column) for column in columns], columns, 0.1)
    assert (-low, high) == pytest.approx((1.1 * most, 1.1 * most), rel=1e-2)


def test_a_run_far_from_the_reference_is_outside():
    columns = [size * np.sin(40 * T_s) for size in (0.2, 0.7)]
    _, high = settled_bounds([run_of(column) for column in columns], columns, 0.01, columns[:1])
    assert high == pytest.approx(1.1 * 0.2, rel=1e-2)


def test_titles_of_plots_with_values_outside_say_so(merged):
    (layout,) = layouts(merged.path)
    titles = [rows[0][0] for (_, name), rows in layout.items() if name == "ViewBlueprint:display_name"]
    cut = {title.removesuffix(", cut") for title in titles if title.endswith(", cut")}
    assert {"α mrad", "β mrad", "γ mrad"} <= cut
    stated = re.findall(r"^- (.*) \(([^()]*)\): run", merged.text, re.MULTILINE)
    headings = {(of.title, of.unit): _heading(of) for of in COMPARED_QUANTITIES}
    assert cut == {headings[of] for of in stated}


@pytest.mark.parametrize(
    ("runs", "out", "complaint"),
    [
        (["first", "slow"], "no folder/out.rrd", "expected a writable path"),
        (["first", "slow"], "first.rrd", "which exists"),
        (["first", "missing"], "out.rrd", "expected the file of a run"),
    ],
)
def test_a_merge_that_is_refused_changes_nothing(files, tmp_path, runs, out, complaint, capsys):
    shutil.copy(files["first"], here := tmp_path / "first.rrd")
    before = here.read_bytes()
    paths = [str({**files, "first": here, "missing": tmp_path / "missing.rrd"}[name]) for name in runs]
    assert cli.main(["review", *paths, "--merge", str(tmp_path / out)]) == 2
    printed = capsys.readouterr()
    (line,) = printed.err.splitlines()
    assert (complaint in line, printed.out) == (True, "")
    assert os.listdir(tmp_path) == ["first.rrd"]
    assert here.read_bytes() == before


def test_the_name_of_a_run_of_which_parts_are_left_is_none_for_the_result(tmp_path):
    run = tmp_path / "run.rrd"
    with pytest.raises(InputError, match="which is a run"):
        comparison.check_merge(run, [run])


def test_runs_of_other_actuators_and_without_a_tick_are_refused_by_name(files, tmp_path):
    run = read(files["first"])
    fewer = Table(
        tuple(replace(each, size=each.size - 1, labels=()) if each.name == "current_A" else each
              for each in run.table.signals),
        run.table.values[:, 1:],
    )  # fmt: skip
    for table, complaint in (
        (fewer, r"expected an actuator of 18 coil groups .* received one of 17"),
        (run.table.rows(0, 0), "expected a run of at least one tick"),
    ):
        with pytest.raises(InputError, match=complaint):
            comparison.merge([run, replace(run, table=table)], tmp_path / "out.rrd")
    assert os.listdir(tmp_path) == []


def test_a_result_that_cannot_be_completed_leaves_nothing(files, tmp_path, monkeypatch):
    """An error after the first run is written, as a panic of Rerun's would be."""
    runs = [read(files["first"]), read(files["slow"])]

    monkeypatch.setattr(Ghost, "begin", Mock(side_effect=BaseException("a panic")))
    with pytest.raises(BaseException, match="a panic"):
        comparison.merge(runs, tmp_path / "out.rrd")
    assert os.listdir(tmp_path) == []


def test_a_recording_that_keeps_some_rows_gives_those_and_no_others(files, tmp_path):
    path, out = tmp_path / "thin.rrd", tmp_path / "out.rrd"
    run = ["simulate", "hold", "--plant.engine", "lagrangian", "--duration", "0.5", "--json"]
    assert cli.main([*run, "--record", str(path), "--record-rate", "20"]) == 0
    assert cli.main(["review", str(path), str(files["first"]), "--merge", str(out)]) == 0
    thin = read(path)
    assert len(thin.table) < len(thin.every_tick) == thin.record.ticks == 500
    assert has_every_row(Merged(out), thin, "/run_1_thin/telemetry")
