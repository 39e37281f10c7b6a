"""The closed loop: the paper's figures, compiled and plain Python, laws of users, pace of a live run."""

import os
import subprocess
import sys
from types import SimpleNamespace

import numba
import numpy as np
import pytest

from spheretwin import scenario as scenarios
from spheretwin import session as sessions
from spheretwin import simulation
from spheretwin.control.law import Law
from spheretwin.loop.closed_loop import loop
from spheretwin.models.telemetry.table import Table
from spheretwin.session import Session
from spheretwin.simulation import follow, simulate
from tests.requirements import needs_compiled_functions
from tests.twin.session_cases import compiled_law, plain_law

LAWS = ("pd", "adaptive_fuzzy", "afsm")


def run(name, law=None, **overrides):
    changes = {key.replace("__", "."): value for key, value in overrides.items()}
    return simulate(scenarios.load(name, changes), law=law)


def largest_error(finished):
    return np.abs(finished.telemetry["error_rad"]).max(axis=0)


@pytest.fixture(scope="module")
def sinusoid():
    return {
        (law, load): run("sinusoid", controller__law=law, disturbance__load=load)
        for law in ("pd", "adaptive_fuzzy", "afsm")
        for load in (1.0, 2.0)
    }


@pytest.mark.parametrize(
    ("load", "paper"), [(1.0, [0.0832, 0.0750, 0.0761]), (2.0, [0.1854, 0.1986, 0.1769])]
)
def test_laws_rank_as_in_the_paper_and_afsm_keeps_its_errors(sinusoid, load, paper):
    pd, fuzzy, afsm = (largest_error(sinusoid[law, load]) for law in ("pd", "adaptive_fuzzy", "afsm"))
    assert np.all(pd > fuzzy)
    assert np.all(fuzzy > afsm)
    assert sinusoid["afsm", load].status == "completed"
    assert np.all(afsm <= paper)


def test_pd_error_is_what_statics_says(sinusoid):
    # At rest PD holds J_i kp e = load + modelling torque; the sine adds its own. L = 1: 0.05 N·m.
    static = 0.05 / (2.2e-3 * 50)
    assert np.all(np.abs(largest_error(sinusoid["pd", 1.0]) - static) < 0.06)


def test_nutation_is_tracked_from_rest():
    finished = run("nutation")
    assert finished.status == "completed"
    table = finished.telemetry
    late = table["t_s"] > 1.0
    assert np.abs(table["error_rad"][late]).max() <= 0.03
    assert np.abs(table["current_A"]).max() <= 8.0
    np.testing.assert_array_equal(table["qdot_rad_s"][0], 0)


UNCOMPILED = """
import sys
import numpy as np
from tests.twin.test_simulation import LAWS, run

for name in LAWS:
    finished = run("nutation", controller__law=name, duration=0.1)
    np.save(f"{sys.argv[1]}/{name}.npy", finished.telemetry.values)
"""


@pytest.fixture(scope="module")
def uncompiled(tmp_path_factory):
    """Telemetry of the same runs in a process without a compiler."""
    folder = tmp_path_factory.mktemp("uncompiled")
    environment = {**os.environ, "NUMBA_DISABLE_JIT": "1"}
    subprocess.run([sys.executable, "-c", UNCOMPILED, folder], check=True, env=environment)
    return {name: np.load(folder / f"{name}.npy") for name in LAWS}


@pytest.mark.parametrize("name", LAWS)
def test_compiled_and_uncompiled_loop_agree(name, uncompiled):
    compiled = run("nutation", controller__law=name, duration=0.1)
    plain = Table(compiled.telemetry.signals, uncompiled[name])
    # Fused multiply-adds round once where Python rounds twice. Where sgn(s) first flips, a rounding may
    # decide its tick; up to there the traces differ by rounding alone.
    rows = 100
    if name == "afsm":
        flips = np.flatnonzero(np.any(np.diff(np.sign(compiled.telemetry["sliding_s"]), axis=0), axis=1))
        rows = flips[0] if len(flips) else rows
    assert rows >= 20
    np.testing.assert_allclose(plain.values[:rows], compiled.telemetry.values[:rows], rtol=1e-9, atol=1e-12)
    # A flip a tick apart moves the angle by J^-1 torque T²/2, some 1e-5 rad.
    largest = np.abs(plain["error_rad"]).max(axis=0)
    np.testing.assert_allclose(largest, largest_error(compiled), atol=1e-4)


@needs_compiled_functions
def test_engines_drives_and_laws_in_plain_python_share_one_loop():
    run("hold", duration=0.01)
    compiled = len(loop.signatures)
    for options in ({"plant__engine": "lagrangian"}, {"hardware": "electronics"}, {"law": plain_law()}):
        run("hold", duration=0.01, **options)
    assert len(loop.signatures) == compiled


def test_a_plain_python_law_runs_as_a_compiled_one_does():
    plain = run("hold", plain_law(), duration=0.3)
    fast = run("hold", compiled_law(), duration=0.3)
    np.testing.assert_array_equal(plain.telemetry["calls"], np.arange(1, 301))
    np.testing.assert_allclose(plain.telemetry.values, fast.telemetry.values, rtol=1e-9, atol=1e-12)
    # 0.05 N·m of load against 0.5 N·m/rad of stiffness.
    np.testing.assert_allclose(plain.telemetry["error_rad"][-1], -0.1, atol=0.01)


def test_live_keeps_pace_with_the_clock(monkeypatch):
    """With a clock that only sleep moves; the sleep is not time of the loop."""
    sleeps = []
    clock = SimpleNamespace(perf_counter=lambda: 7.0 + sum(sleeps), sleep=sleeps.append)
    for module in (simulation, sessions):
        monkeypatch.setattr(module, "time", clock)
    session = Session(scenarios.load("hold"))
    follow(session, 300, [], live=True)
    np.testing.assert_allclose(sleeps, [simulation.LIVE_CHUNK_S] * 15, rtol=1e-9)
    assert session.loop_s == 0.0


def silent(t, reference, measurement, parameters, state, torque):
    pass


def test_a_law_that_writes_no_torque_ends_the_run():
    law = Law("silent", numba.njit(silent), np.zeros(0), np.zeros(0))
    finished = simulate(scenarios.load("hold"), law=law)
    assert (finished.status, len(finished.telemetry)) == ("diverged", 0)


def test_bounded_allocation_completes_what_scaled_currents_cannot(sinusoid):
    scaled = sinusoid["pd", 2.0]
    assert scaled.status == "left_workspace"
    bounded = run("sinusoid", controller__law="pd", disturbance__load=2.0, allocation="bounded")
    assert bounded.status == "completed"
    table = bounded.telemetry
    assert np.abs(table["current_command_A"]).max() <= 8.0
    # Up to the first tick at which the least-norm currents met the limit, the runs are the same.
    first = np.argmax(scaled.telemetry["allocation_scale"] < 1)
    assert first > 1000
    np.testing.assert_array_equal(table["q_rad"][:first], scaled.telemetry["q_rad"][:first])
