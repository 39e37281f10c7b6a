"""Memory of freed arrays, in a process of its own."""

import platform
import subprocess
import sys

import pytest

PROGRAM = """
import os, sys
import numpy as np
from spheretwin.models.base.heap import return_large_arrays

def used_MB():
    return int(open("/proc/self/statm").read().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6

if sys.argv[1] == "apart":
    return_large_arrays()
np.ones(3_750_000)  # 30 MB: from then on glibc takes smaller arrays from its heap
kept = [np.ones(125_000) for _ in range(200)]  # 1 MB each
before = used_MB()
del kept[::2]
print(before - used_MB())
"""


def returned_MB(how):
    return float(subprocess.check_output([sys.executable, "-c", PROGRAM, how], text=True))


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="other C libraries have no such threshold")
def test_every_second_array_goes_back_to_the_system():
    assert returned_MB("apart") > 95
    assert returned_MB("heap") < 50  # else the call is of no use
