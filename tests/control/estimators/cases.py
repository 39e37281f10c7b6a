"""How the tests sample: the prototype's potentiometers at 1 kHz, and estimators built for that."""

import math

import numpy as np

from spheretwin.control.estimators import ESTIMATORS
from spheretwin.control.estimators.estimator import Sampling

PERIOD = 1e-3
NOISE = math.radians(0.02)


def sampling(period=PERIOD, noise=NOISE, quantum=0.0):
    return Sampling(period, np.full(3, noise), np.full(3, quantum))


def built(kind, sampled=None, **fields):
    return ESTIMATORS[kind](**fields).build(sampled or sampling())


def on_all_axes(angle):
    """(n, 3) the same record three times."""
    return np.repeat(np.asarray(angle)[:, None], 3, axis=1)
