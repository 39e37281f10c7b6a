"""The experiments, in the order of the page: a new one is a file, or a small folder, and a row."""

from spheretwin.twin.reproduce.budget import budget
from spheretwin.twin.reproduce.experiment import Experiment
from spheretwin.twin.reproduce.faults import faults
from spheretwin.twin.reproduce.figure11 import figure11

EXPERIMENTS: dict[str, Experiment] = {
    experiment.name: experiment
    for experiment in (
        figure11.EXPERIMENT,
        budget.EXPERIMENT,
        faults.EXPERIMENT,
    )
}
