"""Machine code of compiled functions in the cache of this package.

*Machine code in a cache of this package* (`CompileResult._rebuild` and `_reduce`, `rtsys`). Reason: numba's
cache tracks one file of sources, and a damaged entry is an error at every call. Consequence of a change: a
function is compiled in every process, or an exception at its first call.

*Names of records in machine code* (`types.Record.mangling_args`). Reason: numba names them by numbers that
each process counts anew, so that functions of two processes for different records can have one name.
Consequence of a change: stored machine code reads the fields of another record.

`tests/models/base/test_internals.py` checks each of them.
"""

from __future__ import annotations

import hashlib
import pickle
import re
import warnings
from collections.abc import Callable
from typing import Any

from numba import types
from numba.core.caching import NullCache
from numba.core.compiler import CompileResult
from numba.core.errors import NumbaWarning
from numba.core.runtime import rtsys
from numba.core.serialize import dumps
from numba.cpython import hashing
from numba.experimental import function_type

from spheretwin.models.base import cache, compilation
from spheretwin.models.base.function_identity import function_identity, is_of_package

# Loaded machine code needs the symbols of hashes and the type of a callback, in addition to the math and
# run-time libraries. These imports register them.
_REGISTERED = hashing, function_type


def _name_of_record(record: types.Record) -> tuple[str, tuple[int]]:
    """Return the same name of a record in each process: a digest of its fields."""
    return "Record", (int.from_bytes(hashlib.sha256(record.name.encode()).digest()[:12], "little"),)


types.Record.mangling_args = property(_name_of_record)


class MachineCode(NullCache):
    """Cache of the machine code of one function, one entry for each signature.

    Numba's own cache takes its folder from a setting that all packages share, and an entry that is damaged or
    cannot be written is an error at every call. Here the function is compiled again.

    Parameters
    ----------
    function : callable
        A plain function; one without an identity is compiled in each process.
    kind : str
        Distinguishes different compilations of one function.
    """

    def __init__(self, function: Callable[..., Any], kind: str) -> None:
        self._name = f"{function.__module__}.{function.__qualname__}"
        self._function, self._kind = function, kind

    @property
    def cache_path(self) -> str | None:
        """Folder of the entries."""
        folder = cache.cache_folder()
        return str(folder) if folder else None

    def load_overload(self, sig: Any, target_context: Any) -> CompileResult | None:
        """Return the machine code for a signature; None if there is no usable entry."""
        # Numba's cache would import everything that can be compiled, with scipy.linalg: a third of a short
        # run.
        rtsys.initialize(target_context)
        entry = self._entry(sig, target_context.codegen())
        content = cache.load_entry(entry) if entry else None
        result = self._rebuilt(content, sig, target_context) if content else None
        if result is None:
            compilation.report(self._name)
        return result

    @staticmethod
    def _rebuilt(content: bytes, sig: Any, target_context: Any) -> CompileResult | None:
        try:
            signature, parts = pickle.loads(content)
            if signature != sig:  # a different signature with the same text
                return None
            return CompileResult._rebuild(target_context, *parts)
        # Unpickling or linking a damaged entry may raise anything; the function is compiled again.
        except Exception:
            return None

    def save_overload(self, sig: Any, data: CompileResult) -> None:
        """Store the machine code for a signature."""
        if data.library.has_dynamic_globals:
            if not is_of_package(self._function):
                return  # users refer to what they like
            complaint = f"{self._name} is compiled in every process: it holds an address or a large array"
            warnings.warn(complaint, NumbaWarning, stacklevel=2)
            return
        if entry := self._entry(sig, data.codegen):
            cache.store_entry(entry, dumps((sig, data._reduce())))

    def _entry(self, sig: Any, codegen: Any) -> str | None:
        """Return the name of an entry: function, then a digest of function, signature and processor.

        None for a function without an identity: an entry would become stale.
        """
        identity = function_identity(self._function)
        if identity is None:
            return None
        key = repr((self._name, identity, self._kind, str(sig), codegen.magic_tuple()))
        readable = re.sub(r"\W+", "-", self._name.removeprefix("spheretwin."))[:60]
        return f"{readable}-{hashlib.sha256(key.encode()).hexdigest()[:24]}"
