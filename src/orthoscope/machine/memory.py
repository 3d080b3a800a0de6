"""Memory for a command that makes large arrays and long tables and then ends.

GNU's C library gives what large arrays took back to the system when they end, and asks for it again for the
next ones, which then arrive page by page: a tenth of the time where arrays of some megabytes come and go.
Python looks for garbage whenever some hundreds of things have been made, over all that there are: of tables
of a thousand views as much again.
"""

from __future__ import annotations

import gc
import sys

__all__ = ["collect_seldom", "keep_freed_memory"]

# By this number `mallopt` knows how much may lie free.
TRIM_THRESHOLD = -1
# By this number `mallopt` knows what is asked of the system by itself.
MMAP_THRESHOLD = -3
# What is larger than this is given back at once; the C library takes no larger number.
LARGEST_KEPT_BYTES = 32 << 20
# So much may lie free.
FREE_BYTES = 64 << 20

# Python looks for garbage when so many more things are there than before.
COLLECTED_COUNT = 100_000


def collect_seldom() -> None:
    """Let Python look for what refers to itself alone a hundred times less often than by default."""
    gc.set_threshold(COLLECTED_COUNT)


def keep_freed_memory() -> None:
    """Let this process keep some of the memory that it has given back; nothing where the C library is
    another.
    """
    if not sys.platform.startswith("linux"):
        return
    import ctypes

    mallopt = getattr(ctypes.CDLL(None), "mallopt", None)
    if mallopt is not None:
        mallopt(MMAP_THRESHOLD, LARGEST_KEPT_BYTES)
        mallopt(TRIM_THRESHOLD, FREE_BYTES)
