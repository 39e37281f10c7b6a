"""Recovery of every law and of every estimator from wrong samples, in the loop of the twin.

`tests/twin/export/test_controller_gate.py` has the same for the exported control tick.
"""

import numpy as np
import pytest

import spheretwin as st
from spheretwin.control.laws import LAWS

FAULTS = {
    "angle": {"target": "pot.beta", "mode": "stuck", "value": 1.2, "end_s": 0.601},
    "angle without an end": {"target": "encoder.gamma", "mode": "offset", "value": 6.0, "end_s": 0.601},
    "dropout": {"target": "encoder.gamma", "mode": "dropout", "end_s": 0.65},
}
PRESETS = {"afsm_eso": {"controller.preset": "robust"}}
LARGEST_rad = {"rotation_afsm": 0.45}
"""Largest error; 0.4 of the others. A blind AFSM goes on with its adapted gains, on hinges up to 0.37 rad."""
LATE = {"afsm": 0.2, "rotation_afsm": 0.2, "pd": 5e-3, "adaptive_fuzzy": 5e-3}
"""Further error after the recovery, rad; 2e-3 of the others. The switching gains of AFSM never decrease, and
the two without an integral move slowly."""


def errors(law, estimator, faults):
    """Largest error of an angle in each tick."""
    changes = {
        "hardware": "electronics",
        "watchdog.on": False,
        "duration": 1.2,
        **({"controller.law": law} | PRESETS.get(law, {})),
        "estimator.kind": estimator,
        "fault": faults,
    }
    run = st.simulate("hold", changes)
    assert run.status == "completed"
    return np.abs(run.telemetry["error_rad"]).max(axis=1)


@pytest.mark.parametrize(
    ("law", "estimator"),
    [
        *((law, "kalman") for law in LAWS),
        *(("pid", kind) for kind in ("ideal", "difference", "differentiator")),
    ],
)
def test_the_pose_is_held_again_after_wrong_samples(law, estimator):
    """A wrong sample, or no sample for 50 ms: 0.3 s later the error is that of a run without."""
    undisturbed = errors(law, estimator, [])
    for name, fault in FAULTS.items():
        disturbed = errors(law, estimator, [{**fault, "start_s": 0.6}])
        assert disturbed.max() < max(LARGEST_rad.get(law, 0.4), undisturbed.max() + 0.01), name
        assert disturbed[950:].max() < undisturbed[950:].max() + LATE.get(law, 2e-3), name
