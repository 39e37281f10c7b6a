"""Studies whose best gains are known: their figures are functions of the gains and the seed alone."""

from pathlib import Path

from spheretwin.study.study import Study, made

FIGURES = '''
import math

import numpy as np


def miss(run):
    """How far the stiffness is from 300, by its logarithm, and some noise of the seed."""
    return abs(math.log(run.scenario.controller.stiffness[0] / 300.0)) + noise(run, 0)


def slowness(run):
    """Less for a larger damping."""
    return 100.0 / run.scenario.controller.damping[0] + noise(run, 1)


def exact(run):
    """The first without the noise."""
    return abs(math.log(run.scenario.controller.stiffness[0] / 300.0))


def nothing(run):
    """No figure where the stiffness is above 300."""
    return None if run.scenario.controller.stiffness[0] > 300.0 else 1.0


def noise(run, which):
    return 0.3 * np.random.default_rng(run.scenario.seed).random(2)[which]
'''


STUDY = """
name = "small"
scenario = "hold"
seeds = 2
metrics = ["figures.py:miss", "figures.py:slowness"]
law = [{ law = "pd" }, { law = "pid" }]
fields = { duration = 0.005 }

[optimise]
trials = 8
fresh = 2
objective = [{ metric = "miss" }, { metric = "slowness" }]
gain = [
    { field = "controller.stiffness", low = 30.0, high = 3000.0, log = true, start = 100.0 },
    { name = "damping of pd", field = "controller.damping", law = "pd", low = 5, high = 500, start = 20 },
    { name = "damping of pid", field = "controller.damping", law = "pid", low = 5, high = 500, start = 60 },
]
"""


def gain(name="stiffness", low=30.0, high=3000.0, **fields):
    """A gain of the law, by the name of its field."""
    return {"field": f"controller.{name}", "low": low, "high": high, "log": True, **fields}


def study(folder: Path, objectives=("exact",), gains=(), seeds=1, **optimise) -> Study:
    """A study of runs of five ticks, and own figures."""
    (folder / "figures.py").write_text(FIGURES)
    listed = [{"metric": each} if isinstance(each, str) else each for each in objectives]
    return made(
        {
            "name": "known",
            "scenario": "hold",
            "fields": {"duration": 0.005, "controller.law": "pd"},
            "seeds": seeds,
            "metrics": [f"{folder}/figures.py:{name}" for name in {each["metric"]: None for each in listed}],
            "optimise": {"gain": list(gains) or [gain()], "objective": listed, **optimise},
        },
        "known",
    )


TWO = {"objectives": ("miss", "slowness"), "gains": (gain(), gain("damping", 5.0, 500.0)), "seeds": 3}
"""Two objectives, each of its own gain."""
