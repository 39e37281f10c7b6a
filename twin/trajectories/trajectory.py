"""What a trajectory is: angles, rates and accelerations of the three hinges as a function of time alone."""

from abc import abstractmethod
from typing import Annotated, Any, Protocol

import numpy as np
from numpy.typing import NDArray
from pydantic import BaseModel, Field, model_validator

from spheretwin.models.base.errors import InputError, exception_text, shown
from spheretwin.trajectories.rounding import CONFIG as CONFIG
from spheretwin.trajectories.rounding import LARGEST as LARGEST
from spheretwin.trajectories.rounding import ZERO as ZERO
from spheretwin.trajectories.rounding import Approach, Corners, least_acceleration, no_corners, rounded, told
from spheretwin.trajectories.rounding import Bounded as Bounded
from spheretwin.trajectories.rounding import Time as Time
from spheretwin.trajectories.rounding import Triple as Triple

# The file of a shape finds here all that it needs of these.

Samples = NDArray[np.float64]


class Sampled(Protocol):
    """What a loop needs of a trajectory; a user's own is any object that has it."""

    def sample(self, t: NDArray[np.float64]) -> Samples:
        """Desired motion at times `t` (s), for any times from 0 on and the same for the same times.

        Returns
        -------
        (n, 3, 3) array
            Angle (rad), rate (rad/s) and acceleration (rad/s²) as rows, for each time.
        """
        ...


class Shape(BaseModel):
    """A shape that a scenario can name: its parameters, and the motion that they make.

    A subclass says its motion in `sharp`, in `corners` where that jumps, and in `notes` what its parameters
    alone do not tell.
    """

    model_config = CONFIG

    rounding_rad_s2: Annotated[float, Field(ge=1e-6, le=1e9)] | None = Field(
        None,
        description="acceleration that rounds corners (start from rest, jumps), rad/s²; sharp unless given",
    )
    approach: Approach | None = Field(
        None, description="way to the shape from another motion; it begins at 0 s unless given"
    )

    def sample(self, t: NDArray[np.float64]) -> Samples:
        """Desired motion at times `t` (s).

        Returns
        -------
        (n, 3, 3) array
            Angle (rad), rate (rad/s) and acceleration (rad/s²) as rows, for each time.
        """
        if self.approach is not None:
            return self.approach.join(self.led_to, t)
        return self._rounded(t, self._start())

    def led_to(self, t: NDArray[np.float64]) -> Samples:
        """Motion at times of its own that a way to it leads to: it meets the rates at the start by itself."""
        return self._rounded(t, np.zeros(3))

    @abstractmethod
    def sharp(self, t: NDArray[np.float64]) -> Samples:
        """Desired motion as `sample` has it, its corners as they are.

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
        """Where angle or rate jump after the start, which no shape needs to tell."""
        return no_corners()

    def notes(self) -> list[str]:
        """What a user may want to know of the motion beside its parameters; one line each."""
        return []

    def _rounded(self, t: NDArray[np.float64], start_rad_s: NDArray[np.float64]) -> Samples:
        samples = self.sharp(t)
        if self.rounding_rad_s2 is None:
            return samples
        return rounded(samples, t, start_rad_s, self.corners(), self.rounding_rad_s2)

    def _start(self) -> NDArray[np.float64]:
        """Rates (3,) with which it begins, where the rotor is at rest; an approach meets them by itself."""
        return np.zeros(3) if self.approach else self.sharp(np.zeros(1))[0, 1]

    def _check(self) -> None:
        """Refuse what the fields cannot refuse one by one."""

    @model_validator(mode="after")
    def _usable(self) -> "Shape":
        self._check()
        if self.rounding_rad_s2 is not None:
            least = least_acceleration(self._start(), self.corners())
            if self.rounding_rad_s2 < least:
                raise ValueError(
                    f"expected rounding_rad_s2 of at least {told(least)} rad/s², so that no corner runs into"
                    f" the next, received {self.rounding_rad_s2:.10g}"
                )
        return self


class UserTrajectory:
    """A trajectory of the user's, each of its samples checked.

    Parameters
    ----------
    own : Sampled
        Any object with ``sample(t)``.

    Attributes
    ----------
    name : str
        Of its class.

    Raises
    ------
    InputError
        It has no such method, or what that gives at the start is no finite motion.
    """

    def __init__(self, own: Sampled) -> None:
        if isinstance(own, type) or not callable(getattr(own, "sample", None)):
            raise InputError(f"trajectory: expected an object with sample(t), received {shown(own)}")
        self._own, self.name = own, type(own).__name__
        start = self.sample(np.zeros(1))
        if not np.isfinite(start).all():
            raise InputError(f"trajectory: expected finite numbers at 0 s, received {start[0].tolist()}")

    def sample(self, t: NDArray[np.float64]) -> Samples:
        """Desired motion at times `t` (s): a copy, as its maker may use the array again.

        Raises
        ------
        InputError
            The user's method failed, or gave something else than float64 of shape (n, 3, 3).
        """
        try:
            samples = self._own.sample(t.copy())
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


def checked(own: Sampled) -> UserTrajectory:
    """A trajectory of the user's, found usable; one that is checked already stays as it is.

    Raises
    ------
    InputError
        It has no ``sample(t)``, or what that gives at the start is no finite motion.
    """
    return own if isinstance(own, UserTrajectory) else UserTrajectory(own)


def _shape_of(samples: Any) -> object:
    try:
        return np.shape(samples)
    except ValueError:  # lists of different lengths
        return "none"
