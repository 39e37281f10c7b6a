"""The loop that fits a law: compiled for what can be compiled, uncompiled for a plain Python function."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from numba.core.dispatcher import Dispatcher

from spheretwin.control import law as laws
from spheretwin.control.allocation import registry as allocations
from spheretwin.control.estimation import estimator as estimators
from spheretwin.control.law import Law
from spheretwin.models.base.compiled import COMPILES, compile_error, compiled_callback, uncompiled
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
    law: Law,
    allocate: Callable[..., float],
    estimate: Callable[..., None] | None = None,
    *,
    check_bounds: bool = False,
) -> Functions:
    """Loop and callbacks for a law, an allocation and an estimator of rates.

    Parameters
    ----------
    law : Law
    allocate, estimate : callable
    check_bounds : bool
        Compile the law with bounds checks; in Python, NumPy checks them.

    Raises
    ------
    InputError
        The law is to be compiled, and cannot be.
    """
    own = is_own(law)
    if not COMPILES or (own and not isinstance(law.step, Dispatcher)):
        return Functions(
            uncompiled(loops.loop), uncompiled(law.step), allocate, estimate and uncompiled(estimate), ()
        )
    try:
        stepping = compiled_callback(laws.SIGNATURE, law.step, check_bounds=check_bounds)
    except Exception as error:  # numba lets errors of other kinds pass, as AttributeError
        if not own:
            raise
        raise InputError(
            f"law {law.name}: expected a function of (t, reference, measurement, parameters, state,"
            f" torque) that numba compiles, received {compile_error(error, law.step)}"
        ) from error
    alive = [stepping, compiled_callback(allocations.SIGNATURE, allocate)]
    if estimate:
        alive.append(compiled_callback(estimators.SIGNATURE, estimate))
    addresses = [each.address for each in alive]
    return Functions(loops.loop, addresses[0], addresses[1], addresses[2] if estimate else 0, tuple(alive))


def is_own(law: Law) -> bool:
    """True if a law is the user's, not one of this package."""
    return not (law.step.__module__ or "").startswith("spheretwin.")
