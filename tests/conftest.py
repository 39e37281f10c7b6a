"""Shared by all tests: the shipped actuator, reproducible property tests, what parameters owe."""

import copy
import functools
import gc
import os
import signal
import subprocess
import sys
from pathlib import Path
from typing import get_args

import hypothesis
import numpy as np
import pytest
from pydantic import BaseModel

from spheretwin import scenario as scenarios
from spheretwin.models import actuator as actuators
from spheretwin.models.base.compiled import COMPILES
from spheretwin.models.base.errors import InputError

# Whatever the width of the terminal, and whether or not the tests run in the background of a shell,
# which ignores interruptions there: what they start has neither from them.
os.environ.pop("COLUMNS", None)
# Rerun reads this when it is first imported: as in the command line, it writes no log of its own, whichever
# test imports it.
os.environ["RUST_LOG"] = "off"
signal.signal(signal.SIGINT, signal.default_int_handler)

# Derandomised: a failure on one machine is a failure on every machine. No deadline: machines are shared.
hypothesis.settings.register_profile("reproducible", derandomize=True, deadline=None, max_examples=200)
hypothesis.settings.load_profile("reproducible")


ROOT = Path(__file__).parents[1]

LONG_FILES = (
    "test_ray_cluster.py", "test_ray_ends.py", "test_ray_refusals.py", "test_crosscheck.py", "test_cli.py",
    "test_page.py", "test_magnetics_command.py", "test_interruption.py", "test_processes.py",
    "test_compiled.py", "test_bench_in_browser.py", "test_user_models.py", "test_comparison.py",
    "test_live.py", "test_recorder_files.py", "test_adding.py",
)  # fmt: skip
"""Files of few and long tests. They begin first, so that at the end no worker waits for another."""


# Half a million objects of imported modules live as long as the process. Without them garbage collection
# takes half as long: this saves 5 % of the processor time of the tests, and 20 % of that of the imports.
gc.disable()


def pytest_collection_finish():
    gc.freeze()
    gc.enable()


def pytest_collection_modifyitems(items):
    for item in items:
        for mark in item.iter_markers("release"):
            if not (len(mark.args) == 1 and isinstance(mark.args[0], str)):
                raise pytest.UsageError(f"{item.nodeid}: expected release with its reason as a text")
    order = {name: place for place, name in enumerate(LONG_FILES)}
    items.sort(key=lambda item: order.get(item.path.name, len(order)))


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers():
    """Return two workers more than there are cores: tests that wait for processes leave a core free."""
    return (os.cpu_count() or 1) + 2


@pytest.hookimpl(tryfirst=True)
def pytest_pyfunc_call(pyfuncitem):
    """Run a test marked `uncompiled` in a process without a compiler, one process for the tests of a file.

    Kernels of a GPU run in numba's simulator there.

    For tests of what a kind of plant holds, not of its numbers: each kind is a minute of compilation, and a
    few ticks in plain Python are a second.
    """
    if not (COMPILES and pyfuncitem.get_closest_marker("uncompiled")):
        return None
    report = _run_uncompiled(pyfuncitem.path)
    assert f"PASSED {pyfuncitem.nodeid}" in report.splitlines(), report
    return True


@functools.cache
def _run_uncompiled(file):
    """Run the tests of a file that are marked `uncompiled`; return the report."""
    options = ["-m", "uncompiled", "-rA", "--quiet", "-p", "no:cacheprovider"]
    environment = {name: value for name, value in os.environ.items() if not name.startswith("PYTEST_")}
    environment |= {"NUMBA_DISABLE_JIT": "1", "NUMBA_ENABLE_CUDASIM": "1"}
    done = subprocess.run(
        [sys.executable, "-m", "pytest", *options, file],
        cwd=ROOT, env=environment, capture_output=True, text=True,
    )  # fmt: skip
    return done.stdout + done.stderr


@pytest.fixture(scope="session")
def actuator() -> actuators.Actuator:
    return actuators.load()


def numbers_in(value, path=()):
    """Paths to the numbers of what JSON holds."""
    if isinstance(value, dict | list):
        entries = value.items() if isinstance(value, dict) else enumerate(value)
        for key, inside in entries:
            yield from numbers_in(inside, (*path, key))
    elif isinstance(value, int | float) and not isinstance(value, bool):
        yield path


def may_be_a_number(annotation):
    return annotation in (int, float) or any(map(may_be_a_number, get_args(annotation)))


def with_another(fields, path, value):
    """Fields with one of their values, however deep, replaced."""
    fields = inside = copy.deepcopy(fields)
    for key in path[:-1]:
        inside = inside[key]
    inside[path[-1]] = value
    return fields


def check_every_field_says_what_it_is(kind):
    for field in kind.model_fields.values():
        assert field.description
        for inner in get_args(field.annotation):
            if isinstance(inner, type) and issubclass(inner, BaseModel):
                check_every_field_says_what_it_is(inner)


def check_bad_fields_are_refused_by_name(member, section, overrides):
    fields = member.model_dump(mode="json")
    with pytest.raises(InputError) as refusal:
        scenarios.load("hold", overrides({**fields, "no_such_field": 1.0}))
    assert f"in {section}, received no_such_field" in str(refusal.value)
    absent = [
        (name,)
        for name, field in type(member).model_fields.items()
        if fields[name] is None and may_be_a_number(field.annotation)
    ]
    for path in [*numbers_in(fields), *absent]:
        for bad in (np.nan, np.inf, "text"):
            with pytest.raises(InputError) as refusal:
                scenarios.load("hold", overrides(with_another(fields, path, bad)))
            assert f"{section}.{'.'.join(map(str, path))}: expected" in str(refusal.value)


@pytest.fixture(scope="session")
def check_parameters():
    """Hold a member of a family to what its parameters owe: said what they are, refused where they are none.

    Called with the member, the name of its section in a scenario, and what makes the overrides of a scenario
    from the section's fields.
    """

    def check(member, section, overrides):
        check_every_field_says_what_it_is(type(member))
        assert type(member).__doc__
        scenarios.load("hold", overrides(member.model_dump(mode="json")))
        check_bad_fields_are_refused_by_name(member, section, overrides)

    return check
