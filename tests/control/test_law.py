"""A law, its numbers and its signals as the loop can take them, and what is none."""

from fractions import Fraction

import numpy as np
import pytest

from spheretwin.control.law import Law
from spheretwin.models.base.errors import InputError
from spheretwin.models.telemetry.signals import Signal, common_signals


def step(t, reference, measurement, parameters, state, torque):
    torque[:] = 0.0


def law(**changes):
    return Law(**{"name": "mine", "step": step, "parameters": [1.0], "state": np.zeros(3), **changes})


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


def refusal(**changes):
    with pytest.raises(InputError) as caught:
        law(**changes)
    message = str(caught.value)
    assert message.isprintable()
    assert len(message) < 400
    return message


@pytest.mark.parametrize("field", ["parameters", "state"])
@pytest.mark.parametrize(
    ("numbers", "part"),
    [
        ([1.0 + 2.0j], "real numbers, received [(1+2j)]"),
        (["1.5"], "real numbers, received ['1.5']"),
        ("1.5", "real numbers, received '1.5'"),
        (None, "real numbers, received none"),
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
    message = refusal(**{field: numbers})
    assert message.startswith("law mine: expected ")
    assert field in message
    assert part.format(field=field) in message


@pytest.mark.parametrize(
    ("changes", "part"),
    [
        *(
            ({"name": name}, f"law: expected a name without control characters, received {shown}")
            for name, shown in (("", "''"), (3, "3"), ("a\nb", r"'a\nb'"), ("\x1b[2J", ""), ("a\udcff", ""))
        ),
        ({"step": None}, "law mine: expected step as a function, received none"),
        ({"step": "pd"}, "law mine: expected step as a function, received 'pd'"),
        ({"signals": "gain"}, "law mine: expected signals of type Signal, received 'g'"),
        ({"signals": 3}, "law mine: expected signals of type Signal, received 3"),
        ({"signals": [Signal("gain", "1", 4, "")]}, "at most 3 numbers, the size of its state, received 4"),
        ({"signals": [Signal("gain", "1", 10**5000, "")]}, "at most 3 numbers"),
        ({"signals": [Signal("b", "1", 1, ""), Signal("b", "1", 1, "")]}, "received b"),
        *(
            ({"signals": [Signal(name, "1", 1, "")]}, f"expected new names of signals, received {name}")
            for name in (signal.name for signal in common_signals(18))
        ),
        *(
            ({"period_s": period_s}, "law mine: expected period_s as a number above 0, received")
            for period_s in (0.0, -1e-3, np.nan, np.inf, "1e-3")
        ),
        *(
            ({"current_limit_A": limit_A}, "law mine: expected current_limit_A as a number above 0, received")
            for limit_A in (0.0, -2.0, np.nan, "2", None)
        ),
    ],
)
def test_an_invalid_law_is_refused(changes, part):
    assert part in refusal(**changes)


def test_lists_become_tuples():
    gain = Signal("gain", "1", 2, "", ["a", "b"])
    assert gain == Signal("gain", "1", 2, "", ("a", "b"))
    assert hash(gain) == hash(Signal("gain", "1", 2, "", ("a", "b")))
    assert law(signals=[gain]).signals == (gain,)
