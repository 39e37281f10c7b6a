"""Rows run on the fast plant where the model allows it, and a sample is held against MuJoCo."""

import numpy as np
import pytest

from spheretwin.models.base.errors import InputError, SpheretwinError
from spheretwin.models.telemetry.status import Status
from spheretwin.paper.page import plants_text
from spheretwin.paper.runner import EVERY, compare_plants, make_plan, run_plan, scenario_of, summarise
from spheretwin.study.agreement import BOUND
from tests.twin.paper.cases import IDEAL, NOISY, experiment

OPEN = NOISY._replace(name="open", fields={"duration": 0.2})


def test_the_plant_is_the_fast_one_unless_said_or_the_model_is_more():
    assert scenario_of(OPEN, None).plant.engine == "lagrangian"
    assert scenario_of(OPEN, "mujoco").plant.engine == "mujoco"
    assert scenario_of(IDEAL, "mujoco").plant.engine == "lagrangian"  # the case says so itself
    euler = OPEN._replace(fields={**OPEN.fields, "plant.integrator": "Euler"})
    assert scenario_of(euler, None).plant.engine == "mujoco"


def test_the_sample_is_the_first_of_each_law_and_some_of_the_rest():
    laws = [OPEN._replace(name=law, fields={**OPEN.fields, "controller.law": law}) for law in ("pd", "pid")]
    plan = make_plan(experiment(*laws, IDEAL), seeds=1000)
    jobs = plan.sample
    assert {(job.case.name, job.seed) for job in jobs} >= {("pd", 0), ("pid", 0)}
    # Of 2000 runs one in a hundred by their names: 20, and no lot is that far off.
    assert 2 + 5 <= len(jobs) <= 2 + 5 * 2000 // EVERY
    assert {job.plant for job in jobs} == {"mujoco"}
    assert jobs == plan.sample
    assert plan._replace(plant="mujoco").sample == []


def test_both_plants_agree():
    plan = make_plan(experiment(OPEN), seeds=2)
    apart = compare_plants(plan, run_plan(plan))
    # 200 ticks of a smooth law: rounding, grown by no more than the loop lets it.
    assert 0 < max(apart) < 1e-9
    assert [summary.fields["plant"] for summary in summarise(plan).values()] == ["lagrangian"]
    assert plants_text(["mujoco"], []) == "Rows: 1 on MuJoCo."


def test_plants_that_do_not_agree_fail_loudly():
    plan = make_plan(experiment(OPEN), seeds=1)
    (outcome,) = run_plan(plan)["open"]
    rms = (np.array(outcome.figures["rms_error_rad"]) * (1 + 2 * BOUND)).tolist()
    for wrong in ({"figures": {"rms_error_rad": rms}}, {"status": Status.LEFT_WORKSPACE}):
        with pytest.raises(SpheretwinError, match=r"reproduce short: expected open, seed 0 to be the same"):
            compare_plants(plan, {"open": [outcome._replace(**wrong)]})


def test_a_law_without_what_a_case_varies_is_told_before_any_run():
    without = OPEN._replace(fields={"controller.law": "pd", "controller.surface_slope": 5.0})
    with pytest.raises(InputError, match=r"reproduce short, open: .*surface_slope"):
        summarise(make_plan(experiment(without), seeds=1))
