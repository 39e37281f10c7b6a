"""Runs merged into one recording: every number of each run, and a layout of existing entities only."""

import os
import re
import shutil
from dataclasses import replace

import numpy as np
import pyarrow as pa
import pytest
import rerun as rr
from rerun.chunk import RrdReader

from spheretwin import cli
from spheretwin.analysis import comparison
from spheretwin.analysis.recorded_run import events, read
from spheretwin.models.base.errors import InputError
from spheretwin.models.telemetry.signals import ANGLES
from spheretwin.models.telemetry.status import Status
from spheretwin.models.telemetry.table import Table, read_parquet
from spheretwin.viz import theme
from spheretwin.viz.comparison.ghosts import Ghost
from spheretwin.viz.comparison.merged_recording import EDGE
from spheretwin.viz.layout.extents import number
from spheretwin.viz.layout.styles import MIDDLE, THICK, THIN
from spheretwin.viz.layout.view import TIMELINE
from spheretwin.viz.quantities import COMPARED_QUANTITIES
from spheretwin.viz.scene.entities import shaft_tip
from tests.twin.analysis.runs import written
from tests.viz.comparison.merged import Merged

APART_mrad = 3.0


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """A run, the same with α off by a known angle, a longer one at another rate, and one of another law."""
    folder = tmp_path_factory.mktemp("runs")
    first, recording = written(folder, "first", **{"duration": 0.3})
    table, metadata = read_parquet(first)
    moved = Table(table.signals, table.values.copy())
    for signal in ("q_rad", "error_rad"):
        moved[signal][:, 0] += 1e-3 * APART_mrad
    moved.write_parquet(folder / "moved.parquet", metadata)
    slow, _ = written(folder, "slow", **{"duration": 0.5, "controller.period_s": 2e-3})
    other, _ = written(folder, "other", **{"duration": 0.2, "controller.law": "pd", "disturbance.load": 2})
    return {"first": recording, "moved": folder / "moved.parquet", "slow": slow, "other": other}


@pytest.fixture(scope="module")
def merged(files, tmp_path_factory):
    out = tmp_path_factory.mktemp("merged") / "all.rrd"
    assert cli.main(["review", *map(str, files.values()), "--merge", str(out)]) == 0
    return Merged(out)


@pytest.fixture(scope="module")
def failed(files, tmp_path_factory):
    """A complete run merged with one that leaves the workspace."""
    folder = tmp_path_factory.mktemp("failed")
    path, _ = written(folder, "failed", **{"duration": 1.0, "controller.law": "pd", "disturbance.load": 60})
    out = folder / "all.rrd"
    assert cli.main(["review", str(files["slow"]), str(path), "--merge", str(out)]) == 0
    return read(path), Merged(out)


def test_every_signal_of_every_run_is_there_bit_for_bit(files, merged):
    for place, (name, path) in enumerate(files.items(), start=1):
        run = read(path)
        for signal in run.table.signals:
            entity = f"/run_{place}_{name}/telemetry:{signal.name}"
            column = run.table[signal.name].reshape(len(run.table), -1)
            assert merged.values(entity).tobytes() == column.tobytes()
            # Each at its own times, in whole nanoseconds.
            assert np.array_equal(merged.t_ns(entity), np.round(run.table["t_s"] * 1e9))


def test_a_known_difference_is_between_the_lines_of_two_runs(merged):
    apart = {
        each.name: merged.values(f"/run_2_moved/compare/{each.name}")
        - merged.values(f"/run_1_first/compare/{each.name}")
        for each in COMPARED_QUANTITIES
        if f"/run_1_first/compare/{each.name}" in merged.entities
    }
    # Rounding of angles below 1 rad, in mrad.
    np.testing.assert_allclose(apart["error_α_mrad"], APART_mrad, rtol=0, atol=1e-12)
    np.testing.assert_allclose(apart["angle_α_rad"], 1e-3 * APART_mrad, rtol=0, atol=1e-15)
    for name in (
        "error_β_mrad",
        "error_γ_mrad",
        "torque_command_norm_Nm",
        "largest_current_A",
        "torque_margin",
    ):
        assert not apart[name].any()
    assert apart["error_angle_deg"].any()


def test_the_reference_is_recorded_once(merged):
    leading = {entity.split("/")[2] for entity in merged.entities if entity.startswith("/setpoint/")}
    assert leading == {"run_3_slow"}  # the longest of runs that were asked for the same
    wanted = merged.values("/setpoint/run_3_slow/angle_α_rad")
    assert np.array_equal(wanted, merged.values("/run_3_slow/telemetry:q_ref_rad")[:, :1])


def test_a_legend_says_which_run_a_line_is_and_in_what_it_differs(merged):
    for place, name in ((1, "first"), (4, "other")):
        ((label,),) = {
            tuple(merged.names[f"/run_{place}_{name}/compare/error_{each}_mrad"]) for each in ANGLES
        }
        assert label.startswith(f"{place} {name}: {'afsm' if place == 1 else 'pd'}, ")
    assert "L 2" in label


def test_the_layout_names_only_what_there_is(merged):
    """Every path that a view of the blueprint wants, or overrides, as Rerun's own reader gives them."""
    reader, wanted = RrdReader(merged.path), set()
    for chunk in reader.stream(store=reader.blueprints()[0]):
        batch = chunk.to_record_batch()
        if "ViewContents:query" in batch.schema.names:
            wanted |= {line for cell in batch.column("ViewContents:query").to_pylist() for line in cell}
        _, _, overridden = chunk.entity_path.partition("/overrides")
        wanted.add(overridden.removesuffix("/visualizers"))
    assert "/runs" in merged.entities  # the text, whose view wants what is below its own origin
    wanted -= {"", "$origin/**"}
    assert len(wanted) > 40
    for path in wanted:
        below = path.removesuffix("/**").removeprefix("- ")
        assert any(each == below or each.startswith(f"{below}/") for each in merged.entities), path


def test_every_run_has_a_body_and_one_alone_has_the_whole_actuator(merged):
    for place, name in enumerate(("first", "moved", "slow", "other"), start=1):
        assert f"/run_{place}_{name}/world/rotor/ball" in merged.entities
        assert f"/run_{place}_{name}/tip/point" in merged.entities
        assert (f"/run_{place}_{name}/world/coils" in merged.entities) == (place == 1)


def test_the_coils_have_the_colours_of_the_first_run_s_currents(files, merged):
    table = read(files["first"]).table
    rows = [
        np.frombuffer(bytes(texel), np.uint8)
        for chunk in RrdReader(merged.path).stream().filter(content="/run_1_first/world/coils")
        if "Mesh3D:albedo_texture_buffer" in (batch := chunk.to_record_batch()).schema.names
        for (texel,) in batch.column("Mesh3D:albedo_texture_buffer").to_pylist()
    ]
    limit_A = read(files["first"]).record.scenario["drive"]["current_limit_A"]
    expected = theme.current_colours(table["current_A"], limit_A)
    np.testing.assert_array_equal(rows, expected.reshape(len(table), -1))


def test_nothing_but_the_file_is_left(merged):
    assert os.listdir(merged.path.parent) == ["all.rrd"]


def rgb(packed):
    return packed >> 24, packed >> 16 & 255, packed >> 8 & 255


def colours(merged, entity, kind):
    (row,) = merged.static[entity, kind]
    return [rgb(packed) for packed in row]


def test_lines_have_the_colours_of_their_runs_and_the_viewer_draws_every_extreme(merged):
    names = ("first", "moved", "slow", "other")
    expected = [theme.rgb(colour) for colour in theme.run_colours(["afsm", "afsm", "afsm", "pd"])]
    for place, (name, colour) in enumerate(zip(names, expected, strict=True), start=1):
        entity = f"/run_{place}_{name}/compare/error_α_mrad"
        assert colours(merged, entity, "SeriesLines:colors") == [colour]
        (policy,) = merged.static[entity, "SeriesLines:aggregation_policy"]
        assert policy == [rr.components.AggregationPolicy.MinMax.value]
        assert colours(merged, f"/run_{place}_{name}/tip/point", "Points3D:colors") == [colour]
    assert colours(merged, "/legend", "LineStrips2D:colors") == expected
    assert colours(merged, "/setpoint/run_3_slow/angle_β_rad", "SeriesLines:colors") == [theme.COMMAND]


def test_every_line_has_every_row_to_the_end_of_its_run(files, merged):
    for place, (name, path) in enumerate(files.items(), start=1):
        run = read(path)
        for quantity in COMPARED_QUANTITIES:
            entity = f"/run_{place}_{name}/compare/{quantity.name}"
            if entity in merged.entities:
                assert np.array_equal(merged.t_ns(entity), np.round(run.table["t_s"] * 1e9))
        error = merged.values(f"/run_{place}_{name}/compare/error_β_mrad")[:, 0]
        assert np.array_equal(error, 1e3 * run.table["error_rad"][:, 1])
        torque = merged.values(f"/run_{place}_{name}/compare/torque_command_norm_Nm")[:, 0]
        np.testing.assert_allclose(torque, np.linalg.norm(run.table["torque_command_Nm"], axis=1))


def test_the_legend_is_a_view_of_its_own_and_plots_have_none(merged):
    (labels,) = merged.static["/legend", "LineStrips2D:labels"]
    assert [label.split(":")[0] for label in labels] == ["1 first", "2 moved", "3 slow", "4 other"]
    (strips,) = merged.static["/legend", "LineStrips2D:strips"]
    assert [strip[0][1] for strip in strips] == [0.0, 1.0, 2.0, 3.0]  # below one another
    reader = RrdReader(merged.path)
    visible = [
        value
        for chunk in reader.stream(store=reader.blueprints()[0])
        for name in chunk.to_record_batch().schema.names
        if name == "PlotLegend:visible"
        for value in chunk.to_record_batch().column(name).to_pylist()
    ]
    assert visible
    assert set(map(tuple, visible)) == {(False,)}


def test_the_text_names_runs_ends_and_the_differences_of_their_scenarios(merged, failed):
    ((text,),) = merged.static["/runs", "TextDocument:text"]
    assert "**scenario hold, m 0, hardware ideal**" in text
    assert "- 4 other: pd, L 2, duration 0.2" in text
    assert "completed" in text
    assert "| field | run 1 | run 2 | run 3 | run 4 |" in text
    assert "| L | 1 | 1 | 1 | 2 |" in text
    assert "| law | afsm | afsm | afsm | pd |" in text
    assert "| duration | 0.3 | 0.3 | 0.5 | 0.2 |" in text
    run, of_failed = failed
    ((text,),) = of_failed.static["/runs", "TextDocument:text"]
    end_s, _, reason = events(run)[-1]
    complete, other = (line for line in text.splitlines() if line.startswith("- ") and ", " in line)
    assert complete.startswith("- 1 slow")
    assert complete.endswith(", completed")
    assert other.startswith("- 2 failed")
    assert other.endswith(f"**left workspace at {end_s:.3f} s**: {reason}")


def test_the_end_of_a_failed_run_is_a_cross_at_its_last_value_in_every_plot(failed):
    run, merged = failed
    assert run.record.status is Status.LEFT_WORKSPACE
    ends = [entity for entity in merged.entities if "/end/" in entity]
    assert {entity.split("/")[1] for entity in ends} == {"run_2_failed"}
    assert len(ends) == len([entity for entity in merged.entities if "/run_2_failed/compare/" in entity])
    for entity in ends:
        assert list(merged.t_ns(entity)) == [round(run.table["t_s"][-1] * 1e9)]
        line = merged.values(entity.replace("/end/", "/compare/"))
        low, high = limits(merged, entity)
        edge = EDGE * (high - low)
        assert merged.values(entity)[0, 0] == pytest.approx(np.clip(line[-1, 0], low + edge, high - edge))
        (name,) = merged.static[entity, "SeriesPoints:names"]
        assert name[0].endswith(f"; left workspace at {run.table['t_s'][-1]:.3g} s")


def limits(merged, entity):
    """Range of the plot that contains an entity."""
    reader = RrdReader(merged.path)
    ranges, queries = {}, {}
    for chunk in reader.stream(store=reader.blueprints()[0]):
        batch, (view, _, part) = chunk.to_record_batch(), chunk.entity_path.rpartition("/")
        if part == "ScalarAxis":
            ranges[view] = batch.column("ScalarAxis:range").to_pylist()[0][0]
        if part == "ViewContents":
            queries[view] = batch.column("ViewContents:query").to_pylist()[0]
    (view,) = (view for view, query in queries.items() if entity in query)
    return ranges[view]


def test_a_failed_run_does_not_flatten_the_other_and_the_text_states_its_values(failed):
    _, merged = failed
    low, high = limits(merged, "/run_1_slow/compare/error_α_mrad")
    complete = merged.values("/run_1_slow/compare/error_α_mrad")
    settled = complete[len(complete) // 2 :]
    assert low <= settled.min() <= settled.max() <= high
    assert high - low < np.ptp(complete) / 4  # the transient is not within
    of_failed = merged.values("/run_2_failed/compare/error_α_mrad")
    farthest = of_failed[np.argmax(np.abs(of_failed))][0]
    assert abs(farthest) > 2 * max(abs(low), abs(high))
    ((text,),) = merged.static["/runs", "TextDocument:text"]
    assert f"- α error (mrad): run 2 reaches {number(farthest)} (" in text


def paths_of(merged, entity):
    """Ends of the segments of a path, in the order of time."""
    segments = []
    for chunk in RrdReader(merged.path).stream().filter(has_timeline=TIMELINE):
        batch = chunk.to_record_batch()
        if chunk.entity_path == entity and "LineStrips3D:strips" in batch.schema.names:
            t_ns = np.asarray(batch.column(TIMELINE).cast(pa.int64()))
            segments += list(zip(t_ns, batch.column("LineStrips3D:strips").to_pylist(), strict=True))
    return {int(t_ns): strip[0][-1] for t_ns, strip in sorted(segments, key=lambda item: item[0])}


@pytest.mark.parametrize(
    ("entity", "signal"), [("/run_3_slow/tip/path", "q_rad"), ("/setpoint/run_3_slow/tip/path", "q_ref_rad")]
)
def test_paths_of_tips_are_those_of_the_run_and_of_its_reference(files, merged, actuator, entity, signal):
    table = read(files["slow"]).table
    ends = paths_of(merged, entity)
    assert len(ends) > 10
    tips = dict(zip(np.round(table["t_s"] * 1e9), shaft_tip(table[signal], actuator), strict=True))
    for t_ns, end in ends.items():
        np.testing.assert_allclose(end, tips[t_ns], atol=1e-7)  # single precision


def test_every_plot_has_the_time_of_the_longest_run_and_its_range(merged):
    reader = RrdReader(merged.path)
    ends = [
        cell["end"]
        for chunk in reader.stream(store=reader.blueprints()[0])
        if chunk.entity_path.endswith("/TimeAxis")
        for row in chunk.to_record_batch().column("TimeAxis:view_range").to_pylist()
        for cell in row
    ]
    assert len(ends) >= 11
    longest_ns = round(merged.t_ns("/run_3_slow/compare/error_α_mrad")[-1])
    assert all(str(longest_ns) in str(end) for end in ends)
    for place, name in enumerate(("first", "moved", "slow", "other"), start=1):
        low, high = limits(merged, f"/run_{place}_{name}/compare/error_angle_deg")
        settled = merged.values(f"/run_{place}_{name}/compare/error_angle_deg")
        assert low <= settled[len(settled) // 2 :].min() <= settled[len(settled) // 2 :].max() <= high


def test_titles_of_plots_with_values_outside_say_so(merged, failed):
    for recording in (merged, failed[1]):
        reader = RrdReader(recording.path)
        cut = {
            name.removesuffix(", cut").partition(" [")[0]
            for chunk in reader.stream(store=reader.blueprints()[0])
            if "ViewBlueprint:display_name" in (batch := chunk.to_record_batch()).schema.names
            for cell in batch.column("ViewBlueprint:display_name").to_pylist()
            for name in cell or []
            if name.endswith(", cut")
        }
        ((text,),) = recording.static["/runs", "TextDocument:text"]
        assert cut == set(re.findall(r"^- ([^,\n]*) \([^)\n]*\): run", text, re.MULTILINE))
    assert "α error" in cut


def test_plots_have_titles_with_units_and_a_wide_line_under_the_reference(merged):
    reader = RrdReader(merged.path)
    titles = {
        name.removesuffix(", cut")
        for chunk in reader.stream(store=reader.blueprints()[0])
        if "ViewBlueprint:display_name" in (batch := chunk.to_record_batch()).schema.names
        for cell in batch.column("ViewBlueprint:display_name").to_pylist()
        for name in cell or []
    }
    shown = {
        quantity.heading
        for quantity in COMPARED_QUANTITIES
        if f"/run_4_other/compare/{quantity.name}" in merged.entities
    }
    assert shown <= titles
    for entity, width in (
        ("/run_1_first/compare/angle_β_rad", THICK),
        ("/setpoint/run_3_slow/angle_β_rad", THIN),
        ("/run_1_first/compare/error_β_mrad", MIDDLE),
    ):
        assert merged.static[entity, "SeriesLines:widths"] == [[width]]


def test_every_path_is_shown_over_the_last_seconds(merged):
    reader = RrdReader(merged.path)
    shown = {
        chunk.entity_path.partition("/overrides")[2]
        for chunk in reader.stream(store=reader.blueprints()[0])
        if any("VisibleTimeRanges" in name for name in chunk.to_record_batch().schema.names)
    }
    tips = {entity for entity in merged.entities if entity.endswith("/tip/path")}
    assert len(tips) == 5
    assert tips <= {path.removesuffix("/visualizers") for path in shown}


# --- what is refused


@pytest.mark.parametrize(
    ("runs", "out", "complaint"),
    [
        (["first"], "out.rrd", "expected two runs or more for --merge, received one"),
        (["first", "slow"], "out.parquet", "expected --merge OUT.rrd"),
        (["first", "slow"], "no folder/out.rrd", "expected a writable path"),
        (["first", "slow"], "first.rrd", "which exists"),
        (["first", "missing"], "out.rrd", "expected the file of a run"),
    ],
)
def test_what_cannot_be_merged_is_refused_on_one_line(files, tmp_path, runs, out, complaint, capsys):
    shutil.copy(files["first"], here := tmp_path / "first.rrd")
    before = here.read_bytes()
    paths = [str({**files, "first": here, "missing": tmp_path / "missing.rrd"}[name]) for name in runs]
    assert cli.main(["review", *paths, "--merge", str(tmp_path / out)]) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    (line,) = printed.err.splitlines()
    assert complaint in line
    assert os.listdir(tmp_path) == ["first.rrd"]
    assert here.read_bytes() == before


def test_the_name_of_a_run_of_which_parts_are_left_is_none_for_the_result(tmp_path):
    run = tmp_path / "run.rrd"
    with pytest.raises(InputError, match="which is a run"):
        comparison.check_merge(run, [run])


def test_runs_of_other_actuators_are_refused_by_name(files, tmp_path):
    run = read(files["first"])
    fewer = Table(
        tuple(replace(each, size=each.size - 1, labels=()) if each.name == "current_A" else each
              for each in run.table.signals),
        run.table.values[:, 1:],
    )  # fmt: skip
    with pytest.raises(InputError, match=r"expected an actuator of 18 coil groups .* received one of 17"):
        comparison.merge([run, replace(run, table=fewer)], tmp_path / "out.rrd")
    assert os.listdir(tmp_path) == []


def test_a_run_without_a_tick_is_refused_by_name(files, tmp_path):
    run = read(files["first"])
    with pytest.raises(InputError, match="expected a run of at least one tick"):
        comparison.merge([run, replace(run, table=run.table.rows(0, 0))], tmp_path / "out.rrd")


def test_a_result_that_cannot_be_completed_leaves_nothing(files, tmp_path, monkeypatch):
    """What goes wrong after the first run is written, as a panic of Rerun's would."""
    runs = [read(files["first"]), read(files["slow"])]

    def panic(*_):
        raise BaseException("a panic")

    monkeypatch.setattr(Ghost, "begin", panic)
    with pytest.raises(BaseException, match="a panic"):
        comparison.merge(runs, tmp_path / "out.rrd")
    assert os.listdir(tmp_path) == []


def test_a_recording_that_keeps_some_rows_gives_those_and_no_others(files, tmp_path):
    path, out = tmp_path / "thin.rrd", tmp_path / "out.rrd"
    run = ["simulate", "hold", "--plant.engine", "lagrangian", "--duration", "0.5", "--json"]
    assert cli.main([*run, "--record", str(path), "--record-rate", "20"]) == 0
    assert cli.main(["review", str(path), str(files["first"]), "--merge", str(out)]) == 0
    thin = read(path)
    assert len(thin.table) < len(thin.every_tick) == 500
    assert thin.record.ticks == 500
    result = Merged(out)
    for signal in thin.table.signals:
        column = thin.table[signal.name].reshape(len(thin.table), -1)
        assert result.values(f"/run_1_thin/telemetry:{signal.name}").tobytes() == column.tobytes()
