"""Log of a machine: its shapes, its digest, and what is refused."""

import numpy as np
import pytest

from spheretwin.machine import Log
from spheretwin.machine.log import check_numbers
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
    for name in ("currents", "name", "conditions", "accepted"):
        assert getattr(part, name) == getattr(log, name)


@pytest.mark.parametrize("column", ["t_s", "current_A", "angle_rad"])
@pytest.mark.parametrize("value", [np.inf, -np.inf, 1e308, -1e19])
def test_numbers_that_no_machine_has_are_refused_by_name(column, value):
    columns = {"t_s": np.arange(3.0), "current_A": np.full((3, 18), np.nan), "angle_rad": np.zeros((3, 3))}
    check_numbers(Log(**columns))
    columns[column].reshape(3, -1)[1, -1] = value
    with pytest.raises(InputError, match=rf"as {column}, received {value:g} in row 1".replace("+", r"\+")):
        check_numbers(Log(**columns))
