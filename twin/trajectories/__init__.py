"""Reference trajectories: interface, rounding of corners, and the list of shapes."""

from typing import Annotated, get_args

from pydantic import Field

from spheretwin.trajectories.rotations import GreatCircle
from spheretwin.trajectories.shapes import Chirp, Hold, Jog, Multisine, Nutation, Sinusoid, Steps, Tilt
from spheretwin.trajectories.trajectory import Shape
from spheretwin.trajectories.waypoints import Waypoints

Trajectory = Annotated[
    Sinusoid  # one row each
    | Nutation
    | Tilt
    | Hold
    | Jog
    | Chirp
    | Multisine
    | Steps
    | GreatCircle
    | Waypoints,
    Field(discriminator="shape"),
]

SHAPES: dict[str, type[Shape]] = {
    kind.model_fields["shape"].default: kind for kind in get_args(get_args(Trajectory)[0])
}
