"""The choice from views that stand for many, beside the choice from all of them, by the true camera error.

    python -m benchmarks.studies.many_views 3

Of each world so many sets of 100 photographs of 280 corners; printed is what is chosen from those that stand
for them (as it is) and from all, how far off the camera is that is then fitted to all, px, and the CPU time.
"""

from __future__ import annotations

import sys
import time
from dataclasses import replace
from unittest.mock import patch

import numpy as np

from benchmarks.studies.projectors import Projector
from benchmarks.studies.standing import Standing
from benchmarks.studies.worlds import Recipe, World, made, true_error
from orthoscope.methods.decoupled import fitters
from orthoscope.methods.decoupled.decoupled import decoupled
from orthoscope.targets.detections import Detections, View
from orthoscope.targets.target import chessboard

COUNT = 100
BOARD = (20, 14, 0.012)
WORLDS = {
    "perfect": Recipe(),
    "stretched and sagging": Recipe(shape={"stretch": 0.002, "sag": 0.004}),
    "corners each off": Recipe(shape={"singles": 0.001}),
    "errors alike": Recipe(alike=0.1, shape={"bend": 0.003}),
    "bending from view to view": Recipe(bending=0.002),
    "fisheye, sagging": Recipe(
        camera=Projector(focal=(260.0, 259.0), coefficients=(-0.02, 0.004, -0.001, 0.0), fisheye=True),
        shape={"sag": 0.004},
    ),
}


def main(sets: int) -> int:
    """Print the table."""
    print(
        "| world | chosen from some | px | s | chosen from all | px | s |\n|---|---|---:|---:|---|---:|---:|"
    )
    ratios = []
    for name, recipe in WORLDS.items():
        for seed in range(sets):
            world = made(replace(recipe, board=BOARD, standing=Standing(count=COUNT)), seed)
            some, all_ = _calibrated(world, fitters.CHOICE_VIEWS), _calibrated(world, COUNT)
            ratios.append(some[1] / all_[1])
            cells = [f"{said} | {off:.4f} | {seconds:.1f}" for said, off, seconds in (some, all_)]
            print(f"| {name} | {' | '.join(cells)} |", flush=True)
    print(f"\nTrue error over that of the choice from all: {np.exp(np.mean(np.log(ratios))):.4f}.")
    return 0


def _calibrated(world: World, views: int) -> tuple[str, float, float]:
    """What is chosen from so many views, how far off the camera is, px, and the seconds."""
    found = tuple(View(*photograph) for photograph in world.photographs)
    detections = Detections(chessboard(*world.recipe.board), world.recipe.camera.size, found)
    start = time.process_time()
    with patch.object(fitters, "CHOICE_VIEWS", views):
        calibration = decoupled(detections)
    seconds, settings = time.process_time() - start, calibration.settings
    pixels = np.concatenate([view.pixels for view in calibration.detections.views])[::20]
    off = true_error(world, pixels, calibration.camera.unproject(pixels))
    return f"{settings['base']}, {settings['shape']}, {settings['lens']}", off, seconds


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]) if len(sys.argv) > 1 else 2))
