"""New members of the families of plant, sensors, drive and faults: class, row, and where they belong."""

from tests.additions import Addition, copy_of

UNCOUPLED = {"Lagrangian": "Uncoupled", "LAGRANGIAN": "UNCOUPLED", '"lagrangian"': '"uncoupled"'}

ADDITIONS = {
    "physics engine": Addition(
        "twin/plant/stiff.py",
        copy_of("twin/plant/lagrangian_rotor.py", UNCOUPLED),
        "twin/plant/plant_tick.py",
        (
            "        lagrangian_rotor.LAGRANGIAN,\n",
            "        lagrangian_rotor.LAGRANGIAN,\n        stiff.UNCOUPLED,\n",
        ),
        "from spheretwin.plant import stiff\n",
    ),
    "plant part": Addition(
        "twin/plant/dashpot.py",
        '''
from pydantic import BaseModel, Field

from spheretwin.models.base.arrays import Array
from spheretwin.models.base.compiled import inlined
from spheretwin.models.base.record import Record, field
from spheretwin.plant.plant_part import PlantPart


class DashpotSection(BaseModel):
    """Dashpot that follows the motion with a delay."""

    damping_Nm_s: float = Field(0.0, description="torque per unit of the delayed rate, N·m·s")


class Dashpot(Record):
    on: bool = field("whether it acts")
    damping_Nm_s: float = field("torque per unit of the delayed rate", "N·m·s")
    rate_rad_s: Array = field("delayed rates", "rad/s", 3, state=True)


@inlined
def follow(part, plant, substep):
    for i in range(3):
        part.rate_rad_s[i] += 0.25 * (plant.rotor.qdot[i] - part.rate_rad_s[i])


@inlined
def load(part, plant, substep):
    for i in range(3):
        plant.rotor.torque_q[i] -= part.damping_Nm_s * part.rate_rad_s[i]


def fill(rows, setup):
    rows["damping_Nm_s"] = setup.scenario.plant.dashpot.damping_Nm_s
    rows["on"] = rows["damping_Nm_s"] > 0


DASHPOT = PlantPart(Dashpot, fill, DashpotSection, begin=follow, load=load)
''',
        "twin/plant/parts.py",
        ('    "heat": HEAT,\n', '    "heat": HEAT,\n    "dashpot": DASHPOT,\n'),
        "from spheretwin.plant.dashpot import DASHPOT\n",
    ),
    "sensor stage": Addition(
        "",
        '''from spheretwin.electronics.random_streams import errors
from spheretwin.electronics.stages import FaultLine, fill_fault_line, through


class Gear(Record):
    on: bool = field("whether a ratio has an error")
    ratio: Array = field("ratio of each gear", "", 3)
    turned_rad: Array = field("sum of the angles so far", "rad", 3, state=True)
    line: FaultLine = field("of the turned angles, rad", channels=3)


class GearSection(SensorStage):
    """Gears between the joints and their sensors, of which each has an error of its ratio."""

    record: ClassVar[type[Record]] = Gear

    ratio_error: float = Field(0.0, description="largest error of a ratio, drawn from the seed")

    @property
    def ideal(self):
        return self.ratio_error == 0

    def fill(self, rows, setup):
        shares = errors(setup.seed, setup.name, 3, 1)[..., 0]
        put(rows, on=np.logical_not(self.ideal) | setup.faults, ratio=1 + self.ratio_error * shares)
        fill_fault_line(rows["line"])

    @classmethod
    def function(cls):
        return turn


@inlined
def turn(stage, measurement, noise):
    for i in range(3):
        turned = stage.ratio[i] * measurement[0, i]
        stage.turned_rad[i] += turned
        measurement[0, i] = through(stage.line, i, turned, noise.faults)
''',
        "twin/electronics/sensor_chain.py",
        (
            "    potentiometer: PotentiometerSection = PotentiometerSection()\n",
            "    gear: GearSection = GearSection()\n"
            "    potentiometer: PotentiometerSection = PotentiometerSection()\n",
        ),
    ),
    "drive stage": Addition(
        "",
        '''from typing import ClassVar

import numpy as np

from spheretwin.electronics.stages import FaultLine, fill_fault_line, pass_line
from spheretwin.models.base.compiled import inlined
from spheretwin.models.base.record import Record, field, put


class Filter(Record):
    on: bool = field("whether it attenuates")
    gain: float = field("gain")
    line: FaultLine = field("of the setpoint, A", channels="groups")


class FilterSection(DriveStage):
    """Filter in front of the converter, which attenuates."""

    stage: ClassVar[str] = "filter"
    record: ClassVar[type[Record]] = Filter
    filter_gain: float = Field(1.0, description="gain of the filter")

    @staticmethod
    def ideal(section):
        return section.filter_gain == 1

    @staticmethod
    def fill(rows, section, setup):
        put(rows, on=np.not_equal(section.filter_gain, 1) | setup.faults, gain=section.filter_gain)
        fill_fault_line(rows["line"], 0.0)

    @staticmethod
    def advance():
        return attenuate


@inlined
def attenuate(stage, setpoint, draws):
    for j in range(setpoint.shape[0]):
        setpoint[j] *= stage.gain
    pass_line(stage, setpoint, draws)
''',
        "twin/electronics/drive_section.py",
        (
            "class DriveSection(DelaySection, DacSection, ",
            "class DriveSection(DelaySection, FilterSection, DacSection, ",
        ),
    ),
    "fault": Addition(
        "",
        """
def _blow(effects, fault):
    effects.drive.coil.contact[fault.place] = OPEN


FUSE = Target("fuse", {"blown": Mode(_blow)}, each_group=True)
""",
        "twin/faults/targets.py",
        ("        COIL,\n", "        FUSE,\n        COIL,\n"),
    ),
    "sensor stage's fault": Addition(
        "",
        """
GEAR_SIGNAL = FaultSignal(lambda effects: effects.sensors.stages["gear"].line, "rad")
GEAR = Target("gear", signal_modes(GEAR_SIGNAL), places=("alpha", "beta", "gamma"), measured=True)
""",
        "twin/faults/targets.py",
        ("        DAC,\n", "        DAC,\n        GEAR,\n"),
    ),
    "drive stage's fault": Addition(
        "",
        """
FILTER_SIGNAL = FaultSignal(lambda effects: effects.drive.stages["filter"].line, "A")
FILTER_MODES = {**signal_modes(FILTER_SIGNAL), **silent_modes(FILTER_SIGNAL)}
FILTER = Target("filter", FILTER_MODES, each_group=True)
""",
        "twin/faults/targets.py",
        ("        SUPPLY,\n", "        SUPPLY,\n        FILTER,\n"),
    ),
}
