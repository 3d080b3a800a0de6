"""Finding corners, as a task of workers that have OpenCV: photographs in, corners and times out."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import cv2
import numpy as np
from served import timed

__all__ = ["finding"]

Finder = Callable[[np.ndarray, tuple[int, int]], "np.ndarray | None"]


def finding(finders: Mapping[str, Finder]) -> Callable[..., dict[str, Any]]:
    """The task `find`: for each file its corners in the finder's own order, [] where there is no board; time
    without reading.

    The sums are of all files; `each` is the CPU time of one after the other.
    """

    def find(paths: list[str], grid: list[int], kind: str) -> dict[str, Any]:
        corners: list[list[list[float]]] = []
        each: list[dict[str, float]] = []
        for path in paths:
            grey = cv2.imread(path, cv2.IMREAD_GRAYSCALE)
            assert grey is not None
            found, times = timed(lambda grey=grey: finders[kind](grey, (grid[0], grid[1])))
            corners.append([] if found is None else np.asarray(found, dtype=float).tolist())
            each.append(times)
        total = {clock: sum(times[clock] for times in each) for clock in ("cpu", "wall")}
        return {**total, "each": [times["cpu"] for times in each], "corners": corners}

    return find
