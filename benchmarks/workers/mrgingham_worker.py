"""mrgingham as a peer: its command, whole, on square boards, which are all that it finds."""

from __future__ import annotations

import os
import subprocess
import time
from typing import Any

from served import serve


def find(paths: list[str], grid: list[int], kind: str) -> dict[str, Any]:
    """For each file its corners, [] where there is no board; time of the command, which reads the
    files too.
    """
    if grid[0] != grid[1]:
        raise ValueError(f"mrgingham finds square boards only, not {grid[0]}x{grid[1]}")
    before, start = os.times(), time.perf_counter()
    command = [kind, "--gridn", str(grid[0]), "--jobs", "1", *paths]
    text = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    wall, after = time.perf_counter() - start, os.times()
    corners: dict[str, list[list[float]]] = {path: [] for path in paths}
    for line in text.splitlines():
        name, x, y, *_ = line.split() if not line.startswith("#") else ("", "-", "-")
        if x != "-":
            corners[name].append([float(x), float(y)])
    cpu = after.children_user + after.children_system - before.children_user - before.children_system
    return {"cpu": cpu, "wall": wall, "corners": [corners[path] for path in paths]}


def told_version() -> dict[str, str]:
    subprocess.run(["mrgingham", "--help"], capture_output=True, check=True)
    query = ["dpkg-query", "-W", "-f", "${Version}", "mrgingham"]
    package = subprocess.run(query, capture_output=True, text=True, check=False).stdout
    return {"version": f"mrgingham {package or 'of unknown version'}"}


if __name__ == "__main__":
    serve({"find": find, "version": told_version})
