"""``spheretwin watch LOG``: alarms when a machine changes."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import NamedTuple

import numpy as np

from spheretwin.cli.common import interruptible, print_json, print_message
from spheretwin.cli.log_options import (
    STREAM,
    STREAMED,
    blocks,
    file_log,
    for_each_log,
    known_fields,
    live_view,
    scenario_of,
)
from spheretwin.cli.options import number, verb
from spheretwin.machine.link.stream import is_address
from spheretwin.machine.log import Log
from spheretwin.machine.model import model_of
from spheretwin.machine.state_estimation import Shadow, signals
from spheretwin.machine.twin_file import read_drifts
from spheretwin.machine.watching import WATCHED, Watch, WatchSettings
from spheretwin.models.base.errors import InputError, SpheretwinError
from spheretwin.models.telemetry.joint_state_server import published
from spheretwin.models.telemetry.table import with_currents
from spheretwin.viz.terminal import runs

MOST_VARIANCE = 1.5
"""Mean square of the residuals, over that of the noise, above which the twin is not that of the machine."""

_STREAM = STREAM.replace("the log\n", "all logs, or one for each in their order\n", 1).replace(
    "--twin TWIN.toml      identified parameters of the machine",
    "--twin TWIN.toml...   identified parameters of all machines, or of each in the order of their logs",
)


@verb(
    f"""{_STREAM}
    --parameter NAME...      parameter to watch; repeatable (default: {", ".join(WATCHED)})
    --false-alarms RATE=0.1  largest mean rate of alarms without a change, 1/h (default: 0.1)
    --json  print nothing but the lines of JSON, also no summary on stderr
    """,
    has_fields=True,
    **{**STREAMED, "logs": {"nargs": "*"}},
    false_alarms=number("a number above 0"),
)
def run(options: argparse.Namespace) -> bool:
    """Watch over machines: print a line of JSON for each change of their parameters.

    Of several logs, each of a machine, a table follows: state, last alarm, drift. Exit code 1 if anything
    changed.
    """
    sources = options.logs
    if len(sources) > 1 and (options.live or any(is_address(source) for source in sources)):
        raise InputError(f"watch: expected a stream or --live alone, received {len(sources)} machines")
    maps = for_each_log(options.columns, len(sources), "--columns")
    twins = for_each_log(options.twin, len(sources), "--twin")
    machines = []
    for source, column_map, twin in zip(sources, maps, twins, strict=True):
        columns = [column_map] if column_map else []
        own = {**vars(options), "logs": source, "columns": columns, "twin": twin}
        machines.append(_watch(argparse.Namespace(**own)))
    if len(machines) > 1 and not options.json:
        rows = [(one.name, one.state, str(one.alarms), one.last, one.drift) for one in machines]
        runs.print_rows("machines", ("machine", "state", "alarms", "last alarm", "drift"), rows, 2, _WORDS)
    return not any(one.alarms for one in machines)


class _Watched(NamedTuple):
    """Machine after its watch."""

    name: str
    misfit: float
    """Mean square of the residuals of the start over that of the noise."""
    alarms: int
    last: str
    """Last alarm."""
    drift: str
    """Clear drifts of the parameters in the history of its twin."""

    @property
    def state(self) -> str:
        if self.misfit > MOST_VARIANCE:
            return "unlike its twin"
        return "changed" if self.alarms else "as its twin"


_WORDS = ("last alarm", "drift")


def _watch(options: argparse.Namespace) -> _Watched:
    """Watch over one machine."""
    settings = WatchSettings(false_alarms_per_hour=options.false_alarms)
    scenario, log = scenario_of(options), file_log(options)
    known = known_fields(options, log)
    model = model_of(scenario, known)
    watch = Watch(scenario, known, options.parameter or WATCHED, settings)
    last, count, seconds, warned = "none", 0, 0.0, False
    with (
        interruptible() as stop_requested,
        published(options.publish) as publishers,
        live_view(options, model, signals(False), stop_requested, watched=True) as view,
    ):
        estimator = Shadow(model) if view or publishers else None
        for block in blocks(options, log, model.groups, stop_requested):
            alarms = watch.advance(block)
            if not (warned or count) and watch.misfit > MOST_VARIANCE:
                warned = True
                print_message(_warning(watch.misfit, settings, block, is_stream=log is None))
            for alarm in alarms:
                of_log = {"log": options.logs, "log_sha256": log and log.digest}
                print_json({**alarm._asdict(), **of_log, "accepted_findings": list(block.accepted)})
                last = f"{alarm.onset_s:.2f} s: {alarm.text()}"
            if estimator:
                estimated = estimator.advance(block)
                for publisher in publishers:
                    publisher.write(with_currents(estimated, block.current_A))
                if view:
                    view.judge(watch.judged, [(alarm.t_s, alarm.text()) for alarm in alarms])
                    view.show(estimated, block.current_A)
            count += len(alarms)
            seconds += len(block) * float(np.median(np.diff(block.t_s)))
    if seconds <= settings.calibration_s + settings.window_s:
        raise SpheretwinError(
            f"watch: expected more than {settings.calibration_s + settings.window_s:g} s of data, of which"
            f" the first {settings.calibration_s:g} s measure the noise, received {seconds:.3g} s"
        )
    if not options.json:
        print_message(
            f"watch: alarms: {count} in {seconds:.3g} s; without a change, fewer than"
            f" {options.false_alarms:g} in an hour on average"
        )
    return _Watched(options.logs, watch.misfit, count, last, _drift(options.twin))


def _drift(twin: Path | None) -> str:
    """Return the clear drifts of the parameters of a twin."""
    found = read_drifts(twin) if twin else {}
    if not found:
        return "no history"
    clear = [f"{name} {one.text()}" for name, one in found.items() if one.is_clear]
    return ", ".join(clear) or "none"


def _warning(variance: float, settings: WatchSettings, block: Log, *, is_stream: bool) -> str:
    """Return the warning about a twin that does not explain the start of a log or a stream."""
    others = f", or the currents are not {block.currents} (--currents)" if is_stream else ""
    return (
        f"warning: in the first {settings.calibration_s:g} s the mean square of the residuals is"
        f" {variance:.3g} times that of the noise: the twin lacks something that the machine has{others};"
        " validate it first"
    )
