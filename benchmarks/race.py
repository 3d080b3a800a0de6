"""Times of several contenders that take turns, so that what else the machine does falls on all of
them alike.
"""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

__all__ = ["Result", "race", "whole_process"]

PATIENCE = 60.0  # seconds: a contender that has taken so long in all is not asked again


class Result(NamedTuple):
    """A contender's last answer, and the least CPU and wall time of its turns, milliseconds; failed: why
    there is none.
    """

    answer: dict[str, Any]
    cpu: float
    wall: float
    failed: str = ""


def race(contenders: Mapping[str, Callable[[], dict[str, Any]]], *, rounds: int) -> dict[str, Result]:
    """Each contender's best of so many rounds; a contender returns {"cpu", "wall", ...} in seconds or
    {"failed"}.
    """
    results: dict[str, Result] = {}
    spent = dict.fromkeys(contenders, 0.0)
    for _ in range(rounds):
        for name, run in contenders.items():
            best = results.get(name)
            if best and (best.failed or spent[name] > PATIENCE):
                continue
            answer = run()
            if "failed" in answer:
                results[name] = Result({}, float("nan"), float("nan"), answer["failed"])
                continue
            spent[name] += answer["wall"]
            cpu, wall = 1e3 * answer["cpu"], 1e3 * answer["wall"]
            results[name] = Result(
                answer, min(cpu, best.cpu) if best else cpu, min(wall, best.wall) if best else wall
            )
    return results


def whole_process(command: list[str | Path], *, cwd: Path | None = None) -> dict[str, Any]:
    """Run a command to its end as a user would: {"cpu", "wall", "out"} in seconds, or {"failed"}."""
    before, start = os.times(), time.perf_counter()
    try:
        done = subprocess.run(
            [str(part) for part in command], capture_output=True, text=True, cwd=cwd, check=False
        )
    except OSError as error:
        return {"failed": f"{command[0]} cannot be run: {error.strerror}"}
    wall, after = time.perf_counter() - start, os.times()
    if done.returncode:
        said = " ".join((done.stderr or done.stdout).split())
        return {"failed": f"{Path(command[0]).name} ended with code {done.returncode}: {said[-300:]}"}
    cpu = after.children_user + after.children_system - before.children_user - before.children_system
    return {"cpu": cpu, "wall": wall, "out": done.stdout}


ORTHOSCOPE = Path(sys.executable).with_name("orthoscope")
