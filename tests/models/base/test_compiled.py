"""The compile cache: kept between processes, and never stale."""

import gc
import hashlib
import os
import pickle
import shutil
import subprocess
import sys
import weakref
from pathlib import Path
from typing import Any, NamedTuple

import numba
import numpy as np
import pytest
from numba import types

from spheretwin.models.base import addresses, cache, compiled
from tests.requirements import needs_compiled_functions

SOURCE = Path(compiled.__file__).parent


CALLER = """
import numba
from numba import types
from spheretwin.models.callee import answer
from spheretwin.models.base.compiled import compiled, compiled_callback

@compiled
def ask():
    return answer()

def callback():
    return answer()

if __name__ == "__main__":
    before = numba.config.CACHE_DIR
    import spheretwin.models.caller as caller
    called_back = compiled_callback(types.int64(), caller.callback)
    assert called_back.ctypes() == caller.ask()
    assert numba.config.CACHE_DIR == before
    print(caller.ask(), sum(caller.ask.stats.cache_hits.values()), called_back.cache_hits)
"""


LOADED = """
import sys
import numpy as np
from numba import types
from spheretwin.models.base.compiled import compiled, compiled_callback

@compiled
def through(function, x):
    return function(np.full(3, x)[1:])

def largest(values):
    return np.exp(np.sort(values)[-1])

@compiled
def hashed(text):
    return hash(text)

if __name__ == "__main__":
    import spheretwin.models.loaded as loaded
    callback = compiled_callback(types.float64(types.float64[::1]), loaded.largest)
    assert loaded.through(callback, 0.0) == 1.0
    assert loaded.hashed("secret of this process") == hash("secret of this process")
    print("scipy.linalg" in sys.modules)
"""


@pytest.fixture
def package(tmp_path):
    return write_package(tmp_path)


def write_package(root):
    """Write a small package under the same name, with the real decorator and three modules."""
    models = root / "spheretwin" / "models"
    models.mkdir(parents=True)
    base = models / "base"
    base.mkdir()
    for folder in (models, base):
        (folder / "__init__.py").write_text("")
    names = ("bounds_checks", "cache", "compiled", "compilation", "errors", "files", "function_identity")
    names += ("numba_internals", "record")
    for name in (f"{name}.py" for name in names):
        shutil.copy(SOURCE / name, base)
    (models / "callee.py").write_text(
        "from spheretwin.models.base.compiled import compiled\n@compiled\ndef answer():\n    return 41\n"
    )
    (models / "caller.py").write_text(CALLER)
    (models / "loaded.py").write_text(LOADED)
    return root


@pytest.fixture(scope="module")
def with_entries(tmp_path_factory):
    """The package with a compile cache that one process has filled; tests copy it."""
    package = write_package(tmp_path_factory.mktemp("package"))
    assert ask(package) == (41, 0)
    return package


@pytest.fixture
def filled(with_entries, tmp_path):
    """A copy of the package after its first process."""
    return Path(shutil.copytree(with_entries, tmp_path / "package"))


# The package above must come before the installed one, whose folders an import hook may map.
RUN = """
import runpy, sys
sys.meta_path[:] = [finder for finder in sys.meta_path if "editable" not in repr(finder)]
runpy.run_module("spheretwin.models.caller", run_name="__main__")
"""


def python(code, **environment):
    command = [sys.executable, "-c", code]
    return subprocess.run(command, env=environment, capture_output=True, text=True, check=True).stdout


def environment_of(package):
    cache = str(package / "cache")
    return {**os.environ, "PYTHONPATH": str(package), "SPHERETWIN_CACHE_DIR": cache}


def ask(package):
    answer, hits, callback_hits = map(int, python(RUN, **environment_of(package)).split())
    assert hits == callback_hits  # the function and its callback come from entries of their own
    return answer, hits


def entries(package):
    return sorted(path for path in (package / "cache").rglob("*") if path.is_file())


def test_second_process_compiles_nothing(filled):
    assert ask(filled) == (41, 1)


def test_edited_callee_in_another_file_is_seen(filled):
    callee = filled / "spheretwin" / "models" / "callee.py"
    callee.write_text(callee.read_text().replace("41", "42"))
    assert ask(filled) == (42, 0)


@pytest.mark.release("processes of 3 s; test_second_process_compiles_nothing has the cache in one")
def test_machine_code_is_loaded_without_all_that_can_be_compiled(package):
    """Memory, mathematics, hashes and callbacks work without the modules that compile them."""
    run = RUN.replace("caller", "loaded")
    assert python(run, **environment_of(package)).strip() == "True"  # compiled, which needs them
    assert python(run, **environment_of(package)).strip() == "False"


def double(x):
    return 2 * x


def of_content(content):
    pickled = pickle.dumps(content)
    return lambda _: hashlib.sha256(pickled).digest() + pickled


DAMAGES = {
    "truncated": lambda content: content[: len(content) // 2],
    "overwritten": lambda content: content[:200] + b"garbage in the midst of machine code" + content[236:],
    "empty": lambda _: b"",
    "nonsense": lambda _: b"nonsense",
    "no pair": of_content(5),
    "another signature": of_content(("another signature", ())),
    "no parts": of_content(((types.float64,), (1, 2, 3))),
}


@pytest.mark.parametrize("damage", DAMAGES.values(), ids=DAMAGES)
def test_entry_that_cannot_be_used_is_made_again(tmp_path, monkeypatch, damage):
    monkeypatch.setattr(cache, "cache_folder", lambda: tmp_path)

    def hits():
        """Compile or load the function, as another process would."""
        function = compiled.compiled(double)
        assert function(1.5) == 3.0
        return sum(function.stats.cache_hits.values())

    assert [hits(), hits()] == [0, 1]
    (path,) = (path for path in tmp_path.rglob("*") if path.is_file())
    path.write_bytes(damage(path.read_bytes()))
    assert [hits(), hits()] == [0, 1]


def test_no_folder_at_all_is_done_without(package):
    nowhere = {"SPHERETWIN_CACHE_DIR": "/proc", "XDG_CACHE_HOME": "/proc", "HOME": "/proc"}
    environment = {**os.environ, **nowhere, "PYTHONPATH": str(package)}
    assert python(RUN, **environment).split() == ["41", "0", "0"]


class Pair(NamedTuple):
    number: float
    record: Any


SIGNATURE = types.float64(types.float64)


def test_callback_is_compiled_once_for_a_function_and_a_signature():
    callback = compiled.compiled_callback(SIGNATURE, double)
    assert callback.ctypes(2.0) == 4.0
    assert compiled.compiled_callback(SIGNATURE, double) is callback
    assert compiled.compiled_callback(SIGNATURE, numba.njit(double)) is callback
    other = compiled.compiled_callback(types.int64(types.int64), double)
    assert other is not callback
    assert other.ctypes(3) == 6


def test_callback_lives_no_longer_than_its_function():
    def triple(x):
        return 3 * x

    compiled.compiled_callback(SIGNATURE, triple)
    alive = weakref.ref(triple)
    del triple
    gc.collect()
    assert alive() is None


@needs_compiled_functions
def test_machine_code_changes_a_record_that_has_no_fields():
    @compiled.allocation_free
    def fill(pair):
        pair[1].mass = 2.0 * pair[0]

    rows = np.zeros(2, np.dtype((np.record, np.dtype([("id", np.int64), ("mass", np.float64)]))))
    pair = Pair(3.0, rows[1])
    given = compiled.without_fields(pair)
    compiled.for_types_of(fill, pair)(given)
    assert given.record.dtype.names == ("bytes",)
    assert rows["mass"].tolist() == [0.0, 6.0]


def test_uncompiled_is_the_plain_function():
    assert compiled.uncompiled(numba.njit(double)) is double
    assert compiled.uncompiled(double) is double


def test_cached_array_is_computed_once(tmp_path, monkeypatch):
    monkeypatch.setattr(cache, "cache_folder", lambda: tmp_path)
    made = []

    def compute():
        made.append(1)
        return np.arange(3.0)

    for _ in range(2):
        np.testing.assert_array_equal(cache.cached_array(b"key", compute), [0, 1, 2])
    assert len(made) == 1
    cache.cached_array(b"other key", compute)
    assert len(made) == 2
    next(tmp_path.rglob("*.npy")).write_bytes(b"damaged")
    cache.cached_array(b"key", compute)
    cache.cached_array(b"other key", compute)
    assert len(made) == 3


@needs_compiled_functions
def test_a_caller_of_addresses_also_calls_a_compiled_function_itself():
    call = addresses.caller_of(types.float64(types.float64, types.float64))

    @compiled.allocation_free
    def difference(a, b):
        return a - b

    @compiled.allocation_free
    def through(function, a, b):
        return call(function, a, b)

    address = compiled.compiled_callback(
        types.float64(types.float64, types.float64), compiled.uncompiled(difference)
    ).address
    assert through(difference, 5, 2.5) == through(address, 5.0, 2.5) == 2.5
