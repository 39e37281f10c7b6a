"""Bounded allocation against 10,080 linear programmes: ``python tests/benchmarks/allocation.py``.

Every kind of matrix with every kind of direction, at a tenth to five times what least-norm currents give.
"""

import itertools
import runpy
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np

from spheretwin.models import actuator as actuators

CASES = Path(__file__).parents[1] / "control" / "allocation" / "cases.py"
CASES_EACH = 420

# Of the share given, and of what the currents leave of the torque: HiGHS is asked for 1e-10.
BOUND = 1e-9


def compared(cases: SimpleNamespace, matrix, direction) -> tuple[int, float]:
    """How often the limit cut the torque, and the largest difference of all programmes, relative."""
    actuator, rng = actuators.load(), np.random.default_rng(1)
    cut, worst = 0, 0.0
    for _ in range(CASES_EACH):
        G = cases.of_full_rank(rng, matrix, actuator)
        limit = 10 ** rng.uniform(-6, 3)
        multiple = 10 ** rng.uniform(-1, np.log10(5))
        torque = cases.at_multiple(G, direction(rng, G), multiple, limit)
        scale, current = cases.bounded(G, torque, limit)
        largest = min(cases.largest_by_programme(G, torque, limit), 1.0)
        left = np.linalg.norm(G @ current - scale * torque) / np.linalg.norm(torque)
        beyond = max(np.abs(current).max() / limit - 1.0, 0.0)
        worst = max(worst, abs(scale / largest - 1.0), left, beyond)
        cut += scale < 1
    return cut, worst


def main() -> int:
    cases = SimpleNamespace(**runpy.run_path(str(CASES)))
    print(f"{'matrix':25} {'direction':16} {'programmes':>10} {'cut':>5} {'worst':>8}   bound {BOUND:g}")
    broken = 0
    for matrix, direction in itertools.product(cases.MATRICES, cases.DIRECTIONS):
        cut, worst = compared(cases, matrix, direction)
        within_bounds = worst <= BOUND and cut > 0
        broken += not within_bounds
        names = f"{matrix.__name__:25} {direction.__name__:16}"
        print(
            f"{names} {CASES_EACH:>10} {cut:>5} {worst:>8.1e}   {'' if within_bounds else 'BROKEN'}".rstrip()
        )
    return 1 if broken else 0


if __name__ == "__main__":
    sys.exit(main())
