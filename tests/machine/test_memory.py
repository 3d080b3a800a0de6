"""Memory is kept, and seldom searched."""

from __future__ import annotations

import gc
import subprocess
import sys

import pytest

from orthoscope.machine.memory import collect_seldom

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


def test_garbage_is_looked_for_seldom_while_a_table_grows():
    seen, before = [], gc.get_threshold()
    gc.callbacks.append(lambda phase, _: seen.append(phase))
    try:
        collect_seldom()
        table = [[float(i)] for i in range(250_000)]
    finally:
        gc.callbacks.pop()
        gc.set_threshold(*before)
    assert len(table) == 250_000
    assert seen.count("start") <= 3
