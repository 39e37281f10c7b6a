"""Runs merged into one recording: every number of each run, and a layout of existing entities only."""

import os
import shutil
from dataclasses import replace

import numpy as np
import pyarrow as pa
import pytest
from rerun.chunk import RrdReader

from spheretwin import cli
from spheretwin.analysis import comparison
from spheretwin.analysis.recorded_run import read
from spheretwin.models.base.errors import InputError
from spheretwin.models.telemetry.signals import ANGLES
from spheretwin.models.telemetry.table import Table, read_parquet
from spheretwin.viz.comparison.ghosts import Ghost
from spheretwin.viz.layout.view import TIMELINE
from spheretwin.viz.quantities import SCALAR_QUANTITIES
from tests.twin.analysis.runs import written

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


class Merged:
    """What a merged recording holds, read chunk by chunk."""

    def __init__(self, path):
        self.path, self.entities, self.columns, self.names = path, set(), {}, {}
        for chunk in RrdReader(path).stream():
            self.entities.add(chunk.entity_path)
            batch = chunk.to_record_batch()
            if "Scalars:scalars" in batch.schema.names:
                self.take(batch, chunk.entity_path, batch.column("Scalars:scalars"))
            if "values_0" in batch.schema.names:
                rows = batch.column("values_0").flatten()
                for field in rows.type:
                    self.take(batch, f"{chunk.entity_path}:{field.name}", rows.field(field.name))
            if "SeriesLines:names" in batch.schema.names:
                self.names[chunk.entity_path] = batch.column("SeriesLines:names").to_pylist()[0]

    def take(self, batch, name, column):
        t_ns = np.asarray(batch.column(TIMELINE).cast(pa.int64()))
        values = np.asarray(column.flatten()).reshape(len(t_ns), -1)
        self.columns.setdefault(name, []).append((t_ns, values))

    def values(self, entity):
        return np.concatenate([values for _, values in sorted(self.columns[entity], key=lambda c: c[0][0])])

    def t_ns(self, entity):
        return np.concatenate([t_ns for t_ns, _ in sorted(self.columns[entity], key=lambda c: c[0][0])])


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
        for each in SCALAR_QUANTITIES
        if f"/run_1_first/compare/{each.name}" in merged.entities
    }
    # Rounding of angles below 1 rad, in mrad.
    np.testing.assert_allclose(apart["error_α_mrad"], APART_mrad, rtol=0, atol=1e-12)
    np.testing.assert_allclose(apart["angle_α_rad"], 1e-3 * APART_mrad, rtol=0, atol=1e-15)
    for name in ("error_β_mrad", "error_γ_mrad", "torque_asked_Nm", "largest_current_A", "torque_margin"):
        assert not apart[name].any()
    assert apart["error_angle_deg"].any()


def test_the_reference_is_recorded_once(merged):
    leading = {entity.split("/")[2] for entity in merged.entities if entity.startswith("/what_was_asked/")}
    assert leading == {"run_3_slow"}  # the longest of runs that were asked for the same
    wanted = merged.values("/what_was_asked/run_3_slow/angle_α_rad")
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


def test_nothing_but_the_file_is_left(merged):
    assert os.listdir(merged.path.parent) == ["all.rrd"]


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
    found = Merged(out)
    for signal in thin.table.signals:
        column = thin.table[signal.name].reshape(len(thin.table), -1)
        assert found.values(f"/run_1_thin/telemetry:{signal.name}").tobytes() == column.tobytes()
