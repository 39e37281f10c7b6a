"""``spheretwin export fmu|c SCENARIO``: plant and control tick for other tools and for firmware."""

from __future__ import annotations

import argparse
from pathlib import Path

from spheretwin.cli.common import print_message, print_result
from spheretwin.cli.log_options import changes_of
from spheretwin.cli.options import verb
from spheretwin.models.base.errors import InputError
from spheretwin.models.base.files import check_writable

BOTH = ("plant", "controller")

INPUTS = ("currents", "voltages")

COMMON = """
    [SCENARIO]         name or file
    --inputs=currents  inputs of the plant: commanded currents, or voltages at the groups
        (default: currents)
    --twin
    --json             print what was written as JSON, alone on stdout"""


@verb(
    f"""{COMMON}
    --fmi=2               version of the interface (default: 2)
    --kind=co-simulation  with the fixed-step method of the twin, or for the solver of the tool (default:
        co-simulation)
    --target PLATFORM...  also for other platforms, such as x86_64-windows, by the extra cross; repeatable
    --out FILE.fmu        (default: the name of the scenario)
    """,
    has_fields=True,
    inputs=INPUTS,
    fmi=(2, 3),
    kind=("co-simulation", "model-exchange"),
)
def run_fmu(options: argparse.Namespace) -> bool:
    """Write the plant as a functional mock-up unit.

    It is C99 without Python, with its sources, and with a binary for this machine if it has a C compiler.
    """
    from spheretwin.export.fmu import write_fmu
    from spheretwin.export.plant_code import plant_code

    path = options.out or Path(f"{Path(options.scenario).stem}.fmu")
    if path.suffix != ".fmu":
        raise InputError(f"export: expected --out FILE.fmu, received {path}")
    check_writable(path)
    model = plant_code(options.scenario, changes_of(options), options.inputs)
    written = write_fmu(path, model, options.fmi, options.kind, options.target)
    if not written.binaries:
        print_message("export: no binary: no C compiler for this machine; the sources are inside")
    figures = {
        "fmu": str(path),
        "fmi": options.fmi,
        "kind": options.kind,
        "inputs": options.inputs,
        "identifier": written.identifier,
        "binaries": written.binaries,
        "parameters": [name for quantity in model.parameters for name in quantity.names],
    }
    return print_result(options, "export fmu", figures, written=[path])


@verb(
    f"""{COMMON}
    --part     only this one (default: both)
    --out DIR  (default: the name of the scenario, and _c)
    """,
    has_fields=True,
    inputs=INPUTS,
    part=BOTH,
)
def run_c(options: argparse.Namespace) -> bool:
    """Write plant and control tick as C files.

    The plant of a scenario becomes a C99 library, and one control tick of its controller (estimator, law,
    allocation) code for a microcontroller.
    """
    from spheretwin.export.c_library import write_c
    from spheretwin.export.controller_code import controller_code
    from spheretwin.export.plant_code import plant_code

    chosen, changes = [options.part] if options.part else BOTH, changes_of(options)
    plant = plant_code(options.scenario, changes, options.inputs) if "plant" in chosen else None
    controller = controller_code(options.scenario, changes) if "controller" in chosen else None
    folder = options.out or Path(f"{Path(options.scenario).stem}_c")
    paths = write_c(folder, plant, controller)
    tick = controller._asdict() if controller else {}
    tick.pop("files", None)
    figures = {"folder": str(folder), "files": [path.name for path in paths], "controller": tick or None}
    return print_result(options, "export c", figures, written=[folder])


PARTS = {"fmu": run_fmu, "c": run_c}
