"""A study as a whole: the same table however it is run, failures that are rows, plants that agree."""

import json
from contextlib import nullcontext
from unittest.mock import Mock

import pytest

from spheretwin.models.base.errors import InputError, SpheretwinError
from spheretwin.study import agreement
from spheretwin.study import table as tables
from spheretwin.study.grid import Grid
from spheretwin.study.row import Rows
from spheretwin.study.runner import check, run
from spheretwin.study.study import load, shipped
from tests.twin.study.cases import SHORT, loads, rows_of, run_rows, study, table, values


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """Folder of a study that was run at once on one thread."""
    folder = tmp_path_factory.mktemp("whole")
    run_rows(loads(), folder)
    return folder


@pytest.mark.parametrize("threads", [2, 64])
def test_threads_change_no_byte(whole, tmp_path, threads):
    run_rows(loads(), tmp_path, threads=threads)
    assert table(tmp_path) == table(whole)


@pytest.mark.parametrize("threads", [1, 2])
def test_a_study_that_is_stopped_goes_on_to_the_same_table(whole, tmp_path, monkeypatch, threads):
    monkeypatch.setattr("spheretwin.study.engines.threads.AHEAD", 4)  # otherwise one piece has all 24 rows
    counts = [0]
    while counts[-1] < 24:
        messages = []
        done = run(
            loads(),
            tmp_path,
            threads=threads,
            done=lambda *message, messages=messages: messages.append(message),
            stop_requested=lambda messages=messages: len(messages) > 2,  # after the second row
        )
        assert messages == [(rows, 24) for rows in range(counts[-1], done.rows + 1)]
        assert len(rows_of(tmp_path)) == done.rows > counts[-1] == done.resumed
        counts.append(done.rows)
    assert len(counts) > 3
    assert table(tmp_path) == table(whole)


@pytest.mark.parametrize("threads", [1, 2])
def test_a_study_over_laws_and_hardware_is_the_same_in_pieces(tmp_path, threads):
    """Rows of several kinds, which share no set-up, one after the other in one process."""
    laws = [{"law": "pd"}, {"law": "afsm"}, {"law": "pid"}]
    axes = values("hardware", "ideal", "electronics"), values("disturbance.load", 0.5, 2.0)
    kinds = study(*axes, law=laws, fast=False)
    run_rows(kinds, tmp_path / "whole")
    for limit in (3, 8, None):
        run_rows(kinds, tmp_path / "pieces", threads=threads, limit=limit)
    assert table(tmp_path / "pieces") == table(tmp_path / "whole")
    # Rows with telemetry have sensors that other rows do not need.
    with_telemetry = run_rows(kinds.model_copy(update={"telemetry": (6, 8)}), tmp_path / "telemetry")
    assert with_telemetry == rows_of(tmp_path / "whole")
    alone = Rows(kinds)
    for row, of_table in zip(Grid(kinds), rows_of(tmp_path / "whole"), strict=True):
        ((_, _, _, figures),) = alone.run([row])
        assert figures == {name: of_table[name] for name in figures}


def test_a_limit_runs_the_first_rows_and_drops_no_finished_one(whole, tmp_path):
    assert run_rows(loads(), tmp_path, limit=5) == rows_of(whole)[:5]
    done = run(loads(), tmp_path, limit=3)
    assert (done.rows, done.of, done.study_rows, done.resumed) == (5, 5, 24, 5)
    assert rows_of(tmp_path) == rows_of(whole)[:5]
    run_rows(loads(), tmp_path)
    assert table(tmp_path) == table(whole)
    done = run(loads(), tmp_path, limit=5)
    assert (done.rows, done.of, done.study_rows, done.resumed) == (24, 24, 24, 24)
    assert table(tmp_path) == table(whole)


def test_rows_behind_a_limit_stay_where_rows_before_it_are_missing(whole, tmp_path):
    run_rows(loads(), tmp_path)
    journal = tmp_path / "journal.jsonl"
    head, *lines = journal.read_bytes().splitlines(keepends=True)
    # Rows 3, 4 and 5 are left.
    journal.write_bytes(head + b"".join(line for line in lines if json.loads(line)[0] in (3, 4, 5)))
    counts = []
    done = run(loads(), tmp_path, limit=2, done=lambda rows, of: counts.append((rows, of)))
    assert (done.rows, done.of, done.resumed) == (5, 5, 3)
    assert counts == [(3, 5), (4, 5), (5, 5)]
    assert rows_of(tmp_path) == [rows_of(whole)[row] for row in (0, 1, 3, 4, 5)]


def test_a_table_in_many_batches_has_the_same_rows(whole, tmp_path, monkeypatch):
    monkeypatch.setattr(tables, "BATCH_ROWS", 5)
    assert run_rows(loads(), tmp_path) == rows_of(whole)


def test_a_run_that_ends_early_is_a_row_with_what_it_gave(tmp_path):
    stuck = [{"target": "encoder.gamma", "mode": "dropout", "start_s": 0.01}]
    chosen = study(values("watchdog.on", True), fields={"duration": 0.3, "fault": stuck}, fast=False)
    (row,) = run_rows(chosen, tmp_path)
    assert (row["status"], row["reason"], row["error"]) == ("failsafe", "no fresh measurement", None)
    assert row["watchdog.on"] is True
    assert len(row["rms_error_rad"]) == 3


def test_plants_that_differ_end_the_study_and_keep_its_rows(tmp_path, monkeypatch):
    checked = []
    real = agreement._endings

    def elsewhere(rows, every, engine):
        checked.extend((row.number, engine) for row in every)
        return [
            (status, [(1 + 0.03 * (engine == "mujoco" and row.number > 0)) * each for each in rms])
            for row, (status, rms) in zip(every, real(rows, every, engine), strict=True)
        ]

    monkeypatch.setattr(agreement, "_endings", elsewhere)
    monkeypatch.setattr(agreement, "EVERY", 5)
    monkeypatch.setattr("spheretwin.study.engines.threads.AHEAD", 4)  # fewer than the rows behind the fault
    monkeypatch.setattr("spheretwin.study.engines.engine.TASK_S", 0.0)  # batches of one row
    with pytest.raises(SpheretwinError) as failure:
        run_rows(loads(), tmp_path)
    wrong = {number for number, _ in checked if number > 0}  # rows that had been handed out have their turn
    both = [(number, engine) for number in (0, *wrong) for engine in ("lagrangian", "mujoco")]
    assert sorted(checked) == sorted(both)
    first = min(wrong)
    assert f"expected row {first} to be the same on both plants within 0.02" in str(failure.value)
    assert "fast = false runs it on MuJoCo alone" in str(failure.value)
    fields = {row["row"] for row in rows_of(tmp_path)}
    assert fields.isdisjoint(wrong)
    # What had been handed out behind it is finished, no more.
    assert set(range(first)) <= fields
    assert max(fields | wrong) <= first + 4


@pytest.mark.parametrize("share", [0.019, 0.021])
def test_the_bound_of_the_plants_is_a_bound(tmp_path, monkeypatch, share):
    real = agreement._endings

    def shifted(rows, every, engine):
        # One and the same plant, so that the shift is all there is between them.
        shift = 1.0 - share * (engine == "lagrangian")
        return [(status, [shift * each for each in rms]) for status, rms in real(rows, every, "lagrangian")]

    monkeypatch.setattr(agreement, "_endings", shifted)
    is_within = share < agreement.BOUND
    with nullcontext() if is_within else pytest.raises(SpheretwinError, match="both plants"):
        assert run(study(), tmp_path).checked == 1


def test_the_rows_are_the_same_on_both_plants_within_the_bound(tmp_path):
    fast, slow = (run_rows(loads(fast=fast), tmp_path / str(fast)) for fast in (True, False))
    for ours, theirs in zip(fast, slow, strict=True):
        assert ours["key"] == theirs["key"]
        assert ours["rms_error_rad"] == pytest.approx(theirs["rms_error_rad"], rel=agreement.BOUND)


@pytest.mark.parametrize(
    "chosen",
    [
        study(fields={**SHORT, "plant.engine": "mujoco"}),
        study(fields={**SHORT, "plant.engine": "lagrangian"}),
        study(fields={**SHORT, "plant.integrator": "Euler"}),  # MuJoCo alone has it
        study(values("plant.engine", "mujoco", "lagrangian")),
        study(scenario="base.toml", fields={}),
    ],
)
def test_a_row_with_one_possible_plant_is_not_compared(tmp_path, chosen, monkeypatch):
    base = 'name = "b"\nduration = 0.02\nplant.engine = "mujoco"\ntrajectory.shape = "hold"\n'
    (tmp_path / "base.toml").write_text(base)
    monkeypatch.setattr(agreement, "_endings", lambda *_: pytest.fail("a row was run for a comparison"))
    monkeypatch.setattr(agreement, "check", lambda rows, checked: agreement._endings() if checked else ())
    chosen = chosen.model_copy(update={"folder": str(tmp_path)})
    assert not agreement.has_both(Rows(chosen), Grid(chosen)[0])
    assert run(chosen, tmp_path / "out").checked == 0


def test_a_folder_that_cannot_be_had_is_refused(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="expected a writable folder"):
        run_rows(study(), tmp_path / "file")
    (tmp_path / "journal.jsonl").mkdir()
    with pytest.raises(InputError, match="expected a folder for its journal"):
        run_rows(study(), tmp_path)


def test_a_failure_of_the_table_hides_no_other(tmp_path, monkeypatch):
    for module, name, message in ((tables, "write", "table"), (agreement, "check", "plants")):
        monkeypatch.setattr(module, name, Mock(side_effect=SpheretwinError(message)))
        with pytest.raises(SpheretwinError, match=message):
            run_rows(study(), tmp_path / message)


@pytest.mark.parametrize("name", shipped())
def test_shipped_studies_can_be_run(name):
    chosen = load(name)
    check(Grid(chosen), Rows(chosen))
