"""Private APIs of numba, all in this folder. `pyproject.toml` bounds the versions.

*Machine code in a cache of this package* (`MachineCode`, `CompileResult._rebuild` and `_reduce`, `rtsys`,
`_cache`). Reason: numba's cache tracks one file of sources, and a damaged entry is an error at every call.
Consequence of a change: a function is compiled in every process, or an exception at its first call.

*Functions for compiled callers* (`CPUDispatcher`, its `_compiler`, `overloads` and `add_overload`). Reason:
numba compiles the conversion of Python arguments of every function, a fifth of the compile time of a loop.
Consequence: a loop compiles longer, or a function is compiled at every call.

*Inlined implementations without machine code* (`make_overload_template`, `_get_jit_decorator`,
`_can_compile`). Reason: numba compiles an implementation completely, then inlines it and drops the code, a
tenth of the compile time of a loop. Consequence: the loop does not compile, or takes longer.

*Functions by address* (`cgutils`, `FunctionType`). Reason: the loop is compiled once for all laws.
Consequence: the loop does not compile.

*Values in memory* (`get_data_type`, `get_abi_sizeof`). Reason: C code passes an address to compiled code,
which reads a tuple of arrays there. Consequence: a plugin reads invalid memory.

*No reference counting* (`_nrt`). Reason: it takes a third of the loop's own time. Consequence: the option is
refused, or the loop is slower.

*Tuples as values* (`Lower._find_singly_assigned_variable`). Reason: numba gives each variable that several
blocks use a place in memory, and LLVM spends most of the compile time on copies of tuples of many arrays.
Consequence: the loop compiles two to three times as long.

*Fingerprint of types* (`_dispatcher.compute_fingerprint`). Reason: numba's type of the hundred arrays of a
loop takes half of the start-up time of a session. Consequence: an exception at the first loop.

*Callbacks with bounds checks and exceptions* (`CFunc`, `Dispatcher`, the text of `sys.unraisablehook`).
Reason: numba checks bounds only in the outermost function, and drops the exceptions of callbacks.
Consequence: an exception of a law is printed, and the run ends as diverged.

`tests/models/base/test_internals.py` checks each of them.
"""
