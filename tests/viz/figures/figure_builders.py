"""Figures of constructed data that content of figures and widths of a paper share."""

import numpy as np
from matplotlib.figure import Figure

from spheretwin.viz.comparison.runs import ComparedRun
from spheretwin.viz.figures import conditions, crosscheck, faults, fronts, maps, over_time
from tests.viz.comparison.compared import RAMP, T_s, run_of

HINGES = ("α", "β", "γ")


def run_with_currents() -> ComparedRun:
    """Return a run with a constant current in each group but one, whose current chatters."""
    run = run_of(RAMP)
    rows = np.arange(len(T_s))
    run.table["current_A"][:] = np.linspace(-2.0, 2.0, 18)
    run.table["current_A"][:, 5] = np.where(rows // 2 % 2, 3.0, -3.0)  # mean 0, deviation 3
    return run


BANDWIDTHS = np.geomspace(20, 1000, 7)
CURVES = {
    "slow": conditions.Curve(
        BANDWIDTHS / 1e3, 1 / BANDWIDTHS, np.full(7, 1e-6), BANDWIDTHS / 2e3, 2 / BANDWIDTHS, 150.0
    ),
    "exact": conditions.Curve(
        BANDWIDTHS / 3e3, np.linspace(-1e-4, 1e-3, 7), np.full(7, 1e-4), BANDWIDTHS / 3e3, np.zeros(7), 800.0
    ),
}


def estimators() -> Figure:
    """Return errors and lags of two estimators; some lags are within their noise."""
    return conditions.estimators(BANDWIDTHS, CURVES, "rates")


def by_condition() -> Figure:
    """Return errors of two laws under two conditions, of two hinges."""
    low = np.array([[10.0, 20.0], [30.0, 40.0], [50.0, 60.0]])  # of each of two conditions and two hinges
    spread = 1e-3 * np.stack([low[:2] * factor for factor in (0.5, 1.0, 3.0)])
    series = {
        "PD": conditions.ErrorsByCondition("pd", np.array([1.0, 2.0]), spread, np.array([True, False]), {}),
        "AFSM": conditions.ErrorsByCondition(
            "afsm", np.array([1.0, 2.0]), spread / 10, np.array([True, True]), {2.0: (0.008, 0.009)}
        ),
    }
    return conditions.by_condition(series, ("α", "β"), "load L", "largest |error|", "title")


def by_condition_of_three_hinges() -> Figure:
    """Return errors of two laws under two conditions, of three hinges; one law ended early."""
    spread = np.array([0.9, 1.0, 1.2])[:, None, None] * np.array([1.0, 2.0])[:, None] * np.ones(3)
    at = np.array([0.0, 1.0])
    by_label = {
        "PD": conditions.ErrorsByCondition("pd", at, 0.1 * spread, np.array([True, False]), {}),
        "AFSM": conditions.ErrorsByCondition(
            "afsm", at, 0.01 * spread, np.array([True, True]), {1.0: (0.03, 0.04, 0.05)}
        ),
    }
    return conditions.by_condition(by_label, HINGES, "load L", "largest |error|", "title")


def margins() -> Figure:
    """Return checks of the cross-check within and beyond their bounds."""
    return crosscheck.margins({"one": 0.5, "two": 2.0, "three": 0.0, "four": np.inf}, "margins")


WINDOWS = 0.1 + np.linspace(0, 1, 40)[None, :, None] + 0.1 * np.arange(3)[:, None, None] * np.ones((1, 1, 2))


def courses(windows: np.ndarray = WINDOWS) -> Figure:
    """Return errors in windows of time, of two laws."""
    by_label = {
        "AFSM": over_time.ErrorBand("afsm", np.radians(windows), np.radians(0.12), (0,)),
        "PID": over_time.ErrorBand("pid", np.radians(windows)),
    }
    return over_time.errors(by_label, 0.02, ("α", "β"), "courses")


SIZES = np.array([0.1, 0.3, 0.2])


def heat() -> Figure:
    """Return a table of errors in colours; one is absent."""
    values = np.array([[0.1, 9.0], [np.nan, 0.3]])
    panels = {"α": maps.HeatPanel(values, values - 0.2), "β": maps.HeatPanel(values, 0 * values)}
    return maps.heat(panels, ["ideal", "all"], ["pd", "afsm"], "heat", "change, degrees")


TIP = np.array([[1.0, 2.0, 30.0], [4.0, -5.0, 31.0], [7.0, 8.0, 32.0]])


def tip_paths() -> Figure:
    """Return paths of the tip of two laws, one of which ended early."""
    desired = TIP + [0.5, 0.25, 0.125]
    by_label = {
        "PD": over_time.TipPath("pd", TIP, desired, False),
        "AFSM": over_time.TipPath("afsm", TIP, desired, True),
    }
    return over_time.paths(by_label, "title")


VALUES = np.array([[1.0, 20.0, 3.0], [4.0, np.nan, 6.0]])
LOST = np.array([[False, True, False], [False, True, False]])


def study_map() -> Figure:
    """Return a map of two laws; some runs are lost."""
    panels = {"pd": maps.MapPanel(VALUES, LOST), "afsm": maps.MapPanel(2 * VALUES, np.zeros_like(LOST))}
    labels = (["low", "high"], ["a", "b", "c"])
    return maps.maps(panels, ("the rows", "the columns"), labels, "error, mrad", "title")


SHARES = {"told": {1: 1.0, 2: 0.9, 9: 0.4}, "not told": {1: 0.6, 2: 0.3}}
TRIANGLE = np.array([[1.0, np.nan, np.nan], [2.5, 1.5, np.nan], [np.nan, 8.0, 2.0]])


def shares() -> Figure:
    """Return shares of the runs that track, by the number of open groups."""
    return faults.shares(SHARES, "open groups", "runs that track, %", "shares")


def triangles() -> Figure:
    """Return ratios of pairs of groups."""
    return faults.triangles({"told": TRIANGLE, "not told": TRIANGLE}, "group", "ratio", 2.0, "pairs")


TRIALS = fronts.Trials(
    law="pid",
    numbers=np.arange(6.0),
    values=np.array([[3.0, 1.0], [2.0, 5.0], [np.nan, np.nan], [9.0, 9.0], [1.0, 6.0], [4.0, 8.0]]),
    completed=np.array([True, True, False, False, True, True]),
    best=np.array([True, True, False, False, True, False]),
    signs=np.array([1.0, 1.0]),
    has_start=True,
    fresh=np.array([[1.5, 6.5], [2.5, 5.5]]),
)
OBJECTIVES = ("worst error", "worst variation")
