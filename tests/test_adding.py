"""A copy of the package with a new member in every family: one file and one row each, and it works.

What is added here is what CONTRIBUTING.md says. Nothing else of the copy is touched, so a family that needs
a third place to be told of a new member fails here, be it in a test that every member of the family passes.
"""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import pytest

ROOT = Path(__file__).parents[1]
FOLDERS = ("models", "control", "viz", "twin")


class Addition(NamedTuple):
    """What is written for a new member: its file, and its row (with the import) in the family's list."""

    file: str
    text: str
    registry: str
    row: tuple[str, str]
    imported: str = ""


ADDITIONS = {
    "law": Addition(
        "control/laws/lazy.py",
        '''
from typing import Literal

import numpy as np
from pydantic import Field

from spheretwin.control.law import Known, Law
from spheretwin.control.parts.parameters import LawParameters, PositiveEach, each, named


class Lazy(LawParameters):
    """Proportional, and slow."""

    law: Literal["lazy"] = named("lazy")
    slackness: PositiveEach = Field(each(2.0), description="torque a unit of error, N·m")

    def build(self, known: Known) -> Law:
        return Law(self.law, step, np.array(self.slackness), np.zeros(0))


def step(t, reference, measurement, parameters, state, torque):
    for axis in range(3):
        torque[axis] = -parameters[axis] * (measurement[0, axis] - reference[0, axis])
        torque[axis] -= 0.05 * (measurement[1, axis] - reference[1, axis])
''',
        "control/laws/registry.py",
        ("    | AFSMWithObserver,\n", "    | AFSMWithObserver\n    | Lazy,\n"),
        "from spheretwin.control.laws.lazy import Lazy\n",
    ),
    "trajectory": Addition(
        "twin/trajectories/shapes/ramp.py",
        '''
from typing import Literal

import numpy as np
from pydantic import Field

from spheretwin.twin.trajectories.trajectory import Shape, Triple


class Ramp(Shape):
    """Each axis at a rate of its own."""

    shape: Literal["ramp"] = Field("ramp", description="kind of trajectory")
    rate_rad_s: Triple = Field((0.1, 0.2, 0.3), description="rate of each axis, rad/s")

    def sharp(self, t):
        rate = np.array(self.rate_rad_s)
        rows = [np.outer(t, rate), np.tile(rate, (len(t), 1)), np.zeros((len(t), 3))]
        return np.stack(rows, axis=1)
''',
        "twin/trajectories/registry.py",
        ("    | Waypoints,\n", "    | Waypoints\n    | Ramp,\n"),
        "from spheretwin.twin.trajectories.shapes.ramp import Ramp\n",
    ),
    "disturbance": Addition(
        "twin/disturbances/kick.py",
        '''
from typing import Literal

import numpy as np
from pydantic import Field

from spheretwin.twin.disturbances.term import Term, Torque


class Kick(Term):
    """One pulse."""

    kind: Literal["kick"] = Field("kick", description="kind of disturbance")
    torque_Nm: Torque = Field(0.01, description="on the second axis from 10 to 20 ms, N·m")

    def sample(self, t, draws):
        return np.outer((t >= 0.01) & (t < 0.02), [0.0, self.torque_Nm, 0.0])
''',
        "twin/disturbances/registry.py",
        ("    | Random,\n", "    | Random\n    | Kick,\n"),
        "from spheretwin.twin.disturbances.kick import Kick\n",
    ),
    "telemetry column": Addition(
        "twin/columns/largest.py",
        """
from spheretwin.models.base.compiled import part_of_its_caller
from spheretwin.models.telemetry.signals import Signal
from spheretwin.twin.columns.column import Columns


@part_of_its_caller
def write(row, controller, sensors, plant):
    row[0] = 0.0
    for j in range(plant.current.shape[0]):
        row[0] = max(row[0], abs(plant.current[j]))


SIGNALS = (Signal("largest_current_A", "A", 1, "largest group current at the end of the tick"),)
COLUMNS = Columns(lambda groups: SIGNALS, lambda scenario: True, write)
""",
        "twin/columns/registry.py",
        ("    drive.COLUMNS,\n", "    drive.COLUMNS,\n    largest.COLUMNS,\n"),
        "from spheretwin.twin.columns import largest\n",
    ),
    "plant": Addition(
        "twin/plant/stiff.py",
        """
from typing import NamedTuple

import numpy as np

from spheretwin.models.base.compiled import allocation_free
from spheretwin.twin.plant.rotor import EngineKind


class Integrators(NamedTuple):
    step_s: float
    inertia: np.ndarray
    q: np.ndarray
    qdot: np.ndarray
    torque_S: np.ndarray
    torque_q: np.ndarray
    warnings: np.ndarray


class Uncoupled:
    def __init__(self, setting):
        self.setting = setting

    def start(self, q, qdot):
        self.q, self.qdot = np.array(q, float), np.array(qdot, float)
        inertia = self.setting.actuator.inertia
        none = np.zeros(1, np.int32)
        return Integrators(
            self.setting.step_s, inertia, self.q, self.qdot, np.zeros(3), np.zeros(3), none
        )

    def state(self):
        return np.concatenate([self.q, self.qdot])

    def restore(self, state):
        self.q[:], self.qdot[:] = state[:3], state[3:]


@allocation_free
def step(rotor):
    for i in range(3):
        rotor.qdot[i] += rotor.step_s * (rotor.torque_S[i] + rotor.torque_q[i]) / rotor.inertia[i]
        rotor.q[i] += rotor.step_s * rotor.qdot[i]


UNCOUPLED = EngineKind("uncoupled", Uncoupled, Integrators, step)
""",
        "twin/plant/registry.py",
        ("        lagrangian.LAGRANGIAN,\n", "        lagrangian.LAGRANGIAN,\n        stiff.UNCOUPLED,\n"),
        "from spheretwin.twin.plant import stiff\n",
    ),
    "metric": Addition(
        "twin/metrics/effort/mean_load.py",
        '''
import numpy as np

from spheretwin.twin.metrics.metric import Metric
from spheretwin.twin.metrics.reducing import add_rows


class MeanLoad(Metric):
    """Mean disturbance on each axis, N·m."""

    def __init__(self, planned):
        super().__init__(planned)
        self.total, self.rows = np.zeros(3), 0

    def write(self, rows):
        add_rows(np.ascontiguousarray(rows["disturbance_Nm"]), self.total)
        self.rows += len(rows)

    def value(self):
        """[3] in N·m; None without a row."""
        return (self.total / self.rows).tolist() if self.rows else None
''',
        "twin/metrics/registry.py",
        (
            '    "copper_loss_J": CopperLoss,\n',
            '    "copper_loss_J": CopperLoss,\n    "mean_load_Nm": MeanLoad,\n',
        ),
        "from spheretwin.twin.metrics.effort.mean_load import MeanLoad\n",
    ),
    "check": Addition(
        "twin/crosscheck/units.py",
        """
from typing import NamedTuple

from spheretwin.models.base.check import Check
from spheretwin.twin.crosscheck.part import Part


class Units(NamedTuple):
    checks: list[Check]


def examine(subject):
    value = float(abs(subject.actuator.inertia).max())
    return Units([Check("inertia is small", "largest inertia, kg·m²", 1, value, 1.0, "it fits a hand")])


PART = Part("units", examine)
""",
        "twin/crosscheck/suite.py",
        ("    closed_loop.PART,\n", "    closed_loop.PART,\n    units.PART,\n"),
        "from spheretwin.twin.crosscheck import units\n",
    ),
    "figure": Addition(
        "twin/crosscheck/figures/names.py",
        """
from spheretwin.viz.figures.drawing import Drawing


def draw(evidence):
    from matplotlib.figure import Figure

    figure = Figure()
    figure.text(0.1, 0.5, ", ".join(check.name for check in evidence.checks))
    return Drawing("names.png", "Names of the checks.", figure)
""",
        "twin/crosscheck/figures/registry.py",
        ("    closed_loop.draw,\n", "    closed_loop.draw,\n    names.draw,\n"),
        "from spheretwin.twin.crosscheck.figures import names\n",
    ),
    "experiment": Addition(
        "twin/reproduce/holding.py",
        """
from spheretwin.twin.reproduce.experiment import Case, Experiment, Section, Table


def cases():
    laws = ("pd", "lazy")
    return [Case(law, "hold", {"controller.law": law, "duration": 0.05}, draws=False) for law in laws]


def tell(outcomes):
    rows = [(name, str(found[0].status)) for name, found in outcomes.items()]
    return [Section("All", "They hold.", [Table("Ends", ("law", "status"), rows)])]


EXPERIMENT = Experiment("holding", "Holding on", "Laws that hold on.", cases, tell)
""",
        "twin/reproduce/registry.py",
        ("        budget.EXPERIMENT,\n", "        budget.EXPERIMENT,\n        holding.EXPERIMENT,\n"),
        "from spheretwin.twin.reproduce import holding\n",
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
        "control/estimation/rough.py",
        '''
from typing import Literal

import numpy as np

from spheretwin.control.estimation.estimator import Derived, Estimator, EstimatorParameters, Sampling, named


class Rough(EstimatorParameters):
    """The backward difference as it is."""

    kind: Literal["rough"] = named("rough")

    def build(self, sampling: Sampling) -> Estimator:
        return Estimator(self.kind, step, np.array([sampling.period_s]), np.full(3, np.nan))

    def derived(self, sampling: Sampling) -> Derived:
        T = sampling.period_s
        return Derived(np.full(3, np.sqrt(2) / T), np.full(3, T / 2))


def step(angle, parameters, state, rate):
    for axis in range(3):
        rate[axis] = (angle[axis] - state[axis]) / parameters[0] if state[axis] == state[axis] else 0.0
        state[axis] = angle[axis]
''',
        "control/estimation/registry.py",
        ("    | Differentiator,\n", "    | Differentiator\n    | Rough,\n"),
        "from spheretwin.control.estimation.rough import Rough\n",
    ),
    "fault": Addition(
        "twin/faults/targets/fuse.py",
        """
from spheretwin.twin.electronics.driving.undriven import OPEN
from spheretwin.twin.faults.target import Mode, Target


def _blow(effects, strike):
    effects.drive.acts[0] = True
    effects.drive.contact[strike.place] = OPEN


TARGET = Target("fuse", {"blown": Mode(_blow)}, each_group=True)
""",
        "twin/faults/targets/registry.py",
        ("        supply.TARGET,\n", "        supply.TARGET,\n        fuse.TARGET,\n"),
        "from spheretwin.twin.faults.targets import fuse\n",
    ),
    "axis": Addition(
        "twin/study/axes/triangular.py",
        '''
from typing import Literal

import numpy as np
from pydantic import Field

from spheretwin.twin.study.axes.axis import DrawnAxis, Number


class Triangular(DrawnAxis):
    """Most often at its lower end."""

    kind: Literal["triangular"] = Field("triangular", description="how the values are chosen")
    low: Number = Field(description="lower bound, the most frequent")
    width: Number = Field(description="from there to the upper bound")

    def drawn(self, uniform):
        return self.low + self.width * (1 - np.sqrt(1 - uniform))
''',
        "twin/study/axes/registry.py",
        ("    | Normal,\n", "    | Normal\n    | Triangular,\n"),
        "from spheretwin.twin.study.axes.triangular import Triangular\n",
    ),
    "allocation": Addition(
        "control/allocation/halved.py",
        '''
from spheretwin.control.allocation.least_norm import allocate


def halved(G, torque_S, limit, current, scratch):
    """Least-norm currents up to half of the limit."""
    share = allocate(G, torque_S, 0.5 * limit, current)
    return share
''',
        "control/allocation/registry.py",
        ('    "bounded": bounded,\n', '    "bounded": bounded,\n    "halved": halved,\n'),
        "from spheretwin.control.allocation.halved import halved\n",
    ),
}

# An editable install would be found before the copy.
ALONE = """
import sys

sys.meta_path[:] = [finder for finder in sys.meta_path if "editable" not in repr(finder)]
"""

TESTS = (
    ALONE
    + """
import pytest

sys.exit(pytest.main(sys.argv[1:]))
"""
)

SCRIPT = (
    ALONE
    + """
import json
from pathlib import Path

folder = Path(sys.argv[1])

from spheretwin.models.base.errors import InputError
from spheretwin.models.telemetry.status import Status
from spheretwin.models.telemetry.table import read_parquet
from spheretwin.twin import cli
from spheretwin.twin import scenario as scenarios
from spheretwin.twin.scenario import flags
from spheretwin.twin.crosscheck import page, suite
from spheretwin.twin.crosscheck.part import Evidence, Subject
from spheretwin.models import actuator as actuators
from spheretwin.viz.recording.recorder import Recorder
from spheretwin.twin.records.facts import facts_of
from spheretwin.twin.session import Session
from spheretwin.twin.simulation import follow

(folder / "new.toml").write_text('''
name = "new"
duration = 0.05
allocation = "halved"
[trajectory]
shape = "ramp"
[controller]
law = "lazy"
slackness = [1.0, 2.0, 3.0]
[estimator]
kind = "rough"
[plant]
engine = "uncoupled"
[[disturbance.terms]]
kind = "kick"
torque_Nm = 0.02
[[fault]]
target = "fuse.03"
mode = "blown"
start_s = 0.03
''')
parquet = folder / "new.parquet"
code = cli.main(["simulate", str(folder / "new.toml"), "--telemetry", str(parquet), "--json"])
scenario = scenarios.load(str(folder / "new.toml"))
helped = {flag: text for flag, _, text in flags.described(scenario)}
refused = {}
for name in ("controller.law", "trajectory.shape", "plant.engine", "allocation", "estimator.kind"):
    try:
        scenarios.load("hold", {name: "nothing"})
    except InputError as error:
        refused[name] = str(error)

reproduced = cli.main(["reproduce", "holding", "--out", str(folder / "page")])

class Bored:
    def write(self, rows): pass
    def note(self, t_s, text): pass
    def finish(self, status): self.status = status

with Session(scenario) as session:
    recorder = Recorder(session.actuator, session.signals, facts_of(session.begun_as), path=folder / "n.rrd")
    recorder.write(session.advance(10))
    recorder.finish(Status.BORED)
    recorder.close()

part = suite.PARTS[-1]
evidence = Evidence({part.name: part.examine(Subject(actuators.MJCF_PATH, actuators.load(), 10))})
from spheretwin.twin.crosscheck.figures.registry import FIGURES
page.FIGURES = FIGURES[-1:]
page.write(folder, evidence, {"none": "1"})
table = read_parquet(parquet)[0]
print("RESULT" + json.dumps({
    "code": code, "helped": helped, "refused": refused, "status": str(Status("bored")),
    "columns": [signal.name for signal in table.signals],
    "blown": table["current_A"][:, 3].tolist(), "marks": sorted(set(table["fault"].ravel().tolist())),
    "largest": table["largest_current_A"].tolist(), "q_ref": table["q_ref_rad"][-1].tolist(),
    "disturbance": table["disturbance_Nm"][:, 1].tolist(), "current": abs(table["current_command_A"]).max(),
    "page": (folder / page.PAGE).read_text(), "figure": (folder / "names.png").stat().st_size,
    "recording": (folder / "n.rrd").stat().st_size,
    "reproduced": reproduced, "experiments": (folder / "page" / "reproduce.md").read_text(),
}))
"""
)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Where the copy is, with its new members."""
    folder = tmp_path_factory.mktemp("grown")
    package = folder / "spheretwin"
    for name in FOLDERS:
        shutil.copytree(ROOT / name, package / name, ignore=shutil.ignore_patterns("__pycache__"))
    for addition in ADDITIONS.values():
        if addition.file:
            assert not (package / addition.file).exists()
            (package / addition.file).write_text('"""New."""\n' + addition.text)
        registry = package / addition.registry
        text, (old, new) = registry.read_text(), addition.row
        assert text.count(old) == 1, f"{addition.registry} has no row {old!r}"
        text = text.replace(old, new)
        first = text.find("\nfrom spheretwin")
        registry.write_text(text[: first + 1] + addition.imported + text[first + 1 :])
    return folder


def python(folder, script, *arguments):
    """What a script does where the copy is the package."""
    environment = {**os.environ, "PYTHONPATH": str(folder), "SPHERETWIN_CACHE_DIR": str(folder / "cache")}
    command = [sys.executable, "-c", script, *map(str, arguments)]
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True)


@pytest.fixture(scope="module")
def grown(folder):
    """What the copy says of its new members."""
    done = python(folder, SCRIPT, folder)
    assert done.returncode == 0, done.stderr
    figures, told = done.stdout.split("RESULT")
    return {"summary": json.loads(figures.splitlines()[0]), **json.loads(told)}


def test_a_law(grown):
    assert (grown["code"], grown["summary"]["status"]) == (0, "completed")
    assert grown["summary"]["scenario"]["controller"]["slackness"] == [1.0, 2.0, 3.0]
    assert grown["helped"]["--controller.slackness"] == "torque a unit of error, N·m"
    assert "adaptive_fuzzy, afsm, afsm_eso, lazy" in grown["refused"]["controller.law"]


def test_a_trajectory(grown):
    # 49 ms at 0.1, 0.2 and 0.3 rad/s: a product, rounded once.
    assert grown["q_ref"] == pytest.approx([0.0049, 0.0098, 0.0147], rel=1e-14)
    assert grown["helped"]["--trajectory.rate-rad-s"] == "rate of each axis, rad/s"
    assert grown["refused"]["trajectory.shape"].count("ramp") == 1


def test_a_disturbance(grown):
    assert grown["disturbance"] == [0.02 if 10 <= tick < 20 else 0.0 for tick in range(50)]
    assert "--disturbance.terms.0.torque-Nm" in grown["helped"]


def test_a_telemetry_column(grown):
    assert "largest_current_A" in grown["columns"]
    assert max(grown["largest"]) > 0


def test_a_plant(grown):
    assert grown["summary"]["scenario"]["plant"]["engine"] == "uncoupled"
    assert "'uncoupled'" in grown["refused"]["plant.engine"]


def test_an_estimator(grown):
    assert "qdot_estimated_rad_s" in grown["columns"]
    assert "kalman, differentiator, rough" in grown["refused"]["estimator.kind"]


def test_a_fault(grown):
    assert all(grown["blown"][1:30])
    assert not any(grown["blown"][30:])
    assert len(grown["marks"]) == 2


def test_an_allocation(grown):
    assert 0 < grown["current"] <= 4.0
    assert "'halved'" in grown["refused"]["allocation"]


def test_a_metric(grown):
    # Ten of fifty ticks with 0.02 N·m: sums of ten numbers, rounded at 1e-18.
    assert grown["summary"]["mean_load_Nm"] == pytest.approx([0.0, 0.004, 0.0], abs=1e-16)


def test_a_status(grown):
    assert grown["status"] == "bored"
    assert grown["recording"] > 0


def test_a_check(grown):
    assert "| inertia is small |" in grown["page"]


def test_a_figure(grown):
    assert "(names.png)" in grown["page"]
    assert grown["figure"] > 1000


def test_an_experiment(grown):
    assert grown["reproduced"] == 0
    assert "## Holding on" in grown["experiments"]
    assert "| lazy | completed |" in grown["experiments"]


# New members by the file of tests that every member of their family passes.
EVERY = {
    "control/laws/test_every_law.py": "lazy",
    "control/allocation/test_every_allocation.py": "halved",
    "twin/trajectories/shapes/test_every_shape.py": "ramp",
    "twin/disturbances/test_every_kind.py": "kick",
    "twin/columns/test_every_column.py": "largest_current_A",
    "twin/metrics/test_every_metric.py": "mean_load_Nm",
    "twin/plant/test_every_engine.py": "uncoupled",
    "twin/reproduce/test_every_experiment.py": "holding",
    "twin/faults/test_every_target.py": "fuse",
    "twin/study/test_every_axis.py": "triangular",
}


def test_the_families_tests_run_the_new_members_and_pass(folder, grown):
    tests = ROOT / "tests"
    assert set(EVERY) == {str(path.relative_to(tests)) for path in tests.rglob("test_every_*.py")}
    # The copy has no machine code as yet, and these, which are as they were, take the longest to compile.
    others = "not bounded and not lagrangian and not figure11 and not budget"
    options = ["-p", "no:cacheprovider", "-rA", "-q", "-k", others]
    done = python(folder, TESTS, *options, *(tests / name for name in EVERY))
    assert done.returncode == 0, done.stdout
    passed = [line for line in done.stdout.splitlines() if line.startswith("PASSED")]
    for file, member in EVERY.items():
        of_the_member = [line for line in passed if file in line and member in line.partition("[")[2]]
        assert len(of_the_member) >= 2, f"{file} runs nothing for {member}"


def test_contributing_names_the_file_and_the_row_of_each():
    text = (ROOT / "CONTRIBUTING.md").read_text()
    for family, addition in ADDITIONS.items():
        (row,) = [line for line in text.splitlines() if line.startswith(f"| a {family}") or
                  line.startswith(f"| an {family}")]  # fmt: skip
        assert f"`{addition.registry}`" in row
        if addition.file:
            assert f"`{Path(addition.file).parent}/" in row
