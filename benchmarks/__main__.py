"""`python -m benchmarks [PART ...]`: measure, then write results.json and RESULTS.md beside this file."""

from __future__ import annotations

import os
import sys
import tempfile
import time
from pathlib import Path

from benchmarks.all_parts import PARTS
from benchmarks.machine import machine
from benchmarks.page import page, read_results, write_results
from benchmarks.peers import Peers

__all__ = ["main"]

HERE = Path(__file__).resolve().parent
RESULTS, PAGE = HERE / "results.json", HERE / "RESULTS.md"


def main(names: list[str]) -> int:
    """Measure the parts of these names, all where there are none; figures of other parts stay as they
    were.
    """
    if unknown := [name for name in names if name not in PARTS]:
        print(f"there is no part {unknown[0]!r}; expected some of {', '.join(PARTS)}.", file=sys.stderr)
        return 2
    with Peers() as peers, tempfile.TemporaryDirectory(prefix="benchmarks-") as folder:
        for name in names or PARTS:
            print(f"{name} ...", end=" ", file=sys.stderr, flush=True)
            start, load = time.perf_counter(), os.getloadavg()[0]
            part = PARTS[name](peers, Path(folder))
            seconds = time.perf_counter() - start
            results = read_results(RESULTS).with_part(
                name,
                part,
                machine=machine(),
                peers=peers,
                seconds=seconds,
                load=max(load, os.getloadavg()[0]),
            )
            write_results(RESULTS, results)
            PAGE.write_text(page(results), encoding="utf-8")
            print(f"{seconds:.0f} s", file=sys.stderr)
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
