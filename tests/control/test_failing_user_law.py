"""Laws of a user's that raise, do not compile, or write outside their arrays: one line, and exit 1 or 2."""

import sys
import threading

import pytest

from spheretwin import cli
from spheretwin import scenario as scenarios
from spheretwin.control.law import Law
from spheretwin.models.base.callback_errors import callback_errors
from spheretwin.models.telemetry.table import read_parquet
from spheretwin.simulation import simulate

FILE = """
import sys

import numba
import numpy as np


class Strange(BaseException):
    pass


def leaves(t, reference, measurement, parameters, state, torque):
    torque[:] = 0.0
    if t > 0.005:
        sys.exit(0)


def closes(*_):
    raise GeneratorExit


def strange(*_):
    raise Strange("so it is")


def returns(t, reference, measurement, parameters, state, torque):
    return np.zeros(3)


def rebinds(t, reference, measurement, parameters, state, torque):
    torque = np.zeros(3)


def late(t, reference, measurement, parameters, state, torque):
    print("here")
    torque[:] = 1 / 0 if t > 0.0205 else 0


@numba.njit
def raises(t, reference, measurement, parameters, state, torque):
    torque[:] = 0.0  # a torque that could be taken for one of a law that works
    if t > 0.0205:
        raise ValueError("lost")


@numba.njit
def asserts(t, reference, measurement, parameters, state, torque):
    torque[:] = 0.0
    assert t < 0.0205


@numba.njit
def unnamed(t, reference, measurement, parameters, state, torque):
    torque[:] = nothing_of_that_name


@numba.njit
def deeper(matrix):
    return matrix.no_such_attribute


@numba.njit
def nested(t, reference, measurement, parameters, state, torque):
    torque[:] = 0.0
    torque[0] = deeper(measurement)


@numba.njit
def adds(t, reference, measurement, parameters, state, torque):
    torque[0] = "a" + t


@numba.njit
def absent(t, reference, measurement, parameters, state, torque):
    torque[:] = np.linalg.no_such_function(measurement)


@numba.njit
def opens(t, reference, measurement, parameters, state, torque):
    with open("x") as file:
        file.read()


@numba.njit
def short(t, reference):
    pass


@numba.njit
def outside(t, reference, measurement, parameters, state, torque):
    torque[:] = 0.0
    torque[3 + int(t)] = 0.0  # the compiler cannot know the place


@numba.njit
def put(torque, place):
    torque[place] = 0.0
    if place > 3:
        put(torque, place - 1)


@numba.njit
def outside_below(t, reference, measurement, parameters, state, torque):
    torque[:] = 0.0
    put(torque, 4 + int(t))


def metric_leaves(run):
    sys.exit(0)
"""


@pytest.fixture
def file(tmp_path):
    (path := tmp_path / "failing.py").write_text(FILE)
    return path


def printed(capfd, *arguments):
    """Run the command; return its exit code and all that came to the terminal, whoever wrote it."""
    code = cli.main(["simulate", "hold", "--duration", "0.05", *map(str, arguments)])
    out, err = capfd.readouterr()
    return code, out, err


@pytest.mark.parametrize(("law", "rows"), [("leaves", 6), ("late", 21), ("raises", 21)])
def test_rows_before_an_exception_are_kept(file, law, rows, tmp_path, capfd):
    path = tmp_path / "run.parquet"
    assert printed(capfd, "--controller.law", f"{file}:{law}", "--telemetry", path)[0] == 1
    assert len(read_parquet(path)[0]) == rows


def test_ctrl_c_in_a_law_stays_ctrl_c():
    def interrupted(t, reference, measurement, parameters, state, torque):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        simulate(scenarios.load("hold"), law=Law("interrupted", interrupted, [], []))


def test_exceptions_of_other_threads_go_where_they_went(monkeypatch):
    """A hook is of the process, and what it takes is of one thread: of callbacks alone."""
    others, own = [], []
    monkeypatch.setattr(sys, "unraisablehook", others.append)
    before = sys.unraisablehook

    class Fails:
        def __del__(self):
            raise ValueError("elsewhere")

    def lose():
        Fails()

    with callback_errors(own.append):
        lose()
        thread = threading.Thread(target=lose)
        thread.start()
        thread.join()
        with callback_errors(own.append):
            pass
    assert (len(others), own) == (2, [])
    assert sys.unraisablehook is before


@pytest.mark.release("compiles two laws again for 3 s; other tests run laws with bounds checks")
@pytest.mark.parametrize("law", ["pd", "afsm_eso"])
def test_bounds_checks_change_no_bit_of_a_law_that_keeps_to_its_arrays(law):
    fields = {"duration": 0.1, "controller.law": law}
    checks = ({"controller.check_bounds": checked} for checked in (False, True))
    one, other = (simulate(scenarios.load("sinusoid", fields | check)) for check in checks)
    assert one.status == other.status == "completed"
    assert one.telemetry.values.tobytes() == other.telemetry.values.tobytes()
