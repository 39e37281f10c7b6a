"""Folder of C files: the plant as a library, the control tick, and an example of both in a loop."""

from __future__ import annotations

from pathlib import Path

from spheretwin.export.c_text import source
from spheretwin.export.controller_code import ControllerCode
from spheretwin.export.fmu import plant_files
from spheretwin.export.plant_code import PlantCode
from spheretwin.models.base.errors import InputError
from spheretwin.models.base.files import make_folder, whole_file

EXAMPLE = "st_example.c"


def write_c(folder: Path, plant: PlantCode | None, controller: ControllerCode | None) -> list[Path]:
    """Write the C files of a plant and of a control tick into a folder; return their paths.

    With both, and currents as inputs of the plant, there is an example program too.

    Raises
    ------
    InputError
        No folder can be made there, or plant and control tick have different numbers of groups.
    """
    files = plant_files(plant) if plant else {}
    if controller:
        files |= controller.files
    if plant and controller:
        if plant.groups != controller.groups:
            raise InputError(
                f"export: expected a nominal model of {plant.groups} groups, received {controller.groups}"
            )
        if plant.inputs == "currents":
            files[EXAMPLE] = source(EXAMPLE)
    make_folder(folder)
    for name, text in files.items():
        with whole_file(folder / name) as temporary:
            temporary.write_text(text, encoding="utf-8")
    return [folder / name for name in sorted(files)]
