"""``spheretwin link test ADDRESS``: what a link to a machine suffices for."""

from __future__ import annotations

import argparse
from itertools import pairwise

from spheretwin.cli.common import interruptible, print_json
from spheretwin.cli.machine import FRAME
from spheretwin.cli.options import verb
from spheretwin.machine.link.admission import read_key
from spheretwin.machine.link.channel import FrameChannel
from spheretwin.machine.link.real_time import real_time
from spheretwin.machine.link.round_trips import EDGES_ms, RateResult, RATES_Hz, measure_link

GROUPS = 18
BAR = 40
"""Letters of the longest bar."""


@verb(
    f"""
    ADDRESS          udp://HOST:PORT or serial:DEVICE@BAUD
    --rate HZ...     rate of the requests; repeatable; {", ".join(map(str, RATES_Hz))} unless given
    --seconds S=5    time at each rate; 5 unless given
    --groups N={GROUPS}  coil groups of the machine; {GROUPS} unless given{FRAME}
    --json"""
)
def run_test(options: argparse.Namespace) -> bool:
    """Measure round trip, jitter and loss of a link to a machine that waits for a controller.

    No current is sent, and the machine does not advance. A link suffices for a rate if 99.9 % of the round
    trips are below a period, at most 0.1 % of the requests are lost, and 99 % of the delays of this computer
    are below half a period. Exit code 1 if it does not suffice for the first rate.
    """
    frame, groups, key = options.frame, options.groups, read_key(options.key)
    with interruptible() as stop_requested:
        channel = FrameChannel.open(options.address, frame, groups, key=key)
        try:
            with real_time() as granted:
                results = measure_link(
                    channel, options.rate or RATES_Hz, options.seconds, stop_requested=stop_requested
                )
        finally:
            channel.transport.close()
    if options.json:
        rows = [result.row() for result in results]
        print_json({"rates": rows, "edges_ms": list(EDGES_ms), "real_time": granted._asdict()})
    else:
        for result in results:
            print("\n".join(lines_of(result)))
    return bool(results) and results[0].suffices


def lines_of(result: RateResult) -> list[str]:
    """Return a result as lines: verdict, quantiles, and the histogram of the round trip."""
    verdict = "suffices" if result.suffices else f"does not suffice: {'; '.join(result.reasons)}"
    lines = [
        f"{result.rate_Hz:g} Hz: {verdict}",
        f"  {result.sent} requests, {100 * result.loss:.2g} % lost",
    ]
    for name, times in (("round trip", result.round_trip), ("delay of requests", result.jitter)):
        quantiles = (f"{key.removesuffix('_ms')} {value:.3g} ms" for key, value in times.items() if value)
        lines.append(f"  {name}: {', '.join(quantiles) or 'none'}")
    most = max(*result.histogram, 1)
    for (low, high), count in zip(pairwise(EDGES_ms), result.histogram, strict=True):
        if count:
            bar = "█" * max(round(BAR * count / most), 1)
            lines.append(f"  {low:>5g} to {high:<4g} ms {count:>7} {bar}")
    return lines


PARTS = {"test": run_test}
