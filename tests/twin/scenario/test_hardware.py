"""Hardware sets: the nominal model of the controller has the values of the set."""

import pytest

from spheretwin.scenario.hardware import HARDWARE
from spheretwin.scenario.sections import Scenario

NOMINAL = set(Scenario.model_fields["nominal"].annotation.model_fields)


@pytest.mark.parametrize("name", [name for name, fields in HARDWARE.items() if fields])
def test_what_the_controller_knows_of_plant_and_drive_is_in_the_set(name):
    fields = HARDWARE[name]
    shared = {
        dotted: f"nominal.{dotted.partition('.')[2]}"
        for dotted in fields
        if dotted.startswith(("plant.", "drive.")) and dotted.partition(".")[2] in NOMINAL
    }
    assert set(shared) == {"drive.delay_s", "plant.coulomb_Nm", "plant.viscous_Nm_s"}
    for dotted, nominal in shared.items():
        assert fields[nominal] == fields[dotted], dotted
