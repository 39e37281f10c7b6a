"""The random torque of the paper (56)."""

from collections.abc import Callable
from typing import Annotated, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from spheretwin.twin.disturbances.term import LARGEST_Nm, Term

Array = NDArray[np.float64]
Envelope = Literal["decaying", "growing"]
Bound = Annotated[float, Field(ge=0, le=LARGEST_Nm)]


class Random(Term):
    """A uniform random factor a tick, the same on all axes, times ``cos πt``, ``-sin πt`` and ``exp ∓πt``."""

    kind: Literal["random"] = Field("random", description="kind of disturbance")
    bound_Nm: tuple[Bound, Bound, Bound] = Field(
        (0.05, 0.05, 0.05), description="bound of the random factor on each axis, N·m"
    )
    gamma_envelope: Envelope = Field(
        "decaying", description="exp(-πt) or, as printed, exp(πt) on the third axis"
    )

    def sample(self, t: Array, draws: Callable[[], Array]) -> Array:  # noqa: D102
        return random_torque(t, draws(), np.array(self.bound_Nm), self.gamma_envelope)


def random_torque(t: Array, draws: Array, bound_Nm: Array, gamma_envelope: Envelope) -> Array:
    """Random torque (56) at control ticks.

    Parameters
    ----------
    t : (n,) array, s
        Times of the ticks.
    draws : (n,) array
        Uniform random numbers from 0 to 1.
    bound_Nm : (3,) array, N·m
        Bound of the random factor on each axis.
    gamma_envelope : "decaying" or "growing"
        Sign of the exponent on the third axis.

    Returns
    -------
    (n, 3) array, N·m
        Not finite where the growing envelope overflows.
    """
    r = -bound_Nm + 2 * bound_Nm * draws[:, None]  # (n, 3)
    growth = np.pi if gamma_envelope == "growing" else -np.pi
    with np.errstate(over="ignore", invalid="ignore"):  # infinity, and its product with a factor of 0
        third = np.exp(growth * t) if bound_Nm[2] else np.zeros_like(t)
        return r * np.stack([np.cos(np.pi * t), np.sin(-np.pi * t), third], axis=1)
