"""The loop that fits a law: compiled for what can be compiled, uncompiled for a plain Python function."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from numba.core.dispatcher import Dispatcher
from numba.core.errors import NumbaError

from spheretwin.control import law as laws
from spheretwin.control.allocation import registry as allocations
from spheretwin.control.estimation import estimator as estimators
from spheretwin.control.law import Law
from spheretwin.models.base.compiled import COMPILES, compiled_callback, uncompiled
from spheretwin.models.base.errors import InputError
from spheretwin.twin import loop as loops


class Functions(NamedTuple):
    """The loop, and the functions of its users as it takes them."""

    loop: Callable[..., tuple[int, int]]
    law: Any
    allocate: Any
    estimate: Any
    """0 where nothing is estimated."""
    alive: tuple[Any, ...]
    """Compiled code holds bare addresses: what they belong to must not go."""


def matching(
    law: Law, allocate: Callable[..., float], estimate: Callable[..., None] | None = None
) -> Functions:
    """Loop and callbacks for a law, an allocation and an estimator of rates.

    Raises
    ------
    InputError
        The law is to be compiled, and cannot be.
    """
    own = not (law.step.__module__ or "").startswith("spheretwin.")
    if not COMPILES or (own and not isinstance(law.step, Dispatcher)):
        return Functions(
            uncompiled(loops.loop), uncompiled(law.step), allocate, estimate and uncompiled(estimate), ()
        )
    try:
        stepping = compiled_callback(laws.SIGNATURE, law.step)
    except (NumbaError, TypeError) as error:
        complaint = next(filter(None, map(str.strip, str(error).splitlines())), "")
        raise InputError(
            f"law {law.name}: expected a function that compiles as {laws.SIGNATURE}, received: {complaint}"
        ) from error
    alive = [stepping, compiled_callback(allocations.SIGNATURE, allocate)]
    if estimate:
        alive.append(compiled_callback(estimators.SIGNATURE, estimate))
    addresses = [each.address for each in alive]
    return Functions(loops.loop, addresses[0], addresses[1], addresses[2] if estimate else 0, tuple(alive))
