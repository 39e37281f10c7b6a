"""Numbers at an address, in compiled code: arrays of the engine, which other code may move.

In plain Python the functions read and write the same memory.
"""

from __future__ import annotations

import ctypes
from typing import Any

from numba import types
from numba.extending import intrinsic

from spheretwin.models.base.compiled import COMPILES


def read_number(address: int, place: int) -> float:
    """Return a number of an array of doubles."""
    return ctypes.c_double.from_address(int(address) + 8 * int(place)).value


def write_number(address: int, place: int, value: float) -> None:
    """Write a number of an array of doubles."""
    ctypes.c_double.from_address(int(address) + 8 * int(place)).value = value


def read_integer(address: int, place: int) -> int:
    """Return a number of an array of integers of four bytes."""
    return ctypes.c_int32.from_address(int(address) + 4 * int(place)).value


def _access(number: Any, is_read: bool) -> Any:
    """Return the intrinsic that reads or writes a number of an array at an address."""

    def build(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        pointer = builder.inttoptr(arguments[0], context.get_value_type(number).as_pointer())
        entry = builder.gep(pointer, [arguments[1]])
        if is_read:
            return builder.load(entry)
        builder.store(arguments[2], entry)
        return context.get_dummy_value()

    def read(_: Any, address: Any, place: Any) -> tuple[Any, Any]:
        return number(types.int64, types.int64), build

    def write(_: Any, address: Any, place: Any, value: Any) -> tuple[Any, Any]:
        return types.void(types.int64, types.int64, number), build

    return intrinsic(read if is_read else write)


if COMPILES:
    read_number, write_number = _access(types.float64, True), _access(types.float64, False)
    read_integer = _access(types.int32, True)
