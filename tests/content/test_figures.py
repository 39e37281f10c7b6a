"""Approved content of the figures of constructed data."""

from types import SimpleNamespace

import numpy as np

from spheretwin.models.telemetry.status import Level, Status
from spheretwin.viz.comparison.runs import Spectrum
from spheretwin.viz.figures import (
    comparison,
    conditions,
    crosscheck,
    distributions,
    faults,
    fronts,
    maps,
    over_time,
)
from spheretwin.viz.figures.style import PAPER_WIDTHS_in, fit_width
from tests.content.content import Cases, content_test
from tests.content.figures import figure_text
from tests.content.verdicts import capability
from tests.viz.comparison.compared import RAMP, SIGNALS, SPIKE, VALUE, T_s, run_of
from tests.viz.figures import figure_builders as built

HINGES = ("α", "β", "γ")
LAWS = {"pd": "PD", "pid": "PID", "adaptive_fuzzy": "adaptive fuzzy", "afsm": "AFSM"}
DIGITS = np.arange(1.0, 13.0)


def slow_runs():
    """A run of three quantities with an early end, one that is complete and a shifted one without end."""
    runs = [
        run_of(SPIKE, "1 first: afsm", "afsm"),
        run_of(RAMP[:2500], "2 other: pd", "pd", status=Status.LEFT_WORKSPACE),
        run_of(0.1 + 0.2 * RAMP[:900], "3 own law: mine", "mine", start_s=0.5),
    ]
    for place, run in enumerate(runs):
        run.table["q_rad"][:, 1] = 0.3 + place * run.table["t_s"]
        run.table["q_ref_rad"][:, 0] = 1.5 + 0.25 * place
    return runs


def compared_over_time():
    angle = VALUE._replace(
        title="angle α", desired=lambda rows: rows.table["q_ref_rad"][:, 0], group="angle", limits=(-4.0, 8.0)
    )
    other = VALUE._replace(
        title="angle β", unit="°", values=lambda rows: rows.table["q_rad"][:, 1:2], group="x"
    )
    whole = VALUE._replace(title="error as one angle", unit="°", group="whole")
    return comparison.over_time(slow_runs(), [0, 1], [angle, other, whole], "Angles: scenario made")


def compared_spectra():
    frequency = np.geomspace(0.5, 500.0, 900)
    runs = slow_runs()[:2]

    def spectrum(place, hinge):
        lines = [(50.0, 0.1 * place), (7.0, 2.0 + hinge)]
        return Spectrum(frequency, (1 + place) * DIGITS[hinge] / frequency, lines)

    of_runs = [[spectrum(place, hinge) for hinge in range(3)] for place in range(2)]
    return comparison.spectra(runs, of_runs, "Spectra")


def events():
    noted = [(1.0, Level.WARN, "a warning"), (2.0, Level.ERROR, "an error"), (0.5, Level.INFO, "a note")]
    runs = [run_of(RAMP, "1 a"), run_of(RAMP[:3000], "2 b", "afsm", events=noted), *slow_runs()[2:]]
    return comparison.events_figure(runs, "Events")


def currents():
    return comparison.currents([built.run_with_currents(), run_of(RAMP[:1500], "2 short")], "Currents")


def overview():
    run = run_of(RAMP)
    places = np.arange(18.0)
    run.table["q_rad"][:, 1:] = np.array([0.5, -0.25]) * T_s[:, None]
    run.table["q_ref_rad"][:] = np.array([0.1, 0.2, 0.3]) + T_s[:, None]
    run.table["error_rad"][:] = np.array([1e-3, 2e-3, -3e-3]) * (1 + T_s[:, None])
    run.table["current_A"][:] = (places - 12.0) * (1 + T_s[:, None])
    return comparison.overview(run.table, "made under pd")


def margins_of_laws():
    steps = np.array([[0.5, 0.01, 1.0], [1.0, 0.02, 1.0], [8.0, 0.3, 0.0]])
    panels = {
        "load, N·m": {"pd": steps, "afsm": steps * [1.0, 0.5, 1.0]},
        "delay, ms": {"pd": steps * [0.1, 2.0, 1.0], "afsm": steps[:2]},
        "steps from zero": {"pd": steps - [0.5, 0.0, 0.0], "afsm": steps},
        "narrow": {"pd": steps + [5.0, 0.0, 0.0], "afsm": steps + [6.0, 0.0, 0.0]},
    }
    return conditions.margins(panels, {"pd": "PD", "afsm": "AFSM"}, 0.05, "largest |error|, mrad", "Margins")


def ratios():
    values = {
        "one reading": ([0.5, 3.0, 2.0], [1.1, 1.2, 0.9]),
        "another": ([0.25, 0.75], [4.0, 5.0, 6.0]),
        "third": ([7.0], [8.0, 2.0]),
    }
    rows = {name: {"pd": np.array(pd), "afsm": np.array(afsm)} for name, (pd, afsm) in values.items()}
    return conditions.ratios(rows, {"pd": "PD", "afsm": "AFSM"}, "ours over printed", "Ratios")


def spreads():
    differences = {
        source: {"M": factor * np.linspace(1e-9, 3e-9, 101), "tau": factor * np.array([1e-5, 2e-5, 9e-5])}
        for source, factor in (("MuJoCo", 1.0), ("Pinocchio", 10.0))
    }
    return crosscheck.spreads(differences, {"M": 1e-7, "tau": 1e-3}, "Spreads")


def motion():
    t_s = np.linspace(0.0, 2.0, 40)
    three = np.stack([0.1 * t_s, 0.2 - t_s, t_s * t_s], axis=1)
    return crosscheck.motion(t_s, three, 1e-9 * three[:, ::-1], 1e-8, "Motion")


def convergence():
    steps = np.array([1e-3, 2e-3, 4e-3])
    slopes = {
        "RK4": (steps, 3.0 * steps**4, 4.0),
        "Euler": (steps[1:], 0.2 * steps[1:], 1.0),
    }
    return crosscheck.convergence(slopes, "Orders")


def map_lines():
    count = np.arange(5.0)
    line = maps.StudyLine(1 + count, 0.5 + count, 2 + 3 * count, count == 3)
    gap = maps.StudyLine(np.where(count == 1, np.nan, 9.0 - count), 3 + count, 10 + count, count == 9)
    return maps.lines(
        {"pd": line, "afsm": gap}, np.array([1.0, 2.0, 4.0, 80.0, 500.0]), "load", "error, mrad", "Lines"
    )


def map_lines_of_names():
    line = maps.StudyLine(np.array([1.0, 2.0]), np.ones(2), 2 * np.ones(2), np.zeros(2, bool))
    return maps.lines({"pd": line}, ["hold", "tilt"], "scenario", "error", "Names")


def narrow_map():
    panel = maps.MapPanel(1 + 0.1 * built.VALUES / 20, built.LOST)
    return maps.maps({"pd": panel}, ("rows", "columns"), (["1", "2"], list("abc")), "q", "Narrow")


def large_map():
    values = np.arange(1.0, 901.0).reshape(30, 30)
    panels = {
        law: maps.MapPanel(values * factor, values % 7 == 0)
        for law, factor in (("pd", 1), ("pid", 2), ("afsm", 3))
    }
    names = [f"{place}" for place in range(30)]
    return maps.maps(panels, ("rows", "columns"), (names, names[::-1]), "error", "Large")


def heat_of_many():
    values = np.arange(12.0).reshape(2, 6) / 10
    panels = {"α": maps.HeatPanel(values, values - 0.5), "β": maps.HeatPanel(2 * values, 0.01 * values)}
    return maps.heat(panels, ["ideal", "all"], list(LAWS.values()) + ["a", "b"], "Heat", "change, degrees")


def spread_figures():
    rows = {
        "rms error, mrad": {"pd": DIGITS[:7], "afsm": 3 * DIGITS[:4]},
        "loss, J": {"pd": DIGITS[::-1] * 100, "afsm": DIGITS[:0]},
        "third": {"pd": DIGITS, "afsm": DIGITS + 0.5},
        "fourth": {"pd": DIGITS / 7, "afsm": 1000 * DIGITS**3},
    }
    return distributions.distributions(rows, {"pd": 13, "afsm": 12}, "Spreads")


def rank_figures():
    by_law = {
        "pd": distributions.Rank(np.array([0.9, -0.4, 0.1]), np.array([0.1, 0.3, -0.2]), 0.12, True),
        "afsm": distributions.Rank(np.array([0.5, 0.2, -0.3]), np.array([-0.2, 0.0, 0.4]), 0.2, False),
    }
    return distributions.ranks(["load", "gain", "delay"], by_law, "Ranks")


def scatter_figures():
    x = np.arange(60.0)
    by_field = {
        "load": {"pd": x, "afsm": x[:40]},
        "gain": {"pd": np.roll(x, 7), "afsm": x[:40] ** 2},
        "delay": {"pd": 10.0 ** (x / 10), "afsm": x[40:0:-1]},
        "mass": {"pd": x + 5, "afsm": x[:40] + 3},
    }
    return distributions.scatters(by_field, {"pd": x**2, "afsm": 5 + 3 * x[:40]}, "error, mrad", "Scatters")


def workspace_figures():
    tilt_rad, azimuth_rad = np.radians([0.0, 10.0, 20.0]), np.radians([0.0, 90.0])
    best = DIGITS.reshape(3, 2, 2)
    full = SimpleNamespace(tilt_rad=tilt_rad, azimuth_rad=azimuth_rad, reachable=np.ones((3, 2, 2), bool))
    space = SimpleNamespace(**{**vars(full), "reachable": full.reachable.copy()})
    space.reachable[1, 1, 0] = space.reachable[2, 0] = False
    on_grid, least = capability(best), best.min((1, 2))
    copper = np.array([20.0, 40.0, 60.0])
    worst = {"best_Nm": least - 0.5, "least_norm_Nm": least / 4, "copper_W_per_Nm2": copper}
    of_grid, by_tilt = (
        maps.capability_map(space, on_grid, 8.0),
        maps.capability_by_tilt(full, on_grid, worst, 8.0),
    )
    return "\n".join(map(figure_text, (of_grid, by_tilt)))


def error_bands():
    seeds = np.multiply.outer([0.1, 0.2, 0.4], np.outer(np.arange(1.0, 31.0), [1.0, 3.0, 5.0]))
    broken = seeds.copy()
    broken[1, 20:] = np.nan
    errors = (seeds[:, :9], broken, 1e-3 * seeds, 1e-2 * seeds)
    by_label = {
        label: over_time.ErrorBand(law, each) for (law, label), each in zip(LAWS.items(), errors, strict=True)
    }
    return over_time.errors(by_label, 0.5, HINGES, "Errors")


def angle_traces():
    t_s = np.linspace(0, 1, 25)
    q = np.stack([t_s, 2 * t_s, 3 * t_s], axis=1)
    by_label = {
        "PD": over_time.AngleTraces("pd", t_s[:12], q[:12], t_s, q + 0.5, False),
        "AFSM": over_time.AngleTraces("afsm", t_s, 2 * q, t_s, q + 0.25, True),
    }
    return over_time.angles(by_label, HINGES, "Angles")


def error_lines():
    line = over_time.ErrorLine("as printed", built.SIZES, 0.5 * built.SIZES)
    other = line._replace(label="as acceleration", measured_deg=3 * built.SIZES)
    lines = [line, other, line._replace(label="c")]
    groups = [
        over_time.ErrorGroup("afsm", "AFSM", lines, 0.12),
        over_time.ErrorGroup("pid", "PID", lines[::-1], None),
        over_time.ErrorGroup("pd", "PD", lines, 0.5),
    ]
    return over_time.lines(groups, "largest |error|, degrees", "Lines")


def many_shares():
    shares = {
        name: {count: 1.0 / (place + count) for count in range(1, 6)} for place, name in enumerate("abcd")
    }
    return faults.shares(shares, "open groups", "runs that track, %", "Shares")


def remaining():
    times = {
        "open": [4e-3, 5e-3, 0.2, np.inf, 7e-3],
        "short": [1e-3, 2e-3, np.inf, np.inf],
        "third": [0.5, 0.05],
    }
    return faults.remaining(times, "time, s", "not detected, %", "Latency")


def clouds():
    points = {
        "reported": [(0.5, 3.0, 9), (1.5, 1.0, 1), (np.nan, 1.0, 2), (0.25, 8.0, 4)],
        "bounded": [(0.5, 1.2, 9), (2.0, 4.0, 3), (1.0, np.inf, 5)],
    }
    return faults.clouds(points, ("torque", "error", "groups"), (1.0, 2.0), "Clouds")


def tuned():
    trials = {
        "pid": built.TRIALS,
        "afsm": built.TRIALS._replace(
            law="afsm",
            values=built.TRIALS.values[::-1] * 1.5,
            completed=np.array([True, True, True, False, False, True]),
            best=np.array([False, True, False, False, False, True]),
            signs=np.array([1.0, -1.0]),
            has_start=False,
        ),
    }
    objectives = built.OBJECTIVES
    figures = (fronts.progress(trials, objectives, "Trials"), fronts.front(trials, objectives, "Front"))
    return "\n".join(map(figure_text, figures))


def condition_fronts():
    values = np.array([[2.0, 1.0], [1.0, 3.0], [4.0, 0.5], [9.0, 60.0]])
    panels = [
        fronts.FrontPanel(
            "ideal", "error, mrad", {"pd": values, "afsm": values / 2}, {"best": ("pd", 1.0, 3.0)}, (0.25,)
        ),
        fronts.FrontPanel(
            "noise",
            "tail error, mrad",
            {"pd": 3 * values},
            {"a": ("afsm", 2.0, 2.0), "far": ("pd", 99.0, 99.0)},
        ),
    ]
    return fronts.fronts(panels, {"pd": "PD", "afsm": "AFSM"}, "variation, A/s")


def one_column():
    figure = error_bands()
    fit_width(figure, PAPER_WIDTHS_in["pdf-one-column"])
    return figure


def long_run():
    return comparison.over_time([run_of(SIGNALS["square"])], [0], [VALUE], "Long")


FIGURES = {
    "compared_over_time": compared_over_time, "compared_spectra": compared_spectra, "compared_events": events,
    "compared_currents": currents, "compared_long_run": long_run, "overview": overview,
    "by_condition": built.by_condition, "by_condition_of_three_hinges": built.by_condition_of_three_hinges,
    "margins_of_laws": margins_of_laws, "ratios": ratios, "estimators": built.estimators,
    "crosscheck_margins": built.margins, "crosscheck_spreads": spreads, "crosscheck_motion": motion,
    "crosscheck_convergence": convergence,
    "map": built.study_map, "map_narrow": narrow_map, "map_large": large_map, "map_lines": map_lines,
    "map_lines_of_names": map_lines_of_names, "heat": built.heat, "heat_of_many": heat_of_many,
    "workspace": workspace_figures, "distributions": spread_figures, "ranks": rank_figures,
    "scatters": scatter_figures, "error_courses": built.courses, "error_lines": error_lines,
    "error_bands": error_bands, "error_bands_one_column": one_column, "angle_traces": angle_traces,
    "tip_paths": built.tip_paths, "fault_shares": built.shares, "fault_shares_of_many": many_shares,
    "fault_remaining": remaining, "fault_triangles": built.triangles, "fault_clouds": clouds, "tuning": tuned,
    "condition_fronts": condition_fronts,
}  # fmt: skip


def _text(draw) -> str:
    result = draw()
    return result if isinstance(result, str) else figure_text(result)


CASES: Cases = {f"figure_{name}": (lambda draw=draw: _text(draw)) for name, draw in FIGURES.items()}


test_content = content_test(CASES)
