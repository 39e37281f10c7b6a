"""Approved values of the functions below pictures: ranges, decimation, quantities, colours and solids."""

from inspect import signature
from itertools import product

import numpy as np

from spheretwin.models.telemetry.signals import ANGLES, Signal, common_signals
from spheretwin.viz import decimation, quantities, theme
from spheretwin.viz.comparison import merged_recording, runs
from spheretwin.viz.layout import extents, styles, view
from spheretwin.viz.layout.extents import ExtentTracker, PlotChannel
from spheretwin.viz.scene import entities, meshes, places, solids
from tests.content.content import Cases, content_test
from tests.content.runs import FAULTS, rows_of, session_of
from tests.content.values import array, number
from tests.viz.comparison.compared import RAMP, SPIKE, SQUARE, VALUE, T_s, run_of

COUNT = np.arange(3000.0)
WAVE = COUNT % 37 - 18.0 + (COUNT > 2000) * 5.0


def ranges() -> str:
    """Nice numbers, texts and labelled ranges; bounds of spans that were united; ranges of runs."""
    values = (1e-4, 0.9, 1.0, 1.01, 1.5, 2.2, 3.99, 4.0, 7.0, 9.99, 10.0, 1234.5, 999_999.0, 2e6)
    lines = [
        f"{number(value)}: {number(extents.nice(value))} {extents.number(value)} {extents.number(-value)}"
        f" {extents.nice(value, extents.NICE_ABOVE_ZERO)}"
        for value in values
    ]
    for low, high, least in product((-3.0, -0.2, 0.0, 0.31, 7.9), (0.32, 8.0, 8.4, 95.0), (0.01, 2.0)):
        low, high = min(low, high), max(low, high)
        results = [*extents.labelled(low, high, least), *extents.labelled(low, high, least, 3)]
        lines.append(f"{low} {high} {least}: {array(np.array(results))}")
    for ended_s, rows in ((None, 3000), (2.5, 3000), (None, 40), (0.01, 3)):
        tracker = ExtentTracker({"a": 2, "b": 1})
        assert tracker.extents(None) is None
        for first in range(0, rows, 100):
            part = slice(first, min(first + 100, rows))
            low = np.stack([WAVE[part], 0.1 * COUNT[part], -COUNT[part] % 101], axis=1)
            low[::9, 1] = np.nan
            tracker.add(1e-3 * COUNT[part], low - 1.0, low + 2.0)
        of = tracker.extents(ended_s)
        lines += [f"spans {array(of.t_s)} {of.ended_s}"]
        lines += [f"{name} {array(of._low[name])} {array(of._high[name])}" for name in ("a", "b")]
        several = (PlotChannel("a", 1), PlotChannel("b"))
        for channels in ((PlotChannel("a"),), several, (PlotChannel("b", 0),)):
            kinds = product((0.1, 30), (False, True))
            limits = [of.limit(*channels, least=least, above_zero=up) for least, up in kinds]
            results = [*limits, *of.bounds(*channels), *of.band(*channels, least=0.5)]
            lines.append(f"{channels}: {array(np.array(results))} {of.is_cut(12.0, *channels)}")
    shown = [
        run_of(RAMP),
        run_of(SPIKE + 0.01 * RAMP, "2 b"),
        run_of(9 * SQUARE[:900], "3 c", status="failed"),
    ]
    for chosen in (shown, shown[:2], shown[1:2], shown[2:]):
        columns = [run.table["q_rad"][:, 0] for run in chosen]
        results = [
            _settled_range(chosen, columns, 1e-3),
            _settled_range(chosen, columns, 5.0, [RAMP + 9]),
        ]
        results.append(runs.quantity_ranges([VALUE], chosen, [0])[0])
        lines += [
            f"{array(np.array(each[:2]))} {[outside.text() for outside in each.outside]}" for each in results
        ]
    of_kinds = {
        "transient": (0 * T_s, 0.01 * np.sin(40 * T_s) + np.where(T_s < 0.3, 2.0 - T_s, 0.0)),
        "failed": (0.1 * np.sin(9 * T_s), -np.exp(np.minimum(8 * T_s[:2000], 12.0))),
        "failed alone": (np.where(T_s < 3.9, np.sin(9 * T_s), -1e6),),
        "gaps": (np.where(T_s > 3.99, np.nan, np.sin(9 * T_s)),),
        "no number": (np.array([np.nan, np.inf]),),
        "zeros": (np.zeros(2),),
    }
    for name, columns in of_kinds.items():
        compared = [run_of(each) for each in columns]
        compared[-1:] = [run_of(columns[-1], status="diverged")] if "failed" in name else compared[-1:]
        low, high, outside = _settled_range(compared, columns, 1e-3)
        lines.append(f"{name}: {array([low, high])} {[each.text() for each in outside]}")
    late = [run_of(np.minimum(T_s, 1.0) + 1e-3), run_of(np.where(T_s < 0.1, 50.0, 1.0))]
    ramp = VALUE._replace(desired=lambda rows: np.minimum(T_s, 1.0))
    lines.append(f"reference: {runs.quantity_ranges([ramp], late, [0])[0]}")
    lines.append(f"{runs.leaders([run.table for run in shown])}")
    return "\n".join(lines)


def _settled_range(compared, columns, least: float, references=()) -> runs.PlotRange:
    bounds = runs.settled_bounds(compared, columns, least, references)
    return runs.PlotRange(*bounds, runs.values_outside(compared, columns, bounds))


def decimated() -> str:
    """Envelopes, cells, octaves, bins of time and rows of decimated recordings, of several lengths."""
    lines = []
    for length, most in product((1, 2, 7, 100, 1999, 3000), (1, 7, 500)):
        values = WAVE[:length].copy()
        values[5:9] = np.nan
        bounds = decimation.envelope(values, most)
        cells = decimation.mean_and_deviation(np.stack([WAVE[:length], COUNT[:length]], axis=1), most)
        lines += [f"{length} {most}", *(f"  {name} {array(part)}" for name, part in bounds._asdict().items())]
        lines += [f"  cells {name} {array(part)}" for name, part in cells._asdict().items()]
    for lines_per_octave in (1, 3, 12):
        result = decimation.octave_maxima(0.5 + COUNT, WAVE, lines_per_octave)
        lines.append(f"octaves {lines_per_octave} {array(result[0])} {array(result[1])}")
    lines.append(f"no octaves {decimation.octave_maxima(COUNT[:0], WAVE[:0], 10)}")
    for immediate, rate_Hz in product((False, True), (10.0, 60.0)):
        bins = decimation.TimeBins(rate_Hz, immediate=immediate)
        sent = [bins.add(1e-3 * COUNT[k : k + 130], WAVE[k : k + 130, None]) for k in range(0, 3000, 130)]
        for place, part in enumerate([*sent, bins.flush()]):
            if part is not None and (place < 3 or not immediate):
                texts = [f"{name} {array(values)}" for name, values in part._asdict().items()]
                lines.append(f"bins {rate_Hz} {place} {' '.join(texts)}")
    session = session_of("tilt", hardware="electronics", fault=FAULTS, **{"watchdog.on": True})
    rows = rows_of(session, 900)
    rows["t_s"][:] *= 50.0  # more than two windows
    for selection in (
        decimation.FirstRows(0.5),
        decimation.FirstAndExtremeRows(0.5),
        decimation.RowSelection(),
    ):
        parts = [each for k in range(0, 900, 130) for each in selection.add(rows.rows(k, min(k + 130, 900)))]
        selected = np.concatenate([each.values for each in [*parts, *selection.flush()]])
        lines.append(f"{type(selection).__name__} {array(selected[:, 0])} {array(selected)}")
    return "\n".join(lines)


def every_quantity() -> str:
    """Every quantity with its texts and its values of constructed rows."""
    session = session_of(
        "tilt", hardware="electronics", **{"watchdog.on": True, "controller.law": "afsm_eso"}
    )
    table = rows_of(session, 300)
    given = quantities.QuantityRows(table.rows(10, 300), table.rows(9, 10), session.actuator, 8.0)
    lines = []
    for each in (*quantities.QUANTITIES, *quantities.COMPARED_QUANTITIES):
        facts = each._replace(values=None, desired=None)._asdict()
        lines.append(f"{each.heading} {[facts[name] for name in facts if facts[name] is not None]}")
        if set(each.needs) <= {signal.name for signal in table.signals}:
            lines.append(f"  {array(each.values(given))}")
        if each.desired:
            lines.append(f"  desired {array(each.desired(given))}")
    names = {signal.name for signal in table.signals}
    lines.append(f"{[each.name for each in quantities.quantities_of(names)]}")
    other = rows_of(session_of(), 100)
    lines.append(f"{[each.name for each in quantities.compared_quantities([table, other])]}")
    lines.append(f"{[each.name for each in quantities.compared_quantities([table])]}")
    lines.append(f"{extents.plotted_signals(table.signals)}")
    others = [
        Signal(name, "A", len(labels) or 1, "a signal", labels)
        for name, labels in {"new_rad": ANGLES, "new_1": (), "new_A": tuple(map(str, range(18)))}.items()
    ]
    others.append(Signal("three_others", "A", 3, "a signal", ("a", "b", "c")))
    lines += [f"{signal.name} {styles.signal_style(signal)}" for signal in (*table.signals, *others)]
    lines += [f"{each.name} {styles.quantity_style(each)}" for each in quantities.QUANTITIES]
    return "\n".join(lines)


def colours() -> str:
    """Colours of laws, runs, currents and variations; application ids depend on all that a layout does."""
    laws = ["afsm", "pd", "pid", "mine", "other", "afsm", "pd", "pd", "third", "afsm"]
    lines = [
        f"{name} {value!r}" for name, value in vars(theme).items() if name.isupper() and name != "Colour"
    ]
    lines += [f"{theme.law_colours(laws)}", f"{theme.run_colours(laws)}", f"{theme.law_marks(laws)}"]
    lines += [f"{theme.rgb('#0a64ff')} {theme.mixed((0, 100, 200), (50, 0, 250), 0.3)}"]
    at = np.linspace(-10.0, 10.0, 41)
    lines.append(f"{theme.current_colours(at, 8.0).tolist()}")
    lines.append(f"{theme.magnitude_colours(np.linspace(0.0, 10.0, 21), 8.0).tolist()}")
    plain = view.View(1.0, 8.0, 18, (), False)
    changes = {
        "duration_s": 2.0, "current_limit_A": 4.0, "groups": 12, "own": common_signals(18)[:2], "live": True,
        "shown": "coils", "run": "another", "decimated": True,
    }  # fmt: skip
    others = [plain, *(plain._replace(**{name: value}) for name, value in changes.items())]
    lines.append(f"{[view.application(each) for each in others]}")
    lines.append(f"{[view.shown_until_s(*times) for times in ((10.0, 4.0), (4.2, 4.0))]}")
    return "\n".join(lines)


def shapes() -> str:
    """Solids, meshes and poses of the scene."""
    outline = [(1.0, 0.0), (2.0, 0.5), (1.5, 3.0), (0.5, 2.0)]
    surfaces = {
        "revolved": solids.revolved_surface(outline, 7), "tube": solids.tube(0.5, 1.5, -1.0, 2.0, 6),
        "cylinder": solids.cylinder(0.7, 0.1, 0.9, 5), "zone": solids.zone(2.0, -1.0, 1.5, 4, 9),
        "bar": solids.bar((1.0, 2.0, 3.0)), "reversed": solids.reversed_(solids.bar((1.0, 2.0, 3.0))),
        "merged": solids.merged_surface([solids.bar((1.0, 2.0, 3.0)), solids.cylinder(0.7, 0.1, 0.9, 5)]),
    }  # fmt: skip
    lines = [
        f"{name} {array(surface.positions)} {array(surface.triangles)}" for name, surface in surfaces.items()
    ]
    actuator = session_of().actuator
    q = 0.01 * np.stack([COUNT[:50], -COUNT[:50], 2 + COUNT[:50] % 7], axis=1)
    lines += [f"{name} {array(turned)}" for name, turned in entities.body_quaternions(q).items()]
    lines.append(f"tip {array(places.shaft_tip(q, actuator))} size {number(entities.size_of(actuator))}")
    point = np.array([0.01, 0.02, -0.03])
    lines.append(f"point {array(places.point_in_stator(q, point))}")
    lines.append(f"load {array(entities.load_torque(q, 0.1 * q[:, ::-1]))}")
    gravity = entities.gravity_torque(q, 0.4, point, np.array([0.0, 1.0, -9.81]))
    lines.append(f"gravity {array(gravity)} {signature(entities.gravity_torque)}")
    binary = meshes.binary(np.arange(12.0).reshape(4, 3), np.array([[0, 1, 2], [1, 2, 3]]))
    lines.append(f"file {array(np.frombuffer(binary, np.uint8))}")
    return "\n".join(lines)


class _Sent:
    """Stream that lists what is sent."""

    def __init__(self) -> None:
        self.lines: list[str] = []

    def log(self, entity: str, look, static: bool) -> None:
        markers, colours = (each.as_arrow_array().to_pylist() for each in (look.markers, look.colors))
        self.lines.append(f"{entity} {markers} {colours}")

    def send_columns(self, entity: str, indexes: list, columns: list) -> None:
        t_ns = np.asarray(indexes[0].as_arrow_array().cast("int64"))
        values = np.asarray(columns[0].as_arrow_array().flatten())
        self.lines.append(f"{entity} {t_ns.tolist()} {array(values)}")


def marks() -> str:
    """Markers of eight merged runs, of gaps, of no value and of one row, and their outlines in the legend."""
    sent = _Sent()
    series = [RAMP] * 8 + [np.where(T_s > 2.0, np.nan, RAMP), np.full(len(T_s), np.nan), RAMP[:1]]
    for place, values in enumerate(series):
        run = run_of(values, label=f"{place + 1} run")
        merged_recording._send_marks(sent, f"run {place}", run, values, (1, 2, 3), (place % 8, 8))
    outlines = [f"{name} {array(merged_recording._outline(place))}" for place, name in
                enumerate([*map(str, merged_recording._OUTLINES), "other"])]  # fmt: skip
    return "\n".join([*sent.lines, *outlines])


CASES: Cases = {
    "values_marks": marks, "values_ranges": ranges, "values_decimated": decimated,
    "values_quantities": every_quantity, "values_colours": colours, "values_shapes": shapes,
}  # fmt: skip


test_content = content_test(CASES)
