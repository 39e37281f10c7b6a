"""Compilation in a fresh cache folder: ``python tests/benchmarks/compilation.py [--json]``.

One process runs a short simulation of each kind, one after the other; what a run takes beyond a second one is
compilation. The unit is what numba takes to compile four functions of NumPy in the same process, 7 s where
the bounds were set: 8 s for the first run, 5 s for the other engine, 1 s for all others.
"""

import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from measuring import options_of, ratio, report

LAW = """
import numba


@numba.njit
def step(t, reference, measurement, parameters, state, torque):
    for axis in range(3):
        torque[axis] = {gain} * (reference[0, axis] - measurement[0, axis])
"""

RUNS = {
    "first run, ideal hardware": {},
    "then electronics": {"hardware": "electronics"},
    "then prototype": {"hardware": "prototype"},
    "then static friction": {"plant.stiction.on": True, "plant.coulomb_Nm": [0.01] * 3},
    "then heat": {"plant.thermal.on": True, "hardware": "electronics"},
    "then another estimator": {"estimator.kind": "kalman", "hardware": "electronics"},
    "then a fault": {
        "hardware": "electronics", "detector.detect": True, "watchdog.on": True,
        "fault": [{"target": "coil.03", "mode": "short", "start_s": 0.01}],
    },
    "then another law": {"controller.law": "pid"},
    "then the other engine": {"plant.engine": "lagrangian"},
}  # fmt: skip

UNITS = {"first run, ideal hardware": 1.15, "then the other engine": 0.7}
"""Bounds; of all others `OTHER_UNITS`."""
OTHER_UNITS = 0.15
CHANGED_LAW = "then an own law, changed"


def processor_s(work) -> float:
    """Processor time of some work, s."""
    started = time.process_time()
    work()
    return time.process_time() - started


def measured() -> dict[str, float]:
    """Measure in this process; seconds by name."""
    import numba
    import numpy as np

    import spheretwin as st

    def compiled(overrides) -> float:
        def run() -> None:
            st.simulate(st.load("nutation", {"duration": 0.02, "seed": 3, **overrides}))

        first = processor_s(run)
        return first - processor_s(run)

    seconds = {name: compiled(overrides) for name, overrides in RUNS.items()}
    law = Path(os.environ["SPHERETWIN_CACHE_DIR"]) / "law.py"
    for gain in (1.0, 2.0):
        law.write_text(LAW.format(gain=gain), encoding="utf-8")
        seconds[CHANGED_LAW] = compiled({"controller.law": f"{law}:step"})
    functions = (
        lambda a: np.sort(a), lambda a: np.argsort(a, kind="mergesort"), lambda a: np.interp(a, a, a),
        lambda a: np.linalg.lstsq(a.reshape(2, 4), a[:2]),
    )  # fmt: skip
    seconds["unit"] = sum(processor_s(lambda f=f: numba.njit(f)(np.linspace(0, 1, 8))) for f in functions)
    return seconds


def ratios() -> list[dict[str, object]]:
    """Rows of the process with a cache folder of its own."""
    with tempfile.TemporaryDirectory() as folder:
        environment = {**os.environ, "SPHERETWIN_CACHE_DIR": folder}
        command = [sys.executable, str(Path(__file__)), "--measure"]
        done = subprocess.run(command, env=environment, check=True, capture_output=True, text=True)
    seconds = json.loads(done.stdout.splitlines()[-1])
    return [
        ratio(f"compilation: {name}", seconds[name], seconds["unit"], at_most=UNITS.get(name, OTHER_UNITS))
        for name in (*RUNS, CHANGED_LAW)
    ]


def main() -> int:
    if "--measure" in sys.argv:
        print(json.dumps(measured()))
        return 0
    options = options_of(__doc__)
    return 0 if report(ratios(), options.json) else 1


if __name__ == "__main__":
    sys.exit(main())
