"""Columns of sections: what rows may differ in; `tests/twin/test_assembly_rows.py` has their values."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.testing import assert_array_equal
from pydantic import BaseModel

from spheretwin.models.base.columns import Columns, MixedRowsError, column_of

pytestmark = pytest.mark.uncompiled


class Inner(BaseModel):
    gain: float = 1.0


class Section(BaseModel):
    noise: float = 0.0


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
