"""A new member of every family: its class, its row, and where they belong."""

from pathlib import Path
from typing import NamedTuple


class Addition(NamedTuple):
    """Text of a new member, and its row (with the import) in the family's list."""

    file: str
    """File of the text: a new one, or one to whose end it goes; empty where it goes in front of the list."""
    text: str
    registry: str
    """File of the list."""
    row: tuple[str, str]
    imported: str = ""


def copy_of(file: str, names: dict[str, str]) -> str:
    """Return the text of a member below its docstring, with other names."""
    text = (Path(__file__).parents[1] / file).read_text(encoding="utf-8").split('"""', 2)[2]
    for old, new in names.items():
        text = text.replace(old, new)
    return text


UNCOUPLED = {"Lagrangian": "Uncoupled", "LAGRANGIAN": "UNCOUPLED", '"lagrangian"': '"uncoupled"'}

ADDITIONS = {
    "law": Addition(
        "control/laws/lazy.py",
        copy_of(
            "control/laws/pd.py",
            {
                "PD(": "Lazy(",
                '"pd"': '"lazy"',
                "stiffness": "slackness",
                "np.zeros(0)": "np.zeros(3)",
                "        torque[axis] =": "        state[axis] += error\n        torque[axis] =",
            },
        ),
        "control/laws/__init__.py",
        ("    | AFSMWithObserver,\n", "    | AFSMWithObserver\n    | Lazy,\n"),
        "from spheretwin.control.laws.lazy import Lazy\n",
    ),
    "trajectory": Addition(
        "twin/trajectories/shapes.py",
        '''
class Ramp(Shape):
    """Each axis at a rate of its own."""

    shape: Literal["ramp"] = Field("ramp", description="kind of trajectory")
    rate_rad_s: Triple = Field((0.1, 0.2, 0.3), description="rate of each axis, rad/s")

    def sharp(self, t):
        rate = np.array(self.rate_rad_s)
        rows = [np.outer(t, rate), np.tile(rate, (len(t), 1)), np.zeros((len(t), 3))]
        return np.stack(rows, axis=1)
''',
        "twin/trajectories/__init__.py",
        ("    | Waypoints,\n", "    | Waypoints\n    | Ramp,\n"),
        "from spheretwin.trajectories.shapes import Ramp\n",
    ),
    "disturbance": Addition(
        "",
        '''
class Kick(DisturbanceTerm):
    """One pulse."""

    kind: Literal["kick"] = Field("kick", description="kind of disturbance")
    torque_Nm: Torque = Field(0.01, description="on the second axis from 10 to 20 ms, N·m")

    def sample(self, t, draws):
        return np.outer((t >= 0.01) & (t < 0.02), [0.0, self.torque_Nm, 0.0])
''',
        "twin/trajectories/disturbances.py",
        ("    | RandomDisturbance,\n", "    | RandomDisturbance\n    | Kick,\n"),
    ),
    "telemetry column": Addition(
        "",
        """
@channel(
    lambda scenario: True, single("largest_current_A", "A", "largest group current at the end of the tick")
)
def largest(row, plant):
    row[0] = 0.0
    for j in range(plant.current.shape[0]):
        row[0] = max(row[0], abs(plant.current[j]))
""",
        "twin/loop/channels.py",
        ("    drive,\n", "    drive,\n    largest,\n"),
    ),
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
import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, Field

from spheretwin.models.base.compiled import inlined
from spheretwin.models.base.record import Record, field
from spheretwin.plant.plant_part import PlantPart


class DashpotSection(BaseModel):
    """Dashpot that follows the motion with a delay."""

    damping_Nm_s: float = Field(0.0, description="torque per unit of the delayed rate, N·m·s")


class Dashpot(Record):
    on: bool = field("whether it acts")
    damping_Nm_s: float = field("torque per unit of the delayed rate", "N·m·s")
    rate_rad_s: NDArray[np.float64] = field("delayed rates", "rad/s", 3, state=True)


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
    "metric": Addition(
        "twin/metrics/effort.py",
        '''
@rounding_each
def _add_load(rows, first, columns, total, run):
    for i in range(rows.shape[0]):
        for j in range(3):
            total[run, j] += rows[i, columns[0] + j]


class MeanLoad(Metric):
    """Mean disturbance on each axis, N·m."""

    reads = ("disturbance_Nm",)
    add = staticmethod(_add_load)

    def start(self, planned):
        """Return the sums."""
        return np.zeros((planned.runs, 3))

    def results(self, rows):
        """Return [3] in N·m of each run."""
        return (self.state / rows[:, None]).tolist()
''',
        "twin/metrics/__init__.py",
        (
            '    "copper_loss_J": CopperLoss,\n',
            '    "copper_loss_J": CopperLoss,\n    "mean_load_Nm": MeanLoad,\n',
        ),
        "from spheretwin.metrics.effort import MeanLoad\n",
    ),
    "check": Addition(
        "twin/crosscheck/units.py",
        """
from typing import NamedTuple

from spheretwin.models.base.checks import Check


class Units(NamedTuple):
    checks: list[Check]


def examine(subject):
    value = float(abs(subject.actuator.inertia).max())
    return Units([Check("inertia is small", "largest inertia, kg·m²", 1, value, 1.0, "it fits a hand")])
""",
        "twin/crosscheck/suite.py",
        (
            "\n)\n\n\nclass CrosscheckResult",
            '\n    CheckPart("units", units.examine),\n)\n\n\nclass CrosscheckResult',
        ),
        "from spheretwin.crosscheck import units\n",
    ),
    "figure": Addition(
        "",
        """
def draw_names(evidence):
    from matplotlib.figure import Figure

    figure = Figure()
    figure.text(0.1, 0.5, ", ".join(check.name for check in evidence.checks))
    return Drawing("names.svg", "Names of the checks.", figure)
""",
        "twin/crosscheck/suite.py",
        ("    draw_convergence,\n", "    draw_convergence,\n    draw_names,\n"),
    ),
    "experiment": Addition(
        "twin/paper/holding.py",
        """
from spheretwin.paper.experiment import Case, Experiment, ExperimentSection
from spheretwin.viz.pages.markdown import ResultTable


def cases():
    laws = ("pd", "lazy")
    return [Case(law, "hold", {"controller.law": law, "duration": 0.05}, is_random=False) for law in laws]


def tell(outcomes):
    rows = [(name, str(found[0].status)) for name, found in outcomes.items()]
    return [ExperimentSection("All", "They hold.", [ResultTable("Ends", ("law", "status"), rows)])]


EXPERIMENT = Experiment("holding", "Holding on", "Laws that hold on.", cases, tell)
""",
        "twin/paper/__init__.py",
        (
            "        error_budget.EXPERIMENT,\n",
            "        error_budget.EXPERIMENT,\n        holding.EXPERIMENT,\n",
        ),
        "from spheretwin.paper import holding\n",
    ),
    "status": Addition(
        "",
        "",
        "models/telemetry/status.py",
        (
            '    INTERRUPTED = "interrupted",',
            '    BORED = "bored", Level.WARN, "nothing went on any more"\n    INTERRUPTED = "interrupted",',
        ),
    ),
    "estimator": Addition(
        "control/estimators/rough.py",
        copy_of("control/estimators/difference.py", {"Difference(": "Rough(", '"difference"': '"rough"'}),
        "control/estimators/__init__.py",
        ("    | Differentiator,\n", "    | Differentiator\n    | Rough,\n"),
        "from spheretwin.control.estimators.rough import Rough\n",
    ),
    "sensor stage": Addition(
        "",
        '''from spheretwin.electronics.random_streams import errors
from spheretwin.electronics.stages import FaultLine, fill_fault_line, through


class Gear(Record):
    on: bool = field("whether a ratio has an error")
    ratio: NDArray[np.float64] = field("ratio of each gear", "", 3)
    turned_rad: NDArray[np.float64] = field("sum of the angles so far", "rad", 3, state=True)
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
    "study axis": Addition(
        "",
        '''
class Triangular(DrawnAxis):
    """Most often at its lower end."""

    kind: Literal["triangular"] = Field("triangular", description="how the values are chosen")
    low: Number = Field(description="lower bound, the most frequent")
    width: Number = Field(description="from there to the upper bound")

    def quantile(self, uniform):
        return self.low + self.width * (1 - np.sqrt(1 - uniform))
''',
        "twin/study/axes.py",
        ("    | Normal,\n", "    | Normal\n    | Triangular,\n"),
    ),
    "allocation": Addition(
        "control/allocation/halved.py",
        '''
from spheretwin.control.allocation.least_norm import allocate


def halved(G, torque_S, limit, current, scratch):
    """Least-norm currents up to half of the limit if they are enough."""
    share = allocate(G, torque_S, 0.5 * limit, current)
    return share if share == 1.0 else allocate(G, torque_S, limit, current)
''',
        "control/allocation/__init__.py",
        ('    "bounded": bounded,\n', '    "bounded": bounded,\n    "halved": halved,\n'),
        "from spheretwin.control.allocation.halved import halved\n",
    ),
}

# An editable install would be found before the copy.
