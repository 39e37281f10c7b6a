"""A trajectory of the user's: any object with sample(t), taken as it is or refused on one line."""

import numpy as np
import pytest

from spheretwin.models.base.errors import InputError
from spheretwin.trajectories.shapes import Sinusoid
from spheretwin.trajectories.trajectory import UserTrajectory, checked


class Own:
    def __init__(self, sample):
        self.sample = sample


def test_it_is_sampled_as_it_is():
    t = np.linspace(0, 3, 31)
    own = checked(Own(Sinusoid().sample))
    assert own.sample(t).tobytes() == Sinusoid().sample(t).tobytes()
    assert checked(own) is own
    assert isinstance(own, UserTrajectory)


def test_what_it_does_with_its_arrays_later_changes_nothing():
    buffer = np.zeros((2, 3, 3))

    def sample(t):
        buffer[:] = t[0]
        t[:] = -1.0
        return buffer[: len(t)]

    own, t = checked(Own(sample)), np.array([1.0, 2.0])
    first = own.sample(t)
    own.sample(np.array([5.0, 6.0]))
    np.testing.assert_array_equal(first, 1.0)
    np.testing.assert_array_equal(t, [1.0, 2.0])


def test_rows_in_another_order_of_memory_or_bytes_are_put_right():
    own = checked(Own(lambda t: np.asfortranarray(Sinusoid().sample(t)).astype(">f8")))
    t = np.linspace(0, 3, 31)
    assert own.sample(t).flags.c_contiguous
    assert own.sample(t).dtype == np.float64
    assert own.sample(t).tobytes() == Sinusoid().sample(t).tobytes()


def failing(t):
    raise ZeroDivisionError("division\nby zero")


@pytest.mark.parametrize(
    ("own", "complaint"),
    [
        (None, "an object with sample(t), received none"),
        (3.0, "an object with sample(t), received 3.0"),
        (Own, "an object with sample(t), received <class"),
        (Own(1.0), "an object with sample(t)"),
        (Own(failing), "samples from 0 to 0 s, received ZeroDivisionError: division by zero"),
        (Own(lambda: 0), "received TypeError"),
        (
            Own(lambda t: np.zeros((len(t), 3))),
            "float64 of shape (1, 3, 3) (angle, rate, acceleration by axis)",
        ),
        (Own(lambda t: np.zeros((len(t), 3))), "received float64 of shape (1, 3)"),
        (Own(lambda t: np.zeros((3, 3, 3))), "received float64 of shape (3, 3, 3)"),
        (Own(lambda t: np.zeros((len(t), 3, 3), np.float32)), "received float32 of shape (1, 3, 3)"),
        (Own(lambda t: np.zeros((len(t), 3, 3), int)), "received int64"),
        (Own(lambda t: [[[0.0] * 3] * 3]), "received list of shape (1, 3, 3)"),
        (Own(lambda t: [[0.0], [0.0, 1.0]]), "received list of shape none"),
        (Own(lambda t: np.full((len(t), 3, 3), np.nan)), "finite numbers at 0 s, received [[nan, nan, nan]"),
        (Own(lambda t: np.full((len(t), 3, 3), np.inf)), "finite numbers at 0 s"),
    ],
)
def test_what_is_none_is_refused_on_one_line(own, complaint):
    with pytest.raises(InputError) as refusal:
        checked(own)
    message = str(refusal.value)
    assert message.startswith("trajectory: expected ")
    assert complaint in message
    assert "\n" not in message


def test_later_samples_are_checked_too():
    own = checked(Own(lambda t: np.zeros((1, 3, 3))))
    with pytest.raises(InputError, match=r"float64 of shape \(5, 3, 3\)"):
        own.sample(np.arange(5.0))
