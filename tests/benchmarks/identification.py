"""Evidence for identification: ``python tests/benchmarks/identification.py [--draws N] [--lacks STRUCTURE]``.

Parameters are drawn, MuJoCo plays the machine with noise and counts, and each log with and without a payload
is identified. Shares of 95 % intervals that hold the true value, and the mean square on held-out windows.
With `--lacks` the machine has a small error that the model does not know: a scatter of 1 % of the gains of
the groups or poles, or a play of 0.4 mrad between the gimbal and its angle sensors.
"""

import argparse
import json
import sys
from pathlib import Path

import numpy as np

import spheretwin
from spheretwin.machine import IdentifySettings, Log, identify
from spheretwin.machine.intervals import Z95
from spheretwin.machine.workflow import CALIBRATED
from spheretwin.models import actuator

SCENARIO, PAYLOADS_kg = "sinusoid", (0.0, 0.1)
KNOWN = {**CALIBRATED, "controller.law": "pid", "duration": 4.0}
WANTED = ("torque_scale", "plant.modelling_error", "plant.coulomb_Nm", "plant.viscous_Nm_s")


LACKING = ("nothing", "groups", "poles", "play")
SCATTER, PLAY_rad = 0.01, 4e-4


def random_machine(seed, lacks="nothing"):
    """True parameters of one machine, by the names of the identification, and its fields."""
    generator = np.random.default_rng(seed)
    scale, error = generator.uniform(0.9, 1.1), generator.uniform(-0.1, 0.2)
    coulomb, viscous = generator.uniform(1e-3, 5e-3, 3), generator.uniform(1e-4, 1e-3, 3)
    true = {"torque_scale": scale, "plant.modelling_error": error}
    true |= {f"plant.coulomb_Nm.{i}": float(coulomb[i]) for i in range(3)}
    true |= {f"plant.viscous_Nm_s.{i}": float(viscous[i]) for i in range(3)}
    fields = {
        "plant.group_gain": [scale] * 18,
        "plant.modelling_error": error,
        "plant.coulomb_Nm": coulomb.tolist(),
        "plant.viscous_Nm_s": viscous.tolist(),
    }
    scatter = np.random.default_rng(2000 + seed).normal(0, SCATTER, (2, 64))
    if lacks == "groups":
        # The true scale is the mean of the gains.
        fields["plant.group_gain"] = (scale * (1 + scatter[0, :18] - scatter[0, :18].mean())).tolist()
    elif lacks == "poles":
        poles = len(actuator.load().pole_axes)
        fields["plant.poles.errors"] = [[error, 0.0, 0.0, 0.0] for error in scatter[1, :poles].tolist()]
    return true, fields


def with_play(angle_rad, width_rad):
    """Angles behind a play."""
    behind = angle_rad.copy()
    for row in range(1, len(behind)):
        behind[row] = np.clip(behind[row - 1], angle_rad[row] - width_rad / 2, angle_rad[row] + width_rad / 2)
    return behind


def logs_of(fields, seed, lacks="nothing"):
    """Logs of a machine with each payload, each with noise of its own.

    Amplitude and frequency are drawn too. With 0.5 Hz a cycle has exactly 2,000 periods, and an encoder
    without noise passes its edges at the same parts of a period in each cycle: two cycles say no more than
    one. With 0.2 rad its largest rate is a fifth of a count per period, which has the same effect.
    """
    generator = np.random.default_rng(1000 + seed)
    shape = {
        "trajectory.amplitude_rad": [float(generator.uniform(0.15, 0.25))] * 3,
        "trajectory.frequency_Hz": float(generator.uniform(0.45, 0.55)),
    }
    for number, payload_kg in enumerate(PAYLOADS_kg):
        conditions = {"plant.payload_kg": payload_kg}
        motion = {**shape, "seed": len(PAYLOADS_kg) * seed + number}
        changes = {**KNOWN, **fields, **conditions, **motion}
        table = spheretwin.simulate(SCENARIO, changes).telemetry
        angle_rad = table["q_measured_rad"].copy()
        if lacks == "play":  # of the potentiometers
            true_rad = table["q_rad"][:, :2]
            angle_rad[:, :2] += with_play(true_rad, PLAY_rad) - true_rad
        yield Log(table["t_s"], table["current_command_A"], angle_rad, conditions=conditions)


def identified(seed, lacks="nothing"):
    """Errors of one machine over the standard deviations, whether intervals hold, and the held-out fit."""
    true, fields = random_machine(seed, lacks)
    settings = IdentifySettings(least_improvement=0.0)
    result = identify(list(logs_of(fields, seed, lacks)), SCENARIO, WANTED, KNOWN, settings)
    if result.refused:
        raise SystemExit(f"draw {seed}: {result.reasons}")
    inside, by_noise, wider, deviations = {}, {}, {}, {}
    for name, value in true.items():
        low, high = result.parameters[name].interval
        inside[name] = low <= value <= high
        wider[name] = result.parameters[name].widening
        by_noise[name] = 2 * abs(result.parameters[name].value - value) <= (high - low) / wider[name]
        deviations[name] = (result.parameters[name].value - value) / (high - low) * 2 * Z95
    chi2 = result.held_out.chi2
    return {
        "seed": seed,
        "inside": inside,
        "by_noise": by_noise,
        "wider": wider,
        "deviations": deviations,
        "chi2": chi2,
        "accepted": abs(chi2 - 1) <= settings.chi2_limit,
    }


def journal_of(path):
    """Draws of a journal, by seed."""
    lines = path.read_text().splitlines() if path and path.exists() else []
    return {draw["seed"]: draw for draw in map(json.loads, lines)}


def add_to(path, draw):
    """Add a draw to a journal, if there is one."""
    if path:
        with path.open("a") as file:
            file.write(json.dumps(draw) + "\n")


def figures_of(draws):
    """Figures of all draws."""
    names, chi2 = draws[0]["inside"], np.array([draw["chi2"] for draw in draws])
    inside = {name: [draw["inside"][name] for draw in draws] for name in names}
    deviations = {name: [draw["deviations"][name] for draw in draws] for name in names}
    return {
        "draws": len(draws),
        "accepted": float(np.mean([draw["accepted"] for draw in draws])),
        "coverage": {name: float(np.mean(values)) for name, values in inside.items()},
        "by_noise": {name: float(np.mean([draw["by_noise"][name] for draw in draws])) for name in names},
        "wider": {name: float(np.median([draw["wider"][name] for draw in draws])) for name in names},
        "deviation": {name: float(np.std(values)) for name, values in deviations.items()},
        "bias": {name: float(np.mean(values)) for name, values in deviations.items()},
        "held_out_chi2": [float(chi2.mean()), float(chi2.std()), float(chi2.min()), float(chi2.max())],
    }


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--draws", type=int, default=200, help="seeds below this number")
    parser.add_argument("--first", type=int, default=0, help="first seed that this process identifies")
    parser.add_argument("--lacks", choices=LACKING, default=LACKING[0], help="what the model does not know")
    parser.add_argument("--journal", type=Path, help="file with a line a draw; draws in it are not repeated")
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    draws = journal_of(options.journal)
    for seed in range(options.first, options.draws):
        if seed in draws:
            continue
        draws[seed] = identified(seed, options.lacks)
        add_to(options.journal, draws[seed])
        print(f"draw {seed}: held-out mean square {draws[seed]['chi2']:.3f}", file=sys.stderr, flush=True)
    figures = figures_of(list(draws.values()))
    if options.json:
        print(json.dumps(figures))
    else:
        for name in figures["coverage"]:
            print(
                f"{name}: {figures['coverage'][name]:.1%} of the intervals hold the true value"
                f" ({figures['by_noise'][name]:.1%} without widening, median {figures['wider'][name]:.2f});"
                f" deviations {figures['deviation'][name]:.2f}, mean {figures['bias'][name]:+.2f}"
            )
        mean, deviation, low, high = figures["held_out_chi2"]
        print(
            f"held-out mean square over that of the noise: mean {mean:.3f}, standard deviation"
            f" {deviation:.3f}, {low:.3f} to {high:.3f}, {figures['accepted']:.1%} within the limit"
        )
    return 0 if all(share >= 0.9 for share in figures["coverage"].values()) else 1


if __name__ == "__main__":
    sys.exit(main())
