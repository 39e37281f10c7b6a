"""Columns of sections, and filling of records with them."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from pydantic import BaseModel

from spheretwin.models.base.columns import Columns, MixedRowsError, column_of
from spheretwin.models.base.record import Record, field, put

pytestmark = pytest.mark.uncompiled


class Inner(BaseModel):
    gain: float = 1.0


class Section(BaseModel):
    noise: float = 0.0
    limits: tuple[float, ...] = (1.0, 2.0)
    per_group: float | tuple[float, ...] = 1.0
    name: str = "shared"
    inner: Inner = Inner()
    many: tuple[Inner, ...] = ()

    @property
    def doubled(self) -> float:
        return 2 * self.noise

    def scaled(self, factor: float) -> float:
        return factor * self.noise


class Data(Record):
    noise: float = field("of a row")
    limits: np.ndarray = field("of a row", shape=2)


def test_shared_and_varied_fields():
    columns = Columns([Section(noise=1.0, limits=(3, 4)), Section(noise=2.0), Section(noise=4.0)])
    assert_array_equal(columns.noise, [[1], [2], [4]])
    assert_array_equal(columns.limits, [[3, 4], [1, 2], [1, 2]])
    assert (columns.name, columns.per_group, columns.inner) == ("shared", 1.0, Inner())


def test_properties_methods_and_nested_sections():
    sections = [Section(noise=k, inner=Inner(gain=k), many=(Inner(), Inner(gain=k))) for k in (1.0, 2.0)]
    columns = Columns(sections)
    assert_array_equal(columns.doubled, [[2], [4]])
    assert_array_equal(columns.scaled(3.0), [[3], [6]])
    assert_array_equal(columns.inner.gain, [[1], [2]])
    shared, varied = columns.many
    assert shared == Inner()
    assert_array_equal(varied.gain, [[1], [2]])


def test_one_number_or_one_for_each_group():
    columns = Columns([Section(per_group=1.0), Section(per_group=(2.0, 3.0))])
    assert_array_equal(columns.per_group, [[1, 1], [2, 3]])


def test_zeros_of_both_signs_stay_apart():
    assert_array_equal(np.signbit(column_of([0.0, -0.0])), [[False], [True]])


@pytest.mark.parametrize(
    "values", [["a", "b"], [None, 1.0], [1.0, None], [1, 2**63], [1, 2**64], [(1.0, 2.0), (1.0, 2.0, 3.0)]]
)
def test_refuses_rows_that_differ_in_more_than_numbers(values):
    with pytest.raises(MixedRowsError):
        column_of(values)


def test_refuses_sections_of_different_classes():
    with pytest.raises(MixedRowsError, match="Section in all rows"):
        Columns([Section(), Inner()])


def test_one_section_of_all_rows_stays_itself():
    section = Section()
    assert column_of([section, section]) is section


def test_put_fills_shared_and_varied_columns():
    rows = Data.zeros(3)
    put(rows, noise=column_of([1.0, 2.0, 3.0]), limits=(4.0, 5.0))
    assert_array_equal(rows["noise"], [1, 2, 3])
    assert_array_equal(rows["limits"], [[4, 5]] * 3)
    put(rows, noise=7, limits=column_of([1.0, 2.0, 3.0]))
    assert_array_equal(rows["noise"], [7, 7, 7])
    assert_array_equal(rows["limits"], [[1, 1], [2, 2], [3, 3]])
