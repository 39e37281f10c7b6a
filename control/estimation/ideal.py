"""No estimator: the true rates, which no sensor of the prototype gives."""

from typing import Literal

import numpy as np

from spheretwin.control.estimation.estimator import (
    Derived,
    Estimator,
    EstimatorParameters,
    Sampling,
    named,
)


class Ideal(EstimatorParameters):
    """The true rates."""

    kind: Literal["ideal"] = named("ideal")

    def build(self, sampling: Sampling) -> Estimator | None:
        """No estimator: the rates that are handed over stay as they are."""
        return None

    def derived(self, sampling: Sampling) -> Derived:
        """No noise of the angles, no lag."""
        return Derived(np.zeros(3), np.zeros(3))
