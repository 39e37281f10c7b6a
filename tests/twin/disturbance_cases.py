"""Table of torques and samples of terms, for the tests of disturbances."""

import numpy as np

from spheretwin.trajectories.disturbances import term_draws

TORQUES = "t_s,alpha_Nm,beta_Nm,gamma_Nm\n0.5,0.1,0,0\n1.5,0.3,-0.2,0\n2.0,0,0,0.4\n"
PERIOD = 1e-3


def sampled(term, first, ticks, seed=3, place=2):
    t = PERIOD * np.arange(first, first + ticks, dtype=np.float64)
    return term.sample(t, lambda: term_draws(seed, first, ticks, place))
