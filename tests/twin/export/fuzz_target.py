"""Sources of the fuzz target `edges_fuzz.c`, with the export that it calls."""

import shutil
import sys
from pathlib import Path

from spheretwin.export.c_library import write_c
from spheretwin.export.c_text import header, source
from spheretwin.export.controller_code import controller_code
from spheretwin.export.plant_code import plant_code

SOURCES = ("edges_fuzz.c", "st_fmu.c", "st_plant.c", "st_controller.c")
EVERY_PART = {
    "plant.coulomb_Nm": [2e-3] * 3,
    "plant.thermal.on": True,
    "drive.supply_V": 24.0,
    "controller.law": "afsm_eso",
    "controller.preset": "robust",
    "nominal.delay_s": 1.5e-3,
    "estimator.kind": "kalman",
    "allocation": "bounded",
    "controller.governor.acceleration_rad_s2": 100.0,
    "controller.feed_forward.inertia": 1.0,
}


def write_target(folder, changes, inputs="currents"):
    """Write the fuzz target for the plant and the control tick of changes."""
    write_c(folder, plant_code("nutation", changes, inputs), controller_code("nutation", changes))
    for name in ("st_fmu.h", "st_fmu.c", "fmi.c"):
        (folder / name).write_text(source(name))
    (folder / "st_fmu_token.h").write_text(header(["#define ST_FMI 3", '#define ST_TOKEN "fuzz"']))
    shutil.copy(Path(__file__).with_name("edges_fuzz.c"), folder)


if __name__ == "__main__":
    write_target(Path(sys.argv[1]), EVERY_PART)
