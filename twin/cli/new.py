"""``spheretwin new``: write a commented template that runs: a law, an actuator or a study."""

from __future__ import annotations

import argparse
import re
import shlex
from importlib import resources
from pathlib import Path

from spheretwin.cli.options import verb
from spheretwin.models.base.errors import InputError, shown
from spheretwin.models.base.files import check_writable, whole_file

FOLDER = resources.files("spheretwin") / "cli" / "templates"

TEMPLATES = {
    "law": ("py", "spheretwin simulate sinusoid --controller.law {file}:{class_name}"),
    "actuator": ("xml", "spheretwin simulate hold --plant.mjcf {file}"),
    "study": ("toml", "spheretwin sweep {file}"),
}
"""Suffix of the file, and a command that uses it, by the kind of template."""


@verb(
    f"""
    KIND  {", ".join(TEMPLATES)}
    NAME  name of the file without its ending, or its path
    """,
    kind=tuple(TEMPLATES),
)
def run(options: argparse.Namespace) -> bool:
    """Write a commented template that runs, NAME.py, NAME.xml or NAME.toml."""
    suffix, command = TEMPLATES[options.kind]
    path = Path(options.name).expanduser()
    name = path.name.removesuffix(f".{suffix}")
    if not re.fullmatch(r"[^\W\d]\w*", name, re.ASCII):
        raise InputError(
            f"new: expected a name of letters, digits and underscores, such as mine, received {shown(name)}"
        )
    path = path.with_name(f"{name}.{suffix}")
    if path.exists():
        raise InputError(f"new: expected the name of a new file, received {path}, which exists")
    check_writable(path)
    words = {"{name}": name, "{file}": path.name, "{class_name}": _class_name(name)}
    text = _filled((FOLDER / f"{options.kind}.template").read_text(encoding="utf-8"), words)
    with whole_file(path) as temporary:
        temporary.write_text(text, encoding="utf-8")
    print(f"{options.kind}  {path}\nrun it:  {_filled(command, {**words, '{file}': shlex.quote(f'{path}')})}")
    return True


def _class_name(name: str) -> str:
    return "".join(part[:1].upper() + part[1:] for part in name.split("_") if part)


def _filled(text: str, words: dict[str, str]) -> str:
    for placeholder, word in words.items():
        text = text.replace(placeholder, word)
    return text
