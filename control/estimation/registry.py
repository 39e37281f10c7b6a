"""The shipped estimators: a new one is a file and a row."""

from typing import Annotated, get_args

from pydantic import Field

from spheretwin.control.estimation.difference import Difference
from spheretwin.control.estimation.differentiator import Differentiator
from spheretwin.control.estimation.estimator import EstimatorParameters
from spheretwin.control.estimation.ideal import Ideal
from spheretwin.control.estimation.kalman import Kalman

AnyEstimator = Annotated[
    Ideal  # one row each
    | Difference
    | Kalman
    | Differentiator,
    Field(discriminator="kind"),
]

ESTIMATORS: dict[str, type[EstimatorParameters]] = {
    kind.model_fields["kind"].default: kind for kind in get_args(get_args(AnyEstimator)[0])
}
