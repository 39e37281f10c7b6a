"""Currents by hand: those that were asked for, the law asked for nothing, and everything else as it was."""

import numpy as np
import pytest

from spheretwin import cli
from spheretwin import scenario as scenarios
from spheretwin.control.manual_currents import Manual, command_manual_currents
from spheretwin.models.telemetry.table import read_parquet
from spheretwin.session import Session
from spheretwin.simulation import simulate

CURRENTS = [0.1 * (-1) ** group * group for group in range(18)]
FAST = {"plant.engine": "lagrangian", "disturbance.random_bound_Nm": 0.0, "disturbance.load": 0.0}


def by_hand(**changes):
    return simulate(
        scenarios.load("sinusoid", FAST | {"duration": 0.05, "manual.currents_A": CURRENTS} | changes)
    )


def test_each_group_is_commanded_its_current_and_the_law_is_not_called():
    rows = by_hand().telemetry
    np.testing.assert_array_equal(rows["current_command_A"], np.tile(CURRENTS, (50, 1)))
    np.testing.assert_array_equal(rows["torque_command_Nm"], 0.0)
    np.testing.assert_array_equal(rows["allocation_scale"], 1.0)
    assert np.abs(rows["torque_Nm"]).max() > 0.0


def test_no_group_is_commanded_more_than_the_limit():
    rows, command = Manual.zeros(groups=3), np.empty(3)
    rows["current_A"] = [0.5, -4.0, 10.0]
    share = command_manual_currents(rows[0], 2.0, command)
    np.testing.assert_array_equal(command, [0.5, -2.0, 2.0])
    assert share == 0.2
    rows = by_hand(**{"nominal.current_limit_A": 0.4, "drive.current_limit_A": 0.3}).telemetry
    assert 0.29 < np.abs(rows["current_A"]).max() <= 0.3  # the drive keeps its own limit
    np.testing.assert_array_equal(rows["current_command_A"][0], np.clip(CURRENTS, -0.4, 0.4))
    np.testing.assert_array_equal(rows["allocation_scale"], 0.4 / max(map(abs, CURRENTS)))


@pytest.mark.parametrize("law", ["pd", "pid", "afsm", "adrc"])
def test_a_law_that_takes_over_again_begins_anew(law):
    """After a while by hand, it asks for what it would at the start of a run from that pose."""
    with Session(scenarios.load("hold", FAST | {"controller.law": law})) as session:
        session.advance(200)
        session.set("manual.currents_A", [0.0] * 18)
        session.advance(30)
        pose, rates = session.q_rad, session.qdot_rad_s
        session.set("manual.currents_A", None)
        rows = session.advance(20)
    started = FAST | {
        "controller.law": law,
        "plant.initial_rad": pose.tolist(),
        "plant.initial_rad_s": rates.tolist(),
    }
    with Session(scenarios.load("hold", started)) as fresh:
        again = fresh.advance(20)
    # The currents of both are 0 to 1e-19 A after 30 ms, and the laws know no absolute time.
    np.testing.assert_allclose(rows["torque_command_Nm"], again["torque_command_Nm"], rtol=1e-9, atol=1e-12)


def test_other_currents_by_hand_leave_the_law_where_it_was():
    with Session(scenarios.load("hold", FAST | {"controller.law": "pid"})) as session:
        session.set("manual.currents_A", [0.0] * 18)
        first = session.advance(3)
        session.set("manual.currents_A", CURRENTS)
        second = session.advance(3)
    logged = first.signals[12:]
    assert second.signals == first.signals
    for signal in logged:
        np.testing.assert_array_equal(second[signal.name], first[signal.name])


def series_file(folder, t_s, currents_A, groups=18):
    header = ",".join(["t_s", *(f"current_{group:02}_A" for group in range(groups))])
    rows = [",".join(map(repr, map(float, [t, *row]))) for t, row in zip(t_s, currents_A, strict=True)]
    (path := folder / "currents.csv").write_text("\n".join([header, *rows]) + "\n")
    return str(path)


def test_currents_of_a_file_are_commanded_at_their_times(tmp_path):
    generator = np.random.default_rng(3)
    t_s, currents_A = np.array([0.01, 0.02, 0.0255, 0.04]), generator.uniform(-1, 1, (4, 18))
    path, ticks = series_file(tmp_path, t_s, currents_A), 1e-3 * np.arange(50)
    fields = FAST | {"duration": 0.05, "manual.file": path}
    zero_order_hold = simulate(scenarios.load("sinusoid", fields)).telemetry["current_command_A"]
    before = [max(sum(t_s <= t + 1e-9) - 1, 0) for t in ticks]
    np.testing.assert_array_equal(zero_order_hold, currents_A[before])
    linear = simulate(scenarios.load("sinusoid", fields | {"manual.between": "linear"})).telemetry
    expected = np.stack([np.interp(ticks, t_s, column) for column in currents_A.T], axis=1)
    np.testing.assert_allclose(linear["current_command_A"], expected, atol=1e-10)  # times within 1e-12
    assert np.abs(expected - zero_order_hold).max() > 0.1


def test_a_file_of_currents_is_replayed_and_its_limit_counts(tmp_path):
    first, again = tmp_path / "first.parquet", tmp_path / "again.parquet"
    path = series_file(tmp_path, [0.0, 0.01], [[0.5] * 18, [-3.0] * 18])
    flags = ["--duration", "0.03", "--manual.file", path, "--nominal.current-limit-A", "2"]
    assert cli.main(["simulate", "hold", *flags, "--telemetry", str(first)]) == cli.DONE
    assert cli.main(["simulate", "--replay", str(first), "--telemetry", str(again)]) == cli.DONE
    assert first.read_bytes() == again.read_bytes()
    rows = read_parquet(first)[0]
    np.testing.assert_array_equal(rows["current_command_A"][[9, 10], 7], [0.5, -2.0])
    assert rows["allocation_scale"][10] == pytest.approx(2 / 3)
