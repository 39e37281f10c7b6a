"""Allocations of compiled code."""

from numba import njit
from numba.core.runtime import _nrt_python, rtsys


def allocates_nothing(function, *arguments):
    """True if a thousand calls from compiled code allocate no more than one.

    What is left is the wrapping of the arguments, once a call from Python.
    """

    @njit
    def repeat(count, arguments):
        for _ in range(count):
            function(*arguments)

    _nrt_python.memsys_enable_stats()

    def allocations(count):
        before = rtsys.get_allocation_stats().alloc
        repeat(count, arguments)
        return rtsys.get_allocation_stats().alloc - before

    allocations(1)
    return allocations(1000) == allocations(1)
