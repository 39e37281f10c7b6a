"""Comparison with mujoco.sysid: ``python tests/benchmarks/sysid.py [--draws N] [--free N] [--json]``.

Both identify the logs of ``identification.py`` in the same windows, with the same plant. Errors over half
widths of 95 % intervals, shares of intervals that hold the true value, time, and what each does without the
payload that separates torque from inertia. mujoco.sysid needs ``pip install "mujoco[sysid]"``.
"""

import argparse
import contextlib
import json
import sys
import time
import xml.etree.ElementTree as ElementTree

import mujoco
import numpy as np
from identification import KNOWN, SCENARIO, WANTED, logs_of, random_machine
from mujoco import sysid

from spheretwin.machine import IdentifySettings, identify
from spheretwin.machine.identification import Problem
from spheretwin.machine.windows import Shooting

try:
    from absl import logging
except ModuleNotFoundError:
    logging = None
if logging is None or not hasattr(sysid, "default_report"):
    raise SystemExit('sysid: expected the packages of mujoco.sysid; run: pip install "mujoco[sysid]"')

SETTINGS = IdentifySettings(least_improvement=0.0)
HINGES = ("alpha", "beta", "gamma")
BOUNDS = {
    "torque_scale": (0.5, 1.5),
    "plant.modelling_error": (-0.5, 0.5),
    "plant.coulomb_Nm": (0.0, 0.02),
    "plant.viscous_Nm_s": (0.0, 0.004),
}
START_BOUNDS = np.repeat([0.1, 1.0], 3)  # rad, rad/s, about the start of the shadow
WAYS = ("default weights", "weights of the noise", "free starts")


class Peer:
    """Windows of logs as mujoco.sysid takes them, with our plant.

    Parameters
    ----------
    logs : list of Log
    way : str
        One of `WAYS`: each has that of the one before, too.
    """

    def __init__(self, logs, way):
        self.problem = Problem(logs, SCENARIO, WANTED, KNOWN, SETTINGS)
        self.shooting: Shooting = self.problem.train
        self.weighted, self.free = way != WAYS[0], way == WAYS[2]
        self.starts = np.array(self.shooting._starts)  # of the shadow, as long as nothing is solved
        self.parameters = sysid.ParameterDict()
        for parameter, value in zip(self.problem.requested, self.problem.initial, strict=True):
            self.parameters.add(sysid.Parameter(parameter.name, value, *BOUNDS[parameter.kind.name]))
        if self.free:
            zero, bound = np.zeros(self.starts.size), np.tile(START_BOUNDS, len(self.starts))
            self.parameters.add(sysid.Parameter("starts", zero, -bound, bound))
        self.parameters.move_off_bounds()
        self.spec = mujoco.MjSpec.from_string(_mjcf())
        self.model = self.spec.compile()
        rollouts = [self._trajectory(number) for number in range(len(self.starts))]
        self.numbers = {id(rollout.control): number for number, rollout in enumerate(rollouts)}
        names = [f"{number}" for number in range(len(rollouts))]
        columns = ("initial_state", "control", "sensordata")
        of_each = [[getattr(one, column) for one in rollouts] for column in columns]
        sequences = sysid.ModelSequences("machine", self.spec, names, *of_each)
        self.residual = sysid.build_residual_fn(
            models_sequences=[sequences],
            build_model=lambda _parameters, _spec: self.model,
            custom_rollout=self._roll_out,
            modify_residual=self._weighted if self.weighted else None,
            n_threads=1,
            resample_true=False,
        )

    def optimize(self):
        """Return values, intervals and warnings, of the wanted parameters."""
        messages, warning = [], logging.warning
        logging.warning = lambda text, *values: messages.append(text % values)
        try:
            with contextlib.redirect_stdout(None):  # it prints its iterations whatever `verbose` says
                outcome, result = sysid.optimize(
                    self.parameters, self.residual, verbose=False, check_conditioning=True, x_scale="jac"
                )
        finally:
            logging.warning = warning
        residuals = self.residual(result.x, outcome)[0]
        _, half = sysid.calculate_intervals([one.ravel() for one in residuals], result.jac)
        count = len(self.problem.requested)
        values, half = result.x[:count], half[:count]
        return values, np.array([values - half, values + half]), messages

    def _trajectory(self, number):
        window = self.shooting.windows[number]
        rows = slice(window.first, window.first + window.rows + 1)
        times = window.log.t_s[rows]
        return sysid.SystemTrajectory(
            model=self.model,
            control=sysid.TimeSeries(times, window.log.current_A[rows]),
            sensordata=self._series(times, window.log.angle_rad[rows]),
            initial_state=np.concatenate([[times[0]], self.starts[number]]),
            state=None,
        )

    def _series(self, times, angles):
        return sysid.TimeSeries(times, angles, sysid.TimeSeries.compute_all_sensor_mapping(self.model))

    def _roll_out(self, *, control_signal, param_dicts, initial_states, **_):
        number, count = self.numbers[id(control_signal[0])], len(self.problem.requested)
        # Rounding takes its steps below a bound by 1e-20.
        vectors = [np.clip(one.as_vector(), *self.parameters.get_bounds()) for one in param_dicts]
        window = self.shooting.windows[number]
        setups = [window.machine.setup(self.problem.requested, vector[:count]) for vector in vectors]
        starts = np.array([state[1:7] for state in initial_states])
        if self.free:
            starts += [vector[count:].reshape(-1, 6)[number] for vector in vectors]
        angles = self.shooting._angles(number, setups, starts)[:, 1:]
        times = control_signal[0].times[1:]
        return [
            sysid.SystemTrajectory(
                self.model,
                control_signal[0],
                self._series(times, reached),
                state,
                sysid.TimeSeries(times, np.column_stack([times, reached, np.zeros_like(reached)])),
            )
            for reached, state in zip(angles, initial_states, strict=True)
        ]

    def _weighted(self, _parameters, predicted, measured, _model, _everything, **_):
        measured = self._series(measured.times[1:], measured.data[1:])
        model = self.problem.machine.model  # counts as white noise
        noise_rad = np.hypot(model.noise_rad, model.half_count_rad / np.sqrt(3))
        return (measured.data - predicted.data) / noise_rad, predicted, measured


def _mjcf() -> str:
    """Return a model with the sensors and actuators alone: our plant takes the place of its dynamics."""
    root = ElementTree.Element("mujoco")
    body = ElementTree.SubElement(ElementTree.SubElement(root, "worldbody"), "body")
    ElementTree.SubElement(body, "geom", size="0.05")
    actuators, sensors = ElementTree.SubElement(root, "actuator"), ElementTree.SubElement(root, "sensor")
    for name, axis in zip(HINGES, ("1 0 0", "0 1 0", "0 0 1"), strict=True):
        ElementTree.SubElement(body, "joint", name=name, type="hinge", axis=axis)
        ElementTree.SubElement(sensors, "jointpos", name=f"{name}_rad", joint=name)
    for number in range(18):
        ElementTree.SubElement(actuators, "motor", name=f"i_{number}", joint="alpha")
    return ElementTree.tostring(root, encoding="unicode")


def ours(logs):
    """Return values, intervals and refusals of `identify`."""
    result = identify(logs, SCENARIO, WANTED, KNOWN, SETTINGS)
    if result.refused:
        return None, None, list(result.reasons)
    estimates = list(result.parameters.values())
    return np.array([one.value for one in estimates]), np.array([one.interval for one in estimates]).T, []


def compared(draws: int, free: int):
    """Return figures of each way over some draws."""
    methods = {"identify": ours} | {way: lambda logs, way=way: Peer(logs, way).optimize() for way in WAYS}
    names = list(random_machine(0)[0])
    rows = {method: [] for method in methods}
    ours(list(logs_of(random_machine(draws)[1], draws)))  # compile
    for seed in range(draws):
        true, fields = random_machine(seed)
        logs = list(logs_of(fields, seed))
        for method, solve in methods.items():
            if method == WAYS[2] and seed >= free:
                continue
            start = time.process_time()
            values, interval, _ = solve(logs)
            rows[method].append((values, interval, list(true.values()), time.process_time() - start))
            print(f"draw {seed}, {method}: {rows[method][-1][-1]:.1f} CPU s", file=sys.stderr)
    return {method: _figures(names, outcomes) for method, outcomes in rows.items() if outcomes}


def _figures(names, outcomes):
    values, intervals, true, times = (np.array(column) for column in zip(*outcomes, strict=True))
    errors, halves = values - true, np.ptp(intervals, axis=1) / 2
    inside = (intervals[:, 0] <= true) & (true <= intervals[:, 1])
    each = {
        "coverage_each": np.mean(inside, axis=0),
        "error_over_half_width_rms": np.sqrt(np.mean((errors / halves) ** 2, axis=0)),
        "error_rms": np.sqrt(np.mean(errors**2, axis=0)),
        "half_width": np.mean(halves, axis=0),
    }
    of_all = {"draws": len(outcomes), "coverage": float(np.mean(inside)), "cpu_s": float(np.median(times))}
    return of_all | {figure: dict(zip(names, row.tolist(), strict=True)) for figure, row in each.items()}


def without_payload():
    """Return what each does with a log that cannot tell torque from inertia."""
    true, fields = random_machine(0)
    logs = list(logs_of(fields, 0))[:1]
    outcomes = {"identify": {"refusals": ours(logs)[2]}}
    for way in WAYS[:2]:
        values, interval, messages = Peer(logs, way).optimize()
        errors = np.abs(values - list(true.values()))
        outcomes[way] = {
            "warnings": messages,
            "error": dict(zip(true, errors.tolist(), strict=True)),
            "half_width": dict(zip(true, ((interval[1] - interval[0]) / 2).tolist(), strict=True)),
        }
    return outcomes


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--draws", type=int, default=10)
    parser.add_argument("--free", type=int, default=1, help="draws with starts as parameters")
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    figures = {"without_payload": without_payload(), **compared(options.draws, options.free)}
    print(json.dumps(figures) if options.json else json.dumps(figures, indent=2))
    return 0


if __name__ == "__main__":
    sys.exit(main())
