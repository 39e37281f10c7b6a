"""Rows by number: crossed, zipped, drawn; keys that are a row's own, seeds that follow from them."""

import hashlib
import itertools
import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from spheretwin.study.grid import Grid, _mixed
from tests.twin.study.cases import loads, study, values


@given(st.lists(st.integers(1, 5), min_size=1, max_size=5))
def test_numbers_count_as_nested_loops_do(sizes):
    loops = list(itertools.product(*map(range, sizes)))
    assert [tuple(_mixed(number, sizes)) for number in range(len(loops))] == loops


def test_axes_are_crossed_and_those_of_a_zip_go_together():
    axes = [
        values("plant.coulomb_Nm.0", 0.0, 0.1, zip="friction"),
        values("disturbance.load", 1.0, 2.0, 3.0),
        values("plant.coulomb_Nm.1", 0.2, 0.3, zip="friction"),
    ]
    grid = Grid(study(*axes, law=[{"law": "pd"}, {"law": "afsm"}], seeds=2))
    loops = itertools.product([(0.0, 0.2), (0.1, 0.3)], [1.0, 2.0, 3.0], ["pd", "afsm"], [0, 1])
    expected = [((a, load, b), law, repeat) for (a, b), load, law, repeat in loops]
    assert [(tuple(row.values.values()), row.law["law"], row.repeat) for row in grid] == expected
    assert len(grid) == len(expected) == 24


def test_keys_and_seeds_are_of_a_row_alone():
    rows = list(Grid(loads(seeds=3)))
    assert len({row.key for row in rows}) == len({row.seed for row in rows}) == len(rows) == 72
    assert all(0 <= row.seed < 2**53 for row in rows)
    # Fewer loads, in another order: what is left has the keys and the seeds that it had.
    axes = [values("disturbance.load", 2.0, 0.0), {**loads().axis[1].model_dump(), "zip": None}]
    fewer = Grid(loads(seeds=3, axis=axes))
    assert {(row.key, row.seed) for row in fewer} < {(row.key, row.seed) for row in rows}


def test_common_seeds_are_those_of_the_repeat_alone():
    rows = list(Grid(loads(seeds=3, common_seeds=True)))
    assert len({row.key for row in rows}) == len(rows) == 72
    pairs = {(row.repeat, row.seed) for row in rows}
    assert len(pairs) == len({seed for _, seed in pairs}) == 3


@pytest.mark.parametrize("seed", [0, 4])
def test_a_key_is_that_of_values_law_and_repeat_and_not_of_their_order(seed):
    """Rows of a journal are found by it: it is the digest of the content, whatever the order of the axes."""
    axes = [values("disturbance.load", 0.5, 2.0), values("plant.payload_kg", 0.1)]
    rows, swapped = ([*Grid(study(*listed, seeds=2, seed=seed))] for listed in (axes, axes[::-1]))
    assert {row.key for row in rows} == {row.key for row in swapped}
    content = json.dumps([{"disturbance.load": 2.0, "plant.payload_kg": 0.1}, None, 1])
    assert rows[3].key == hashlib.sha256(content.encode()).hexdigest()[:16]
    of_row = hashlib.sha256(f"{seed} {rows[3].key}".encode()).hexdigest()
    assert rows[3].seed == int(of_row[:16], 16) // 2**11


def test_rows_of_a_law_are_at_even_places_and_none_is_there_twice():
    grid = Grid(loads(seeds=2))
    for law, name in enumerate(("pd", "afsm")):
        some = list(grid.of_law(law, 5))
        assert [row.law["law"] for row in some] == [name] * 5
        assert (some[0].number, some[-1].number) == (2 * law, len(grid) - 2 * (2 - law))
    grid = Grid(study(values("disturbance.load", *map(float, range(9)))))
    assert [row.number for row in grid.of_law(0, 5)] == [0, 2, 4, 6, 8]
    assert [row.number for row in grid.of_law(0, 20)] == list(range(9))


def test_a_study_of_many_millions_is_counted_not_listed():
    linspace = {"kind": "linspace", "first": 0, "last": 1, "count": 400}
    grid = Grid(study(*({"field": f"plant.coulomb_Nm.{i}", **linspace} for i in range(3))))
    assert len(grid) == 400**3
    assert list(grid[len(grid) - 2].values.values()) == [1.0, 1.0, 398 / 399]


def test_values_of_a_zip_may_repeat_where_their_rows_do_not():
    axes = [values("disturbance.load", 1.0, 1.0, zip="a"), values("plant.modelling_error", 0.1, 0.2, zip="a")]
    assert len({row.key for row in Grid(study(*axes))}) == 2


def test_rows_are_found_by_number_from_zero_and_by_key():
    grid = Grid(study(values("disturbance.load", 0.0, 1.0)))
    assert [row.number for row in grid] == [0, 1]
    assert [grid.of(row.key) for row in grid] == list(grid)
    for number in (-1, 2):
        with pytest.raises(IndexError):
            grid[number]
    assert grid.values("disturbance.load") == [0.0, 1.0]
    assert grid.values("seed") is None
