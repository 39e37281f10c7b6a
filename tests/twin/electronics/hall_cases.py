"""A Hall array alone, without a loop."""

import numpy as np

from spheretwin.electronics.hall_array import HallArray, HallSection, fill_hall, measure_pose, sizes_of
from spheretwin.electronics.random_streams import noise_table
from spheretwin.models.actuator import load
from spheretwin.models.base.compiled import allocation_free

ACTUATOR = load()
PERIOD_s = 1e-3
NO_CURRENT = np.zeros(len(ACTUATOR.groups))


def array_of(scatter=None, seed=0, actuator=ACTUATOR, **fields):
    """Return the record of a new array, an array of one, and its section."""
    section = HallSection(**fields)
    rows = HallArray.zeros(groups=len(actuator.groups), **sizes_of(section, actuator))
    fill_hall(rows, section, actuator, scatter, PERIOD_s, seed)
    return rows, section


@allocation_free
def _measure_all(hall, poses, remanence, current_A, measured_A, noise, estimates):
    for tick in range(poses.shape[0]):
        measure_pose(hall, poses[tick], remanence, current_A, measured_A, noise[tick])
        for i in range(3):
            estimates[tick, i] = hall.pose.q[i]


def estimates(array, poses, *, seed=0, remanence=1.0, current_A=NO_CURRENT, measured_A=None):
    """Return the estimated poses (n, 3) at true poses (n, 3) of successive ticks."""
    rows, section = array
    noise = noise_table(seed, 0, len(poses), section.streams)
    result, measured_A = np.empty((len(poses), 3)), current_A if measured_A is None else measured_A
    _measure_all(rows[0], poses, remanence, current_A, measured_A, noise, result)
    return result


def at_rest(q, ticks):
    return np.tile(np.asarray(q, float), (ticks, 1))
