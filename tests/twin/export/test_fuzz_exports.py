"""Extreme values at every entry of exported C code and of its FMU, under sanitizers, by a fixed seed."""

import subprocess

import pytest

from tests.requirements import needs_c_compiler
from tests.twin.export.fuzz_target import EVERY_PART, SOURCES, write_target
from tests.twin.export.generated import SANITIZERS, compiled

PROTOTYPE = {
    "hardware": "prototype",
    "plant.stiction.on": False,
    "plant.cable.hysteresis_Nm": [0.0] * 3,
    "watchdog.on": False,
}
SEED = 43

pytestmark = needs_c_compiler


def broken_promises(folder, changes, draws, *flags, inputs="currents"):
    """What the sanitizers or the target report: nothing, if all promises are kept."""
    write_target(folder, changes, inputs)
    program = compiled(folder, SOURCES, "fuzz", *SANITIZERS, "-DST_DRAWS", *flags)
    done = subprocess.run([program, str(SEED), str(draws)], capture_output=True, text=True)
    return done.stderr or done.returncode


def test_extreme_values_break_no_promise(tmp_path):
    # Without optimisation: it takes longer than these draws.
    assert broken_promises(tmp_path, EVERY_PART, 1000, "-O0") == 0


@pytest.mark.release("20 s of draws; the first suite has fewer of them")
@pytest.mark.parametrize(
    ("changes", "flags", "inputs"),
    [
        (EVERY_PART, ["-DST_SINGLE"], "currents"),
        (PROTOTYPE | {"controller.law": "pid"}, [], "currents"),
        ({"controller.law": "afsm", "estimator.kind": "differentiator"}, ["-DST_SINGLE"], "currents"),
        ({"controller.law": "lqi", "estimator.kind": "difference", "allocation": "bounded"}, [], "voltages"),
    ],
    ids=["single", "prototype", "afsm", "lqi"],
)
def test_many_extreme_values_break_no_promise(changes, flags, inputs, tmp_path):
    assert broken_promises(tmp_path, changes, 20_000, *flags, inputs=inputs) == 0
