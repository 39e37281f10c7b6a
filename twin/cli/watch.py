"""``spheretwin watch LOG``: alarms when a machine changes."""

from __future__ import annotations

import argparse

import numpy as np

from spheretwin.cli.common import interruptible, print_json, print_message
from spheretwin.cli.log_options import (
    STREAM,
    STREAMED,
    blocks,
    file_log,
    known_fields,
    live_view,
    scenario_of,
)
from spheretwin.cli.options import number, verb
from spheretwin.machine.log import Log
from spheretwin.machine.model import model_of
from spheretwin.machine.state_estimation import Shadow, signals
from spheretwin.machine.watching import WATCHED, Watch, WatchSettings
from spheretwin.models.base.errors import SpheretwinError

MOST_VARIANCE = 1.5
"""Mean square of the residuals, over that of the noise, above which the twin is not that of the machine."""


@verb(
    f"""{STREAM}
    --parameter NAME...      parameter to watch; repeatable (default: {", ".join(WATCHED)})
    --false-alarms RATE=0.1  largest mean rate of alarms without a change, 1/h (default: 0.1)
    --json  print nothing but the lines of JSON, also no summary on stderr
    """,
    has_fields=True,
    **STREAMED,
    false_alarms=number("a number above 0"),
)
def run(options: argparse.Namespace) -> bool:
    """Watch over a machine: print a line of JSON for each change of its parameters.

    Exit code 1 if there was one.
    """
    settings = WatchSettings(false_alarms_per_hour=options.false_alarms)
    scenario, log = scenario_of(options), file_log(options)
    known = known_fields(options, log)
    model = model_of(scenario, known)
    watch = Watch(scenario, known, options.parameter or WATCHED, settings)
    count, seconds, warned = 0, 0.0, False
    with (
        interruptible() as stop_requested,
        live_view(options, model, signals(False), stop_requested, watched=True) as view,
    ):
        estimator = Shadow(model) if view else None
        for block in blocks(options, log, model.groups, stop_requested):
            alarms = watch.advance(block)
            if not (warned or count) and watch.misfit > MOST_VARIANCE:
                warned = True
                print_message(_warning(watch.misfit, settings, block, is_stream=log is None))
            for alarm in alarms:
                of_log = {"log_sha256": log and log.digest, "accepted_findings": list(block.accepted)}
                print_json({**alarm._asdict(), **of_log})
            if view and estimator:
                view.judge(watch.judged, [(alarm.t_s, alarm.text()) for alarm in alarms])
                view.show(estimator.advance(block), block.current_A)
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
    return not count


def _warning(variance: float, settings: WatchSettings, block: Log, *, is_stream: bool) -> str:
    """Return the warning about a twin that does not explain the start of a log or a stream."""
    others = f", or the currents are not {block.currents} (--currents)" if is_stream else ""
    return (
        f"warning: in the first {settings.calibration_s:g} s the mean square of the residuals is"
        f" {variance:.3g} times that of the noise: the twin lacks something that the machine has{others};"
        " validate it first"
    )
