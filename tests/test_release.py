"""One version and one list of dependencies in every file that states them."""

import re
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]


def test_citation_and_recipe_have_the_version():
    version = PROJECT["version"]
    assert f"\nversion: {version}\n" in (ROOT / "CITATION.cff").read_text()
    assert f'version: "{version}"' in (ROOT / "docs" / "project" / "conda" / "recipe.yaml").read_text()


def test_the_recipe_has_the_dependencies_of_the_package():
    listed = re.findall(
        r"^    - (\S+) (\S+)$",
        (ROOT / "docs" / "project" / "conda" / "recipe.yaml").read_text(),
        re.MULTILINE,
    )
    recipe = {
        name.removesuffix("-python"): bounds
        for name, bounds in listed
        if name not in ("python", "setuptools")
    }
    lines = PROJECT["dependencies"] + PROJECT["optional-dependencies"]["record"]
    needed = dict(re.match(r"([\w-]+)(\S+)", line).groups() for line in lines)
    assert recipe == needed


def test_the_demo_prints_the_command_that_opens_its_recording_once():
    """The command of the package prints it, with the place of the viewer."""
    recipe = re.search(r"^demo:.*\n((?:\t.*\n)+)", (ROOT / "Makefile").read_text(), re.MULTILINE)[1]
    assert "--record nutation.rrd" in recipe
    assert "echo" not in recipe


def test_make_has_every_target_that_documents_name():
    targets = set(re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(), re.MULTILINE))
    pages = [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md"), *(ROOT / ".github").rglob("*.yml")]
    for page in pages:
        for words in re.findall(r"(?:`|run: |^)make ((?:[a-z-]+ ?)+)", page.read_text(), re.MULTILINE):
            for name in words.split():
                assert name in targets, f"{page}: make {name}"
