"""Cache folder: which sources its name depends on, and which accounts can change it."""

import os
import re
from pathlib import Path

import pytest

from spheretwin.models.base import cache

ROOT = Path(__file__).parents[3]
DECORATORS = "compiled|njit|allocation_free|inlined|rounding_each|overload"
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


needs_modes = pytest.mark.skipif(not hasattr(os, "geteuid"), reason="Windows has no such modes")


@pytest.fixture
def folder_of(monkeypatch):
    """Function that returns the cache below a root, as in a new process."""

    def folder_of(root, variable="SPHERETWIN_CACHE_DIR"):
        monkeypatch.delenv("SPHERETWIN_CACHE_DIR", raising=False)
        monkeypatch.setenv(variable, str(root))
        cache.checked_folder.cache_clear()
        return cache.cache_folder()

    yield folder_of
    cache.checked_folder.cache_clear()


@needs_modes
def test_folders_and_entries_are_of_their_owner_alone(folder_of, tmp_path):
    mask = os.umask(0)
    try:
        folder = folder_of(tmp_path / "a" / "b")
        cache.store_entry("entry", b"content")
    finally:
        os.umask(mask)
    assert [path.stat().st_mode & 0o777 for path in (folder, *folder.parents)[:3]] == [0o700] * 3
    assert [path.stat().st_mode & 0o777 for path in folder.iterdir()] == [0o600]
    assert cache.load_entry("entry") == b"content"


@needs_modes
@pytest.mark.parametrize("variable", ["SPHERETWIN_CACHE_DIR", "XDG_CACHE_HOME"])
@pytest.mark.parametrize(("mode", "who"), [(0o777, "everyone"), (0o1777, "everyone"), (0o770, "its group")])
def test_a_folder_that_others_can_write_is_refused_in_one_line(
    folder_of, tmp_path, capsys, mode, who, variable
):
    root = tmp_path / "spheretwin"
    folder_of(root)
    cache.store_entry("entry", b"content")
    (root / cache.sources_digest() if mode == 0o1777 else tmp_path).chmod(mode)
    assert folder_of(root if variable == "SPHERETWIN_CACHE_DIR" else tmp_path, variable) is None
    assert cache.load_entry("entry") is None
    cache.store_entry("other", b"content")
    (line,) = capsys.readouterr().err.splitlines()
    assert f"can be written by {who}" in line
    assert "nothing is cached on disk" in line


@needs_modes
def test_a_sticky_folder_above_that_of_the_owner_is_accepted(folder_of, tmp_path):
    tmp_path.chmod(0o1777)
    assert folder_of(tmp_path / "own")


@needs_modes
def test_a_link_counts_as_the_folder_behind_it(folder_of, tmp_path):
    (tmp_path / "open").mkdir()
    (tmp_path / "open").chmod(0o777)
    (tmp_path / "link").symlink_to(tmp_path / "open" / "cache")
    assert folder_of(tmp_path / "link") is None
    assert not any((tmp_path / "open").iterdir())


@needs_modes
def test_an_entry_that_others_can_write_is_computed_again(folder_of, tmp_path):
    folder = folder_of(tmp_path)
    for _ in range(2):
        cache.store_entry("entry", b"content")
        assert cache.load_entry("entry") == b"content"
        (folder / "entry").chmod(0o666)
        assert cache.load_entry("entry") is None


@needs_modes
def test_the_folder_of_another_account_is_refused(folder_of, tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(os, "geteuid", lambda: tmp_path.stat().st_uid + 1)
    owner = tmp_path.stat().st_uid
    if owner == 0:  # a folder of root is no danger to others
        os.chown(tmp_path, 12345, -1)
        owner = 12345
    assert folder_of(tmp_path) is None
    assert f"belongs to another account (number {owner})" in capsys.readouterr().err
