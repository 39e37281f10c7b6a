"""Trajectories: angles, rates and accelerations of the three hinges as functions of time."""

from abc import abstractmethod
from typing import Annotated, Any, Protocol

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, Field, model_validator

from spheretwin.models.base.errors import InputError, exception_text, shown
from spheretwin.trajectories.rounding import CONFIG as CONFIG
from spheretwin.trajectories.rounding import LARGEST as LARGEST
from spheretwin.trajectories.rounding import ZERO as ZERO
from spheretwin.trajectories.rounding import (
    Approach,
    Corners,
    format_acceleration,
    least_acceleration,
    no_corners,
    rounded,
)
from spheretwin.trajectories.rounding import Bounded as Bounded
from spheretwin.trajectories.rounding import Time as Time
from spheretwin.trajectories.rounding import Triple as Triple

# Re-exported, so that the file of a shape needs one import.

Samples = NDArray[np.float64]


class Sampled(Protocol):
    """Interface of a trajectory to the loop; a user trajectory is any object with this method."""

    def sample(self, t: NDArray[np.float64]) -> Samples:
        """Return the desired motion at any times `t` (s) from 0 on; equal times give equal motion.

        Returns
        -------
        (n, 3, 3) array
            Angle (rad), rate (rad/s) and acceleration (rad/s²) as rows, for each time.
        """
        ...


class Shape(BaseModel):
    """Shape of a scenario: parameters and motion.

    A subclass defines the motion in `sharp`, its jumps in `corners`, and in `notes` facts that do not follow
    from the parameters.
    """

    model_config = CONFIG

    rounding_rad_s2: Annotated[float, Field(ge=1e-6, le=1e9)] | None = Field(
        None,
        description="acceleration that rounds corners (start from rest, jumps), rad/s²; sharp unless given",
    )
    approach: Approach | None = Field(
        None, description="transition to the shape from another motion; the shape begins at 0 s unless given"
    )

    def sample(self, t: NDArray[np.float64]) -> Samples:
        """Return the desired motion at times `t` (s).

        Returns
        -------
        (n, 3, 3) array
            Angle (rad), rate (rad/s) and acceleration (rad/s²) as rows, for each time.
        """
        if self.approach is not None:
            return self.approach.join(self.sample_after_approach, t)
        return self._rounded(t, self._start())

    def sample_after_approach(self, t: NDArray[np.float64]) -> Samples:
        """Return the motion after an approach, which provides the initial rates, at shape times `t`."""
        return self._rounded(t, np.zeros(3))

    @abstractmethod
    def sharp(self, t: NDArray[np.float64]) -> Samples:
        """Return the desired motion as in `sample`, without rounding of its corners.

        Parameters
        ----------
        t : (n,) array, s
            Any times from 0 on.

        Returns
        -------
        (n, 3, 3) array
            Angle (rad), rate (rad/s) and acceleration (rad/s²) as rows, for each time.
        """

    def corners(self) -> Corners:
        """Return the jumps of angle or rate after the start; default: none."""
        return no_corners()

    def notes(self) -> list[str]:
        """Return facts about the motion that do not follow from its parameters, one line each."""
        return []

    def _rounded(self, t: NDArray[np.float64], start_rad_s: NDArray[np.float64]) -> Samples:
        samples = self.sharp(t)
        if self.rounding_rad_s2 is None:
            return samples
        return rounded(samples, t, start_rad_s, self.corners(), self.rounding_rad_s2)

    def _start(self) -> NDArray[np.float64]:
        """Return the rates (3,) to be rounded at the start; 0 with an approach, which provides them."""
        return np.zeros(3) if self.approach else self.sharp(np.zeros(1))[0, 1]

    def _check(self) -> None:
        """Check relations between fields."""

    @model_validator(mode="after")
    def _usable(self) -> "Shape":
        self._check()
        if self.rounding_rad_s2 is not None:
            least = least_acceleration(self._start(), self.corners())
            if self.rounding_rad_s2 < least:
                raise ValueError(
                    f"expected rounding_rad_s2 of at least {format_acceleration(least)} rad/s², so that"
                    f" no corner overlaps the next, received {self.rounding_rad_s2:.10g}"
                )
        return self


class UserTrajectory:
    """User trajectory whose samples are checked.

    Parameters
    ----------
    trajectory : Sampled
        Any object with ``sample(t)``.

    Attributes
    ----------
    name : str
        Name of its class.

    Raises
    ------
    InputError
        The object has no such method, or its motion at the start is not finite.
    """

    def __init__(self, trajectory: Sampled) -> None:
        if isinstance(trajectory, type) or not callable(getattr(trajectory, "sample", None)):
            raise InputError(f"trajectory: expected an object with sample(t), received {shown(trajectory)}")
        self._trajectory, self.name = trajectory, type(trajectory).__name__
        start = self.sample(np.zeros(1))
        if not np.isfinite(start).all():
            raise InputError(f"trajectory: expected finite numbers at 0 s, received {start[0].tolist()}")

    def sample(self, t: NDArray[np.float64]) -> Samples:
        """Return a copy of the desired motion at times `t` (s), as the object may reuse its array.

        Raises
        ------
        InputError
            The method of the user failed, or did not return float64 of shape (n, 3, 3).
        """
        try:
            samples = self._trajectory.sample(t.copy())
        except KeyboardInterrupt:
            raise
        except BaseException as error:  # the user's code may raise anything
            raise InputError(
                f"trajectory: expected samples from {t[0]:g} to {t[-1]:g} s, received {exception_text(error)}"
            ) from error
        shape = (len(t), 3, 3)
        if (
            not isinstance(samples, np.ndarray)
            or samples.shape != shape
            or samples.dtype.newbyteorder("=") != np.float64
        ):
            received = getattr(samples, "dtype", type(samples).__name__)
            raise InputError(
                f"trajectory: expected float64 of shape {shape} (angle, rate, acceleration by axis),"
                f" received {received} of shape {_shape_of(samples)}"
            )
        return np.array(samples, dtype=np.float64, order="C")


def checked(trajectory: Sampled) -> UserTrajectory:
    """Return a checked user trajectory; a trajectory that is already checked stays the same object.

    Raises
    ------
    InputError
        It has no ``sample(t)``, or its motion at the start is not finite.
    """
    return trajectory if isinstance(trajectory, UserTrajectory) else UserTrajectory(trajectory)


def _shape_of(samples: Any) -> object:
    try:
        return np.shape(samples)
    except ValueError:  # lists of different lengths
        return "none"
