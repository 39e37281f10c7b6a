"""Scripts that run new members of the families in a copy of the package."""

# An editable install would be found before the copy.
ALONE = """
import sys

sys.meta_path[:] = [finder for finder in sys.meta_path if "editable" not in repr(finder)]
"""

TESTS = f"""{ALONE}
import pytest

sys.exit(pytest.main(sys.argv[1:]))
"""

# What parts of the prototype draw and measure, none of which is new.
DRAWN = """
import numpy as np

def drawn_numbers():
    from spheretwin import scenario as scenarios
    from spheretwin.electronics.drive_chain import DriveChain, fill_drive
    from spheretwin.electronics.random_streams import noise_table
    from spheretwin.electronics.sensor_chain import SensorChain, fill_sensors, noise_streams, sense
    from spheretwin.faults.schedule import FaultSchedule
    from spheretwin.loop.hardware_assembly import fault_streams
    from spheretwin.session import Session

    faults = [
        {"target": "adc", "mode": "noise", "value": 1e-3},
        {"target": "dac.04", "mode": "noise", "value": 0.1},
        {"target": "supply", "mode": "intermittent", "value": 2e-3},
    ]
    scenario = scenarios.load("hold", {"hardware": "electronics", "seed": 3, "fault": faults})
    with Session(scenario) as session:
        scenario = session.scenario
    plan = FaultSchedule(scenario.fault, 18, 1e-3, 3)
    sensors = SensorChain.filled(fill_sensors, scenario.sensors, 3, delays=8)[0]
    drive = DriveChain.filled(fill_drive, scenario.drive, 5e-4, 2, 3, groups=18, delays=8)[0]
    noise, measurement = noise_table(3, 0, 5, noise_streams(scenario.sensors)), np.empty((3, 3))
    sense(sensors, np.array([0.1, -0.2, 0.3]), np.zeros(3), noise[0], np.zeros(0), measurement)
    return {
        "tracks": sensors.stages["potentiometer"].channels.tobytes().hex(),
        "converters": sensors.stages["adc"].channels.tobytes().hex(),
        "dac": drive.stages["dac"].dac.offset_V.tolist(), "amplifiers": drive.amplifier.offset_A.tolist(),
        "noise": noise.tolist(), "measured": measurement[0].tolist(),
        "fault noise": noise_table(3, 0, 5, fault_streams(scenario, 18)).tolist(),
        "supply": [2 in plan.active(tick) for tick in range(0, 100, 2)],
    }
"""

SCRIPT = (
    ALONE
    + DRAWN
    + """
import json
from pathlib import Path

folder = Path(sys.argv[1])

from spheretwin.models.base.errors import InputError
from spheretwin.models.telemetry.status import Status
from spheretwin.models.telemetry.table import read_parquet
from spheretwin import cli
from spheretwin import scenario as scenarios
from spheretwin.scenario import reading as flags
from spheretwin.crosscheck import suite
from spheretwin.crosscheck.suite import CrosscheckResult, Subject
from spheretwin.models import actuator as actuators
from spheretwin.viz.recording.recorder import Recorder
from spheretwin.records.provenance import facts_of
from spheretwin.session import Session
from spheretwin.simulation import follow

(folder / "new.toml").write_text('''
name = "new"
duration = 0.05
allocation = "halved"
[trajectory]
shape = "ramp"
[controller]
law = "lazy"
level = "torque"
slackness = [1.0, 2.0, 3.0]
damping = [0.05, 0.05, 0.05]
[estimator]
kind = "rough"
[plant]
engine = "uncoupled"
[plant.dashpot]
damping_Nm_s = 1e-3
[[disturbance.terms]]
kind = "kick"
torque_Nm = 0.02
[sensors.gear]
ratio_error = 0.1
[drive]
filter_gain = 0.5
time_constant_s = 0.0
[[fault]]
target = "fuse.03"
mode = "blown"
start_s = 0.03
[[fault]]
target = "gear.beta"
mode = "offset"
value = 0.02
start_s = 0.04
[[fault]]
target = "filter.05"
mode = "stuck"
value = 0.25
start_s = 0.04
''')
parquet = folder / "new.parquet"
code = cli.main(["simulate", str(folder / "new.toml"), "--telemetry", str(parquet), "--json"])
scenario = scenarios.load(str(folder / "new.toml"))
helped = {flag: text for flag, _, text in flags.field_descriptions(scenario)}
refused = {}
for name in ("controller.law", "trajectory.shape", "plant.engine", "allocation", "estimator.kind"):
    try:
        scenarios.load("hold", {name: "nothing"})
    except InputError as error:
        refused[name] = str(error)

class Bored:
    def write(self, rows): pass
    def note(self, t_s, text): pass
    def finish(self, status): self.status = status

with Session(scenario) as session:
    facts = facts_of(session.initial_scenario)
    recorder = Recorder(session.actuator, session.signals, facts, path=folder / "n.rrd")
    recorder.write(session.advance(10))
    recorder.finish(Status.BORED)
    recorder.close()

from spheretwin.models.base.record import states_of

with Session(scenario) as session:
    begun = session.advance(6)
    snapshot, states = session.snapshot(), []
    for again in range(2):
        went_on = session.advance(6)
        states.append(states_of(session._runtime.rows).tolist())
        own = session._runtime.rows[0], session._runtime._controller.memory.tolist()
        if not again:
            session.restore(snapshot)
    moved = {
        name: [*begun[name].tolist(), *went_on[name].tolist()]
        for name in ("qdot_rad_s", "q_measured_rad", "q_rad", "q_ref_rad")
    }

part = suite.PARTS[-1]
evidence = CrosscheckResult({part.name: part.examine(Subject(actuators.MJCF_PATH, actuators.load(), 10))})
suite.FIGURES = suite.FIGURES[-1:]
suite.write(folder, evidence)
table = read_parquet(parquet)[0]
from spheretwin.electronics.random_streams import errors

print("RESULT" + json.dumps({
    "code": code, "helped": helped, "refused": refused, "status": str(Status("bored")),
    "columns": [signal.name for signal in table.signals],
    "blown": table["current_A"][:, 3].tolist(), "marks": sorted(set(table["fault"].ravel().tolist())),
    "ratio": errors(0, "sensors.gear", 3, 1)[:, 0].tolist(), "q": table["q_rad"].tolist(),
    "measured": table["q_measured_rad"].tolist(), "asked": table["current_command_A"].tolist(),
    "carried": table["current_A"].tolist(), "random": drawn_numbers(),
    "states": states, "delayed": own[0].plant.parts.dashpot.rate_rad_s.tolist(), "moved": moved,
    "turned": own[0].sensors.stages.gear.turned_rad.tolist(), "errors": own[1],
    "largest": table["largest_current_A"].tolist(), "q_ref": table["q_ref_rad"][-1].tolist(),
    "disturbance": table["disturbance_Nm"][:, 1].tolist(), "current": abs(table["current_command_A"]).max(),
    "page": (folder / "crosscheck.md").read_text(), "figure": (folder / "names.svg").stat().st_size,
    "recording": (folder / "n.rrd").stat().st_size,
}))
"""
)

REPRODUCE = f"""{ALONE}
from spheretwin import cli

sys.exit(cli.main(["reproduce", "holding", "--out", sys.argv[1]]))
"""
