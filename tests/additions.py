"""New members of the families of control, scenarios and results: class, row, and where they belong."""

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
