"""Evidence for the watch: ``python tests/benchmarks/watching.py [--draws N] [--designed] [--journal FILE]``.

The machines of ``reproduce twin`` are drawn, MuJoCo plays them, and a twin is identified from a log without
and one with a payload. The twin then watches ten minutes without a change, and a log of each of the changes
of ``reproduce twin``, at times drawn from the seed. False alarms, what the first alarm after a change names,
and how long after the change.
"""

import argparse
import json
import sys
from pathlib import Path

import numpy as np
from identification import add_to, journal_of

from spheretwin import scenario as scenarios
from spheretwin.machine import Log, Watch, identify
from spheretwin.machine import workflow as reproduced
from spheretwin.machine.excitation import design
from spheretwin.session import Session

LOG_s, CHUNK = 4.0, 1000
PAYLOAD_kg = max(reproduced.PAYLOADS_kg)


def motion_of(designed):
    """Fields of the designed motion; none for that of the scenario."""
    if not designed:
        return {}
    settings = reproduced.WorkflowSettings().design
    found = design(reproduced.SCENARIO, reproduced.REQUESTED, reproduced.NOMINAL, settings)
    return {"trajectory.shape": "multisine", "trajectory.components": reproduced._components(found)}


def healthy_alarms(hidden, twin, duration_s, seed):
    """Alarms of a watch over a machine that does not change."""
    known = {"plant.payload_kg": PAYLOAD_kg}
    scenario = scenarios.load(reproduced.SCENARIO, {**hidden, **known, "duration": duration_s, "seed": seed})
    watch, alarms = Watch(reproduced.SCENARIO, {**twin, **known}), []
    with Session(scenario) as session:
        for _ in range(round(duration_s / scenario.controller.period_s / CHUNK)):
            rows = session.advance(CHUNK)
            log = Log(rows["t_s"], rows["current_command_A"], rows["q_measured_rad"])
            alarms += watch.advance(log)
        if session.t_s < duration_s - 1e-6:
            raise SystemExit(f"seed {seed}: the run ended at {session.t_s} s, {session.status}")
    return [alarm._asdict() for alarm in alarms]


def watched(seed, motion, duration_s):
    """What the watch reports of one machine."""
    true = reproduced.hidden_machine(seed)
    hidden = {**reproduced.NOMINAL, **reproduced._fields(true), **motion}
    logs = [
        reproduced._play(hidden, payload_kg, LOG_s, 100 * seed + place).log
        for place, payload_kg in enumerate(reproduced.PAYLOADS_kg)
    ]
    identified = identify(logs, reproduced.SCENARIO, reproduced.REQUESTED, reproduced.NOMINAL)
    if not identified.accepted:
        raise SystemExit(f"seed {seed}: {identified.reasons}")
    twin = {**reproduced.NOMINAL, **identified.fields}
    changes = {}
    for place, change in enumerate(reproduced._changes(true, seed)):
        result = reproduced._watch(hidden, twin, change, 100 * seed + 10 + place)
        alarm = next((one for one in result.alarms if one.t_s > change.t_s), None)
        changes[change.label] = {
            "early": sum(one.t_s <= change.t_s for one in result.alarms),
            "named": bool(alarm and result._names(alarm)),
            "what": alarm and alarm.what,
            "after_s": alarm and round(alarm.t_s - change.t_s, 6),
            "size": alarm and alarm.size and alarm.size / change.size,
        }
    return {"seed": seed, "healthy": healthy_alarms(hidden, twin, duration_s, 100 * seed + 20), **changes}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--draws", type=int, default=20, help="seeds below this number")
    parser.add_argument("--minutes", type=float, default=10.0, help="time without a change, of each machine")
    parser.add_argument("--designed", action="store_true", help="the designed motion")
    parser.add_argument("--journal", type=Path, help="file with a line a machine; these are not repeated")
    options = parser.parse_args()
    machines = journal_of(options.journal)
    motion = motion_of(options.designed)
    for seed in range(options.draws):
        if seed not in machines:
            machines[seed] = watched(seed, motion, 60 * options.minutes)
            print(json.dumps(machines[seed]), file=sys.stderr, flush=True)
            add_to(options.journal, machines[seed])
    false = sum(len(machine["healthy"]) for machine in machines.values())
    hours = len(machines) * options.minutes / 60
    print(f"{false} alarms in {hours:.2f} h without a change")
    names = [name for name in machines[0] if name not in ("seed", "healthy")]
    for name in names:
        alarms = [machine[name] for machine in machines.values()]
        after_s = [alarm["after_s"] for alarm in alarms if alarm["after_s"] is not None]
        sizes = [alarm["size"] for alarm in alarms if alarm["named"]]
        named = sum(alarm["named"] for alarm in alarms)
        print(
            f"{name}: {named} of {len(alarms)} named rightly, first alarm after {np.median(after_s):.1f} s"
            f" (median), {min(after_s):.1f} to {max(after_s):.1f} s; size over the true one"
            f" {np.mean(sizes):.2f} ± {np.std(sizes):.2f}"
        )
    seen = all(machine[name]["what"] for machine in machines.values() for name in names)
    return 0 if seen and not false else 1


if __name__ == "__main__":
    sys.exit(main())
