"""What a scenario says of the sensors, stage by stage."""

from pydantic import BaseModel, Field

from spheretwin.twin.electronics.sensing.adc import AdcSection
from spheretwin.twin.electronics.sensing.current import CurrentSection
from spheretwin.twin.electronics.sensing.encoder import EncoderSection
from spheretwin.twin.electronics.sensing.potentiometer import PotentiometerSection
from spheretwin.twin.electronics.sensing.stage import SensorStage
from spheretwin.twin.trajectories.trajectory import CONFIG, Triple


class SensorsSection(BaseModel):
    """How the controller sees the rotor; each stage is ideal unless told otherwise.

    Its fields that are a `SensorStage` are the list of the stages, in the order in which angles pass them.
    """

    model_config = CONFIG

    angle_offset_rad: Triple = Field(
        (0.0, 0.0, 0.0), description="constant error of each angle, with which its sensor is mounted, rad"
    )
    potentiometer: PotentiometerSection = PotentiometerSection()
    adc: AdcSection = AdcSection()
    encoder: EncoderSection = EncoderSection()
    current: CurrentSection = CurrentSection()

    @property
    def ideal(self) -> bool:
        """True if the controller is handed the true angles."""
        stages = (getattr(self, name) for name in STAGES)
        return not any(self.angle_offset_rad) and all(stage.ideal for stage in stages)


STAGES: dict[str, type[SensorStage]] = {
    name: field.annotation
    for name, field in SensorsSection.model_fields.items()
    if isinstance(field.annotation, type) and issubclass(field.annotation, SensorStage)
}
"""Kinds of the stages of the angles by their names, in the order in which the angles pass them."""
