"""A worker: reads one request a line, does it, answers on one line; the benchmarks talk to every environment
this way.

Plain numpy and the standard library, because it runs inside every peer's environment. A request is a JSON
object with "task"; an answer is what the task returns, or {"failed": why}. Whatever a peer prints goes to
stderr, so that it cannot garble an answer.
"""

from __future__ import annotations

import json
import os
import resource
import sys
import time
from collections.abc import Callable, Mapping
from typing import Any

__all__ = ["peak", "reason", "serve", "timed"]


def serve(tasks: Mapping[str, Callable[..., dict[str, Any]]]) -> None:
    """Answer requests from stdin until it ends."""
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    for line in sys.stdin:
        request = json.loads(line)
        try:
            answer = tasks[request.pop("task")](**request)
        except Exception as error:  # a peer may raise anything; the others shall still be measured
            answer = {"failed": reason(error)}
        answers.write(json.dumps(answer) + "\n")
        answers.flush()


def timed(work: Callable[[], Any]) -> tuple[Any, dict[str, float]]:
    """What the work returned, and the process CPU and wall time that it took, seconds."""
    cpu, wall = time.process_time(), time.perf_counter()
    result = work()
    return result, {"cpu": time.process_time() - cpu, "wall": time.perf_counter() - wall}


def peak() -> dict[str, float]:
    """The most memory that this process ever held, megabytes."""
    return {"megabytes": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0}


def reason(error: Exception) -> str:
    """An error in one line."""
    return f"{type(error).__name__}: {' '.join(str(error).split())[:300]}"
