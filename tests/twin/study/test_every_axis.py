"""Requirements on every kind of axis: descriptions of its fields, refusals by name, values of its own."""

from typing import get_args

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from spheretwin.models.base.errors import InputError
from spheretwin.study.axes import AnyAxis, DrawnAxis
from spheretwin.study.grid import Grid
from tests.conftest import check_every_field_says_what_it_is
from tests.twin.study.cases import study

UNION = get_args(AnyAxis)[0]
KINDS = {kind.model_fields["kind"].default: kind for kind in (get_args(UNION) or (UNION,))}
each_kind = pytest.mark.parametrize("kind", KINDS)


def fields(kind):
    """Fields of an axis of a kind: those without a default rise, one by one."""
    values = {"field": "disturbance.load"}
    for place, (name, field) in enumerate(KINDS[kind].model_fields.items()):
        if name not in values and field.is_required():
            values[name] = {float: 0.1 * (1 + place), int: 3}.get(field.annotation, [0.25, 0.5])
    return values


def listed(kind, **others):
    """Values of the rows of a study over an axis of a kind."""
    samples = 16 if issubclass(KINDS[kind], DrawnAxis) else None
    rows = Grid(study({**fields(kind), "kind": kind, **others}, samples=samples))
    return [row.values["disturbance.load"] for row in rows]


@each_kind
def test_values_are_finite_and_different_and_the_same_each_time(kind):
    check_every_field_says_what_it_is(KINDS[kind])
    assert KINDS[kind].__doc__
    values = listed(kind)
    assert len(set(values)) == len(values) > 1
    assert np.all(np.isfinite(values))
    assert values == listed(kind)


@pytest.mark.parametrize("kind", [kind for kind in KINDS if issubclass(KINDS[kind], DrawnAxis)])
@given(st.lists(st.floats(1e-12, 1 - 1e-12), min_size=2, max_size=20))
def test_what_is_drawn_rises_with_what_it_is_drawn_by(kind, uniform):
    drawn = KINDS[kind](**fields(kind)).quantile(np.sort(uniform))
    assert np.all(np.isfinite(drawn))
    # The inverse of a distribution: where two numbers are next to each other, rounding is all there is.
    assert np.all(np.diff(drawn) >= -1e-12 * np.abs(drawn).max())


@each_kind
def test_unknown_fields_and_values_that_are_no_numbers_are_refused_by_name(kind):
    numbers = [name for name, value in fields(kind).items() if isinstance(value, int | float)]
    bad = [("no_such_field", 1.0, "no_such_field")]
    bad += [(n, value, f"axis.0.{n}: expected") for n in numbers for value in (np.nan, np.inf, "text", "0")]
    for name, value, message in bad:
        with pytest.raises(InputError) as refusal:
            listed(kind, **{name: value})
        assert message in str(refusal.value)
