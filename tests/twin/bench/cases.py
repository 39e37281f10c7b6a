"""What the tests of the bench share: one driven by hand, and the bytes of what it ran."""

import numpy as np

from spheretwin import cli
from spheretwin import scenario as scenarios
from spheretwin.bench import Bench
from spheretwin.models.telemetry.signals import common_signals
from spheretwin.models.telemetry.table import read_parquet
from tests.viz.tables import table_of

GROUPS = 18

# No load: a rotor that is let go then stays within its workspace for the length of a test.
QUIET = {
    "plant.engine": "lagrangian",
    "disturbance.load": 0.0,
    "disturbance.random_bound_Nm": 0.0,
    "plant.modelling_torque_Nm": [0.0, 0.0, 0.0],
    "plant.modelling_error": 0.0,
}

# Without end stops the loop of a bench is one that other tests compile, too.
FREE = QUIET | {"plant.end_stops.on": False}

MODES = {
    "off": {},
    "hold": {},
    "point": {"pose_rad": [0.15, -0.2, 0.4]},
    "trajectory": {"fields": {"shape": "sinusoid"}},
    "jog": {"rates_rad_s": [0.05, -0.1, 0.3]},
    "manual": {"group": 5, "current_A": 0.1},
}


class Clock:
    """Clock of a test."""

    now = 0.0

    def __call__(self):
        return self.now


def bench(name="sinusoid", **changes):
    return Bench(
        scenarios.load(name, QUIET | {key.replace("__", "."): value for key, value in changes.items()})
    )


def paused(name="sinusoid", **changes):
    return bench(name, **{"plant__end_stops__on": False, **changes})


def said(bench, command, **arguments):
    """Let a bench act on a command before its next tick; returns why it was refused, if it was."""
    ticket = bench.command(command, **arguments)
    bench.advance(0)
    assert ticket.done
    return ticket.refused


def done(bench, command, **arguments):
    assert said(bench, command, **arguments) is None


def begun(name="sinusoid", **changes):
    """A bench whose time goes on."""
    made = paused(name, **changes)
    done(made, "start")
    return made


def kept_rows(path):
    return read_parquet(path)[0]


def same_when_replayed(path):
    again = path.with_name("again.parquet")
    cli.main(["simulate", "--replay", str(path), "--telemetry", str(again), "--json"])
    return again.read_bytes() == path.read_bytes()


def table(first, last, more=()):
    """Rows of the ticks of a run at rest, with the signals that all runs have, and more."""
    return table_of((*common_signals(GROUPS), *more), 1e-3 * np.arange(first, last), allocation_scale=1.0)
