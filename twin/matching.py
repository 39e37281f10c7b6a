"""The loop that fits a law: compiled for what can be compiled, uncompiled for a plain Python function."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from numba.core.dispatcher import Dispatcher
from numba.core.errors import NumbaError

from spheretwin.control import law as laws
from spheretwin.control.allocation import registry as allocations
from spheretwin.control.law import Law
from spheretwin.models.base.compiled import COMPILES, compiled_callback, uncompiled
from spheretwin.models.base.errors import InputError
from spheretwin.twin import loop as loops


class Functions(NamedTuple):
    """The loop, and the functions of its users as it takes them."""

    loop: Callable[..., tuple[int, int]]
    law: Any
    allocate: Any
    alive: tuple[Any, ...]
    """Compiled code holds bare addresses: what they belong to must not go."""


def matching(law: Law, allocate: Callable[..., float]) -> Functions:
    """Loop and callbacks for a law and an allocation.

    Raises
    ------
    InputError
        The law is to be compiled, and cannot be.
    """
    own = not (law.step.__module__ or "").startswith("spheretwin.")
    if not COMPILES or (own and not isinstance(law.step, Dispatcher)):
        return Functions(uncompiled(loops.loop), uncompiled(law.step), allocate, ())
    try:
        stepping = compiled_callback(laws.SIGNATURE, law.step)
    except (NumbaError, TypeError) as error:
        complaint = next(filter(None, map(str.strip, str(error).splitlines())), "")
        raise InputError(
            f"law {law.name}: expected a function that compiles as {laws.SIGNATURE}, received: {complaint}"
        ) from error
    allocating = compiled_callback(allocations.SIGNATURE, allocate)
    return Functions(loops.loop, stepping.address, allocating.address, (stepping, allocating))
