"""Rows by number: crossed, zipped, drawn; keys that are a row's own, seeds that follow from them."""

import hashlib
import itertools
import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from spheretwin.models.base.errors import InputError
from spheretwin.study.grid import Grid, _mixed
from tests.twin.study.cases import loads, study, values


@given(st.lists(st.integers(1, 5), min_size=1, max_size=5))
def test_numbers_count_as_nested_loops_do(sizes):
    loops = list(itertools.product(*map(range, sizes)))
    assert [tuple(_mixed(number, sizes)) for number in range(len(loops))] == loops


def test_axes_are_crossed_and_those_of_a_zip_go_together():
    grid = Grid(
        study(
            values("plant.coulomb_Nm.0", 0.0, 0.1, zip="friction"),
            values("disturbance.load", 1.0, 2.0, 3.0),
            values("plant.coulomb_Nm.1", 0.2, 0.3, zip="friction"),
            law=[{"law": "pd"}, {"law": "afsm"}],
            seeds=2,
        )
    )
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
    by_repeat = {repeat: {row.seed for row in rows if row.repeat == repeat} for repeat in range(3)}
    assert all(len(seeds) == 1 for seeds in by_repeat.values())
    assert len(set.union(*by_repeat.values())) == 3


def test_another_seed_of_the_study_is_another_seed_of_each_row():
    first, second = (Grid(study(values("disturbance.load", 1.0, 2.0), seed=seed)) for seed in (0, 1))
    assert [row.key for row in first] == [row.key for row in second]
    assert not {row.seed for row in first} & {row.seed for row in second}


def test_a_key_finds_its_row():
    grid = Grid(loads())
    assert [grid.of(row.key) for row in grid] == list(grid)
    with pytest.raises(InputError, match="expected the key of one of its rows, received 0000"):
        grid.of("0000")


def test_rows_of_a_law_are_of_that_law():
    grid = Grid(loads(seeds=2))
    for law, name in enumerate(("pd", "afsm")):
        some = list(grid.of_law(law, 5))
        assert [row.law["law"] for row in some] == [name] * 5
        assert some[0].number == 2 * law
        assert some[-1].number == len(grid) - 2 * (2 - law)


def test_a_study_of_many_millions_is_counted_not_listed():
    axes = [
        {"field": f"plant.coulomb_Nm.{i}", "kind": "linspace", "first": 0, "last": 1, "count": 400}
        for i in range(3)
    ]
    grid = Grid(study(*axes))
    assert len(grid) == 400**3
    assert list(grid[len(grid) - 2].values.values()) == [1.0, 1.0, 398 / 399]


@pytest.mark.parametrize(
    ("axes", "message"),
    [
        ([values("disturbance.load", 1.0, 2.0, 1.0)], "expected different values of disturbance.load"),
        ([values("disturbance.load", 1.0, 1)], "expected different values of disturbance.load"),
        ([{"field": "disturbance.load", "kind": "linspace", "first": 1, "last": 1, "count": 2}], "different"),
        (
            [values("disturbance.load", 1.0, 2.0, zip="a"), values("plant.modelling_error", 0.1, zip="a")],
            "of equal length, received 2 of disturbance.load, 1 of plant.modelling_error",
        ),
        (
            [
                {"field": f"plant.coulomb_Nm.{i}", "kind": "linspace", "first": 0, "last": 1, "count": 10**6}
                for i in range(3)
            ],
            "expected at most 100000000 rows, received 1000000000000000000",
        ),
    ],
)
def test_rows_that_are_the_same_or_without_end_are_refused(axes, message):
    with pytest.raises(InputError) as refusal:
        Grid(study(*axes))
    assert message in str(refusal.value)


def test_values_of_a_zip_may_repeat_where_their_rows_do_not():
    axes = [values("disturbance.load", 1.0, 1.0, zip="a"), values("plant.modelling_error", 0.1, 0.2, zip="a")]
    assert len({row.key for row in Grid(study(*axes))}) == 2


def test_a_key_is_that_of_values_law_and_repeat_and_not_of_their_order():
    """Rows of a journal are found by it: it is the digest of the content, whatever the order of the axes."""
    axes = [values("disturbance.load", 0.5, 2.0), values("plant.payload_kg", 0.1)]
    rows, swapped = ([*Grid(study(*listed, seeds=2))] for listed in (axes, axes[::-1]))
    assert {row.key for row in rows} == {row.key for row in swapped}
    content = json.dumps([{"disturbance.load": 2.0, "plant.payload_kg": 0.1}, None, 1])
    assert rows[3].key == hashlib.sha256(content.encode()).hexdigest()[:16]
    assert rows[3].seed == int(hashlib.sha256(f"0 {rows[3].key}".encode()).hexdigest()[:16], 16) // 2**11


def test_a_law_has_no_row_twice_and_rows_at_even_places():
    grid = Grid(study(values("disturbance.load", *map(float, range(9)))))
    assert [row.number for row in grid.of_law(0, 5)] == [0, 2, 4, 6, 8]
    assert [row.number for row in grid.of_law(0, 20)] == list(range(9))


def test_rows_are_numbered_from_zero_and_no_others_exist():
    grid = Grid(study(values("disturbance.load", 0.0, 1.0)))
    assert [row.number for row in grid] == [0, 1]
    for number in (-1, 2):
        with pytest.raises(IndexError):
            grid[number]
    assert grid.values("disturbance.load") == [0.0, 1.0]
    assert grid.values("seed") is None
