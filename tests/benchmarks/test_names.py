"""Names that the benchmarks import exist: benchmarks run by hand, some with packages of their own."""

import ast
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

import pytest

FOLDER = Path(__file__).parent
FILES = sorted(path for path in FOLDER.rglob("*.py") if not path.name.startswith("test_"))


def imports_of(path):
    """Pairs of module and name of all imports by name in a file."""
    nodes = [
        node for node in ast.walk(ast.parse(path.read_text("utf-8"))) if isinstance(node, ast.ImportFrom)
    ]
    return [(node.module, alias.name) for node in nodes for alias in node.names]


def exists(module, name):
    """True if a module of the package has an attribute or a submodule of some name."""
    try:
        return hasattr(import_module(module), name) or find_spec(f"{module}.{name}") is not None
    except ModuleNotFoundError as error:
        if error.name.startswith(("spheretwin", "tests")):
            return False
        # A module of ours that needs a package of its own, as that for training: its names cannot be listed.
        pytest.skip(f"{error.name} is not installed")


def names_in(path):
    """Names at the top level of a file."""
    names = set()
    for node in ast.parse(path.read_text("utf-8")).body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            names.add(node.name)
        elif isinstance(node, ast.Assign | ast.AnnAssign):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            names |= {
                name.id for target in targets for name in ast.walk(target) if isinstance(name, ast.Name)
            }
    return names


@pytest.mark.parametrize("path", FILES, ids=[str(path.relative_to(FOLDER)) for path in FILES])
def test_imported_names_exist(path):
    missing = []
    for module, name in imports_of(path):
        if module.startswith(("spheretwin", "tests")):
            missing += [] if exists(module, name) else [f"{module}.{name}"]
        for folder in (path.parent, FOLDER):
            if (own := folder / f"{module}.py").exists():
                missing += [] if name in names_in(own) else [f"{own.name}: {name}"]
    assert not missing
