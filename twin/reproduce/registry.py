"""The experiments, in the order of the page: a new one is a file, or a small folder, and a row."""

from spheretwin.twin.reproduce.budget import budget
from spheretwin.twin.reproduce.experiment import Experiment
from spheretwin.twin.reproduce.faults import faults
from spheretwin.twin.reproduce.figure8 import figure8
from spheretwin.twin.reproduce.figure11 import figure11
from spheretwin.twin.reproduce.readings import readings
from spheretwin.twin.reproduce.rivals import rivals
from spheretwin.twin.reproduce.sinusoid import figures
from spheretwin.twin.reproduce.stability import stability
from spheretwin.twin.reproduce.step_size import step_size

EXPERIMENTS: dict[str, Experiment] = {
    experiment.name: experiment
    for experiment in (
        figures.EXPERIMENT_6,
        figures.EXPERIMENT_7,
        figure8.EXPERIMENT,
        figure11.EXPERIMENT,
        readings.EXPERIMENT,
        stability.EXPERIMENT,
        rivals.EXPERIMENT,
        budget.EXPERIMENT,
        faults.EXPERIMENT,
        step_size.EXPERIMENT,
    )
}
