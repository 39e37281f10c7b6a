"""A law, its numbers and its signals as the loop can take them, and what is none."""

from fractions import Fraction

import numpy as np
import pytest

from spheretwin.control.law import Law
from spheretwin.models.base.errors import InputError
from spheretwin.models.telemetry.signals import Signal, common_signals

SIGNALS = common_signals(18)


def step(t, reference, measurement, parameters, state, torque):
    torque[:] = 0.0


def law(**changes):
    return Law(**{"name": "mine", "step": step, "parameters": [1.0], "state": np.zeros(3), **changes})


def refusal(make, **changes):
    with pytest.raises(InputError) as caught:
        make(**changes)
    message = str(caught.value)
    assert message.isprintable()
    assert len(message) < 400
    return message


@pytest.mark.parametrize("field", ["parameters", "state"])
def test_numbers_are_copied_as_compiled_code_takes_them(field):
    mine = np.arange(6.0)[::2]
    copy = getattr(law(**{field: mine}), field)
    mine[:] = -1.0
    np.testing.assert_array_equal(copy, [0, 2, 4])
    assert copy.flags.c_contiguous
    assert copy.dtype == np.float64


@pytest.mark.parametrize(
    "numbers",
    [[1, 2.5], (1, 2), [], np.array([1, 2], dtype=np.int8), np.array([0.5], dtype=np.float32), [True, 2]],
)
def test_plain_numbers_are_taken(numbers):
    np.testing.assert_array_equal(law(parameters=numbers).parameters, np.array(numbers, dtype=float))


@pytest.mark.parametrize("field", ["parameters", "state"])
@pytest.mark.parametrize(
    ("numbers", "part"),
    [
        ([1.0 + 2.0j], "real numbers, received [(1+2j)]"),
        (["1.5"], "real numbers, received ['1.5']"),
        ("1.5", "real numbers, received '1.5'"),
        (None, "real numbers, received none"),
        ([None], "real numbers"),
        ([Fraction(1, 2)], "real numbers"),
        ([10**5000], "real numbers"),
        (np.array(["2020-01-01"], dtype="datetime64[D]"), "real numbers"),
        ([[1.0], [1.0, 2.0]], "an array"),
        (1.0, "one-dimensional array, received shape ()"),
        (np.zeros((2, 2)), "one-dimensional array, received shape (2, 2)"),
        ([0.0, np.nan], "finite numbers in {field}, received nan as entry 1"),
        ([-np.inf], "finite numbers in {field}, received -inf as entry 0"),
        (np.array(["1e4000"], dtype=np.longdouble), "finite numbers in {field}, received inf as entry 0"),
    ],
)
def test_other_numbers_are_refused_by_field(field, numbers, part):
    message = refusal(law, **{field: numbers})
    assert message.startswith("law mine: expected ")
    assert field in message
    assert part.format(field=field) in message


@pytest.mark.parametrize(
    ("changes", "part"),
    [
        ({"name": ""}, "law: expected a name without control characters, received ''"),
        ({"name": 3}, "law: expected a name without control characters, received 3"),
        ({"name": "a\nb"}, r"law: expected a name without control characters, received 'a\nb'"),
        ({"name": "\x1b[2J"}, "law: expected a name without control characters"),
        ({"name": "a\udcff"}, "law: expected a name without control characters"),
        ({"step": None}, "law mine: expected step as a function, received none"),
        ({"step": "pd"}, "law mine: expected step as a function, received 'pd'"),
        ({"signals": "gain"}, "law mine: expected signals of type Signal, received 'g'"),
        ({"signals": 3}, "law mine: expected signals of type Signal, received 3"),
        ({"signals": [Signal("gain", "1", 4, "")]}, "at most 3 numbers, the size of its state, received 4"),
        ({"signals": [Signal("gain", "1", 10**5000, "")]}, "at most 3 numbers"),
        ({"signals": [Signal("t_s", "s", 1, "")]}, "new names of signals, received t_s"),
        ({"signals": [Signal("b", "1", 1, ""), Signal("b", "1", 1, "")]}, "received b"),
    ],
)
def test_an_invalid_law_is_refused(changes, part):
    assert part in refusal(law, **changes)


def test_signals_may_be_listed():
    assert law(signals=[Signal("gain", "1", 3, "")]).signals == (Signal("gain", "1", 3, ""),)


def signal(**changes):
    return Signal(**{"name": "gain", "unit": "1", "size": 2, "meaning": "", **changes})


@pytest.mark.parametrize(
    ("changes", "part"),
    [
        *[({"size": size}, "size as a whole number above 0") for size in (0, -3, True, 1.0, "2", None)],
        *[({"name": name}, "a name of printable characters") for name in ("", None, 7, "a\nb", "\udcff")],
        ({"unit": None}, "expected unit as printable text, received none"),
        ({"meaning": b"gain"}, "expected meaning as printable text, received b'gain'"),
        ({"labels": ("a",)}, "2 labels or none, received 1"),
        ({"labels": ("a", "b", "c")}, "2 labels or none, received 3"),
        ({"labels": ("a", "")}, "labels as texts without commas"),
        ({"labels": ("a", "b,c")}, "labels as texts without commas"),
        ({"labels": ("a", 1)}, "labels as texts without commas"),
        ({"labels": "ab"}, "labels as texts without commas, received 'ab'"),
    ],
)
def test_an_invalid_signal_is_refused(changes, part):
    message = refusal(signal, **changes)
    assert part in message
    assert message.startswith("signal")


def test_labels_may_be_listed():
    assert signal(labels=["a", "b"]) == signal(labels=("a", "b"))
    assert hash(signal(labels=["a", "b"])) == hash(signal(labels=("a", "b")))


@pytest.mark.parametrize("taken", SIGNALS, ids=lambda each: each.name)
def test_names_of_any_run_s_own_columns_are_refused(taken):
    message = refusal(law, signals=(Signal(taken.name, "1", 1, ""),))
    assert f"expected new names of signals, received {taken.name}" in message
