"""C code of the control tick against the compiled tick over recorded runs."""

import numpy as np
import pytest

import spheretwin as st
from spheretwin.export.controller_code import controller_code
from spheretwin.models.base.errors import InputError
from tests.requirements import needs_c_compiler
from tests.twin.export.generated import CController

RUN = {
    "plant.engine": "lagrangian",
    "duration": 1.0,
    "plant.coulomb_Nm": [2e-3] * 3,
    "disturbance.load": 1.0,
    "nominal.current_limit_A": 1.0,  # the start of the nutation needs more
}
OBSERVER = {"controller.law": "afsm_eso", "nominal.delay_s": 1.5e-3}
CASES = {
    "pd": {"controller.law": "pd"},
    "pid": {"controller.law": "pid", "allocation": "bounded", "estimator.kind": "difference"},
    "lqi": {"controller.law": "lqi", "nominal.delay_s": 1.5e-3},
    "afsm": {"controller.law": "afsm", "allocation": "bounded"},
    "afsm_eso": {**OBSERVER, "controller.fuzzy_adaptation": 10.0},
    "uncoupled": {**OBSERVER, "controller.coupled": False, "estimator.kind": "differentiator"},
    "robust": {
        **OBSERVER,
        "controller.preset": "robust",
        "estimator.kind": "kalman",
        "nominal.coulomb_Nm": [2e-3] * 3,
        "allocation": "bounded",
    },
}


def recorded_and_replayed(folder, changes, **settings):
    """Shares and commands of a recorded run, and those of the C code for its references and measurements."""
    run = st.simulate("nutation", changes).telemetry
    reference = st.load("nutation", changes).trajectory.sample(run["t_s"])
    controller = CController(folder, "nutation", changes, **settings)
    ticks = zip(*map(controller.tick, reference, run["q_rad"], run["qdot_rad_s"]), strict=True)
    shares, commands = map(np.array, ticks)
    return run["allocation_scale"], run["current_command_A"], shares, commands


@needs_c_compiler
@pytest.mark.parametrize("case", CASES)
def test_commands_are_those_of_the_recorded_run(case, tmp_path):
    share, command, shares, commands = recorded_and_replayed(tmp_path, RUN | CASES[case])
    assert (share < 1).any(), "the limit shall be active somewhere"
    # Bound of the documentation. Rounding differs where the compiled tick fuses a product and a sum; a Kalman
    # filter multiplies it by its bandwidth, and an adaptive law accumulates it: some 1e-11 A of 1 A.
    np.testing.assert_allclose(commands, command, atol=1e-9)
    np.testing.assert_allclose(shares, share, atol=1e-9)


@needs_c_compiler
@pytest.mark.parametrize("case", CASES)
def test_single_precision_is_within_its_bound(case, tmp_path):
    changes = RUN | CASES[case] | {"nominal.current_limit_A": 8.0}
    _, command, _, commands = recorded_and_replayed(tmp_path, changes, single=True)
    # An angle of 1 rad is rounded to 6e-8; times bandwidths of 1e3 1/s and gains of 1e4 1/s² that is some
    # 0.1 A at 2e-3 kg·m² and 0.02 N·m/A, for laws that take rates from an estimator or an observer.
    bound = 0.15 if "estimator.kind" in changes or "afsm" in changes["controller.law"] else 1e-3
    # AFSM switches with the sign of s, which rounding changes in a few ticks where s passes 0.
    share = 0.99 if changes["controller.law"] == "afsm" else 1.0
    assert np.quantile(np.abs(commands - command).max(axis=1), share) < bound


@needs_c_compiler
def test_a_start_erases_the_memory(tmp_path):
    controller = CController(tmp_path, "nutation", RUN | CASES["afsm"])
    generator = np.random.default_rng(0)
    motion = generator.uniform(-0.2, 0.2, (20, 5, 3))

    def commands():
        return [controller.tick(rows[:3], rows[3], rows[4])[1] for rows in motion]

    first = commands()
    controller.start()
    np.testing.assert_array_equal(first, commands())
    assert not np.array_equal(commands()[0], first[0])


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"controller.law": "adrc"}, "expected a law pd, pid, lqi, afsm, afsm_eso, received adrc"),
        ({"controller.law": "geometric_pd"}, "afsm, afsm_eso, received geometric_pd"),
        ({"controller.prediction.on": True}, "received controller.prediction.on"),
        ({"watchdog.on": True, "detector.detect": True}, "received watchdog.on, detector.detect"),
        ({"manual.currents_A": [0.0] * 18}, "received manual"),
    ],
)
def test_what_the_c_code_has_not_is_refused(changes, said):
    with pytest.raises(InputError, match=said):
        controller_code("hold", changes)
