"""Sets of coil groups that are open together: every single one, every pair, and larger ones at random."""

from __future__ import annotations

from functools import cache
from itertools import combinations

import numpy as np

from spheretwin.models import actuator

Groups = tuple[int, ...]
"""Numbers of the open groups, rising."""

DRAWN = 2000
SIZES = tuple(range(3, 10))
"""Of the drawn sets; each has as many sets as any other, but for one."""
SEED = 18


@cache
def drawn() -> tuple[Groups, ...]:
    """The drawn sets, size after size in turn; no two are the same."""
    random = np.random.default_rng(SEED)
    found: dict[Groups, None] = {}
    while len(found) < DRAWN:
        size = SIZES[len(found) % len(SIZES)]
        chosen = random.choice(count(), size, replace=False)
        found[tuple(sorted(int(group) for group in chosen))] = None
    return tuple(found)


@cache
def singles() -> tuple[Groups, ...]:
    """Every group alone."""
    return tuple((group,) for group in range(count()))


@cache
def pairs() -> tuple[Groups, ...]:
    """Every two groups."""
    return tuple(combinations(range(count()), 2))


@cache
def count() -> int:
    """Coil groups of the actuator."""
    return len(actuator.load().groups)
