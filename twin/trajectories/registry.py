"""The shapes of trajectories: a new one is a file and a row."""

from typing import Annotated, get_args

from pydantic import Field

from spheretwin.twin.trajectories.shapes.chirp import Chirp
from spheretwin.twin.trajectories.shapes.hold import Hold
from spheretwin.twin.trajectories.shapes.jog import Jog
from spheretwin.twin.trajectories.shapes.multisine import Multisine
from spheretwin.twin.trajectories.shapes.nutation import Nutation
from spheretwin.twin.trajectories.shapes.sinusoid import Sinusoid
from spheretwin.twin.trajectories.shapes.steps import Steps
from spheretwin.twin.trajectories.shapes.tilt import Tilt
from spheretwin.twin.trajectories.shapes.waypoints import Waypoints
from spheretwin.twin.trajectories.trajectory import Shape

Trajectory = Annotated[
    Sinusoid  # one row each
    | Nutation
    | Tilt
    | Hold
    | Jog
    | Chirp
    | Multisine
    | Steps
    | Waypoints,
    Field(discriminator="shape"),
]

SHAPES: dict[str, type[Shape]] = {
    kind.model_fields["shape"].default: kind for kind in get_args(get_args(Trajectory)[0])
}
