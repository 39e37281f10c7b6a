"""Generated C, compiled with all warnings as errors, called by ctypes."""

import ctypes
import subprocess

import numpy as np

from spheretwin.export.c_library import write_c
from spheretwin.export.controller_code import controller_code
from spheretwin.export.plant_code import plant_code
from tests.requirements import C_COMPILER

WARNINGS = ["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Wconversion", "-Wshadow", "-Werror"]
SANITIZERS = ["-g", "-O1", "-fsanitize=address,undefined,float-cast-overflow", "-fno-sanitize-recover=all"]


def compiled(folder, sources, name, *flags):
    """Path of a library or a program; no warning is accepted."""
    made = folder / name
    command = [*C_COMPILER, *WARNINGS, *flags, "-o", made, *(folder / source for source in sources), "-lm"]
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return made


def address(array):
    assert array.flags.c_contiguous
    return array.ctypes.data_as(ctypes.c_void_p)


UNTOUCHED = 12345.0
"""Results before a call."""


class CPlant:
    """Plant as a C library."""

    def __init__(self, folder, scenario, changes, inputs="currents"):
        self.model = plant_code(scenario, changes, inputs)
        write_c(folder, self.model, None)
        library = compiled(folder, ["st_plant.c"], "plant.so", "-O2", "-ffp-contract=off", "-fPIC", "-shared")
        self._c = ctypes.CDLL(str(library))
        for name in ("st_plant_step", "st_plant_advance"):
            getattr(self._c, name).argtypes = [ctypes.c_void_p] * 3 + [ctypes.c_double]
        self._c.st_plant_advance.argtypes += [ctypes.c_void_p]
        groups = self.model.groups
        self.names = [name for quantity in self.model.parameters for name in quantity.names]
        self.parameters, self.x_start = np.empty(len(self.names)), np.empty(8 + 2 * groups)
        self._plant = np.zeros(len(self.x_start) + 3 + groups + 1)
        self.verdict = 0
        self.reset()

    def reset(self):
        """Set the parameters and the state of the start."""
        self._c.st_plant_defaults(address(self.parameters), address(self.x_start))
        self.start(self.x_start)

    @property
    def x(self):
        return self._plant[: len(self.x_start)]

    @property
    def memory(self):
        """Copy of all that a step changes."""
        return self._plant.copy()

    def set(self, name, value):
        """Set a parameter, or all numbers of one that has several."""
        numbers = [place for place, own in enumerate(self.names) if own.partition("[")[0] == name]
        self.parameters[numbers] = value

    def start(self, x):
        return self._c.st_plant_start(address(self._plant), address(x))

    def step(self, u, h):
        return self._c.st_plant_step(address(self.parameters), address(u), address(self._plant), h)

    def advance(self, u, duration_s):
        reached = np.zeros(1)
        verdict = self._c.st_plant_advance(
            address(self.parameters), address(u), address(self._plant), duration_s, address(reached)
        )
        return verdict, reached[0]

    def derivatives(self, u, x):
        result = np.full(len(x), UNTOUCHED)
        arrays = (self.parameters, u, x, result)
        self.verdict = self._c.st_plant_derivatives(*map(address, arrays))
        return result

    def directional(self, u, x, du, dx):
        result = np.full(len(x), UNTOUCHED)
        arrays = (self.parameters, u, x, du, dx, result)
        self.verdict = self._c.st_plant_directional(*map(address, arrays))
        return result


class CController:
    """Control tick as a C library, in double or single precision."""

    def __init__(self, folder, scenario, changes, single=False):
        self.model = controller_code(scenario, changes)
        write_c(folder, None, self.model)
        flags = ["-DST_SINGLE", "-Wdouble-promotion"] if single else []
        name = "single.so" if single else "double.so"
        shared = ["-O2", "-ffp-contract=off", "-fPIC", "-shared"]
        self._c = ctypes.CDLL(str(compiled(folder, ["st_controller.c"], name, *shared, *flags)))
        self._type = np.float32 if single else np.float64
        self._c.st_controller_tick.restype = ctypes.c_float if single else ctypes.c_double
        self._memory = np.zeros(20_000)  # more than any controller has
        self.start()

    @property
    def memory(self):
        """Copy of all that a tick changes."""
        return self._memory.copy()

    def start(self):
        self._c.st_controller_start(address(self._memory))

    def tick(self, reference, angle, rate):
        """Share and commands."""
        command = np.zeros(self.model.groups, self._type)
        given = [np.array(values, self._type, order="C") for values in (reference, angle, rate)]
        share = self._c.st_controller_tick(address(self._memory), *map(address, given), address(command))
        return share, command
