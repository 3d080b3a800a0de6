"""How many photographs, folds or trials are worked on at the same time where nobody says so."""

from __future__ import annotations

import os

__all__ = ["at_once"]


def at_once(jobs: int | None = None) -> int:
    """As many as are asked for; else as many as there are cores that this process may use.

    Args:
        jobs: how many were asked for.
    """
    if jobs:
        return jobs
    if hasattr(os, "sched_getaffinity"):  # a batch system or `taskset` may allow fewer than there are
        return len(os.sched_getaffinity(0)) or 1
    return os.cpu_count() or 1
