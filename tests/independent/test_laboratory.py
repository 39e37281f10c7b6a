"""The verbs on logs of the independent machine in C: own integrator, friction, sensors, controller."""

import json
from dataclasses import replace

import numpy as np
import pytest

from spheretwin import cli, machine
from tests.independent.changes import HELD_OUT, KINDS, judged
from tests.independent.laboratory import DATA_SHEET, SCENARIO, COUNT_rad, read_log, write_log
from tests.requirements import needs_c_compiler, needs_posix

pytestmark = [needs_c_compiler, needs_posix]

MAP = f"""
[time]
column = "micros"
unit = "us"
wrap = 4294967296

[angles]
columns = ["pot_a", "pot_b", "count"]
unit = ["deg", "deg", "rad"]
scale = [1, 1, {COUNT_rad}]

[currents]
columns = ["i*"]
unit = "mA"
kind = "commanded"
"""
# Tilts at which a wrong sign or order of an axis would be seen.
WIDE = "amplitude=0.4,0.35,0.5", "frequency=0.5,0.37,0.43"
MOTION = "amplitude=0.22,0.18,0.3", "frequency=0.53,0.71,0.43"


def test_its_log_is_accepted_and_its_shadow_is_consistent(tmp_path, capsys):
    path, columns = tmp_path / "log.csv", tmp_path / "map.toml"
    write_log(path, 3.0, *WIDE)
    columns.write_text(MAP)
    assert cli.main(["log", "check", str(path), "--columns", str(columns), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["accepted"]
    log = machine.read(path, columns)
    assert np.all(np.diff(log.t_s) > 0)  # micros() passes its rollover in this log
    followed = machine.shadow(log, SCENARIO, DATA_SHEET)
    assert followed.consistent
    assert not machine.shadow(log, SCENARIO, DATA_SHEET | {"plant.payload_kg": 0.1}).consistent


def test_exchanged_groups_and_a_reversed_axis_are_refused(tmp_path):
    log = read_log(tmp_path / "log.csv", 3.0, *WIDE)
    current_A, angle_rad = log.current_A.copy(), log.angle_rad.copy()
    current_A[:, [3, 7]] = current_A[:, [7, 3]]
    angle_rad[:, 1] *= -1
    assert not machine.check(replace(log, current_A=current_A), SCENARIO).accepted
    assert not machine.check(replace(log, angle_rad=angle_rad), SCENARIO).accepted


@pytest.mark.parametrize(("kind", "seed"), [("offset", 2), ("load", 4)])
def test_a_change_has_its_name(tmp_path, kind, seed):
    outcome = judged(tmp_path / "log.csv", seed, kind)
    assert (outcome.early, outcome.is_right) == (0, True)
    assert outcome.alarm.size == pytest.approx(outcome.change.size, rel=0.1)


@pytest.mark.release("56 logs, 5 min; test_a_change_has_its_name has two of them")
def test_changes_at_random_times_have_their_names(tmp_path):
    """54 of 56 had the right name, and 2 were `unexplained`."""
    kinds = list(KINDS)
    outcomes = [judged(tmp_path / "log.csv", seed, kinds[seed % len(kinds)]) for seed in range(56)]
    assert not any(outcome.early for outcome in outcomes)
    assert sum(outcome.is_right for outcome in outcomes) >= 54
    assert sum(outcome.is_wrong for outcome in outcomes) <= 1


@pytest.mark.release("20 logs, 2 min, of kinds that have no name; random_changes has such kinds too")
def test_kinds_that_were_not_used_while_building(tmp_path):
    """12 of 20 were `unexplained`; inertia of a bare rotor that rises is torque that falls, by any data."""
    kinds = list(HELD_OUT)
    outcomes = [judged(tmp_path / "log.csv", seed, kinds[seed % len(kinds)]) for seed in range(20)]
    assert not any(outcome.early for outcome in outcomes)
    assert all(outcome.alarm for outcome in outcomes)
    inertia = [outcome.alarm for outcome in outcomes if outcome.kind == "inertia"]
    assert {alarm.what for alarm in inertia} <= {"torque_scale", "unexplained"}
    assert all(alarm.what == "unexplained" or alarm.size < 0 for alarm in inertia)
    assert sum(outcome.is_right for outcome in outcomes) >= 12


# Rate of the hyperbolic tangent that lacks as much below its level as the root of the data sheet does.
ALIKE = f"transition={0.01 / np.log(2)}"

PARAMETERS = {"torque_scale": "torque", "plant.modelling_error": "inertia", "plant.coulomb_Nm": "coulomb"}


def identified(path, seed):
    """True values of a random machine and the result of its identification."""
    generator = np.random.default_rng([49, seed])
    torque, inertia = generator.uniform(0.95, 1.05), generator.uniform(0.95, 1.1)
    coulomb = generator.uniform(1.5e-3, 4e-3, 3)
    frequency = ",".join(f"{value:.3f}" for value in generator.uniform(0.4, 0.75, 3))
    settings = (
        MOTION[0], ALIKE, f"frequency={frequency}", f"torque={torque}", f"inertia={inertia}",
        f"coulomb={','.join(map(str, coulomb))}",
    )  # fmt: skip
    logs = [
        read_log(
            path, 4.0, *settings, f"payload={payload_kg}", f"seed={1000 * seed + number}",
            conditions={"plant.payload_kg": payload_kg},
        )
        for number, payload_kg in enumerate((0.0, 0.1))
    ]  # fmt: skip
    true = {"torque_scale": torque, "plant.modelling_error": inertia - 1}
    true |= {f"plant.coulomb_Nm.{hinge}": level for hinge, level in enumerate(coulomb)}
    return true, machine.identify(logs, SCENARIO, list(PARAMETERS), DATA_SHEET)


@pytest.mark.release(
    "20 identifications, 4 min; test_identification has the intervals of a simulated machine"
)
def test_intervals_hold_the_values_of_the_independent_machine(tmp_path):
    holds = []
    for seed in range(20):
        true, result = identified(tmp_path / "log.csv", seed)
        assert result.accepted, result.reasons
        holds += [low <= true[name] <= high for name, (_, (low, high), *_) in result.parameters.items()]
    # Of 100 intervals of 95 %, 89 or more hold the truth with a probability of 0.99.
    assert len(holds) == 100
    assert sum(holds) >= 89
