"""Common arguments of the verbs that start from logs of a machine."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from spheretwin.cli.common import keep_viewer, print_message
from spheretwin.machine.files import read
from spheretwin.machine.link import frame_format
from spheretwin.machine.link.admission import read_key
from spheretwin.machine.link.frame_format import DEFAULT_FRAME, shipped
from spheretwin.machine.link.stream import is_address, played, streamed
from spheretwin.machine.log import COMMANDED, MEASURED, Log
from spheretwin.machine.model import Model
from spheretwin.machine.twin_file import read_twin
from spheretwin.machine.verdict import check
from spheretwin.models.base.errors import InputError, SpheretwinError
from spheretwin.models.telemetry.signals import Signal
from spheretwin.scenario import reading
from spheretwin.scenario.sections import Scenario

if TYPE_CHECKING:
    from spheretwin.viz.comparison.shadow import ShadowView

T = TypeVar("T")


LOGS = """
    [LOG...]              Parquet, CSV or MCAP
    --columns MAP.toml...  column map of all logs, or one for each in their order
    --scenario SCENARIO   scenario of the machine (default: hold)
    --twin TWIN.toml      identified parameters of the machine
    --accept FINDING...   accept a finding of `log check`; repeatable
"""
"""Logs, their columns, the scenario of the machine and its twin."""

LOG = LOGS.replace("all logs, or one for each in their order", "the log")

ONE: dict[str, Any] = {"logs": {"nargs": "?"}}
"""Reader of a single log."""

STREAM = f"""{LOG}
    --frame NAME={DEFAULT_FRAME}  frames of a stream, which udp://:PORT, serial:DEVICE@BAUD or - in place
        of LOG names: {", ".join(shipped())}, or a .toml file (default: {DEFAULT_FRAME})
    --currents  currents of a stream: sent to the amplifiers and held, or measured in the coils (default:
        as the frames state)
    --key FILE  frames of a stream are authenticated by the key in a file, as those of `drive` and `machine`
    --live      follow the data in a viewer on 127.0.0.1; a file is played at the pace of its times
    --publish PORT  publish angles, currents and estimates at ws://127.0.0.1:PORT, for Foxglove and ROS 2; a
        file is played at the pace of its times
"""
"""One log, or the address of a stream."""

STREAMED: dict[str, Any] = {**ONE, "currents": (COMMANDED, MEASURED)}
"""Readers of a stream."""


def scenario_of(options: argparse.Namespace) -> str:
    """Return the name or the file of the scenario of the machine."""
    return options.scenario or "hold"


def file_log(options: argparse.Namespace) -> Log | None:
    """Return the log of a file, which a check has accepted; None if a stream is named.

    Raises
    ------
    InputError
        The log cannot be read, or a flag does not belong to a file or a stream.
    """
    if not is_address(options.logs):
        if options.currents or options.key:
            flag = "--currents" if options.currents else "--key"
            raise InputError(f"command line: expected {flag} with a stream, received a file")
        return read_logs(options)[0]
    if not (options.currents or frame_format.load(options.frame).currents):
        print_message(
            f"warning: frame {options.frame}: expected currents = {COMMANDED!r} or {MEASURED!r} in it or"
            f" --currents, received none: taken as {MEASURED}"
        )
    return None


def known_fields(options: argparse.Namespace, log: Log | None) -> dict[str, Any]:
    """Return the fields of the scenario that twin, command line and conditions of a log set."""
    return {**changes_of(options), **(log.conditions if log else {})}


def blocks(
    options: argparse.Namespace, log: Log | None, groups: int, stop_requested: Callable[[], bool]
) -> Iterator[Log]:
    """Return the blocks of a stream, or the log of a file: with viewers as time goes by, else at once."""
    if log is None:
        address, frame, key = options.logs, options.frame, read_key(options.key)
        return streamed(address, groups, frame, options.currents, key, stop_requested=stop_requested)
    if options.live or options.publish is not None:
        return played(log, stop_requested=stop_requested)
    return iter([log])


@contextmanager
def live_view(
    options: argparse.Namespace,
    model: Model,
    signals: Sequence[Signal],
    stop_requested: Callable[[], bool],
    *,
    watched: bool = False,
) -> Iterator[ShadowView | None]:
    """Yield the live view of a shadow, which stays until Ctrl-C; None without `--live`."""
    if not options.live:
        yield None
        return
    from spheretwin.analysis.comparison import subject_of  # Rerun is slow to import
    from spheretwin.viz.comparison.shadow import ShadowView

    view = ShadowView(subject_of(model.scenario, model.actuator), signals, watched=watched)
    try:
        print(f"watch: {view.address}", file=sys.stderr, flush=True)
        yield view
        view.flush()
        keep_viewer(stop_requested)
    finally:
        view.close()


def changes_of(options: argparse.Namespace) -> dict[str, Any]:
    """Return the fields of the scenario that the twin and the command line set."""
    twin = read_twin(options.twin) if options.twin else {}
    return {**twin, **reading.overrides(options.fields)}


def read_logs(options: argparse.Namespace) -> list[Log]:
    """Read the logs, each of which a check has accepted.

    Raises
    ------
    InputError
        A log cannot be read.
    SpheretwinError
        A log is not accepted.
    """
    from spheretwin import scenario as scenarios

    paths = options.logs if isinstance(options.logs, list) else [Path(options.logs)]
    scenario = scenarios.load(scenario_of(options), changes_of(options))
    maps = for_each_log(options.columns, len(paths), "--columns")
    payloads = for_each_log(getattr(options, "payload", []), len(paths), "--payload")
    logs = []
    for path, column_map, payload_kg in zip(paths, maps, payloads, strict=True):
        log = read(path, column_map, tuple(options.accept))
        if payload_kg is not None:
            log = replace(log, conditions={**log.conditions, "plant.payload_kg": payload_kg})
        logs.append(_accepted(log, scenario))
    return logs


def for_each_log(given: Sequence[T], count: int, flag: str) -> list[T | None]:
    """Return the entry of a repeatable flag for each log: none, one for all, or one for each.

    Raises
    ------
    InputError
        Another number of entries.
    """
    if not given:
        return [None] * count
    if len(given) not in (1, count):
        raise InputError(
            f"command line: expected {flag} once or for {count} logs, received {len(given)} of them"
        )
    return [*given] * (count if len(given) == 1 else 1)


def _accepted(log: Log, scenario: Scenario) -> Log:
    if log.notes:
        print_message(f"log {log.name}: read with {'; '.join(log.notes)}")
    verdict = check(log, scenario)
    if not verdict.accepted:
        names = [
            one.name for one in verdict.findings if one.severity == "error" and one.name not in log.accepted
        ]
        raise SpheretwinError(
            f"log {log.name}: expected one that `spheretwin log check` accepts, received {', '.join(names)}"
        )
    return log
