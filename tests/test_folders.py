"""Folders of the package: each with code has an `__init__` of one sentence, which re-exports nothing."""

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
FOLDERS = ("models", "control", "viz", "twin", "tests")

# Folders whose init holds the list of a family, or the functions that users import.
FACES = {
    "control/allocation", "control/compensators", "control/estimators", "control/laws", "twin/bench",
    "twin/cli", "twin/metrics", "twin/paper", "twin/scenario", "twin/study/engines", "twin/trajectories",
}  # fmt: skip

# Their init is public API: it imports on demand and has an example in its docstring.
PUBLIC_API = ("twin", "twin/casadi", "twin/envs", "twin/machine", "twin/mujoco_plugin", "twin/plant")

CACHES = {"__pycache__", ".hypothesis", ".DS_Store"}


def files():
    """Every file of the project except those of tools."""
    paths = sorted(path for folder in FOLDERS for path in (ROOT / folder).rglob("*") if path.is_file())
    return [path for path in paths if not CACHES & set(path.relative_to(ROOT).parts)]


def folder_of(path):
    return str(path.parent.relative_to(ROOT))


INITS = [path for path in files() if path.name == "__init__.py"]


def test_every_folder_of_the_package_with_code_has_an_init():
    folders = {folder_of(path) for path in files() if path.suffix == ".py"}
    code = {folder for folder in folders if folder.partition("/")[0] != "tests"}
    assert code == {folder_of(path) for path in INITS}


def test_tests_mirror_the_folders_of_the_package():
    folders = {folder_of(path).removeprefix("tests/") for path in files() if path.name.startswith("test_")}
    assert folders <= {folder_of(path) for path in INITS} | {
        "tests",
        "benchmarks",
        "content",
        "docs",
        "independent",
    }


@pytest.mark.parametrize("path", INITS, ids=folder_of)
def test_an_init_says_in_one_sentence_what_its_folder_is(path):
    said, *more = ast.get_docstring(ast.parse(path.read_text())).splitlines()
    assert not more or folder_of(path) in PUBLIC_API
    assert said.endswith(".")
    assert ". " not in said


@pytest.mark.parametrize("path", INITS, ids=folder_of)
def test_an_init_re_exports_nothing(path):
    _, *others = ast.parse(path.read_text()).body
    if folder_of(path) in PUBLIC_API:
        return
    if folder_of(path) not in FACES:
        assert [ast.unparse(node) for node in others] == []
    brought = {
        alias.asname or alias.name
        for node in others
        if isinstance(node, ast.Import | ast.ImportFrom)
        for alias in node.names
    }
    used = {node.id for each in others for node in ast.walk(each) if isinstance(node, ast.Name)}
    assert brought - used <= {"annotations"}
    assert not any(
        isinstance(node, ast.Name) and node.id == "__all__" for node in ast.walk(ast.parse(path.read_text()))
    )
