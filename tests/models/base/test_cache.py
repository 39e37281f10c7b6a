"""Cache folder: which sources its name depends on."""

import re
from pathlib import Path

import pytest

from spheretwin.models.base import cache

ROOT = Path(__file__).parents[3]
DECORATORS = "compiled|njit|allocation_free|inlined|part_of_its_caller|rounding_each|overload"
COMPILES = re.compile(rf"^\s*@.*({DECORATORS})|import numba", re.M)


@pytest.mark.parametrize("folder", cache.WITHOUT_COMPILED_CODE)
def test_a_folder_without_compiled_code_has_none(folder):
    sources = list((ROOT / ("viz" if folder == "viz" else f"twin/{folder}")).rglob("*.py"))
    assert sources
    for source in sources:
        assert not COMPILES.search(source.read_text()), source


def test_the_digest_covers_every_source_with_compiled_code():
    covered = {path.resolve() for path in cache._sources()}
    for folder in ("models", "control", "twin"):
        for source in (ROOT / folder).rglob("*.py"):
            if COMPILES.search(source.read_text()):
                assert source.resolve() in covered, source
