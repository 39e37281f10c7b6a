"""Column map: raw numbers become SI with any names, units, signs, order, scales and offsets."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from spheretwin.machine import columns
from spheretwin.machine.columns import ANGLE_UNITS
from spheretwin.machine.raw_table import RawTable
from spheretwin.models.base.errors import InputError

ANGLES = {"columns": ["a", "b", "c"]}
CURRENTS = {"columns": ["i*"]}
TIMES = np.arange(4) * 1e-3
RADIANS = np.array([[0.1, 0.2, 3.0], [0.2, 0.1, 3.1], [0.3, 0.0, -3.1], [0.2, -0.1, -3.0]])

scales = st.floats(1e-6, 1e6) | st.floats(-1e6, -1e-6)
offsets = st.floats(-1e5, 1e5)


def triples(entries):
    return st.lists(entries, min_size=3, max_size=3)


@settings(max_examples=60)
@given(triples(scales), triples(offsets), triples(st.sampled_from([1, -1])), st.permutations(["a", "b", "c"]),
       triples(st.sampled_from(list(ANGLE_UNITS))), st.sampled_from(["s", "ms", "us", "ns"]))  # fmt: skip
def test_angles_come_back_from_raw_numbers(scale, offset, sign, names, unit, time_unit):
    factors = {"rad": 1.0, "mrad": 1e-3, "deg": math.radians(1), "turn": math.tau}
    factor = np.array([factors[one] for one in unit])
    raw = RADIANS / (np.array(sign) * factor * np.array(scale)) + offset
    per_s = {"s": 1, "ms": 1e3, "us": 1e6, "ns": 1e9}[time_unit]
    file = {"t": TIMES * per_s, **dict(zip(names, raw.T, strict=True)), "i0": TIMES, "i1": -TIMES}
    log = columns.of_fields(
        {
            "time": {"column": "t", "unit": time_unit},
            "angles": {"columns": names, "unit": unit, "scale": scale, "offset": offset, "sign": sign},
            "currents": CURRENTS | {"unit": "mA", "kind": "measured", "sign": [1, -1], "offset": [1.0]},
        }
    ).log(RawTable("a.csv", file))
    # The offset costs digits: of a raw number of 1e5, 1.5e-11 are lost.
    lost = 1e-15 + 3e-11 * np.abs(np.array(scale) * factor)
    assert np.all(np.abs(log.angle_rad - RADIANS) <= lost)
    assert log.t_s == pytest.approx(TIMES, abs=1e-15)
    assert np.array_equal(log.current_A, 1e-3 * (np.stack([TIMES, -TIMES], axis=1) - 1) * [1, -1])
    assert (log.currents, log.name) == ("measured", "a.csv")


@given(st.integers(2, 4000), st.floats(-0.9, 0.9))
@settings(max_examples=40)
def test_a_counter_that_starts_again_is_continuous(wrap, phase):
    counts = np.arange(40) * np.trunc(0.45 * wrap * phase)  # less than half a turn between two rows
    file = dict.fromkeys(("a", "b", "i0"), np.zeros(40)) | {"t_s": np.arange(40.0), "c": counts % wrap}
    angles = {**ANGLES, "unit": "turn", "scale": [1.0, 1.0, 1 / wrap], "wrap": [0, 0, wrap]}
    log = columns.of_fields({"angles": angles, "currents": CURRENTS}).log(RawTable("a", file))
    # The first count is within half a revolution of the offset, 0.
    assert log.angle_rad[:, 2] == pytest.approx(math.tau * counts / wrap, abs=1e-9)


def test_a_map_is_read_from_toml(tmp_path):
    (path := tmp_path / "map.toml").write_text(
        """
        [time]
        column = "stamp"
        [angles]
        columns = ["pot_a", "pot_b", "count"]
        scale = [1.047, 1.047, 3.14159e-3]   # rad/V, rad/V, rad per count
        wrap = [0, 0, 65536]
        [currents]
        columns = ["current_*"]
        [conditions]
        plant.payload_kg = 0.05
        """
    )
    column_map = columns.load(path)
    assert column_map.angles.scale == (1.047, 1.047, 3.14159e-3)
    assert column_map.conditions == {"plant.payload_kg": 0.05}
    assert column_map.currents.names(["current_1", "b", "current_0"]) == ["current_0", "current_1"]


@pytest.mark.parametrize(
    ("pattern", "names"),
    [("i*", ["i0", "i1", "i2"]), ("i_*_A", ["i_01_A", "i_02_A"]), ("axis*.i", ["axis0.i"])],
)
def test_a_pattern_stands_for_each_number(pattern, names):
    currents = columns.CurrentColumns(columns=(pattern,))
    assert currents.names(["i0x", *reversed(names), "t"]) == names


def test_a_pattern_does_not_end_at_a_number_that_lacks():
    with pytest.raises(InputError, match="every number up to 3, received none of i2"):
        columns.CurrentColumns(columns=("i*",)).names(["i0", "i1", "i3"])


@pytest.mark.parametrize(("first", "offset", "turns"), [(10, 16380, 1), (16370, 3, -1), (8000, 16380, 1)])
def test_the_first_count_is_within_half_a_revolution_of_the_offset(first, offset, turns):
    counts = (first + np.arange(5)) % 16384
    file = dict.fromkeys(("a", "b", "i0"), np.zeros(5)) | {"t_s": np.arange(5.0), "c": counts}
    angles = {**ANGLES, "wrap": [0, 0, 16384], "offset": [0, 0, offset]}
    log = columns.of_fields({"angles": angles, "currents": CURRENTS}).log(RawTable("a", file))
    expected = first + 16384 * turns - offset + np.arange(5)
    assert log.angle_rad[:, 2] == pytest.approx(expected, abs=1e-9)


def test_units_of_the_file_apply_unless_the_map_has_others():
    file = {"t_s": 1e3 * TIMES, "a": 180 + 0 * TIMES, "b": TIMES, "c": TIMES, "i0": 5 + 0 * TIMES}
    table = RawTable("a", file, {"t_s": "msec", "a": "degrees", "b": "1", "i0": "mA"})
    log = columns.of_fields({"angles": ANGLES, "currents": CURRENTS}).log(table)
    assert log.t_s == pytest.approx(TIMES)
    assert log.angle_rad[0, 0] == pytest.approx(math.pi)
    assert log.current_A[0, 0] == pytest.approx(5e-3)
    stated = {"angles": {**ANGLES, "unit": "rad"}, "currents": {**CURRENTS, "unit": "A"}}
    assert columns.of_fields(stated).log(table).angle_rad[0, 0] == pytest.approx(180)


@pytest.mark.parametrize(
    ("column", "unit", "remedy"),
    [
        ("t_s", "min", "time.unit"),
        ("b", "V", "angles.unit or angles.scale"),
        ("i0", "mV", "currents.unit or"),
    ],
)
def test_a_unit_of_another_quantity_is_refused_unless_the_map_says_more(column, unit, remedy):
    file = {"t_s": TIMES, "a": TIMES, "b": TIMES, "c": TIMES, "i0": TIMES}
    table, fields = RawTable("a", file, {column: unit}), {"angles": ANGLES, "currents": CURRENTS}
    with pytest.raises(InputError, match=rf"column {column}: expected a unit of .*, or {remedy}.* {unit}"):
        columns.of_fields(fields).log(table)
    more = {
        "time": {"unit": "s"},
        "angles": {**ANGLES, "scale": [2.0]},
        "currents": {**CURRENTS, "unit": "A"},
    }
    log = columns.of_fields(more).log(table)
    assert log.angle_rad[:, 1] == pytest.approx(2 * TIMES)


def test_a_file_that_is_no_toml_is_refused(tmp_path):
    (tmp_path / "map.toml").write_text("[angles")
    for name in ("map.toml", "other.toml"):
        with pytest.raises(InputError, match="expected a readable TOML file"):
            columns.load(tmp_path / name)
