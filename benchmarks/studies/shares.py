"""Where the CPU time of `orthoscope calibrate` goes, and how much of it the solver's loops have.

    python -m benchmarks.studies.shares 3 photos/*.jpg --target chessboard:9x6:25mm

The command runs so many times, each in a process of its own, with the arguments that follow; printed is the
least CPU time of each part, seconds, and its share of the command. Parts are timed where the command calls
them; what the solver takes is in the parts that call it.
"""

from __future__ import annotations

import importlib
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from functools import wraps
from typing import Any

# module and name of what is timed, and what it is called; the solver first, before others import it by name
TIMED = (
    ("orthoscope.solve.least_squares", "solve", "in all of these: the solver's loops"),
    ("orthoscope.cli.shared.inputs", "detections_from", "photographs or tables to corners"),
    ("orthoscope.methods", "calibrate", "choice and fits"),
    ("orthoscope.evaluation.evaluate", "evaluate", "evaluation"),
    ("orthoscope.formats.own.json", "save", "JSON"),
    ("orthoscope.cli.calibrate", "_write_report", "report with thumbnails"),
)
LOADING, ALL = "loading", "the whole command"


def main(rounds: int, arguments: list[str]) -> int:
    """Print the table."""
    best: dict[str, float] = {}
    with tempfile.TemporaryDirectory() as out:
        for _ in range(rounds):
            command = [sys.executable, "-m", __spec__.name, "once", *arguments, "-o", out]
            told = subprocess.run(command, check=True, capture_output=True, text=True).stderr
            for name, seconds in json.loads(told.splitlines()[-1]).items():
                best[name] = min(seconds, best.get(name, seconds))
    print("| part | CPU, s | share |\n|---|---:|---:|")
    for name, seconds in best.items():
        print(f"| {name} | {seconds:.2f} | {seconds / best[ALL]:.0%} |")
    return 0


def once(arguments: list[str]) -> int:
    """Run the command here, and write the seconds of its parts to stderr, last, as JSON."""
    spent: dict[str, float] = {}
    for module, name, part in TIMED:
        holder = importlib.import_module(module)
        setattr(holder, name, _timed(getattr(holder, name), part, spent))
    from orthoscope.cli import main as command

    loaded = time.process_time()
    sys.argv = ["orthoscope", "calibrate", *arguments]
    command()
    solver = spent.pop(TIMED[0][2])
    print(
        json.dumps({LOADING: loaded, **spent, TIMED[0][2]: solver, ALL: time.process_time()}), file=sys.stderr
    )
    return 0


def _timed(work: Callable[..., Any], part: str, spent: dict[str, float]) -> Callable[..., Any]:
    @wraps(work)
    def timed(*arguments: Any, **settings: Any) -> Any:
        start = time.process_time()
        try:
            return work(*arguments, **settings)
        finally:
            spent[part] = spent.get(part, 0.0) + time.process_time() - start

    return timed


if __name__ == "__main__":
    first, *others = sys.argv[1:]
    sys.exit(once(others) if first == "once" else main(int(first), others))
