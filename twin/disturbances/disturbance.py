"""Load and random torque of the paper, ``tau_d = tau_l + tau_r`` (1), (55), (56), and what adds to them."""

from functools import partial
from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, Field

from spheretwin.twin.disturbances.draws import Draws
from spheretwin.twin.disturbances.random import Bound, Envelope, random_torque
from spheretwin.twin.disturbances.registry import AnyDisturbance
from spheretwin.twin.disturbances.term import CONFIG

LOAD_UNIT_Nm = 0.05  # paper: torque of L = 1 on each axis

# A hundred times what the coils can hold.
LARGEST_LOAD = 1000.0


class Disturbance(BaseModel):
    """What acts on the hinges beside the coils."""

    model_config = CONFIG

    load: Annotated[float, Field(ge=-LARGEST_LOAD, le=LARGEST_LOAD)] = Field(
        0.0, description="L, constant load in units of 0.05 N·m on each axis"
    )
    random_bound_Nm: Bound = Field(0.0, description="bound of the uniform random factor r, N·m (paper: 0.05)")
    gamma_envelope: Envelope = Field(
        "decaying", description="exp(-πt) or, as printed, exp(πt) on the third axis"
    )
    terms: tuple[AnyDisturbance, ...] = Field(
        (), description="what adds to these: constant, steps, sinusoidal, table, random"
    )

    def sample(self, t: NDArray[np.float64], draws: Draws) -> NDArray[np.float64]:
        """Disturbance at the control ticks, each held for a control period.

        Parameters
        ----------
        t : (n,) array, s
            Times of the ticks.
        draws : Draws
            Random numbers of these ticks.

        Returns
        -------
        (n, 3) array, N·m
            Generalised torque, subtracted in (1); not finite where a growing envelope overflows.
        """
        bound = np.full(3, self.random_bound_Nm)
        torque = self.load * LOAD_UNIT_Nm + random_torque(t, draws.paper, bound, self.gamma_envelope)
        for place, term in enumerate(self.terms):
            torque += term.sample(t, partial(draws.of_term, place))
        return torque
