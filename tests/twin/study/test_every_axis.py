"""What every kind of axis owes: words for its fields, refusals by name, and values of its own."""

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


def fields(kind):
    """Fields of an axis of a kind: those without a default rise, one by one."""
    given_fields = {"field": "disturbance.load", "kind": kind}
    for place, (name, field) in enumerate(KINDS[kind].model_fields.items()):
        if name not in given_fields and field.is_required():
            given_fields[name] = {float: 0.1 * (1 + place), int: 3}.get(field.annotation, [0.25, 0.5])
    return given_fields


def grid(kind, **others):
    samples = 16 if issubclass(KINDS[kind], DrawnAxis) else None
    return Grid(study({**fields(kind), **others}, samples=samples))


@pytest.mark.parametrize("kind", KINDS)
def test_it_says_what_it_is(kind):
    check_every_field_says_what_it_is(KINDS[kind])
    assert KINDS[kind].__doc__


@pytest.mark.parametrize("kind", KINDS)
def test_its_values_are_its_own_and_the_same_each_time(kind):
    listed = [row.values["disturbance.load"] for row in grid(kind)]
    assert len(set(listed)) == len(listed) > 1
    assert np.all(np.isfinite(listed))
    assert listed == [row.values["disturbance.load"] for row in grid(kind)]


@pytest.mark.parametrize("kind", [kind for kind in KINDS if issubclass(KINDS[kind], DrawnAxis)])
@given(st.lists(st.floats(1e-12, 1 - 1e-12), min_size=2, max_size=20))
def test_what_is_drawn_rises_with_what_it_is_drawn_by(kind, uniform):
    given_fields = {name: value for name, value in fields(kind).items() if name != "kind"}
    drawn = KINDS[kind](**given_fields).quantile(np.sort(uniform))
    assert np.all(np.isfinite(drawn))
    # The inverse of a distribution: where two numbers are next to each other, rounding is all there is.
    assert np.all(np.diff(drawn) >= -1e-12 * np.abs(drawn).max())


@pytest.mark.parametrize("kind", KINDS)
def test_what_it_does_not_know_is_refused_by_name(kind):
    with pytest.raises(InputError) as refusal:
        grid(kind, no_such_field=1.0)
    assert "no_such_field" in str(refusal.value)
    numbers = [name for name, value in fields(kind).items() if isinstance(value, int | float)]
    for name in numbers:
        for bad in (float("nan"), float("inf"), "text"):
            with pytest.raises(InputError) as refusal:
                grid(kind, **{name: bad})
            assert f"axis.0.{name}: expected" in str(refusal.value)
