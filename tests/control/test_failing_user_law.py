"""Laws of a user's that raise, do not compile, or write outside their arrays: one line, and exit 1 or 2."""

import json
import sys
import threading

import pytest

from spheretwin import cli
from spheretwin import scenario as scenarios
from spheretwin.control.law import Law
from spheretwin.models.base.numba_internals.callbacks import callback_errors
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


INTO_THE_ARGUMENT = "write the torque into the last argument, torque[:] = …"
RAISED = {
    law: f"expected a torque at {time_s} s, received {received}"
    for law, time_s, received in (
        ("leaves", 0.006, "SystemExit: 0"),
        ("closes", 0, "GeneratorExit"),
        ("strange", 0, "Strange: so it is"),
        ("returns", 0, f"ValueError: a returned value, which is not used: {INTO_THE_ARGUMENT}"),
        ("rebinds", 0, f"ValueError: no torque: {INTO_THE_ARGUMENT}"),
        ("late", 0.021, "ZeroDivisionError: division by zero"),
        ("raises", 0.021, "ValueError: lost"),
        ("asserts", 0.021, "AssertionError"),
    )
}


@pytest.mark.parametrize("law", RAISED)
def test_what_a_law_raises_is_one_line_and_exit_1(file, law, capfd):
    message = f"spheretwin: law {law}: {RAISED[law]}\n"
    code, out, err = printed(capfd, "--controller.law", f"{file}:{law}")
    assert (code, out.replace("here\n", ""), err) == (1, "", message)
    code, out, err = printed(capfd, "--controller.law", f"{file}:{law}", "--json")
    assert (code, out, err.replace("here\n", "")) == (1, "", message)  # what the law prints is no JSON


@pytest.mark.parametrize(("law", "rows"), [("leaves", 6), ("late", 21), ("raises", 21)])
def test_rows_before_an_exception_are_kept(file, law, rows, tmp_path, capfd):
    path = tmp_path / "run.parquet"
    assert printed(capfd, "--controller.law", f"{file}:{law}", "--telemetry", path)[0] == 1
    assert len(read_parquet(path)[0]) == rows


def test_under_a_watchdog_the_line_has_the_time_of_the_exception(file, capfd):
    """The currents run down first, and the line must not have the time of their end."""
    watched = ["--hardware", "electronics", "--watchdog.rundown-s", "0.01"]
    message = f"spheretwin: law raises: {RAISED['raises']}\n"
    assert printed(capfd, "--controller.law", f"{file}:raises", *watched) == (1, "", message)


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


def line_of(text):
    """Number of the line of the file that has a text."""
    (number,) = [number for number, line in enumerate(FILE.splitlines(), 1) if text in line]
    return number


NOT_COMPILED = {
    "unnamed": "NameError: name 'nothing_of_that_name' is not defined, in line"
    f" {line_of('= nothing_of_that_name')}",
    "nested": "Unknown attribute 'no_such_attribute' of type array(float64, 2d, C), in line"
    f" {line_of('return matrix.no_such_attribute')}",
    "adds": "No implementation of function Function(<built-in function add>) found for signature:"
    f" add(Literal[str](a), float64), in line {line_of('+ t')}",
    "absent": "module 'numpy.linalg' has no attribute 'no_such_function'",
    "opens": "The 'with (context manager) as (variable):' construct is not supported",
    "short": "Signature mismatch: 6 argument types given, but function takes 2 arguments",
}


@pytest.mark.parametrize("law", NOT_COMPILED)
def test_why_a_law_does_not_compile_is_one_line(file, law, capfd):
    expected = "a function of (t, reference, measurement, parameters, state, torque) that numba compiles"
    message = f"spheretwin: law {law}: expected {expected}, received {NOT_COMPILED[law]}\n"
    assert printed(capfd, "--controller.law", f"{file}:{law}") == (2, "", message)


@pytest.mark.release("compiles two laws again for 3 s; other tests run laws with bounds checks")
@pytest.mark.parametrize("law", ["pd", "afsm_eso"])
def test_bounds_checks_change_no_bit_of_a_law_that_keeps_to_its_arrays(law):
    runs = [
        simulate(
            scenarios.load(
                "sinusoid", {"duration": 0.1, "controller.law": law, "controller.check_bounds": checked}
            )
        )
        for checked in (False, True)
    ]
    assert [run.status for run in runs] == ["completed"] * 2
    assert runs[0].telemetry.values.tobytes() == runs[1].telemetry.values.tobytes()


def failures_of_a_sweep(folder, capfd, fields):
    """Run a study whose rows all fail; return its report and the line of the failure."""
    (source := folder / "study.toml").write_text(f'name = "failing"\nscenario = "hold"\n{fields}\n')
    assert cli.main(["sweep", str(source), "--out", str(folder / "out"), "--json"]) == 1
    out, err = capfd.readouterr()
    assert err.count("\n") == 1
    return json.loads(out), err


@pytest.mark.parametrize("law", ["leaves", "strange", "raises"])
def test_a_row_whose_law_raises_has_failed(file, law, tmp_path, capfd):
    axis = '[[axis]]\nfield = "disturbance.load"\nkind = "values"\nvalues = [0.0, 1.0]'
    fields = f'fields = {{duration = 0.05}}\nlaw = [{{law = "{file}:{law}"}}]\n{axis}'
    report, err = failures_of_a_sweep(tmp_path, capfd, fields)
    assert [each["statuses"] for each in report["summary"].values()] == [{"failed": 2}]
    assert err.startswith("spheretwin: sweep: 2 of 2 rows failed, the first with key ")
    assert err.endswith(f"{RAISED[law]}\n")


def test_a_row_whose_metric_raises_has_failed(file, tmp_path, capfd):
    fields = f'fields = {{duration = 0.01}}\nmetrics = ["rms_error_rad", "{file}:metric_leaves"]'
    report, err = failures_of_a_sweep(tmp_path, capfd, fields)
    assert report["failed"] == 1
    assert "1 of 1 rows failed" in err
    assert "it raised SystemExit: 0" in err


@pytest.mark.parametrize("law", ["outside", "outside_below"])
def test_a_law_that_writes_outside_its_arrays_is_found_on_request(file, law, tmp_path, capfd):
    message = f"law {law}: expected a torque at 0 s, received IndexError: index is out of bounds\n"
    checked = ["--controller.law", f"{file}:{law}", "--controller.check-bounds", "true"]
    assert printed(capfd, *checked) == (1, "", f"spheretwin: {message}")
    fields = f'fields = {{duration = 0.01}}\nlaw = [{{law = "{file}:{law}", check_bounds = true}}]'
    assert failures_of_a_sweep(tmp_path, capfd, fields)[1].endswith(message)


@pytest.mark.parametrize(
    ("metric", "received"),
    [("metric_leaves", "SystemExit: 0"), ("closes", "GeneratorExit"), ("strange", "Strange: so it is")],
)
def test_what_a_metric_raises_is_a_warning_and_exit_1(file, metric, received, capfd):
    code, out, err = printed(capfd, "--metric", f"{file}:{metric}", "--json")
    report = json.loads(out)
    assert (code, err, report[metric]) == (1, "", None)
    assert f"metric {metric}: expected a figure, it raised {received}" in report["warnings"]
