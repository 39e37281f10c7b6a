"""The kinds of disturbances: a new one is a file and a row."""

from typing import Annotated, get_args

from pydantic import Field

from spheretwin.twin.disturbances.constant import Constant
from spheretwin.twin.disturbances.random import Random
from spheretwin.twin.disturbances.sinusoidal import Sinusoidal
from spheretwin.twin.disturbances.steps import Steps
from spheretwin.twin.disturbances.table import Table
from spheretwin.twin.disturbances.term import Term

AnyDisturbance = Annotated[
    Constant  # one row each
    | Steps
    | Sinusoidal
    | Table
    | Random,
    Field(discriminator="kind"),
]

KINDS: dict[str, type[Term]] = {
    kind.model_fields["kind"].default: kind for kind in get_args(get_args(AnyDisturbance)[0])
}
