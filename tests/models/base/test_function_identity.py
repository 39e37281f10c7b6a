"""Identity of functions to compile: equal for equal machine code, different after any change, else None."""

import os
import subprocess
import sys

import pytest
from numba import float64

from spheretwin.models.base import cache, compilation, user_code
from spheretwin.models.base.compiled import compiled_callback
from spheretwin.models.base.function_identity import function_identity
from spheretwin.models.base.user_code import load_function
from tests.requirements import needs_compiled_functions

LAW = """\
import math
import numba
import numpy as np
from spheretwin.models.lagrangian import inertia_matrix
GAIN = 2.0
TABLE = np.array([1.0, 2.0])

@numba.njit
def helper(x):
    return math.sin(x) + np.sqrt(x) + GAIN * TABLE[0]

def build(bias):
    @numba.njit
    def step(x, limit=5.0):
        if x in {"alpha", "beta", "gamma"}:
            return 0.0
        return min(limit, helper(x) + bias + inertia_matrix(np.zeros(3), np.ones(3))[0, 0])
    return step

step = build(0.25)
"""


def identity_of(source):
    names = {"__name__": "law_of_a_user"}
    exec(compile(source, "law.py", "exec"), names)
    return function_identity(getattr(names["step"], "py_func", names["step"]))


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("GAIN = 2.0", "GAIN = 3.0"),  # a number that only the helper names
        ("[1.0, 2.0]", "[1.0, 2.5]"),
        ("math.sin", "math.cos"),
        ("limit=5.0", "limit=6.0"),
        ("build(0.25)", "build(0.5)"),
        ('"gamma"', '"delta"'),
        ("import math\n", "import math\n\n"),  # an exception states the line
        ("@numba.njit\ndef helper", "@numba.njit(fastmath=True)\ndef helper"),
        ("inertia_matrix(np.zeros(3), np.ones(3))", "inertia_matrix(np.ones(3), np.ones(3))"),
    ],
)
def test_a_change_of_anything_that_a_law_names_changes_its_identity(old, new):
    assert old in LAW
    assert identity_of(LAW) == identity_of(LAW) is not None
    assert identity_of(LAW.replace(old, new)) != identity_of(LAW)


@pytest.mark.parametrize(
    "value",
    ["[1.0]", "{1: 2}", "object()", "os", "np.poly1d([1.0])", "np.zeros(2, [('a', float)])", "lambda: 1.0"],
)
def test_a_law_that_names_a_value_of_unknown_content_has_no_identity(value):
    law = f"import os\n{LAW}".replace("GAIN = 2.0", f"GAIN = {value}")
    assert identity_of(law) is None


def test_the_identity_is_the_same_in_each_process():
    """The order of a set of texts is different in each process."""
    program = "from tests.models.base.test_function_identity import *\nprint(identity_of(LAW))"
    texts = {
        subprocess.run(
            [sys.executable, "-c", program],
            env={**os.environ, "PYTHONHASHSEED": seed}, capture_output=True, text=True, check=True,
        ).stdout
        for seed in ("1", "2")
    }  # fmt: skip
    assert len(texts) == 1


@needs_compiled_functions
def test_a_function_of_a_users_file_is_compiled_once_for_each_content(tmp_path, monkeypatch):
    monkeypatch.setattr(cache, "cache_folder", lambda: tmp_path / "cache")
    program = "import numba\nSIZE = {}\n@numba.njit\ndef own(x):\n    return SIZE * x\n"

    def compilations(size):
        """Load the file as a new process does, compile it, and return the names of what was compiled."""
        user_code._module.cache_clear()
        (tmp_path / "own.py").write_text(program.format(size))
        names = []
        with compilation.listening(names.append):
            own = load_function(f"{tmp_path}/own.py:own", "law")
            assert compiled_callback(float64(float64), own).ctypes(1.0) == size
        return [name.rpartition(".")[2] for name in names]

    assert [compilations(size) for size in (0.5, 0.5, 0.25)] == [["own"], [], ["own"]]
