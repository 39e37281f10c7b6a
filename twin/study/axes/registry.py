"""All kinds of axes: a new one is a file and a row."""

from typing import Annotated

from pydantic import Field

from spheretwin.twin.study.axes.linspace import Linspace
from spheretwin.twin.study.axes.logspace import Logspace
from spheretwin.twin.study.axes.normal import Normal
from spheretwin.twin.study.axes.uniform import Uniform
from spheretwin.twin.study.axes.values import Values

AnyAxis = Annotated[
    Values  # one row each
    | Linspace
    | Logspace
    | Uniform
    | Normal,
    Field(discriminator="kind"),
]
