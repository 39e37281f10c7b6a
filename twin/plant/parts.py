"""List of the parts of the plant, and the compiled functions that call all of them."""

from __future__ import annotations

from typing import TYPE_CHECKING

from pydantic import BaseModel, create_model

from spheretwin.electronics.stages import chained
from spheretwin.models.base.record import record_of
from spheretwin.plant.backlash import BACKLASH
from spheretwin.plant.bristle_friction import BRISTLES
from spheretwin.plant.friction import FRICTION
from spheretwin.plant.learned_torque import LEARNED_TORQUE, LearnedTorqueSection
from spheretwin.plant.magnet_heat import HEAT
from spheretwin.plant.plant_part import PlantPart

PARTS: dict[str, PlantPart] = {
    "backlash": BACKLASH,
    "friction": FRICTION,
    "bristles": BRISTLES,
    "heat": HEAT,
    "learned_torque": LEARNED_TORQUE,
}
"""By the names of their fields, in the order in which they act."""

PlantParts = record_of(
    "PlantParts", "Parts of the plant.", {name: part.record for name, part in PARTS.items()}
)

begin_parts = chained({name: part.begin for name, part in PARTS.items()})
before_step = chained({name: part.before for name, part in PARTS.items()})
load_rotor = chained({name: part.load for name, part in PARTS.items()})
after_step = chained({name: part.after for name, part in reversed(PARTS.items())})
end_parts = chained({name: part.end for name, part in PARTS.items()})

if TYPE_CHECKING:

    class PartSections(BaseModel):
        """Sections of the parts."""

        learned_torque: LearnedTorqueSection = LearnedTorqueSection()

else:
    PartSections = create_model(
        "PartSections",
        **{name: (part.section, part.section()) for name, part in PARTS.items() if part.section},
    )
    """Sections of the parts, fields of the section `plant`."""
