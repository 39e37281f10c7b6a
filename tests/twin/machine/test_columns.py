"""Column map: raw numbers become SI with any names, units, signs, order, scales and offsets."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from spheretwin.machine import columns
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
       st.sampled_from(["rad", "deg", "turn"]), st.sampled_from(["s", "ms", "us", "ns"]))  # fmt: skip
def test_angles_come_back_from_raw_numbers(scale, offset, sign, names, unit, time_unit):
    factor = {"rad": 1.0, "deg": math.radians(1), "turn": math.tau}[unit]
    raw = RADIANS / (np.array(sign) * factor * np.array(scale)) + offset
    per_s = {"s": 1, "ms": 1e3, "us": 1e6, "ns": 1e9}[time_unit]
    file = {"t": TIMES * per_s, **dict(zip(names, raw.T, strict=True)), "i0": TIMES, "i1": -TIMES}
    log = columns.of_fields(
        {
            "time": {"column": "t", "unit": time_unit},
            "angles": {"columns": names, "unit": unit, "scale": scale, "offset": offset, "sign": sign},
            "currents": CURRENTS | {"unit": "mA", "kind": "measured", "sign": [1, -1], "offset": [1.0]},
        }
    ).log(file, "a.csv")
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
    log = columns.of_fields({"angles": angles, "currents": CURRENTS}).log(file, "a")
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
    assert column_map.currents.names(["current_0", "current_1", "current_3"]) == ["current_0", "current_1"]


def test_a_file_that_is_no_toml_is_refused(tmp_path):
    (tmp_path / "map.toml").write_text("[angles")
    for name in ("map.toml", "other.toml"):
        with pytest.raises(InputError, match="expected a readable TOML file"):
            columns.load(tmp_path / name)
