"""A verb of the command line that counts first-time work in its loop: ``first_time_work.py VERB …``.

The last line on stderr has the counts as JSON: imports, compilations, collections of garbage.
"""

import gc
import json
import sys
from contextlib import ExitStack, contextmanager

from numba.core import event

from spheretwin import cli
from spheretwin.cli import machine

COMPILER = ("numba:compile", "numba:compiler_lock", "numba:llvm_lock")


class Imports:
    """Finder that finds nothing and stores the names of modules that are imported for the first time."""

    def __init__(self):
        self.names = []

    def find_spec(self, name, path=None, target=None):
        self.names.append(name)


@contextmanager
def counted(counts):
    """Add the counts of a block."""
    imports, collections = Imports(), []

    def collect(phase, info):
        collections.append(phase)

    with ExitStack() as stack:
        recorders = [stack.enter_context(event.install_recorder(kind)) for kind in COMPILER]
        sys.meta_path.insert(0, imports)
        gc.callbacks.append(collect)
        try:
            yield
        finally:
            gc.callbacks.remove(collect)
            sys.meta_path.remove(imports)
            counts["imports"] = imports.names
            counts["compilations"] = sum(len(recorder.buffer) for recorder in recorders)
            counts["collections"] = collections.count("start")


def main(arguments):
    """Run the command; return its exit code."""
    counts, follow = {}, machine.follow

    def follow_and_count(session, *others, **more):
        with counted(counts):
            return follow(session, *others, **more)

    machine.follow = follow_and_count
    code = cli.main(arguments)
    print(json.dumps(counts), file=sys.stderr)
    return code


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
