"""The compile cache: kept between processes, and never stale."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from spheretwin.models import cache, compiled

SOURCE = Path(compiled.__file__).parent


@pytest.fixture
def package(tmp_path):
    """A small package under the same name, with the real decorator and two modules."""
    models = tmp_path / "spheretwin" / "models"
    models.mkdir(parents=True)
    (models / "__init__.py").write_text("")
    for name in ("cache.py", "compiled.py"):
        shutil.copy(SOURCE / name, models)
    (models / "callee.py").write_text(
        "from spheretwin.models.compiled import compiled\n@compiled\ndef answer():\n    return 41\n"
    )
    (models / "caller.py").write_text(
        "from spheretwin.models.callee import answer\n"
        "from spheretwin.models.compiled import compiled\n"
        "@compiled\ndef ask():\n    return answer()\n"
        "if __name__ == '__main__':\n    import spheretwin.models.caller as c\n"
        "    print(c.ask(), sum(c.ask.stats.cache_hits.values()))\n"
    )
    return tmp_path


# The package above must come before the installed one, whose folders an import hook may map.
RUN = """
import runpy, sys
sys.meta_path[:] = [finder for finder in sys.meta_path if "editable" not in repr(finder)]
runpy.run_module("spheretwin.models.caller", run_name="__main__")
"""


def python(code, **environment):
    command = [sys.executable, "-c", code]
    return subprocess.run(command, env=environment, capture_output=True, text=True, check=True).stdout


def ask(package):
    cache = str(package / "cache")
    printed = python(RUN, **{**os.environ, "PYTHONPATH": str(package), "SPHERETWIN_CACHE_DIR": cache})
    answer, hits = printed.split()
    return int(answer), int(hits)


def test_second_process_compiles_nothing(package):
    assert ask(package) == (41, 0)
    assert ask(package) == (41, 1)


def test_edited_callee_in_another_file_is_seen(package):
    assert ask(package) == (41, 0)
    callee = package / "spheretwin" / "models" / "callee.py"
    callee.write_text(callee.read_text().replace("41", "42"))
    assert ask(package) == (42, 0)


def test_read_only_home_still_compiles():
    named = ("XDG_CACHE_HOME", "SPHERETWIN_CACHE_DIR")
    environment = {key: value for key, value in os.environ.items() if key not in named}
    code = (
        "import numpy as np; from spheretwin.models.kinematics import rotation;"
        "print(rotation(np.zeros(3))[0, 0])"
    )
    assert float(python(code, **{**environment, "HOME": "/proc"})) == 1.0


def test_kept_array_is_computed_once(tmp_path, monkeypatch):
    monkeypatch.setattr(cache, "_root", lambda: tmp_path)
    made = []

    def compute():
        made.append(1)
        return np.arange(3.0)

    for _ in range(2):
        np.testing.assert_array_equal(cache.kept_array(b"key", compute), [0, 1, 2])
    assert len(made) == 1
    cache.kept_array(b"other key", compute)
    assert len(made) == 2
    next(tmp_path.rglob("*.npy")).write_bytes(b"damaged")
    cache.kept_array(b"key", compute)
    cache.kept_array(b"other key", compute)
    assert len(made) == 3
