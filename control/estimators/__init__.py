"""Estimators of the rates from sampled angles, one per file, and the list of them."""

from typing import Annotated, get_args

from pydantic import Field

from spheretwin.control.estimators.difference import Difference
from spheretwin.control.estimators.differentiator import Differentiator
from spheretwin.control.estimators.estimator import EstimatorParameters, Ideal
from spheretwin.control.estimators.kalman import Kalman

AnyEstimator = Annotated[
    Ideal  # one row per estimator
    | Difference
    | Kalman
    | Differentiator,
    Field(discriminator="kind"),
]

ESTIMATORS: dict[str, type[EstimatorParameters]] = {
    kind.model_fields["kind"].default: kind for kind in get_args(get_args(AnyEstimator)[0])
}
