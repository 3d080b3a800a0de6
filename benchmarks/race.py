"""Times of several contenders that take turns, so that what else the machine does falls on all of
them alike.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
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


def whole_process(
    command: list[str | Path], *, cwd: Path | None = None, env: Mapping[str, str] | None = None
) -> dict[str, Any]:
    """Run a command to its end as a user would: {"cpu", "wall" in seconds, "memory" in MB at its peak,
    "out"}, or {"failed"}.

    Args:
        env: the whole environment; by default this process's.
    """
    start = time.perf_counter()
    with tempfile.TemporaryFile("w+") as out, tempfile.TemporaryFile("w+") as err:
        try:
            process = subprocess.Popen(
                [str(part) for part in command], stdout=out, stderr=err, text=True, cwd=cwd, env=env
            )
        except OSError as error:
            return {"failed": f"{command[0]} cannot be run: {error.strerror}"}
        _, status, used = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        wall = time.perf_counter() - start
        out.seek(0)
        err.seek(0)
        said, complained = out.read(), err.read()
    if process.returncode:
        words = " ".join((complained or said).split())
        return {"failed": f"{Path(command[0]).name} ended with code {process.returncode}: {words[-300:]}"}
    cpu, memory = used.ru_utime + used.ru_stime, used.ru_maxrss / 1024.0
    return {"cpu": cpu, "wall": wall, "memory": memory, "out": said}


ORTHOSCOPE = Path(sys.executable).with_name("orthoscope")
