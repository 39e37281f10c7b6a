"""The shipped laws: one row each."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Union

from pydantic import Field

from spheretwin.control.laws.adaptive_fuzzy import AdaptiveFuzzy
from spheretwin.control.laws.afsm import AFSM
from spheretwin.control.laws.pd import PD
from spheretwin.control.parts.parameters import LawParameters

LAWS: tuple[type[LawParameters], ...] = (
    PD,
    AdaptiveFuzzy,
    AFSM,
)

NAMES: tuple[str, ...] = tuple(law.model_fields["law"].default for law in LAWS)

if TYPE_CHECKING:
    AnyLaw = LawParameters
else:
    AnyLaw = Annotated[Union[LAWS], Field(discriminator="law")]  # noqa: UP007
