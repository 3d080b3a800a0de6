"""Memory is kept."""

from __future__ import annotations

import subprocess
import sys

import pytest

COUNTING = """
import resource
import numpy as np
from orthoscope.machine.memory import keep_freed_memory
def faults():
    before = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
    for _ in range(10):
        arrays = [np.ones(3 << 17) for _ in range(8)]
        del arrays
    return resource.getrusage(resource.RUSAGE_SELF).ru_minflt - before
faults()
without = faults()
keep_freed_memory()
faults()
print(without, faults())
"""


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="GNU's C library")
def test_arrays_that_come_and_go_get_the_memory_that_others_had():
    told = subprocess.run([sys.executable, "-c", COUNTING], check=True, capture_output=True, text=True)
    without, kept = map(int, told.stdout.split())
    assert kept < 0.1 * without
