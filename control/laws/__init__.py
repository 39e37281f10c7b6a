"""Control laws, one per file, and the list of them."""

from typing import Annotated, get_args

from pydantic import Field

from spheretwin.control.law_components.parameters import LawParameters
from spheretwin.control.law_components.rotation import RotationLaw
from spheretwin.control.laws.adaptive_fuzzy import AdaptiveFuzzy
from spheretwin.control.laws.adrc import ADRC
from spheretwin.control.laws.afsm import AFSM, RotationAFSM
from spheretwin.control.laws.afsm_eso import AFSMWithObserver
from spheretwin.control.laws.backstepping_sliding_mode import BacksteppingSlidingMode
from spheretwin.control.laws.computed_torque import ComputedTorque
from spheretwin.control.laws.geometric import GeometricPD, GeometricPID
from spheretwin.control.laws.lqi import LQI
from spheretwin.control.laws.pd import PD
from spheretwin.control.laws.pid import PID
from spheretwin.control.laws.quaternion_backstepping import QuaternionBackstepping
from spheretwin.control.laws.super_twisting import SuperTwisting

AnyLaw = Annotated[
    PD  # one row per law
    | PID
    | LQI
    | ComputedTorque
    | BacksteppingSlidingMode
    | ADRC
    | SuperTwisting
    | GeometricPD
    | GeometricPID
    | QuaternionBackstepping
    | RotationAFSM
    | AdaptiveFuzzy
    | AFSM
    | AFSMWithObserver,
    Field(discriminator="law"),
]

LAWS: dict[str, type[LawParameters]] = {
    kind.model_fields["law"].default: kind for kind in get_args(get_args(AnyLaw)[0])
}

HINGE_LAWS = {name: kind for name, kind in LAWS.items() if not issubclass(kind, RotationLaw)}
"""Laws whose error is of hinge angles; the others have a rotation error."""
