"""Speed of plants in lockstep, and of environments: ``python tests/benchmarks/lanes.py [--json]``.

One core, 64 plants, 50 steps a call; the vectors of the processor decide, so its widest are named.
"""

import sys

import llvmlite.binding
import numpy as np
from measuring import fastest, options_of, ratio, report, seconds_of

from spheretwin import plant
from spheretwin import scenario as scenarios
from spheretwin.config.active_config import initial_config
from spheretwin.control.supervision.watchdog import GO
from spheretwin.envs import TwinVectorEnv
from spheretwin.loop.assembly import assembled
from spheretwin.models import actuator as actuators
from spheretwin.models.base.columns import Columns
from spheretwin.models.base.compiled import allocation_free, compiled
from spheretwin.models.joint_chain import JointChain, fill_ideal
from spheretwin.plant.friction import Friction, fill_friction, slow_down
from spheretwin.plant.lagrangian_rotor import LagrangianRotor
from spheretwin.plant.lagrangian_rotor import step as step_rotor
from spheretwin.plant.plant_step import step
from spheretwin.plant.plant_tick import PlantOutput, TickInput, engine_step, plant_tick

PLANTS, STEPS, CALLS = 64, 50, 20
dt = 1e-9  # s: friction must not bring the rotor to rest, where numbers are denormal and slow
FRICTION = {"plant.coulomb_Nm": [2e-3] * 3, "plant.viscous_Nm_s": [1e-4] * 3}
STATE = plant.State(np.array([0.1, 0.2, 0.3]), np.array([0.0, 0.0, 5.0]))


def single(changes):
    """Time of a public step of one plant, called from compiled code, s."""
    parameters, steps = plant.parameters("nutation", changes), PLANTS * STEPS * CALLS
    return lambda: seconds_of(lambda: _coast(steps, STATE, np.zeros(18), np.zeros(3), parameters)) / steps


def row(changes):
    """Time of a physics step of the plant of a run, ideal hardware, one row after the other, s."""
    changes = {"plant.engine": "lagrangian", "plant.step_s": 1e-3, **changes}
    config = initial_config(scenarios.load("nutation", changes), None, None)
    made = assembled(Columns([config.scenario] * PLANTS), config.files)
    given = TickInput(np.zeros(18), np.zeros(3), np.zeros(0), GO)
    output = PlantOutput(np.empty(18), np.empty(18), np.empty(3))
    arguments = made.rows["plant"], made.stages().tables, engine_step("lagrangian").address, given, output
    return lambda: seconds_of(lambda: _advance_rows(STEPS * CALLS, *arguments)) / (PLANTS * STEPS * CALLS)


def lockstep(changes):
    """Time of the same step of one of many plants, s."""
    plants = _plants(changes)
    return _each(lambda: plants.step(np.zeros(18), np.zeros(3), dt, STEPS))


def single_without_field():
    """Time of a step of rotor and friction of one plant, s."""
    parameters, steps = plant.parameters("nutation", FRICTION), PLANTS * STEPS * CALLS
    rotor = LagrangianRotor(JointChain.filled(fill_ideal, actuators.load().inertia), dt)
    coefficients = parameters.coulomb_Nm, parameters.viscous_Nm_s, parameters.friction_smoothing_rad_s
    resistance = Friction.filled(fill_friction, *coefficients, dt)[0]

    def work():
        data = rotor.start(*STATE)
        return seconds_of(lambda: _coast_without_field(steps, data, resistance, np.zeros(3))) / steps

    return work


def lockstep_without_field():
    """Time of the same step of one of many plants, s."""
    plants = _plants(FRICTION)
    return _each(lambda: plants.step_torque(np.zeros(3), dt, STEPS))


def _each(call):
    """Time of one step of one of the plants, in some calls of all of them, s."""

    def work():
        for _ in range(CALLS):
            call()

    return lambda: seconds_of(work) / (PLANTS * STEPS * CALLS)


def _plants(changes):
    plants = plant.Plants(plant.parameters("nutation", changes), PLANTS)
    plants.set_state(STATE.q_rad, STATE.qdot_rad_s)
    return plants


@allocation_free
def _advance_rows(periods, plants, tables, engine, given, output):
    for number in range(plants.shape[0]):
        for _ in range(periods):
            plant_tick(plants[number], tables, engine, given, output)


@compiled
def _coast(calls, state, currents, disturbance, parameters):
    for _ in range(calls):
        state = step(state, currents, disturbance, parameters, dt)


@allocation_free
def _coast_without_field(calls, rotor, resistance, friction_q):
    for _ in range(calls):
        slow_down(resistance, rotor.joint, rotor.q, rotor.qdot, friction_q)
        step_rotor(rotor)
        slow_down(resistance, rotor.joint, rotor.q, rotor.qdot, friction_q)


def environment(actions):
    """Time of one control period of one of many plants in an environment, with new episodes, s."""
    episodes = TwinVectorEnv(PLANTS, "Track", actions=actions, variants=4)
    episodes.reset(seed=0)
    rest, steps = np.zeros(episodes.action_space.shape, np.float32), STEPS * CALLS

    def work():
        for _ in range(steps):  # a list would keep the observations
            episodes.step(rest)

    return lambda: seconds_of(work) / (PLANTS * steps)


def vectors() -> str:
    """Widest vectors of this processor."""
    features = llvmlite.binding.get_host_cpu_features()
    names = [name for name in ("avx512f", "avx2", "neon") if features.get(name)]
    return f"{llvmlite.binding.get_host_cpu_name()}, {names[0] if names else 'no wide vectors'}"


def ratios():
    """Measure everything."""
    taken = fastest(
        {
            "row": row({}), "row, friction": row(FRICTION),
            "single": single({}), "lockstep": lockstep({}), "single, friction": single(FRICTION),
            "lockstep, friction": lockstep(FRICTION), "single, no field": single_without_field(),
            "lockstep, no field": lockstep_without_field(), "torques": environment("torque"),
            "currents": environment("current"),
        },
        rounds=9,
    )  # fmt: skip

    def row_over_lockstep(of, kind):
        sides = taken[f"row{kind}"], taken[f"lockstep{kind}"]
        return ratio(f"row of a block of runs over one of 64 in lockstep, {of}", *sides)

    def over_lockstep(of, kind, at_least):
        sides = taken[f"single{kind}"], taken[f"lockstep{kind}"]
        return ratio(f"one plant over one of 64, {of}", *sides, at_least=at_least)

    return [
        row_over_lockstep("rotor and field", ""),
        row_over_lockstep("rotor, field and friction", ", friction"),
        over_lockstep("rotor and field", "", 2.0),
        over_lockstep("rotor, field and friction", ", friction", 2.0),
        over_lockstep("rotor and friction", ", no field", 5.0),
        ratio("control periods of 64 plants per second, torques", 1.0, taken["torques"], at_least=3e6),
        ratio("control periods of 64 plants per second, currents", 1.0, taken["currents"], at_least=1e6),
    ]


def main() -> int:
    options = options_of(__doc__)
    rows = ratios()
    if not options.json:
        print(vectors())
    return 0 if report(rows, options.json, processor=vectors()) else 1


if __name__ == "__main__":
    sys.exit(main())
