"""Log of a machine: its shapes, its digest, and what is refused."""

import numpy as np
import pytest

from spheretwin.machine import Log

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
