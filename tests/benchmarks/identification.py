"""Evidence for identification: ``python tests/benchmarks/identification.py [--draws N] [--journal FILE]``.

Parameters are drawn, MuJoCo plays the machine with noise and counts, and each log with and without a payload
is identified. Shares of 95 % intervals that hold the true value, and the mean square on held-out windows.
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

SCENARIO, PAYLOADS_kg = "sinusoid", (0.0, 0.1)
KNOWN = {**CALIBRATED, "controller.law": "pid", "duration": 4.0}
WANTED = ("torque_scale", "plant.modelling_error", "plant.coulomb_Nm", "plant.viscous_Nm_s")


def random_machine(seed):
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
    return true, fields


def logs_of(fields, seed):
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
        yield Log(table["t_s"], table["current_command_A"], table["q_measured_rad"], conditions=conditions)


def identified(seed):
    """Errors of one machine over the standard deviations, whether intervals hold, and the held-out fit."""
    true, fields = random_machine(seed)
    settings = IdentifySettings(least_improvement=0.0)
    result = identify(list(logs_of(fields, seed)), SCENARIO, WANTED, KNOWN, settings)
    if result.refused:
        raise SystemExit(f"draw {seed}: {result.reasons}")
    inside, deviations = {}, {}
    for name, value in true.items():
        low, high = result.parameters[name].interval
        inside[name] = low <= value <= high
        deviations[name] = (result.parameters[name].value - value) / (high - low) * 2 * Z95
    return {"seed": seed, "inside": inside, "deviations": deviations, "chi2": result.held_out.chi2}


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
        "coverage": {name: float(np.mean(values)) for name, values in inside.items()},
        "deviation": {name: float(np.std(values)) for name, values in deviations.items()},
        "bias": {name: float(np.mean(values)) for name, values in deviations.items()},
        "held_out_chi2": [float(chi2.mean()), float(chi2.std()), float(chi2.min()), float(chi2.max())],
    }


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--draws", type=int, default=200, help="seeds below this number")
    parser.add_argument("--first", type=int, default=0, help="first seed that this process identifies")
    parser.add_argument("--journal", type=Path, help="file with a line a draw; draws in it are not repeated")
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    draws = journal_of(options.journal)
    for seed in range(options.first, options.draws):
        if seed in draws:
            continue
        draws[seed] = identified(seed)
        add_to(options.journal, draws[seed])
        print(f"draw {seed}: held-out mean square {draws[seed]['chi2']:.3f}", file=sys.stderr, flush=True)
    figures = figures_of(list(draws.values()))
    if options.json:
        print(json.dumps(figures))
    else:
        for name in figures["coverage"]:
            print(
                f"{name}: {figures['coverage'][name]:.1%} of the intervals hold the true value; deviations"
                f" {figures['deviation'][name]:.2f}, mean {figures['bias'][name]:+.2f}"
            )
        mean, deviation, low, high = figures["held_out_chi2"]
        print(
            f"held-out mean square over that of the noise: mean {mean:.3f}, standard deviation"
            f" {deviation:.3f}, {low:.3f} to {high:.3f}"
        )
    return 0 if all(0.9 <= share <= 0.98 for share in figures["coverage"].values()) else 1


if __name__ == "__main__":
    sys.exit(main())
