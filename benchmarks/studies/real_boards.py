"""The photographs of the real sets: boards and corners found, and process time a photograph.

    python -m benchmarks.studies.real_boards

Times are of a thread, the least of three turns, reading not counted.
"""

from __future__ import annotations

import time

import cv2

from benchmarks.real_sets import SETS, datasets
from orthoscope.detection.sight import Sight
from orthoscope.detection.table import see
from orthoscope.targets.target import chessboard

TURNS = 3


def main() -> None:
    """What the module's docstring says."""
    folder = datasets()
    if not folder:
        raise SystemExit("No photographs: name their folder in ORTHOSCOPE_DATASETS.")
    cv2.setNumThreads(1)
    print("| set | photographs | boards | corners of those | time |\n|---|---|---|---|---|")
    for name, one in SETS.items():
        target = chessboard(*one.grid, 1.0)
        pictures = [
            cv2.imread(str(path), cv2.IMREAD_GRAYSCALE) for path in sorted(folder.glob(one.photographs))
        ]
        pictures = [picture for picture in pictures if picture is not None]
        spent = []
        for _ in range(TURNS):
            before = time.process_time()
            sights = [see(picture, target) for picture in pictures]
            spent.append(time.process_time() - before)
        found = [len(sight.ids) for sight in sights if isinstance(sight, Sight)]
        print(
            f"| {name} | {len(pictures)} | {len(found)} | {sum(found)} of {len(found) * len(target.points)} |"
            f" {1e3 * min(spent) / len(pictures):.0f} ms |",
            flush=True,
        )


if __name__ == "__main__":
    main()
