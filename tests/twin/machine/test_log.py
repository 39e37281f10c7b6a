"""Log of a machine: its shapes, its digest, and what is refused."""

import numpy as np
import pytest

from spheretwin.machine import Log
from spheretwin.models.base.errors import InputError

TIMES = np.arange(5) * 1e-3
CURRENTS = np.arange(90.0).reshape(5, 18)
ANGLES = np.arange(15.0).reshape(5, 3)


def test_its_numbers_are_read_only_copies():
    times = TIMES.copy()
    log = Log(times, CURRENTS, ANGLES)
    times[0] = -1.0
    assert log.t_s[0] == 0.0
    with pytest.raises(ValueError, match="read-only"):
        log.angle_rad[0, 0] = 1.0


def test_the_digest_is_that_of_the_numbers():
    log = Log(TIMES, CURRENTS, ANGLES)
    assert log.digest == Log(list(TIMES), CURRENTS.tolist(), ANGLES, name="other").digest
    changed = ANGLES.copy()
    changed[4, 2] = np.nextafter(changed[4, 2], np.inf)
    assert log.digest != Log(TIMES, CURRENTS, changed).digest
    assert log.digest != Log(TIMES, CURRENTS, ANGLES, currents="measured").digest


def test_rows_are_a_log_with_the_same_conditions():
    log = Log(TIMES, CURRENTS, ANGLES, "measured", "a", {"plant.payload_kg": 0.1}, ("gaps",))
    part = log.rows(1, 4)
    assert len(part) == 3
    assert np.array_equal(part.current_A, CURRENTS[1:4])
    assert (part.currents, part.name, part.conditions, part.accepted) == (
        "measured",
        "a",
        {"plant.payload_kg": 0.1},
        ("gaps",),
    )


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        ((TIMES[:1], CURRENTS[:1], ANGLES[:1]), "expected at least two rows, received t_s of shape (1,)"),
        ((0.0, CURRENTS, ANGLES), "expected at least two rows, received t_s of shape ()"),
        ((TIMES, CURRENTS[:4], ANGLES), "received (4, 18) and (5, 3)"),
        ((TIMES, CURRENTS, ANGLES[:, :2]), "received (5, 18) and (5, 2)"),
        ((TIMES, CURRENTS, ANGLES, "voltages"), "expected currents commanded or measured"),
    ],
)
def test_what_does_not_fit_is_refused(arguments, said):
    with pytest.raises(InputError) as error:
        Log(*arguments, name="bad")
    assert said in str(error.value)
    assert str(error.value).startswith("log bad:")
