"""Functional mock-up unit (FMU) of the plant: sources, model description and binaries in one file."""

from __future__ import annotations

import re
import tempfile
import zipfile
from collections.abc import Mapping, Sequence
from hashlib import sha256
from pathlib import Path
from typing import Literal, NamedTuple

from spheretwin.export.c_text import header, source
from spheretwin.export.compiler import Platform, compile_library, cross_compiler, host_compiler, this_machine
from spheretwin.export.model_description import InterfaceKind, build_description, model_description
from spheretwin.export.motion_code import plant_motion
from spheretwin.export.plant_code import SMALLEST, PlantCode, Variable
from spheretwin.models.base.errors import InputError
from spheretwin.models.base.files import whole_file

PLANT_SOURCES = ("st_plant.c",)
PLANT_HEADERS = ("st_plant.h", "st_equations.h", "st_rates.h")
_EPOCH = (1980, 1, 1, 0, 0, 0)  # of all entries: the same plant gives the same file


class Fmu(NamedTuple):
    """Written FMU."""

    path: Path
    identifier: str
    binaries: list[str]
    """Platforms with a binary, by their folders."""


def plant_files(model: PlantCode) -> dict[str, str]:
    """Return the C files of a plant by name."""
    return {
        **{name: source(name) for name in (*PLANT_SOURCES, *PLANT_HEADERS)},
        "st_plant_model.h": model.model_header(),
        "st_plant_motion.h": plant_motion(model.step.joint[0]),
        "st_plant_tables.h": model.table_header(),
        "st_plant_bounds.h": model.bounds_header(),
    }


def write_fmu(
    path: Path, model: PlantCode, fmi: Literal[2, 3], kind: InterfaceKind, targets: Sequence[str] = ()
) -> Fmu:
    """Write the FMU of a plant, completely or not at all.

    Parameters
    ----------
    path : Path
    model : PlantCode
    fmi : int
        Version of the interface.
    kind : str
        ``co-simulation``, with the fixed-step method of the twin inside, or ``model-exchange``.
    targets : sequence of str, optional
        Platforms of `compiler.TARGETS` to compile for; default: this machine, if it has a compiler.

    Raises
    ------
    InputError
        The plant has no derivatives, a platform is unknown or has no name in this version, or no file can be
        made there.
    SpheretwinError
        A compiler reported an error.
    """
    if kind == "model-exchange":
        model = _with_derivatives(model)
    compilers = _compilers(fmi, targets)
    identifier = "spheretwin_" + re.sub(r"[^A-Za-z0-9]", "_", model.name)
    files, names = plant_files(model), ("fmi.c", "st_fmu.c", *PLANT_SOURCES)
    files |= {name: source(name) for name in (*names, "st_fmu.h")}
    unsigned = model_description(model, fmi, kind, identifier, "", names)
    token = sha256("".join([unsigned, *files.values()]).encode()).hexdigest()[:32]
    files["st_fmu_token.h"] = header([f"#define ST_FMI {fmi}", f'#define ST_TOKEN "{token}"'])
    contents: dict[str, str | bytes] = {
        "modelDescription.xml": model_description(model, fmi, kind, identifier, token, names),
        **{f"sources/{name}": text for name, text in files.items()},
    }
    if fmi == 3:
        contents["sources/buildDescription.xml"] = build_description(identifier, names)
    binaries = {}
    for folder, target, command in compilers:
        binaries[f"binaries/{folder}/{identifier}{target.suffix}"] = _binary(command, files, names)
    with whole_file(path) as temporary, zipfile.ZipFile(temporary, "w") as archive:
        for name, content in sorted({**contents, **binaries}.items()):
            archive.writestr(zipfile.ZipInfo(name, _EPOCH), content, zipfile.ZIP_DEFLATED)
    return Fmu(path, identifier, [folder for folder, _, _ in compilers])


def _with_derivatives(model: PlantCode) -> PlantCode:
    """Return a plant whose time constants stay above 0."""

    def above_zero(one: Variable) -> Variable:
        if one.name not in ("lag_s", "thermal_resistance_K_W"):
            return one
        if min(one.values) <= 0:
            field = {"lag_s": "drive.time_constant_s"}.get(one.name, f"drive.{one.name}")
            raise InputError(f"export: expected {field} above 0 for model-exchange, received 0")
        one = one._replace(least=SMALLEST)
        one.check()
        return one

    return model._replace(parameters=[above_zero(one) for one in model.parameters])


def _compilers(fmi: int, targets: Sequence[str]) -> list[tuple[str, Platform, list[str]]]:
    """Return folder, platform and compiler of each binary."""
    chosen = [cross_compiler(name) for name in dict.fromkeys(targets)]
    here, command = this_machine(), host_compiler()
    if not targets and here and command:
        chosen = [(here, command)]
    rows = [(target.name if fmi == 3 else target.fmi2, target, command) for target, command in chosen]
    for folder, target, _ in rows:
        if folder is None and targets:
            raise InputError(f"export: expected FMI 3 for {target.name}, which FMI 2 has no name for")
    return [(folder, target, command) for folder, target, command in rows if folder]


def _binary(command: Sequence[str], files: Mapping[str, str], names: Sequence[str]) -> bytes:
    with tempfile.TemporaryDirectory() as folder:
        for name, text in files.items():
            (Path(folder) / name).write_text(text, encoding="utf-8")
        library = Path(folder) / "library"
        compile_library(command, [Path(folder) / name for name in names], library)
        return library.read_bytes()
