"""Experiments of the paper, run again: one file each, and the page of their results."""

from spheretwin.paper import (
    error_budget,
    fault_study,
    nutation,
    readings,
    rivals,
    sinusoid,
    stability,
    step_size,
    tilt,
)
from spheretwin.paper.experiment import Experiment

EXPERIMENTS: dict[str, Experiment] = {
    experiment.name: experiment
    for experiment in (
        sinusoid.EXPERIMENT_6,
        sinusoid.EXPERIMENT_7,
        nutation.EXPERIMENT,
        tilt.EXPERIMENT,
        readings.EXPERIMENT,
        stability.EXPERIMENT,
        rivals.EXPERIMENT,
        error_budget.EXPERIMENT,
        fault_study.EXPERIMENT,
        step_size.EXPERIMENT,
    )
}
